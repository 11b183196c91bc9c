"""How much memory long courses take."""

import json
import sys

from benchmarks.processes import ProcessFailed, python
from benchmarks.report import Cell, Column, Row, Table, failure
from benchmarks.scope import Scope

BAR = 2.0
"""GiB."""
COLUMNS: list[Column] = [
    ("what", ""), ("legs", ",d"), ("peak memory [GiB]", ".3f"), ("KiB a leg", ".2f"),
    ("plan, wall [s]", ".2f"), ("certified", ""), ("status", ""),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """The whole process, interpreter and libraries included."""
    asked = [("proportional", 100_000, True), ("peak", 1_000 if scope.quick else 10_000, False)]
    if scope.full:
        asked.append(("peak", 100_000, False))
    rows = [_row(method, legs, judge) for method, legs, judge in asked]
    text = "Highest resident memory of a fresh process that plans a random walk."
    return [Table(title="Memory", note=text, columns=COLUMNS, rows=rows)]


def _row(method: str, legs: int, judge: bool) -> Row:
    what: dict[str, Cell] = {"what": method, "legs": legs}
    bar = f"<= {BAR:g} GiB" if judge else ""
    try:
        answer = json.loads(python(["-m", "benchmarks.memory", method, str(legs)]).output)
    except ProcessFailed as error:
        return failure(what, error, bar)
    used = answer["after"]
    cells: dict[str, Cell] = {
        **what,
        "peak memory [GiB]": used / 2**30,
        "KiB a leg": (used - answer["before"]) / 2**10 / legs,
        "plan, wall [s]": answer["wall"],
        "certified": answer["certified"],
        "status": answer["status"],
    }
    met = used <= BAR * 2**30 and answer["certified"] if judge else None
    return Row(cells=cells, bar=bar, met=met)


def plan_here(method: str, legs: int) -> dict[str, object]:
    """Plan in this process and say how much memory that took, in bytes."""
    import peakflight as pf
    from benchmarks.courses import JERK, course, walk

    pf.plan(JERK.problem(course("random_10")), method=method)  # compilation is not what counts
    problem = JERK.problem(walk(legs))
    before = highest_memory()
    plan = pf.plan(problem, method=method)
    return {
        "before": before,
        "after": highest_memory(),
        "wall": plan.wall_time_s,
        "certified": plan.feasible,
        "status": str(plan.status),
    }


def highest_memory() -> int:
    """Bytes of resident memory at the highest, of this process since its program began.

    Linux counts the memory of the parent into what `getrusage` says about a child; /proc does not.
    """
    import resource
    from pathlib import Path

    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) * 1024
    except (OSError, StopIteration):
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


if __name__ == "__main__":
    print(json.dumps(plan_here(sys.argv[1], int(sys.argv[2]))))
