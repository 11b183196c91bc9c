"""Verdicts of our simulator beside crazyflow's, around the border of what flies.

Limits are drawn at random, from what flies well to what crashes, for every public course in a
room, every method and every Crazyflie; no simulator has a say in which plans are flown. Besides,
the plans that the vehicles' own limits give, which have to fly in both.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

import peakflight as pf
from benchmarks.courses import FOLDER, SEED
from benchmarks.report import Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.flight.crazyflow import DRONES, fly_crazyflow
from peakflight.limits import GRAVITY
from peakflight.methods import METHODS

ROOMS = ("tight_then_fast.json", "mfbo_traj_2.json", "figure_eight.yaml", "paper_like.csv")
COURSES = (*ROOMS, "uzh_19wp.json")
"""Public courses that stay above the ground; those in a room."""
ERROR = 0.2
"""RMS error up to which a plan counts as flown, m."""
AGREE = 0.95
PLANS, QUICK_PLANS = 208, 8
SETTINGS = pf.FlySettings(ground=None)
"""Splines between waypoints near the ground may dip below it: no matter here."""


class Kind(NamedTuple):
    """How plans of one method are drawn, so that about half of them fly."""

    method: str
    options: dict[str, Any]
    margin: tuple[float, float]
    """Of the top thrust, kept free: range."""
    turning: tuple[float, float]
    """Angular acceleration, rad/s^2: range of a logarithm."""


KINDS = (
    Kind("proportional", {}, (0.0, 0.12), (60.0, 600.0)),
    Kind("mellinger", {}, (0.0, 0.12), (60.0, 600.0)),
    Kind("bry", {}, (0.0, 0.12), (60.0, 600.0)),
    Kind("peak", {}, (0.0, 0.15), (40.0, 500.0)),
    Kind("peak", {"minimize": "snap"}, (0.0, 0.15), (40.0, 500.0)),
    Kind("joint", {}, (0.08, 0.3), (15.0, 60.0)),
    Kind("joint", {"pieces": 1}, (0.05, 0.3), (20.0, 100.0)),
)
COLUMNS: list[Column] = [
    ("vehicle", ""), ("plans", "d"), ("flew here", "d"), ("flew there", "d"),
    ("only here", "d"), ("only there", "d"), ("disagree", ".3f"), ("RMS here [m]", ".4f"),
    ("RMS there [m]", ".4f"),
]  # fmt: skip
OWN_COLUMNS: list[Column] = [
    ("vehicle", ""), ("plans", "d"), ("not flown", "d"), ("worst RMS here [m]", ".4f"),
    ("worst RMS there [m]", ".4f"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """Agreement around the border, and the plans of the vehicles' own limits."""
    try:
        return [_agreement(scope.pick(QUICK_PLANS, PLANS)), _own_limits(scope)]
    except pf.MissingExtra as error:
        rows = [failure({"vehicle": "all"}, error)]
        return [Table(title="Verdicts beside crazyflow", columns=COLUMNS, rows=rows)]


def _agreement(count: int) -> Table:
    drawn = _drawn(count)
    rows = []
    every: list[tuple[pf.Flight, pf.Flight]] = []
    for name in DRONES:
        plans = [plan for vehicle, plan in drawn if vehicle == name]
        pairs = _both(plans, name)
        every += pairs
        rows.append(Row(cells=_cells(name, pairs)))
    bar = f"<= {1.0 - AGREE:.2f} disagree"
    rows.append(judged(_cells("all", every), "disagree", 1.0 - AGREE, bar))
    note = (
        f"{count} plans under random limits, on {len(ROOMS)} courses; flown is an RMS error of at "
        f"most {ERROR:g} m without a crash. Here: the firmware's controller. Both begin as planned."
    )
    return Table(title="Verdicts beside crazyflow", note=note, columns=COLUMNS, rows=rows)


