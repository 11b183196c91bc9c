"""Every method beside other packages that choose their times, on the public courses."""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

import peakflight as pf
from benchmarks.courses import JERK, course, names, walk
from benchmarks.measure import Sample, repeated, side_by_side
from benchmarks.methods_figure import Point, draw
from benchmarks.planners import DEGREE, PLANNERS, Answer
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.methods import METHODS

LIMITS = JERK.limits
BOUND = {
    "tight_then_fast": 4.300, "mfbo_traj_2": 4.184, "random_10": 5.681, "pmm_slalom": 22.435,
    "uzh_19wp": 43.393,
}  # fmt: skip
"""s, of any motion under the limits: a point mass with piecewise constant snap."""
SEVENTH = {
    "tight_then_fast": 4.420, "mfbo_traj_2": 4.294, "random_10": 5.837, "pmm_slalom": 23.570,
    "uzh_19wp": 45.676,
}  # fmt: skip
"""s, of one polynomial of degree 7 a leg, C3, by a general interior point."""
FIFTH = {
    "tight_then_fast": 4.384, "mfbo_traj_2": 4.295, "random_10": 5.959, "pmm_slalom": 23.959,
    "uzh_19wp": 46.423,
}  # fmt: skip
"""s, the same of degree 5, C2."""
OF_ONE, OF_BOUND = 1.001, 1.005
"""Flight time over the reference: with one piece a leg, and with as many as pay."""
SHORT = range(8, 13)
"""Legs of a short course."""
CPU_OF_ONE = {100: 30e-3, 1_000: 0.4}
"""Legs to CPU seconds of a plan with one piece a leg."""
CPU_OF_ONE_SHORT, CPU_OF_AUTO_SHORT, CPU_OF_REPLAN = 3e-3, 40e-3, 1.5e-3
"""CPU seconds of a plan on short courses, and of a plan again at ten legs."""
MOVED, MOVES = 0.05, 20
"""m by which a waypoint is moved before planning again, and how often."""
QUICK = 2
"""Courses of a quick run."""

COLUMNS: list[Column] = [
    ("course", ""), ("legs", "d"), ("who", ""), ("flight time [s]", ".4f"),
    ("/ reference", ".5f"), ("/ bound", ".4f"), ("pieces", "d"), ("certified", ""),
    ("raw time [s]", ".4f"), ("raw keeps the limits", ""), ("raw largest kappa", ".4f"),
    ("CPU [ms]", ".4g"), ("spread", ".0%"), ("status", ""),
]  # fmt: skip
SPEED_COLUMNS: list[Column] = [
    ("what", ""), ("course", ""), ("legs", ",d"), ("pieces", "d"), ("CPU [ms]", ".4g"),
    ("spread", ".0%"), ("slowest [ms]", ".4g"), ("certified", ""), ("status", ""),
]  # fmt: skip

Plan = Callable[[], Answer]


class Contender(NamedTuple):
    """One of our methods with its options."""

    name: str
    method: str
    degree: int | None = None
    options: dict[str, Any] = {}  # noqa: RUF012 (a constant)
    references: dict[str, float] = {}  # noqa: RUF012
    most: float = 0.0
    """Bar of the flight time over the reference."""

    def problem(self, waypoints: np.ndarray) -> pf.Problem:
        """The problem of a course."""
        return pf.Problem(waypoints, limits=LIMITS, degree=self.degree)


AUTO = Contender("joint", "joint", references=BOUND, most=OF_BOUND)
ONE = Contender("joint, pieces=1", "joint", None, {"pieces": 1}, SEVENTH, OF_ONE)
VARIANTS = {
    "joint": (
        AUTO,
        ONE,
        Contender("joint, pieces=1, degree 5", "joint", 5, {"pieces": 1}, FIFTH, OF_ONE),
    ),
    "peak": (
        Contender("peak", "peak"),
        Contender("peak, paper", "peak", None, {"variant": "paper"}),
    ),
}
"""Of methods that are measured more than once; every other one with its defaults."""


def contenders() -> Iterator[Contender]:
    """Every method of the registry, with its variants."""
    for name in METHODS:
        yield from VARIANTS.get(name, (Contender(name, name),))


