"""`joint` on seeded random courses: certified, solved, one answer from three starts, not slower."""

import statistics
import time

import peakflight as pf
from benchmarks.courses import JERK, unseen
from benchmarks.report import Cell, Column, Row, Table, failure
from benchmarks.scope import Scope

OTHER_STARTS = ("proportional", "peak")
"""Beside the default, `guess`."""
WITHIN = 0.01
"""Spread of the flight times of the three starts, relative."""
NOT_SLOWER = 1e-6
"""Relative: both plans are stretched until a limit is met to 1e-9."""
SOLVED, AGREE = 0.95, 0.98
"""Least shares."""
SHOWN = 5
"""Widest spreads that are shown."""

COLUMNS: list[Column] = [
    ("pieces", ""), ("courses", "d"), ("failures", "d"), ("certified", ".1%"), ("solved", ".1%"),
    ("three starts within 1 %", ".1%"), ("slower than peak", "d"), ("mean / peak", ".4f"),
    ("median CPU [ms]", ".3g"), ("slowest [s]", ".3g"),
]  # fmt: skip
WORST_COLUMNS: list[Column] = [
    ("pieces", ""), ("course", ""), ("legs", "d"), ("joint [s]", ".4f"), ("peak [s]", ".4f"),
    ("spread of starts", ".2%"), ("best start", ""), ("status", ""),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """A summary for one piece a leg and for as many as pay, and the courses to look at."""
    count = 1_000 if scope.full else scope.pick(3, 20)
    summary, worst = [], []
    for pieces in (1, "auto"):
        rows = [_course(index, pieces) for index in range(count)]
        summary.append(_summary(pieces, rows))
        rows.sort(key=lambda row: (not row.note, -float(row.cells.get("spread of starts") or 0.0)))
        noted = sum(bool(row.note) for row in rows)
        worst += rows[: max(SHOWN, min(noted, 4 * SHOWN))]
    text = (
        "Seeded courses of 2 to 40 legs, 0.05 to 20 m (log-uniform), any direction. Certified, "
        "solved and CPU time: of the default start. Slower than `peak`: beside the min-jerk spline "
        "of degree 5."
    )
    return [
        Table(title="`joint` on unseen courses", note=text, columns=COLUMNS, rows=summary),
        Table(title="`joint` on unseen courses: the worst", columns=WORST_COLUMNS, rows=worst),
    ]


def _course(index: int, pieces: int | str) -> Row:
    waypoints = unseen(index)
    cells: dict[str, Cell] = {
        "pieces": str(pieces),
        "course": f"unseen {index}",
        "legs": len(waypoints) - 1,
    }
    problem = pf.Problem(waypoints, limits=JERK.limits)
    try:
        began = time.thread_time()
        plan = pf.plan(problem, method="joint", pieces=pieces)
        cells["seconds"] = time.thread_time() - began
        simple = pf.plan(JERK.problem(waypoints), method="peak")
        found = {"guess": plan.duration}
        for start in OTHER_STARTS:
            found[start] = pf.plan(problem, method="joint", pieces=pieces, initial=start).duration
    except Exception as error:  # a failure is a row
        return failure(cells, error)
    best = min(found.values())
    cells |= {
        "joint [s]": plan.duration,
        "peak [s]": simple.duration,
        "spread of starts": max(found.values()) / best - 1.0,
        "best start": min(found, key=lambda start: found[start]),
        "status": str(plan.status),
        "certified": plan.feasible,
    }
    slower = plan.duration > simple.duration * (1.0 + NOT_SLOWER)
    notes = ["slower than peak"] * slower + ["not certified"] * (not plan.feasible)
    return Row(cells=cells, note="; ".join(notes))


def _summary(pieces: int | str, rows: list[Row]) -> Row:
    good = [row.cells for row in rows if "joint [s]" in row.cells]
    count = len(rows)
    certified = sum(cells["certified"] is True for cells in good)
    solved = sum(cells["status"] == str(pf.Status.SOLVED) for cells in good)
    agree = sum(float(cells["spread of starts"] or 0.0) <= WITHIN for cells in good)
    slower = sum("slower than peak" in row.note for row in rows)
    cells: dict[str, Cell] = {
        "pieces": str(pieces),
        "courses": count,
        "failures": count - len(good),
        "certified": certified / count,
        "solved": solved / count,
        "three starts within 1 %": agree / count,
        "slower than peak": slower,
    }
    if good:
        seconds = [float(own["seconds"] or 0.0) for own in good]
        cells |= {
            "mean / peak": statistics.fmean(
                float(own["joint [s]"] or 0.0) / float(own["peak [s]"] or 1.0) for own in good
            ),
            "median CPU [ms]": 1e3 * statistics.median(seconds),
            "slowest [s]": max(seconds),
        }
    met = certified == count and slower == 0 and solved >= SOLVED * count and agree >= AGREE * count
    bar = f"all certified, none slower, solved {SOLVED:.0%}, three starts {AGREE:.0%}"
    return Row(cells=cells, bar=bar, met=met)
