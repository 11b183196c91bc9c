"""The best segment times for the spline (Eq. opt_time), or the paper's Algorithm 1.

Both alternate between the spline for given times (sub-problem 1) and better times for its peaks
(sub-problem 2). The default does so by descent: it minimises the total time plus a barrier of the
peaks (`kernels.barrier`) over the logarithms of the segment times, with the gradient through
sub-problem 1 by its adjoint. Powers rise from stage to stage, from a rough shape that any start
leads to up to limits that are hard in all but name; the exact stretch does the rest.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from peakflight.certificate import peak_ratios
from peakflight.errors import InvalidProblem, Status
from peakflight.kernels import barrier, basis, descent
from peakflight.limits import GRAVITY
from peakflight.methods import Outcome, algorithm1, require, spline_kernels
from peakflight.methods.algorithm1 import Algorithm1Settings
from peakflight.methods.scaling import estimated_stretch, finish, proportional_times
from peakflight.problem import Problem
from peakflight.result import History
from peakflight.spline import OutOfRange, SplineTask

Stage = tuple[int, int, float]

LADDER: tuple[Stage, ...] = (
    (8, 6, 1e-2),
    (8, 24, 1e-2),
    (8, 96, 1e-3),
    (16, 384, 1e-4),
    (32, 1536, 5e-5),
    (64, 6144, 8e-6),
)
"""Starting at the power 6 is what makes the plain start safe; ending at 6144 leaves 1e-4."""

VARIANTS = ("descent", "paper")
DOUBTFUL = 0.95
"""A descent that gains less than this over its start is compared with it."""
STRETCHED = 2e-3
"""A descent whose result must be slowed down by more than this has missed something."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Tuning of `peak`."""

    variant: Literal["descent", "paper"] = "descent"
    """descent: the best segment times; paper: Algorithm 1 to the letter."""
    ladder: tuple[Stage, ...] = LADDER
    """Stages: samples a piece (8, 16, 32 or 64), power (24 times a power of two, from 6 on), and
    the relative decrease over five iterations that ends the stage."""
    stage_iterations: int = 300
    """Most iterations in a stage."""
    memory: int = 50
    """Pairs that L-BFGS keeps."""
    history_size: int = 1_000_000
    """Most segment times kept for the history, of all iterations together."""
    paper: Algorithm1Settings = field(default_factory=Algorithm1Settings)
    """Learning rates and the rest of variant paper."""

    def __post_init__(self) -> None:
        if self.variant not in VARIANTS:
            raise InvalidProblem(
                f"unknown variant {self.variant!r}; known are {', '.join(VARIANTS)}"
            )
        require("stages of the ladder", len(self.ladder), 1, 100)
        require("stage_iterations", self.stage_iterations, 1, 10**6)
        require("memory", self.memory, 1, 1000)
        require("history_size", self.history_size, 1, 10**9)
        _stages(self.ladder, self.stage_iterations)


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the variant, for the spline."""
    return f"peak-{settings.variant}-{spline_kernels(problem)}"


def solve(problem: Problem, settings: Settings) -> Outcome:
    """Best segment times for the spline of the problem, feasible."""
    if settings.variant == "paper":
        return algorithm1.solve(problem, settings.paper)
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    times = proportional_times(problem)
    times *= estimated_stretch(peak_ratios(task.solve(times), problem.limits))
    start = times.copy()
    count, degree = len(times), task.spline_class.degree
    history = np.empty((max(settings.history_size // count, 1), count))
    iterations, converged = descent.descend(
        task.rows, task.waypoints, task.simple, task.layered, times,
        problem.limits.as_array(), GRAVITY,
        tuple(basis.sample_tables(degree, samples) for samples, _, _ in settings.ladder),
        basis.sample_tables(degree, barrier.BATCH),
        _stages(settings.ladder, settings.stage_iterations), settings.memory,
        barrier.workspace(count, degree, problem.limits.on_turning, problem.limits.figures),
        history,
    )  # fmt: skip
    status = Status.SOLVED if converged else Status.ITERATION_LIMIT
    try:
        outcome = finish(problem, task, times, status=status)
        if outcome.trajectory.duration > (1.0 + STRETCHED) * times.sum():
            outcome = replace(outcome, status=Status.NO_PROGRESS)
        failed = outcome.status is Status.INFEASIBLE
    except OutOfRange:
        failed = True
    if failed or outcome.trajectory.duration > DOUBTFUL * start.sum():
        other = finish(problem, task, start, status=Status.NO_PROGRESS)
        far = failed or _faster(other, outcome, by=STRETCHED)
        if far or _faster(other, outcome, by=0.0):
            outcome = other if far else replace(other, status=outcome.status)
    road = np.concatenate((start[None], history[:iterations]))
    return replace(outcome, iterations=iterations, history=History(segment_times=road))


def _faster(one: Outcome, other: Outcome, *, by: float) -> bool:
    """Whether an outcome is feasible, and faster than another by more than a part of its time."""
    feasible = one.status is not Status.INFEASIBLE
    return feasible and one.trajectory.duration < (1.0 - by) * other.trajectory.duration


@lru_cache
def _stages(ladder: tuple[Stage, ...], iterations: int) -> np.ndarray:
    """(n, 3) doublings of the power, most iterations, decrease."""
    rows = []
    for index, (samples, power, decrease) in enumerate(ladder):
        doublings = np.log2(power / barrier.BASE_POWER) if power > 0 else np.nan
        known = samples in (8, 16, 32, 64) and power >= 6 and doublings % 1.0 == 0.0
        if not (known and 0.0 < decrease < 1.0):
            raise InvalidProblem(
                f"stage {index} of the ladder is {samples} samples, power {power}, decrease "
                f"{decrease}; they must be 8, 16, 32 or 64; 24 times a power of two, from 6 on; "
                "and between 0 and 1"
            )
        rows.append((doublings, iterations, decrease))
    return np.array(rows)
