"""One run of the interior point of `kernels.interior`, from a start to a trajectory."""

import math
import time
from dataclasses import dataclass

import numpy as np

from peakflight.kernels import basis, interior, unknowns
from peakflight.kernels.conditions import Layout
from peakflight.kernels.interior import Begin
from peakflight.limits import GRAVITY
from peakflight.methods.start import Start, start_of
from peakflight.problem import Problem
from peakflight.spline import coefficients_of
from peakflight.trajectory import LONGEST, SHORTEST, Trajectory

SAMPLES, SAMPLES_OF_MANY = 16, 14
"""Points of a piece at which limits are constraints: of a whole leg, and of a part of one."""
FRESH = Begin(margin=1.05, barrier=0.3, slack=1e-3, stiffness=0.0, slowly=1.0, kept=0.0)
"""From a guess."""
GOING_ON = FRESH._replace(margin=1.02, barrier=0.1)
"""From a solution: of this problem with fewer pieces."""
AGAIN = GOING_ON._replace(stiffness=10.0, slowly=0.5)
"""From where a run has stalled."""
WARM = FRESH._replace(margin=0.0, barrier=0.01, slack=3e-2, kept=1.0)
"""From the solution of a similar problem."""
CHUNK = 4
"""Iterations between looks at the clock, if there is a time limit."""


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same from run to run."""

    problem: Problem
    """With degree and continuity filled in."""
    effort: np.ndarray | None
    """(4,) weight of the integral of each squared derivative; None for none."""
    tolerance: float
    iterations: int
    """Most of one run."""
    deadline: float
    """By `time.perf_counter`."""

    @property
    def is_late(self) -> bool:
        """Whether the time is up."""
        return time.perf_counter() >= self.deadline

    @property
    def may_miss(self) -> bool:
        """Whether answers may be much slower than their runs: a stretch turns the thrust."""
        return self.problem.is_at_rest and self.problem.limits.figures is not None

    @property
    def eases(self) -> bool:
        """Whether a little slower is a little easier, so that runs go on from a stretch.

        It is not with motion that is fixed, nor for rotors.
        """
        return self.problem.is_at_rest and not self.may_miss


@dataclass(frozen=True, eq=False)
class Run:
    """What came out of one run of the interior point."""

    trajectory: Trajectory
    pieces: np.ndarray
    objective: float
    """Of the trajectory, as far as samples tell."""
    ended: bool
    """Whether it met its own tolerance."""
    solved: bool
    """Whether it met that of the task."""
    code: int
    iterations: int
    dual: np.ndarray
    """Multipliers of the constraints."""


def run_interior(
    task: Task,
    start: Start,
    begin: Begin,
    tolerance: float | None = None,
    limits: np.ndarray | None = None,
) -> Run:
    """Run the interior point from a start."""
    problem = task.problem
    class_ = problem.spline_class
    layout = unknowns.make_layout(
        problem.waypoints, start.pieces, class_.degree, class_.continuity, problem.fixed
    )
    whole = len(start.times) == len(start.pieces)
    grid = unknowns.make_grid(class_.degree, SAMPLES if whole else SAMPLES_OF_MANY)
    limits = problem.limits.as_array() if limits is None else limits
    free = problem.is_at_rest and task.effort is None
    limited = unknowns.make_limited(
        limits, task.effort, GRAVITY, 0.0 if free else 1.0, problem.limits.figures
    )
    work = unknowns.make_work(layout, grid, limited)
    unknowns.set_unknowns(layout, start.data, start.starts, start.times, work.x)
    if start.dual is not None and start.dual.shape == work.dual.shape:
        work.dual[:] = start.dual
    tolerance = task.tolerance if tolerance is None else tolerance
    if not task.eases and begin in (GOING_ON, AGAIN):
        begin = begin._replace(margin=0.0, slack=WARM.slack)
    at_once = task.iterations if math.isinf(task.deadline) else CHUNK
    code, left, anew = interior.LIMIT, task.iterations, True
    while code == interior.LIMIT and left > 0 and (anew or not task.is_late):
        many = 0 if task.is_late else min(at_once, left)
        code = interior.run(layout, grid, limited, work, anew, begin, tolerance, many)
        left, anew = left - at_once, False
    x = work.x
    if not _is_sound(layout, x):  # gone astray
        x, code = work.best, interior.STALLED
    if problem.is_at_rest:  # the best iterate, stretched to what its samples allow
        stretch = work.marks[interior.STRETCH]
        is_time = layout.order < 0
        x = np.where(
            is_time, work.best + np.log(stretch), work.best / stretch ** np.maximum(layout.order, 0)
        )
    if not _is_sound(layout, x):  # nor is the best: the start stands in
        unknowns.set_unknowns(layout, start.data, start.starts, start.times, x)
        code = interior.STALLED
    data, starts, times = unknowns.get_data(layout, x)
    ended = code == interior.SOLVED
    leg = np.repeat(np.arange(len(start.pieces)), start.pieces)
    orders = basis.row_orders(class_.degree)[:-1]
    coefficients = coefficients_of(
        data * times[:, None, None] ** orders[:, None], problem.waypoints[leg] + starts, times
    )
    return Run(
        Trajectory(coefficients, times),
        start.pieces,
        float(work.marks[interior.BEST]),
        ended,
        ended and tolerance <= task.tolerance,
        code,
        int(work.marks[interior.COUNT]),
        work.dual,
    )


def run_from(task: Task, last: Run, begin: Begin, limits: np.ndarray | None = None) -> Run:
    """Run again from where a run has ended."""
    start = start_of(last.trajectory, last.pieces, task.problem)
    return run_interior(task, start, begin, limits=limits)


def _is_sound(layout: Layout, x: np.ndarray) -> bool:
    """Whether unknowns are numbers that a trajectory can have."""
    times = x[layout.clock]
    return bool(
        np.isfinite(x).all()
        and (times > math.log(SHORTEST)).all()
        and (times < math.log(LONGEST)).all()
    )
