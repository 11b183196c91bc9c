"""What the tuner finds in a minute, and how it flies in crazyflow, which the tuner never sees."""

import math
from importlib.util import find_spec

import peakflight as pf
from benchmarks.courses import FOLDER
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.flight.crazyflow import fly_crazyflow

VEHICLE = "crazyflie-2.1-upgrade"
ERROR = 0.15
BUDGET = 60.0
"""s, on two processes."""
WORKERS = 2
BARS = {"tight_then_fast.json": 4.28, "mfbo_traj_2.json": 4.26}
"""s: the fastest flights within the error that scans of some 460 combinations found."""
OTHERS = ("figure_eight.yaml", "paper_like.csv")
COLUMNS: list[Column] = [
    ("course", ""), ("flight time [s]", ".3f"), ("tracked flight time [s]", ".3f"),
    ("default limits [s]", ".3f"), ("method", ""), ("RMS here [m]", ".4f"),
    ("RMS in crazyflow [m]", ".4f"), ("plans", "d"), ("seconds", ".1f"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """Tune the courses of the bars, then others."""
    rows = []
    for name in [*BARS, *OTHERS][: scope.pick(1, len(BARS) + len(OTHERS))]:
        cells: dict[str, Cell] = {"course": name}
        bar = f"<= {BARS[name]} s, tracked in crazyflow" if name in BARS else ""
        try:
            cells |= _tuned(name, 10.0 if scope.quick else BUDGET)
        except Exception as error:  # a failure is a row
            rows.append(failure(cells, error, bar))
            continue
        judge = bool(bar) and not scope.quick
        key = "tracked flight time [s]"
        rows.append(judged(cells, key, BARS[name], bar) if judge else Row(cells=cells))
    note = (
        f"{VEHICLE}, RMS error at most {ERROR:g} m, {BUDGET:g} s on {WORKERS} processes. Tracked: "
        "crazyflow flies it within that error, too."
    )
    return [Table(title="Tuning", note=note, columns=COLUMNS, rows=rows)]


def _tuned(name: str, budget: float) -> dict[str, Cell]:
    waypoints = pf.read_course(FOLDER / name).waypoints
    result = pf.tune(waypoints, vehicle=VEHICLE, error=ERROR, budget=budget, workers=WORKERS)
    if result.plan is None:
        raise RuntimeError("nothing is tracked")
    cells: dict[str, Cell] = {
        "flight time [s]": result.plan.duration,
        "default limits [s]": pf.plan(waypoints, vehicle=VEHICLE).duration,
        "method": ", ".join(f"{key}={value}" for key, value in result.options.items()),
        "RMS here [m]": result.rms_error,
        "plans": result.plans,
        "seconds": result.seconds,
    }
    if find_spec("crazyflow") is not None:
        flight = fly_crazyflow([result.plan])[0]
        within = flight.within(ERROR)
        cells["RMS in crazyflow [m]"] = flight.rms_error
        cells["tracked flight time [s]"] = result.plan.duration if within else math.inf
    return cells
