"""How long a flight in simulation takes, and many of them."""

import time
from tempfile import TemporaryDirectory

import numpy as np

import peakflight as pf
from benchmarks.measure import repeated, side_by_side
from benchmarks.processes import ProcessFailed, python
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope

BAR = 0.020
"""Seconds of CPU for a flight of 5 s, after the first one."""
DURATION = 5.0
COLUMNS: list[Column] = [("what", ""), ("time [ms]", ".2f"), ("spread", ".1%"), ("flew", "")]
COMPILE = """
import time
import peakflight as pf
from benchmarks.simulation import lap
path = lap()
began = time.perf_counter()
pf.fly(path, vehicle="crazyflie-2.1-upgrade")
print(time.perf_counter() - began)
"""


def lap() -> pf.Trajectory:
    """Two pieces there and back with smooth ends, 5 s in all."""
    points = np.array([[0.0, 0.0, 1.0], [2.0, 1.0, 1.5], [0.0, 0.0, 1.0]])
    rows, seconds = np.zeros((2, 6, 3)), 0.5 * DURATION
    rows[:, 0] = points[:-1]
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        rows[:, power] = factor * np.diff(points, axis=0) / seconds**power
    return pf.Trajectory(rows, np.full(2, seconds))


def run(scope: Scope) -> list[Table]:
    """Both controllers on the upgrade kit, many flights, and the first one of all."""
    path, settings = lap(), pf.FlySettings(hold=0.0)

    def call(controller: str) -> pf.Flight:
        return pf.fly(
            path, vehicle="crazyflie-2.1-upgrade", controller=controller, settings=settings
        )

    names = ("geometric", "firmware")
    samples = side_by_side(
        [repeated(lambda name=name: call(name)) for name in names], scope.pick(3, 15)
    )
    rows: list[Row] = []
    for name, sample in zip(names, samples, strict=True):
        cells: dict[str, Cell] = {
            "what": f"5 s, {name}",
            "time [ms]": 1e3 * sample.median,
            "spread": sample.spread,
            "flew": call(name).flew,
        }
        rows.append(judged(cells, "time [ms]", 1e3 * BAR, f"<= {1e3 * BAR:g} ms"))
    rows += [_many(path, scope.pick(20, 1000)), _first()]
    text = (
        "CPU time of `peakflight.fly` on a plan of 5 s at 500 Hz of control and 1 kHz of "
        "integration, sampling the plan included; many flights and the first one: wall time."
    )
    return [Table(title="Simulation", note=text, columns=COLUMNS, rows=rows)]


def _many(path: pf.Trajectory, count: int) -> Row:
    began = time.perf_counter()
    result = pf.fly_spread(
        path, vehicle="crazyflie-2.1-upgrade", controller="firmware", flights=count
    )
    seconds = time.perf_counter() - began
    return Row(
        cells={"what": f"{count} vehicles, each", "time [ms]": 1e3 * seconds / count},
        note=f"{result.share:.1%} within {result.error:g} m",
    )


def _first() -> Row:
    what: dict[str, Cell] = {"what": "the first flight, kernels compiled"}
    with TemporaryDirectory() as folder:
        try:
            answer = python(["-c", COMPILE], NUMBA_CACHE_DIR=folder)
        except ProcessFailed as error:
            return failure(what, error)
    return Row(cells={**what, "time [ms]": 1e3 * float(answer.output.split()[-1])})
