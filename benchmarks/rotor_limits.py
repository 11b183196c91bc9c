"""Limits on rotors: the racing course, and every vehicle on seeded courses, beside samples."""

import statistics
import time

import numpy as np

import peakflight as pf
from benchmarks.courses import course, unseen
from benchmarks.measure import repeated, side_by_side
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.vehicles import VEHICLES

RACE, RACER = "uzh_19wp", "racing-quad"
MOST_TIME, MOST_CPU, MOST_WITH_YAW = 18.36, 0.2, 1.02
"""Bars: of the flight, s; of planning it, s of CPU; and of the flight with a yaw over without."""
NOSE = {"policy": "velocity", "rate": 3.0}
"""Along the velocity, turning about z at 3 rad/s at most."""

LEGS, LENGTHS = (4, 12), (0.2, 10.0)
"""Of the seeded courses; m."""
RATE = 1e4
"""Samples a second that an independent model of the vehicle is looked at."""
ROUNDED = 1e-9
"""Thrust beyond its range that counts as rounding, over the most."""
STUCK = 1.05
"""A flight this many times as long as the best of other starts and of `peak` is stuck."""
OTHER_STARTS = ("proportional", "peak")
"""Beside the default, `guess`."""
SHOWN = 12
"""Most courses that are shown one by one."""

