"""The discretised bound: about how fast any motion could be under the limits.

The vehicle is a point mass whose snap is constant over intervals of about 25 ms and free otherwise:
no spline, no polynomial a leg. The shortest such motion through the waypoints is a yardstick for
plans. It is a feasible motion, so the true minimum is slightly below it; and it is the best one
near its start, by a local optimiser, so that nothing proves that no motion is faster.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from peakflight.certificate import certify, peak_ratios, stretch_to_limits
from peakflight.errors import InvalidProblem, MissingExtra, Status
from peakflight.limits import LARGEST, Limits
from peakflight.methods import require
from peakflight.multiple_shooting import EXPRESSIONS, ORDERS, Grid, solve
from peakflight.planner import plan
from peakflight.problem import Problem, as_float_array
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

OVERSHOOT = 1e-3
"""Most by which limits may be exceeded between the points at which they are held, relative."""
REFINEMENT = 6
"""How many times more points are tried where they are exceeded by more."""
WAYS: tuple[dict[str, Any], ...] = (
    {  # mostly ends within 50 iterations or never
        "mu_strategy": "adaptive",
        "adaptive_mu_globalization": "never-monotone-mode",
        "max_iter": 150,
    },
    {"mu_strategy": "monotone", "mu_init": 1e-3},
)
"""Options of IPOPT to try in turn."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Tuning of the bound."""

    interval: float = 0.025
    """Longest interval in the start, s; in the result they are shorter, as the flight is."""
    points: int = 3
    """Points of each interval, from its beginning, at which limits are held."""
    fewest_in_leg: int = 4
    """Fewest intervals in a leg."""
    most_in_leg: int = 1000
    """Most intervals in a leg; slower ones have longer intervals."""
    fewest: int = 40
    """About the fewest intervals in all; short flights have shorter intervals."""
    most: int = 20_000
    """About the most intervals in all; long flights have longer intervals."""
    full_rest: bool = True
    """At an end where all that the problem fixes is zero, all motion up to jerk is zero: the body
    of a vehicle at rest does not turn. If false, what the problem leaves free there is free
    (degree 5 fixes velocity and acceleration)."""
    tolerance: float = 1e-7
    """Scaled error of the optimality conditions at which the search ends."""
    iterations: int = 500
    """Most iterations of one search."""
    time_limit: float = 600.0
    """Most time of the search, s."""

    def __post_init__(self) -> None:
        require("interval", self.interval, 1e-4, 10.0)
        require("points", self.points, 1, 50)
        require("fewest_in_leg", self.fewest_in_leg, 2, 1000)
        require("most_in_leg", self.most_in_leg, self.fewest_in_leg, 10**6)
        require("fewest", self.fewest, 8, 10**6)
        require("most", self.most, self.fewest, 10**6)
        require("tolerance", self.tolerance, 1e-12, 1e-3)
        require("iterations", self.iterations, 1, 10**6)
        require("time_limit", self.time_limit, 1e-3, 1e9)


