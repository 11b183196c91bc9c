"""31 pieces, all that a Crazyflie holds: what is lost to the plan with as many as pay."""

import time

import numpy as np

import peakflight as pf
from benchmarks.courses import course, names, unseen
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope

MOST = 31
TOLERANCE = 1e-5
"""Of `peakflight export`, which plans again with fewer pieces."""
MOST_LOST = 0.5
"""Bar of public courses, percent."""
LEGS, LENGTHS = (12, 25), (0.5, 8.0)
"""Of the seeded courses; m."""

COLUMNS: list[Column] = [
    ("course", ""), ("legs", "d"), ("vehicle", ""), ("flight [s]", ".3f"), ("pieces", "d"),
    ("lost by idle time alone [%]", ".2f"), ("CPU [s]", ".2f"), ("lost [%]", ".2f"),
    ("CPU with exchange [s]", ".2f"), ("certified", ""),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """A row for each course and Crazyflie whose plan has more pieces than there is room for."""
    courses = {name: course(name) for name in names() if len(course(name)) - 1 <= MOST}
    public = set(courses)
    for index in range(scope.pick(1, 5)):
        courses[f"unseen {index}"] = unseen(index, LEGS, LENGTHS)
    vehicles = [name for name in pf.VEHICLES if name.startswith("crazyflie")]
    rows = [
        row
        for name, waypoints in courses.items()
        for vehicle in vehicles[: scope.pick(1, len(vehicles))]
        if (row := _row(name, waypoints, vehicle, has_bar=name in public)) is not None
    ]
    text = (
        f"Under the default limits of each Crazyflie. Lost: how much longer {MOST} pieces fly, to "
        f"a tolerance of {TOLERANCE:g}, than as many as pay; pieces where idle time puts them, and "
        f"exchanged between legs. Plans of at most {MOST} pieces are left out. Unseen: seeded "
        f"courses of {LEGS[0]} to {LEGS[1]} legs, {LENGTHS[0]:g} to {LENGTHS[1]:g} m "
        "(log-uniform), any direction."
    )
    return [Table(title=f"{MOST} pieces", note=text, columns=COLUMNS, rows=rows)]


def _row(name: str, waypoints: np.ndarray, vehicle: str, *, has_bar: bool) -> Row | None:
    cells: dict[str, Cell] = {"course": name, "legs": len(waypoints) - 1, "vehicle": vehicle}
    bar = f"<= {MOST_LOST} %" if has_bar else ""
    try:
        whole = pf.plan(waypoints, vehicle=vehicle)
        cells |= {"flight [s]": whole.duration, "pieces": len(whole.trajectory)}
        if len(whole.trajectory) <= MOST:
            return None
        proven = []
        for lost, seconds, rounds in (
            ("lost by idle time alone [%]", "CPU [s]", 0),
            ("lost [%]", "CPU with exchange [s]", pf.methods.joint.Settings.exchanges),
        ):
            began = time.thread_time()
            made = pf.plan(whole.problem, max_pieces=MOST, tolerance=TOLERANCE, exchanges=rounds)
            cells[seconds] = time.thread_time() - began
            cells[lost] = 100.0 * (made.duration / whole.duration - 1.0)
            proven.append(made.feasible)
    except Exception as error:  # a failure is a row
        return failure(cells, error, bar)
    cells["certified"] = all(proven)
    return judged(cells, "lost [%]", MOST_LOST, bar) if has_bar else Row(cells=cells)