def run(scope: Scope) -> list[Table]:
    """Flight times beside other packages, the marks of CPU time, and the figure."""
    rounds = scope.pick(2, 5)
    chosen = names()[:QUICK] if scope.quick else names()
    rows = [row for name in chosen for row in _course(name, rounds)]
    if not scope.quick:
        draw(_points(rows))
    limits = ", ".join(f"{name} {value:g}" for name, value in LIMITS.to_dict().items())
    peers = "; ".join(f"{peer.name}: {peer.note}" for peer in PLANNERS)
    text = (
        f"Limits: {limits}; rest to rest. Flight time: after the exact stretch to the limits. "
        "Raw: what the planner hands back; its largest kappa is above 1 where it breaks a limit. "
        "Reference: the best known for the same kind of motion; the bound is that of any motion. "
        f"CPU: one thread, warm, from waypoints to the result. Peers: {peers}."
    )
    title = "Methods and other planners"
    return [Table(title=title, note=text, columns=COLUMNS, rows=rows), _speed(scope, rounds)]


def _course(name: str, rounds: int) -> list[Row]:
    waypoints = course(name)
    rows = []
    for ours in contenders():
        cells: dict[str, Cell] = {"course": name, "legs": len(waypoints) - 1, "who": ours.name}
        reference = ours.references.get(name)
        bar = f"<= {ours.most} x {reference:.3f} s" if reference else ""
        try:
            plan, sample = _ours(ours, waypoints, rounds)
            cells |= {"status": str(plan.status), "pieces": len(plan.trajectory)}
            answer = Answer(plan.trajectory, plan.pieces)
            cells |= _quality(name, ours.problem(waypoints), answer) | _cost(sample)
        except Exception as error:  # a failure is a row
            rows.append(failure(cells, error, bar))
            continue
        if reference:
            cells["/ reference"] = _number(cells["flight time [s]"]) / reference
            row = judged(cells, "/ reference", ours.most, bar, plan.message)
            row.met = bool(row.met and cells["certified"])
        else:
            row = Row(cells=cells, note=plan.message)
        rows.append(row)
    for peer in PLANNERS:
        cells = {"course": name, "legs": len(waypoints) - 1, "who": peer.name}
        problem = JERK.problem(waypoints)
        try:
            call = peer.prepare(problem)
            answer = call()
            cells |= {"status": "its own: success", "pieces": len(answer.raw)}
            cells |= _quality(name, problem, answer)
            cells |= _cost(side_by_side([repeated(call)], rounds)[0])
        except ModuleNotFoundError as error:
            cells["status"] = "missing"
            rows.append(failure(cells, f"package {error.name} is not installed"))
            continue
        except Exception as error:  # a failure is a row
            cells.setdefault("status", "failed")
            rows.append(failure(cells, error))
            continue
        note = "" if answer.times is None else (
            "acceleration jumps, which no stretch mends: flown as a min-jerk spline at its times"
        )  # fmt: skip
        rows.append(Row(cells=cells, note=note))
    return rows


def _ours(ours: Contender, waypoints: np.ndarray, rounds: int) -> tuple[pf.Plan, Sample]:
    problem = ours.problem(waypoints)

    def call() -> pf.Plan:
        return pf.plan(problem, method=ours.method, **ours.options)

    plan = call()
    return plan, side_by_side([repeated(call)], rounds)[0]


def _quality(name: str, problem: pf.Problem, answer: Answer) -> dict[str, Cell]:
    """What is proven about the raw answer, and about the stretched one."""
    # every spline here is C2 at least; the ends are at rest in speed and acceleration
    raw = _certified(problem, answer.raw, answer.pieces)
    flown, pieces = answer.raw, answer.pieces
    if answer.times is not None:
        flown = pf.minimum_effort_spline(problem.waypoints, answer.times, degree=DEGREE)
        pieces = (1,) * len(answer.times)
    stretched = pf.stretch_to_limits(flown, problem.limits)
    cells: dict[str, Cell] = {
        "raw time [s]": answer.raw.duration,
        "raw keeps the limits": raw.worst <= 1.0 and raw.feasible,
        "raw largest kappa": raw.worst,
    }
    if stretched is None:
        return cells | {"certified": False}
    cells |= {
        "flight time [s]": stretched[0].duration,
        "certified": _certified(problem, stretched[0], pieces).feasible,
    }
    if name in BOUND:
        cells["/ bound"] = stretched[0].duration / BOUND[name]
    return cells