@dataclass(frozen=True, eq=False, kw_only=True)
class Bound:
    """The fastest discretised motion that was found.

    A feasible motion under the same limits: the true minimum is at most its duration, and slightly
    below. It is not certified to be the fastest: nothing proves that no motion is faster.
    """

    status: Status
    """SOLVED, or why there is no figure."""
    duration: float | None
    """s; None unless the status is SOLVED."""
    segment_times: np.ndarray | None
    """(legs,) s."""
    interval: float
    """Mean length of an interval, s: in the result, or in the start if there is none."""
    intervals: int
    """How many there are in all."""
    iterations: int
    wall_time_s: float
    cpu_time_s: float
    trajectory: Trajectory | None
    """The motion, one piece of degree 4 an interval."""
    peak_ratio: float | None
    """Largest certified ratio to a limit. At most 1 where a stretch by less than 0.1 % makes the
    motion keep its limits between points too; otherwise, as for a moving start, 1.001 at most."""
    message: str = ""
    """What the user should know."""

    def __post_init__(self) -> None:
        if self.segment_times is not None:
            times = as_float_array("segment_times", self.segment_times, (None,))
            object.__setattr__(self, "segment_times", times)

    @property
    def success(self) -> bool:
        """Whether there is a figure."""
        return self.status is Status.SOLVED

    def excess(self, duration: float) -> float | None:
        """By how much a duration is above the bound, percent; None if there is no figure."""
        return None if self.duration is None else 100.0 * (duration / self.duration - 1.0)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names; without the motion."""
        times = self.segment_times
        return {
            "status": str(self.status),
            "duration": self.duration,
            "segment_times": None if times is None else times.tolist(),
            "interval": self.interval,
            "intervals": self.intervals,
            "iterations": self.iterations,
            "wall_time_s": self.wall_time_s,
            "cpu_time_s": self.cpu_time_s,
            "peak_ratio": self.peak_ratio,
            "message": self.message,
        }


def require_casadi() -> None:
    """Make sure that the optimiser is installed.

    Raises
    ------
    MissingExtra
        If it is not.
    """
    if find_spec("casadi") is None:
        raise MissingExtra(
            "the bound needs casadi, which is not installed; "
            "install it with: pip install 'peakflight[bound]'"
        )


def discretised_bound(
    problem: Problem,
    *,
    start: Plan | None = None,
    settings: Settings | None = None,
    on_iteration: Callable[[int], None] | None = None,
) -> Bound:
    """The fastest motion of piecewise-constant snap that answers a problem.

    It passes the waypoints exactly and in order, keeps the limits, is continuous up to jerk, and
    meets what the problem fixes at waypoints, up to jerk. The class of spline does not matter.

    Parameters
    ----------
    start
        A plan of the same waypoints to begin from; by default one by `peak`.
    on_iteration
        Called with the number of each iteration.

    Raises
    ------
    MissingExtra
        If CasADi is not installed.
    InvalidProblem
        If a limit that is set cannot be expressed, or the start has other waypoints.
    """
    require_casadi()
    settings = settings or Settings()
    unknown = [kind.label for kind in problem.limits.active if kind.name not in EXPRESSIONS]
    if unknown:
        raise InvalidProblem(f"the bound cannot hold a limit on {' and '.join(unknown)}")
    began, began_cpu = time.perf_counter(), time.process_time()
    start = start or plan(problem, method="peak")
    if not np.array_equal(start.problem.waypoints, problem.waypoints):
        raise InvalidProblem("the start is a plan of other waypoints")
    interval = min(settings.interval, start.duration / settings.fewest)
    grid = Grid.of(
        start.trajectory,
        problem.waypoints,
        start.waypoint_times,
        interval=max(interval, start.duration / settings.most),
        fewest=settings.fewest_in_leg,
        most=settings.most_in_leg,
    )
    held = _held(problem, full_rest=settings.full_rest)
    found = _search(problem, grid, held, settings, on_iteration)
    trajectory, notes = found.trajectory, [found.message] if found.message else []
    if (longest := float(grid.steps.max())) > (1.0 + 1e-9) * settings.interval:
        notes.append(
            f"intervals of up to {longest:.3g} s in the start, as shorter ones would be too many"
        )
    return Bound(
        status=found.status,
        duration=None if trajectory is None else trajectory.duration,
        segment_times=None if trajectory is None else grid.leg_times(trajectory),
        interval=(trajectory or grid).duration / grid.intervals,
        intervals=grid.intervals,
        iterations=found.iterations,
        wall_time_s=time.perf_counter() - began,
        cpu_time_s=time.process_time() - began_cpu,
        trajectory=trajectory,
        peak_ratio=found.peak_ratio,
        message="; ".join(notes),
    )


class _Found(NamedTuple):
    """How the search ended."""

    status: Status
    iterations: int
    trajectory: Trajectory | None = None
    peak_ratio: float | None = None
    message: str = ""


def _search(
    problem: Problem,
    grid: Grid,
    held: Mapping[int, np.ndarray],
    settings: Settings,
    on_iteration: Callable[[int], None] | None,
) -> _Found:
    """Solve, in another way if one fails, and once more with more points if they are too few."""
    ends = time.perf_counter() + settings.time_limit
    points, done = settings.points, 0
    last = points * REFINEMENT
    while True:
        for way in WAYS:
            solution = solve(
                grid,
                problem.limits,
                held,
                points=points,
                options={
                    **way,
                    "tol": settings.tolerance,
                    "max_iter": min(settings.iterations, way.get("max_iter", settings.iterations)),
                    "max_wall_time": max(ends - time.perf_counter(), 1e-3),
                },
                on_iteration=None
                if on_iteration is None
                else partial(_shifted, on_iteration, done),
            )
            done += solution.iterations
            if solution.status in (Status.SOLVED, Status.TIME_LIMIT):
                break
        if solution.trajectory is None:
            return _Found(solution.status, done, message=f"IPOPT ended with {solution.said}")
        trajectory, ratio, wrong = _proven(problem, solution.trajectory, grid, held)
        if not wrong:
            return _Found(Status.SOLVED, done, trajectory, ratio)
        if points == last:
            message = f"the motion that was found is not an answer: {wrong}"
            return _Found(Status.NUMERICAL, done, message=message)
        points = last


def _shifted(on_iteration: Callable[[int], None], done: int, iteration: int) -> None:
    on_iteration(done + iteration)


def _held(problem: Problem, *, full_rest: bool) -> dict[int, np.ndarray]:
    """Waypoint to (3, 3) velocity, acceleration and jerk that are fixed there, NaN where free.

    Snap and what is beyond are not held: a motion may switch its snap at once.
    """
    ends = (0, len(problem.waypoints) - 1)
    held = {}
    for index, state in problem.fixed.items():
        rows = np.full((ORDERS - 1, 3), np.nan)
        known = min(len(state), ORDERS - 1)
        rows[:known] = state[:known]
        if full_rest and index in ends and (state == 0.0).all():
            rows[known:] = 0.0
        held[index] = rows
    return held


def _proven(
    problem: Problem, trajectory: Trajectory, grid: Grid, held: Mapping[int, np.ndarray]
) -> tuple[Trajectory, float, str]:
    """The motion made to keep its limits everywhere, its largest ratio, and what is wrong.

    A stretch is no help to a motion that would have to change much, as one whose least thrust
    acceleration is that of a flight upside down; then the ratio stays where it is.
    """
    worst = _worst(problem, trajectory)
    if problem.is_at_rest:
        stretched = stretch_to_limits(trajectory, problem.limits)
        if stretched is not None and abs(stretched[1] - 1.0) <= OVERSHOOT:
            trajectory, worst = stretched[0], _worst(problem, stretched[0])
    if worst > 1.0 + OVERSHOOT:
        return trajectory, worst, "it exceeds a limit between the points at which they are held"
    report = certify(
        trajectory,
        Limits(speed=LARGEST),
        waypoints=problem.waypoints,
        pieces=grid.counts.tolist(),
        continuity=ORDERS - 1,
        fixed=held,
    )
    return trajectory, worst, "; ".join(report.problems)


def _worst(problem: Problem, trajectory: Trajectory) -> float:
    return float(np.nanmax(peak_ratios(trajectory, problem.limits)))