RACE_COLUMNS: list[Column] = [
    ("yaw", ""), ("figure", ""), ("value", ".4f"), ("flight [s]", ".4f"), ("pieces", "d"),
    ("status", ""), ("certified", ""), ("beyond range [N]", ".1e"),
]  # fmt: skip
COLUMNS: list[Column] = [
    ("vehicle", ""), ("courses", "d"), ("failures", "d"), ("certified", ".1%"),
    ("within range", ".1%"), ("solved", ".1%"), ("tried", "d"), ("stuck", "d"),
    ("slowest / best", ".4f"), ("median CPU [s]", ".3f"), ("slowest [s]", ".2f"),
]  # fmt: skip
NOTED_COLUMNS: list[Column] = [
    ("vehicle", ""), ("course", ""), ("legs", "d"), ("flight [s]", ".4f"), ("/ best", ".4f"),
    ("best start", ""), ("beyond range [N]", ".1e"), ("status", ""),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """The race with and without a yaw; a summary of each vehicle; and the courses to look at."""
    count = 200 if scope.full else scope.pick(2, 20)
    tried = 20 if scope.full else scope.pick(1, 5)
    summary, noted = [], []
    for vehicle in tuple(VEHICLES)[: scope.pick(2, len(VEHICLES))]:
        rows = [random_course(vehicle, index, is_tried=index < tried) for index in range(count)]
        summary.append(summarised(vehicle, rows))
        noted += [row for row in rows if row.note]
    text = (
        f"Seeded courses of {LEGS[0]} to {LEGS[1]} legs, {LENGTHS[0]:g} to {LENGTHS[1]:g} m "
        "(log-uniform), any direction, under limits on rotors and body rate, with a free nose. "
        f"Within range: every rotor in samples at {RATE / 1e3:g} kHz of an independent model. "
        "Tried: from three starts, and by `peak`; stuck is what is slower than the fastest by "
        f"more than {STUCK - 1.0:.0%}."
    )
    return [
        Table(title="Rotors on the racing course", columns=RACE_COLUMNS, rows=_race(scope)),
        Table(title="Rotors on unseen courses", note=text, columns=COLUMNS, rows=summary),
        Table(
            title="Rotors on unseen courses: to look at", columns=NOTED_COLUMNS, rows=noted[:SHOWN]
        ),
    ]


def _race(scope: Scope) -> list[Row]:
    vehicle = pf.find_vehicle(RACER).on_rotors()
    waypoints = course(RACE)
    bars = (f"<= {MOST_TIME} s", f"<= {MOST_CPU} s", f"<= {MOST_WITH_YAW}")
    try:
        free = pf.plan(waypoints, vehicle=vehicle)
        steered = pf.plan(waypoints, vehicle=vehicle, yaw=NOSE)
        plain, yawed = side_by_side(
            [
                repeated(lambda: pf.plan(waypoints, vehicle=vehicle)),
                repeated(lambda: pf.plan(waypoints, vehicle=vehicle, yaw=NOSE)),
            ],
            scope.pick(2, 5),
        )
    except Exception as error:  # a failure is a row
        return [failure({"yaw": "any"}, error, bars[0])]
    rows = []
    for name, plan, figure, value, most, bar in (
        ("free", free, "flight [s]", free.duration, MOST_TIME, bars[0]),
        ("free", free, "CPU [s]", plain.median, MOST_CPU, bars[1]),
        ("velocity", steered, "/ free", steered.duration / free.duration, MOST_WITH_YAW, bars[2]),
        ("velocity", steered, "CPU [s]", yawed.median, None, ""),
    ):
        cells: dict[str, Cell] = {
            "yaw": name, "figure": figure, "value": value, "flight [s]": plan.duration,
            "pieces": sum(plan.pieces), "status": str(plan.status), "certified": plan.feasible,
            "beyond range [N]": beyond_range(plan),
        }  # fmt: skip
        row = Row(cells=cells) if most is None else judged(cells, "value", most, bar)
        rows.append(_sound(row, plan))
    return rows


def _sound(row: Row, plan: pf.Plan) -> Row:
    """A row whose bar is not met if the plan is none."""
    if not plan.feasible or not _is_within(plan, row.cells["beyond range [N]"]):
        row.met, row.note = False, "not certified" if not plan.feasible else "out of range"
    return row


def random_course(vehicle: str, index: int, *, is_tried: bool) -> Row:
    """A row with what a plan of one course is like; a note if there is something to look at."""
    waypoints = unseen(index, LEGS, LENGTHS)
    cells: dict[str, Cell] = {
        "vehicle": vehicle,
        "course": f"unseen {index}",
        "legs": len(waypoints) - 1,
    }
    try:
        problem = pf.Problem(waypoints, vehicle=pf.find_vehicle(vehicle).on_rotors())
        began = time.thread_time()
        plan = pf.plan(problem)
        cells["seconds"] = time.thread_time() - began
        found = {"guess": plan.duration}
        if is_tried:
            others = [pf.plan(problem, initial=start) for start in OTHER_STARTS]
            plans = dict(zip(OTHER_STARTS, others, strict=True))
            plans["peak itself"] = pf.plan(problem, method="peak")
            found |= {name: other.duration for name, other in plans.items() if other.feasible}
        beyond = beyond_range(plan)
    except Exception as error:  # a failure is a row
        return failure(cells, error)
    cells |= {
        "flight [s]": plan.duration,
        "status": str(plan.status),
        "certified": plan.feasible,
        "beyond range [N]": beyond,
        "is within": _is_within(plan, beyond),
    }
    notes = ["not certified"] * (not plan.feasible) + ["out of range"] * (not cells["is within"])
    if is_tried:
        best = min(found, key=lambda start: found[start])
        cells |= {"/ best": plan.duration / found[best], "best start": best}
        notes += ["stuck"] * (plan.duration > STUCK * found[best])
    return Row(cells=cells, note="; ".join(notes))


def beyond_range(plan: pf.Plan) -> float:
    """Largest thrust of a rotor beyond its limits in samples of an independent model, N."""
    limits = plan.problem.limits
    count = max(int(plan.duration * RATE), 2)
    times = np.linspace(plan.trajectory.start_time, plan.trajectory.end_time, count)
    thrust = pf.planned_states(plan, times).rotor_thrust
    most, least = limits.rotor_thrust, limits.least_rotor_thrust
    assert most is not None and least is not None
    return max(float(thrust.max()) - most, least - float(thrust.min()))


def _is_within(plan: pf.Plan, beyond: Cell) -> bool:
    return float(beyond or 0.0) <= ROUNDED * (plan.problem.limits.rotor_thrust or 0.0)


def summarised(vehicle: str, rows: list[Row]) -> Row:
    """What the courses of one vehicle come to."""
    good = [row.cells for row in rows if "flight [s]" in row.cells]
    ratios = [float(cells["/ best"] or 0.0) for cells in good if "/ best" in cells]
    count = len(rows)
    certified = sum(cells["certified"] is True for cells in good)
    within = sum(cells["is within"] is True for cells in good)
    stuck = sum(ratio > STUCK for ratio in ratios)
    seconds = [float(cells["seconds"] or 0.0) for cells in good] or [0.0]
    cells: dict[str, Cell] = {
        "vehicle": vehicle,
        "courses": count,
        "failures": count - len(good),
        "certified": certified / count,
        "within range": within / count,
        "solved": sum(cells["status"] == str(pf.Status.SOLVED) for cells in good) / count,
        "tried": len(ratios),
        "stuck": stuck,
        "slowest / best": max(ratios, default=None),
        "median CPU [s]": statistics.median(seconds),
        "slowest [s]": max(seconds),
    }
    met = certified == within == count and stuck == 0
    return Row(cells=cells, bar="all certified and within range, none stuck", met=met)
