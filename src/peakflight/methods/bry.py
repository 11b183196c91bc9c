"""Bry's method (Eq. BryOpt): the spline's cost plus c_t times the total time, which is free.

Left to the method, c_t is raised until a limit is reached. Each descent begins from the last one's
times, stretched to the limits, and with the c_t that such a stretch is best for; once a c_t on
either side is known, from between the two.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from peakflight.certificate import stretch_to_limits
from peakflight.errors import Status
from peakflight.methods import Outcome, require
from peakflight.methods.least_effort import (
    Descended,
    DescentSettings,
    descend,
    first_times,
    kernels_for,
)
from peakflight.methods.scaling import LONGEST, finish
from peakflight.problem import Problem
from peakflight.result import History
from peakflight.spline import SplineTask

ROUNDS = 40
"""Most descents in the search for c_t."""
FACTOR = 4.0
"""Most that a stretch is trusted for, and by how much c_t changes where it is not."""
EDGE = 0.1
"""A c_t between two known ones is at least this part of their distance from both."""
NARROW = 1e-9
"""Relative distance of two c_t, one within the limits and one beyond, that ends the search: the
optimum jumps between them."""


@dataclass(frozen=True, kw_only=True)
class Settings(DescentSettings):
    """Tuning of `bry`."""

    time_penalty: float | None = None
    """c_t, in m^2/s^6 for jerk and m^2/s^8 for snap: the higher, the more aggressive; None raises
    it until a limit is reached."""
    closeness: float = 1e-3
    """Relative: how much the times could still be shortened when the search for c_t ends."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.time_penalty is not None:
            require("time_penalty", self.time_penalty, 1e-100, 1e100)
        require("closeness", self.closeness, 1e-9, 0.5)


@dataclass(frozen=True, eq=False)
class Trial:
    """A c_t and its optimum."""

    penalty: float
    found: Descended
    stretch: float
    """Of its path, that the limits ask for: at most 1 if it keeps them."""


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the spline and of the descent."""
    del settings
    return kernels_for(problem)


def solve(problem: Problem, settings: Settings) -> Outcome:
    """Descend at the given c_t, or at the one that reaches a limit; then the exact stretch."""
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    start = first_times(problem, task)
    if settings.time_penalty is None:
        trials = _raise_penalty(problem, task, start, settings)
        best = trials[-1].found
        outcome = finish(problem, task, best.times, status=best.status)
    else:
        trials = [_at_given_penalty(problem, task, start, settings)]
        outcome = _kept(problem, task, trials[0])
    road = np.concatenate([trial.found.road for trial in trials])
    iterations = sum(trial.found.iterations for trial in trials)
    rows = max(settings.history_size // len(start), 1)
    return replace(outcome, iterations=iterations, history=History(segment_times=road[:rows]))


def _at_given_penalty(
    problem: Problem, task: SplineTask, times: np.ndarray, settings: Settings
) -> Trial:
    """The optimum for the c_t of the settings, from the scale at which it is near."""
    assert settings.time_penalty is not None
    price = _evaluate(task, times, settings).price
    if price > 0.0:  # falls with the power 2r of the scale
        order = problem.spline_class.cost_order
        times = times * (price / settings.time_penalty) ** (1.0 / (2.0 * order))
    return _attempt(problem, task, times, settings, settings.time_penalty)


def _kept(problem: Problem, task: SplineTask, best: Trial) -> Outcome:
    """The optimum as it is; slowed down, and that is said, only if it exceeds a limit."""
    trajectory = task.solve(best.found.times)
    if best.stretch <= 1.0:
        return Outcome(status=best.found.status, trajectory=trajectory)
    outcome = finish(problem, task, best.found.times, status=best.found.status)
    if outcome.status is Status.INFEASIBLE:
        return outcome
    slower = outcome.trajectory.duration / trajectory.duration - 1.0
    message = (
        f"time_penalty {best.penalty:g} asks for more than the limits allow: slowed down by "
        f"{100.0 * slower:.3g} %"
    )
    return replace(outcome, message=message)


def _raise_penalty(
    problem: Problem, task: SplineTask, times: np.ndarray, settings: Settings
) -> list[Trial]:
    """Optima for one c_t after the other, the best at the end.

    That is one whose path could be flown faster by closeness at most; if there is none, the most
    aggressive within the limits; if none is, the nearest to them.
    """
    aim = 1.0 - 0.5 * settings.closeness
    longest = LONGEST * times.sum()
    trials: list[Trial] = []
    slow: Trial | None = None  # the last that keeps every limit
    fast: Trial | None = None  # the last that does not
    first = _evaluate(task, times, settings)
    penalty = first.price if first.price > 0.0 else first.effort / times.sum()
    while len(trials) < ROUNDS and times.sum() < longest:
        last = _attempt(problem, task, times, settings, penalty)
        trials.append(last)
        if last.stretch > 1.0:
            fast = last
        else:
            slow = last
            if last.stretch >= 1.0 - settings.closeness:
                break
        if slow is None or fast is None:
            times = last.found.times * min(max(last.stretch / aim, 1.0 / FACTOR), FACTOR)
            penalty = _evaluate(task, times, settings).price
            if not (penalty > last.penalty if fast is None else 0.0 < penalty < last.penalty):
                times = last.found.times
                penalty = last.penalty * (FACTOR if fast is None else 1.0 / FACTOR)
        elif fast.penalty <= slow.penalty * (1.0 + NARROW):
            break
        else:
            share = math.log(aim / slow.stretch) / math.log(fast.stretch / slow.stretch)
            share = min(max(share, EDGE), 1.0 - EDGE)
            times = slow.found.times * (fast.found.times / slow.found.times) ** share
            penalty = slow.penalty * (fast.penalty / slow.penalty) ** share
    best = slow or min(trials, key=lambda trial: trial.stretch)
    return [*(trial for trial in trials if trial is not best), best]


def _evaluate(task: SplineTask, times: np.ndarray, settings: Settings) -> Descended:
    """Cost and gradient where the times are."""
    return descend(task, times, settings, penalty=None, iterations=0)


def _attempt(
    problem: Problem, task: SplineTask, times: np.ndarray, settings: Settings, penalty: float
) -> Trial:
    found = descend(task, times, settings, penalty=penalty)
    stretched = stretch_to_limits(task.solve(found.times), problem.limits)
    return Trial(penalty, found, np.inf if stretched is None else stretched[1])
