"""`joint` with as many pieces as pay, against the bound, on seeded courses."""

import peakflight as pf
from benchmarks.courses import JERK, unseen
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.bound import discretised_bound

MOST = 1.005
"""Bar of the flight time over the bound."""
SKIPPED = 2_000
"""Courses before these are those of `random_joint`."""
COLUMNS: list[Column] = [
    ("course", ""), ("legs", "d"), ("pieces", "d"), ("joint [s]", ".4f"), ("bound [s]", ".4f"),
    ("/ bound", ".5f"), ("status", ""), ("bound ended", ""),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """A row for each course."""
    count = 30 if scope.full else scope.pick(1, 8)
    rows = [_course(SKIPPED + index) for index in range(count)]
    text = (
        "Seeded courses of 2 to 40 legs, 0.05 to 20 m (log-uniform), any direction, at minimum "
        "jerk's limits. The bound is a discretised solution, which takes seconds a course."
    )
    return [Table(title="`joint` over the bound, unseen", note=text, columns=COLUMNS, rows=rows)]


def _course(index: int) -> Row:
    waypoints = unseen(index)
    cells: dict[str, Cell] = {"course": f"unseen {index}", "legs": len(waypoints) - 1}
    bar = f"<= {MOST:g}"
    try:
        problem = pf.Problem(waypoints, limits=JERK.limits)
        plan = pf.plan(problem)
        bound = discretised_bound(problem)
    except Exception as error:  # a failure is a row
        return failure(cells, error, bar)
    cells |= {
        "pieces": sum(plan.pieces),
        "joint [s]": plan.duration,
        "bound [s]": bound.duration,
        "/ bound": plan.duration / bound.duration,
        "status": str(plan.status),
        "bound ended": bound.status,
    }
    return judged(cells, "/ bound", MOST, bar)