def _own_limits(scope: Scope) -> Table:
    courses = COURSES[: scope.pick(1, len(COURSES))]
    rows = []
    for name in DRONES:
        vehicle = pf.find_vehicle(name)
        plans = [
            pf.plan(waypoints, vehicle=vehicle, method=method, minimize=minimize)
            for waypoints in (pf.read_course(FOLDER / course).waypoints for course in courses)
            for method in METHODS
            for minimize in ("jerk", "snap")
        ]
        pairs = _both(plans, name)
        cells: dict[str, Any] = {
            "vehicle": name,
            "plans": len(plans),
            "not flown": sum(not (a.within(ERROR) and b.within(ERROR)) for a, b in pairs),
            "worst RMS here [m]": max(a.rms_error for a, _ in pairs),
            "worst RMS there [m]": max(b.rms_error for _, b in pairs),
        }
        rows.append(judged(cells, "not flown", 0, "all fly in both"))
    note = (
        f"Every method, minimum jerk and minimum snap, on {len(courses)} courses, with the "
        "vehicle's default limits."
    )
    return Table(title="Default limits, flown", note=note, columns=OWN_COLUMNS, rows=rows)


def _both(plans: Sequence[pf.Plan], name: str) -> list[tuple[pf.Flight, pf.Flight]]:
    here = [pf.fly(one, vehicle=name, controller="firmware", settings=SETTINGS) for one in plans]
    there = fly_crazyflow(plans, vehicle=name, settings=SETTINGS)
    return list(zip(here, there, strict=True))


def _cells(name: str, pairs: Sequence[tuple[pf.Flight, pf.Flight]]) -> dict[str, Any]:
    counts = Counter((a.within(ERROR), b.within(ERROR)) for a, b in pairs)
    both = [(a, b) for a, b in pairs if a.within(ERROR) and b.within(ERROR)]
    return {
        "vehicle": name,
        "plans": len(pairs),
        "flew here": counts[True, True] + counts[True, False],
        "flew there": counts[True, True] + counts[False, True],
        "only here": counts[True, False],
        "only there": counts[False, True],
        "disagree": (counts[True, False] + counts[False, True]) / max(len(pairs), 1),
        "RMS here [m]": float(np.mean([a.rms_error for a, _ in both])) if both else None,
        "RMS there [m]": float(np.mean([b.rms_error for _, b in both])) if both else None,
    }


def _drawn(count: int) -> list[tuple[str, pf.Plan]]:
    """Vehicle and plan of each draw; what has no plan is drawn again."""
    rng = np.random.default_rng([SEED, 6])
    courses = [pf.read_course(FOLDER / name).waypoints for name in ROOMS]
    found: list[tuple[str, pf.Plan]] = []
    while len(found) < count:
        name = list(DRONES)[len(found) // len(ROOMS) % len(DRONES)]
        kind = KINDS[int(rng.integers(len(KINDS)))]
        turning = math.exp(rng.uniform(*np.log(kind.turning)))
        limits = _limits(pf.find_vehicle(name), rng.uniform(*kind.margin), turning)
        waypoints = courses[len(found) % len(ROOMS)]
        plan = pf.plan(waypoints, limits=limits, method=kind.method, **kind.options)
        if plan.feasible:
            found.append((name, plan))
    return found


def _limits(vehicle: pf.Vehicle, margin: float, turning: float) -> pf.Limits:
    """Limits in the proportions of the default ones, without their caution."""
    least, most = vehicle.rotor_thrust
    thrust = (1.0 - margin) * vehicle.top_thrust_acceleration
    lowest = min(4.0 * (least + margin * most) / vehicle.mass, 0.9 * GRAVITY)
    tilt = math.acos(GRAVITY / thrust)
    rate = math.sqrt(2.0 * turning * tilt)
    return pf.Limits(
        thrust_acceleration=thrust,
        least_thrust_acceleration=lowest,
        tilt=tilt,
        body_rate=rate,
        angular_acceleration=turning,
        jerk=rate * thrust,
        snap=turning * thrust,
    )
