"""How long it takes to begin: the import, the first plan of all, and a plan by command line."""

import json
import os
import statistics
import tempfile
from pathlib import Path

from benchmarks.processes import ROOT, ProcessFailed, median, python
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.limits import PAPER_LIMITS

IMPORT_BAR = 0.3
FIRST_BAR = 20.0
COMMAND_BAR = 1.5
BUSY = 1.2
"""Wall over CPU time from where on the machine had other things to do."""
PICTURES = (".png", ".svg", ".pdf")

COLUMNS: list[Column] = [
    ("what", ""), ("wall [s]", ".3f"), ("CPU [s]", ".3f"), ("wall, least [s]", ".3f"),
    ("wall, most [s]", ".3f"), ("processes", "d"),
]  # fmt: skip
IMPORTED = """
import json, sys
import peakflight
heavy = ("numba", "llvmlite", "scipy", "matplotlib", "click", "rich", "yaml")
print(json.dumps([name for name in heavy if name in sys.modules]))
"""
FIRST_PLAN = """
import peakflight as pf
course = pf.read_course({course!r})
limits = pf.Limits(**{limits!r})
plan = pf.plan(course.waypoints, limits=limits)
assert plan.feasible, plan.message
"""
COURSE = str(ROOT / "examples" / "courses" / "random_10.json")
LIMITS = ",".join(f"{name}={value:g}" for name, value in PAPER_LIMITS.to_dict().items())


def run(scope: Scope) -> list[Table]:
    """One table; every process is fresh, and wall times are what the bars are about."""
    rows = [
        *_imports(scope.pick(3, 7)),
        *_first_plan(scope),
        *_command(scope.pick(2, 5)),
    ]
    text = (
        "Fresh processes, byte code kept, files warm. CPU time is user and system time of all "
        "threads."
    )
    return [Table(title="Start-up", note=text, columns=COLUMNS, rows=rows)]


def _measured(cells: dict[str, Cell], most: float, bar: str, note: str = "") -> Row:
    """A judged row of wall and CPU time, which says so where others kept the machine busy."""
    row = judged(cells, "wall [s]", most, bar, note)
    times = float(cells["wall [s]"] or 0.0) / float(cells["CPU [s]"] or 1.0)
    if times > BUSY:
        row.note = "; ".join(filter(None, (f"machine busy: wall is {times:.2f} x CPU", note)))
    return row


def _imports(count: int) -> list[Row]:
    what: dict[str, Cell] = {"what": "import peakflight, less import numpy", "processes": count}
    bar = f"<= {IMPORT_BAR} s"
    try:
        found = json.loads(python(["-c", IMPORTED]).output)  # also keeps the byte code
        pairs = [
            (python(["-c", "import peakflight"]), python(["-c", "import numpy"]))
            for _ in range(count)
        ]
    except ProcessFailed as error:
        return [failure(what, error, bar)]
    walls = [ours.wall - base.wall for ours, base in pairs]
    cells: dict[str, Cell] = {
        **what,
        "wall [s]": statistics.median(walls),
        "CPU [s]": statistics.median(ours.cpu - base.cpu for ours, base in pairs),
        "wall, least [s]": min(walls),
        "wall, most [s]": max(walls),
    }
    check = Row(
        cells={"what": "import peakflight leaves numba alone", "processes": 1},
        bar="no numba, no compiler",
        met=not {"numba", "llvmlite"} & set(found),
        note=f"also imported: {', '.join(found)}" if found else "",
    )
    return [_measured(cells, IMPORT_BAR, bar), check]


def _first_plan(scope: Scope) -> list[Row]:
    rows = []
    code = FIRST_PLAN.format(course=COURSE, limits=PAPER_LIMITS.to_dict())
    what: dict[str, Cell] = {
        "what": "first plan ever (random_10, nothing compiled)",
        "processes": 1,
    }
    bar = f"<= {FIRST_BAR:g} s"
    with tempfile.TemporaryDirectory() as name:
        folder = os.environ["NUMBA_CACHE_DIR"] if scope.quick else name  # empty so far
        try:
            first = python(["-c", code], NUMBA_CACHE_DIR=folder)
            second = [python(["-c", code], NUMBA_CACHE_DIR=folder) for _ in range(scope.pick(1, 3))]
        except ProcessFailed as error:
            return [failure(what, error, bar)]
        size = sum(f.stat().st_size for f in Path(folder).rglob("*") if f.is_file())
    cells: dict[str, Cell] = {**what, "wall [s]": first.wall, "CPU [s]": first.cpu}
    rows.append(_measured(cells, FIRST_BAR, bar, f"the cache takes {size / 2**20:.1f} MiB"))
    wall, cpu = median(second)
    cells = {
        "what": "the same plan in the next process",
        "wall [s]": wall,
        "CPU [s]": cpu,
        "wall, least [s]": min(r.wall for r in second),
        "wall, most [s]": max(r.wall for r in second),
        "processes": len(second),
    }
    return [*rows, Row(cells=cells)]


def _command(count: int) -> list[Row]:
    what: dict[str, Cell] = {"what": "peakflight plan random_10, pictures included"}
    bar = f"<= {COMMAND_BAR} s"
    course = COURSE
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = ["-m", "peakflight", "plan", course, "--limits", LIMITS, "-o", str(folder / "o")]
        try:
            python(command, cwd=folder)
            runs = [python(command, cwd=folder) for _ in range(count)]
        except ProcessFailed as error:
            return [failure(what, error, bar)]
        written = sorted(path.name for path in (folder / "o").rglob("*") if path.is_file())
    wall, cpu = median(runs)
    cells: dict[str, Cell] = {
        **what,
        "wall [s]": wall,
        "CPU [s]": cpu,
        "wall, least [s]": min(r.wall for r in runs),
        "wall, most [s]": max(r.wall for r in runs),
        "processes": count,
    }
    row = _measured(cells, COMMAND_BAR, bar, f"writes {', '.join(written)}")
    if "plan.json" not in written or not any(n.endswith(PICTURES) for n in written):
        row.met = False
        row.note = f"failed: no plan.json or no picture among {', '.join(written) or 'nothing'}"
    return [row]