def _certified(problem: pf.Problem, flown: pf.Trajectory, pieces: tuple[int, ...]) -> pf.Report:
    rest = np.zeros((2, 3))
    return pf.certify(
        flown, problem.limits, waypoints=problem.waypoints, pieces=pieces, continuity=2,
        fixed={0: rest, len(problem.waypoints) - 1: rest},
    )  # fmt: skip


def _cost(sample: Sample) -> dict[str, Cell]:
    return {"CPU [ms]": 1e3 * sample.median, "spread": sample.spread}


def _speed(scope: Scope, rounds: int) -> Table:
    """The marks of CPU time of `joint`."""
    rows = []
    tasks: list[tuple[Contender, str, np.ndarray, float | None]] = []
    for name in names():
        waypoints = course(name)
        short = len(waypoints) - 1 in SHORT
        if short or len(waypoints) - 1 in CPU_OF_ONE:
            most = CPU_OF_ONE_SHORT if short else CPU_OF_ONE[len(waypoints) - 1]
            tasks.append((ONE, name, waypoints, most))
            tasks.append((AUTO, name, waypoints, CPU_OF_AUTO_SHORT if short else None))
    tasks.append((ONE, "walk of 1,000", walk(1_000), CPU_OF_ONE[1_000]))
    for ours, name, waypoints, most in tasks[:4] if scope.quick else tasks:
        cells: dict[str, Cell] = {"what": ours.name, "course": name, "legs": len(waypoints) - 1}
        bar = "" if most is None else f"<= {1e3 * most:g} ms"
        try:
            plan, sample = _ours(ours, waypoints, max(rounds, 3))
        except Exception as error:  # a failure is a row
            rows.append(failure(cells, error, bar))
            continue
        cells |= _cost(sample) | {"slowest [ms]": 1e3 * max(sample.rounds)}
        cells |= {
            "pieces": len(plan.trajectory),
            "certified": plan.feasible,
            "status": str(plan.status),
        }
        rows.append(
            Row(cells=cells) if most is None else judged(cells, "CPU [ms]", 1e3 * most, bar)
        )
    rows.append(_replan())
    text = "CPU time of one thread, warm, of the whole public call, its certificate included."
    return Table(title="CPU time of `joint`", note=text, columns=SPEED_COLUMNS, rows=rows)


def _replan() -> Row:
    """Plans again after each of some waypoints has moved, each from the plan before the move."""
    name = "random_10"
    cells: dict[str, Cell] = {"what": "replan, pieces=1, 5 cm", "course": name}
    bar = f"<= {1e3 * CPU_OF_REPLAN:g} ms"
    try:
        waypoints = course(name)
        cells["legs"] = len(waypoints) - 1
        last = pf.plan(ONE.problem(waypoints), method="joint", pieces=1)
        rng = np.random.default_rng(5)
        seconds, plans = [], []
        for move in range(MOVES + 1):
            direction = rng.normal(size=3)
            moved = waypoints.copy()
            moved[1 + move % (len(moved) - 2)] += MOVED * direction / np.linalg.norm(direction)
            began = time.thread_time()
            plans.append(pf.replan(last, waypoints=moved))
            seconds.append(time.thread_time() - began)
        sample = Sample(tuple(seconds[1:]))  # the first one warms up
    except Exception as error:  # a failure is a row
        return failure(cells, error, bar)
    solved = sum(plan.status is pf.Status.SOLVED for plan in plans[1:])
    cells |= _cost(sample) | {"slowest [ms]": 1e3 * max(sample.rounds), "pieces": len(last.pieces)}
    cells |= {
        "certified": all(plan.feasible for plan in plans),
        "status": f"{solved} of {MOVES} solved",
    }
    return judged(cells, "CPU [ms]", 1e3 * CPU_OF_REPLAN, bar)


def _points(rows: list[Row]) -> list[Point]:
    found = []
    for row in rows:
        over, cost = row.cells.get("/ bound"), row.cells.get("CPU [ms]")
        if isinstance(over, float) and isinstance(cost, float):
            found.append(Point(str(row.cells["who"]), str(row.cells["course"]), cost, over))
    return found


def _number(cell: Cell) -> float:
    return float(cell) if isinstance(cell, int | float) else float("nan")
