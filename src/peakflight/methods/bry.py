"""Bry's method (Eq. BryOpt): the spline's cost plus c_t times the total time, which is free.

Left to the method, c_t is raised until a limit is reached. Each descent begins from the last one's
times, stretched to the limits, and with the c_t that such a stretch is best for; once a c_t on
either side is known, from between the two.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np

from peakflight.certificate import stretch_to_limits
from peakflight.errors import InvalidProblem, Status
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
IDLE = 1e-2
"""No c_t is small enough if a FACTOR less of it lengthens the flight by no more than this part, and
spares no more than this part of the stretch that the limits ask for."""
SHORTEST, LONGEST_ASKED = 1e-2, 1e3
"""Least and most that a given c_t may ask for, as parts of the time that flying proportional to
distance takes at the limits: `finish` mends what is a little too fast, and digits run out."""
MARGIN = 10.0
"""How far beyond those a descent may begin."""


@dataclass(frozen=True, kw_only=True)
class Settings(DescentSettings):
    """Tuning of `bry`."""

    time_penalty: float | None = None
    """c_t, in m^2/s^6 for jerk and m^2/s^8 for snap: the higher, the more aggressive; None raises
    it until a limit is reached. Refused if the total time is absurd: SHORTEST, LONGEST_ASKED."""
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


class Ending(Enum):
    """How a search for c_t has ended."""

    MET = auto()
    """By its rule."""
    BEYOND = auto()
    """The optimum exceeds the limits however small c_t is."""
    JUMP = auto()
    """The optimum jumps across the limits."""
    ROUNDS = auto()
    """By the number of descents, or at times that are much too long."""


@dataclass(frozen=True, eq=False)
class Search:
    """The c_t that were tried."""

    best: Trial
    """Within the limits the most aggressive; if none is, the nearest to them."""
    ending: Ending
    iterations: int
    """Of all descents."""
    road: np.ndarray
    """(n, K) s, in the order run, up to the optimum of `best`."""


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the spline and of the descent."""
    del settings
    return kernels_for(problem)


def solve(problem: Problem, settings: Settings) -> Outcome:
    """Descend at the given c_t, or at the one that reaches a limit; then the exact stretch."""
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    start = first_times(problem, task)
    if settings.time_penalty is None:
        search = _raise_penalty(problem, task, start, settings)
        outcome = _stretched(problem, task, search)
        iterations, road = search.iterations, search.road
    else:
        trial = _at_given_penalty(problem, task, start, settings)
        outcome = _kept(problem, task, trial)
        iterations, road = trial.found.iterations, _road(trial.found)
    return replace(outcome, iterations=iterations, history=History(segment_times=road))


def _at_given_penalty(
    problem: Problem, task: SplineTask, times: np.ndarray, settings: Settings
) -> Trial:
    """The optimum for the c_t of the settings, from the scale at which it is near."""
    assert settings.time_penalty is not None
    penalty, unit = settings.time_penalty, times.sum()
    price = _evaluate(task, times, settings).price
    if price > 0.0:  # falls with the power 2r of the scale
        scale = (price / penalty) ** (0.5 / problem.spline_class.cost_order)
        times = times * min(max(scale, SHORTEST / MARGIN), LONGEST_ASKED * MARGIN)
    found = descend(task, times, settings, penalty=penalty)
    part = found.times.sum() / unit
    if part < SHORTEST or part > LONGEST_ASKED:
        side, bound = ("below", SHORTEST) if part < SHORTEST else ("above", LONGEST_ASKED)
        raise InvalidProblem(
            f"setting time_penalty is {penalty:g}; it asks for a total time {side} "
            f"{bound * unit:.3g} s, and must ask for one from {SHORTEST:g} to {LONGEST_ASKED:g} "
            f"times the {unit:.3g} s that times proportional to distance take at the limits"
        )
    return _trial(problem, task, found, penalty)


def _kept(problem: Problem, task: SplineTask, best: Trial) -> Outcome:
    """The optimum as it is; slowed down, and that is said, only if it exceeds a limit."""
    trajectory = task.solve(best.found.times)
    if best.stretch <= 1.0:
        return Outcome(status=best.found.status, trajectory=trajectory)
    outcome = finish(problem, task, best.found.times, status=best.found.status)
    if outcome.status is Status.INFEASIBLE:
        return outcome
    message = (
        f"time_penalty {best.penalty:g} asks for more than the limits allow: "
        f"{_change(best, outcome)}"
    )
    return replace(outcome, message=message)


def _stretched(problem: Problem, task: SplineTask, search: Search) -> Outcome:
    """The best optimum at the limits; what it is, unless the search met its rule."""
    best = search.best
    outcome = finish(problem, task, best.found.times, status=best.found.status)
    if search.ending is Ending.MET or outcome.status is Status.INFEASIBLE:
        return outcome
    change = _change(best, outcome)
    if search.ending is Ending.BEYOND:
        status = Status.NO_PROGRESS
        message = f"even without a penalty on time the optimum exceeds the limits; it was {change}"
    elif search.ending is Ending.JUMP:
        status = Status.NO_PROGRESS
        message = (
            f"at time_penalty {best.penalty:.6g} the optimum jumps across the limits; the one "
            f"within was {change}, and is the optimum of no time_penalty"
        )
    else:
        status = Status.ITERATION_LIMIT
        message = (
            "no time_penalty was found at which the optimum reaches the limits and keeps them; "
            f"the nearest was {change}"
        )
    return replace(outcome, status=status, message=message)


def _change(best: Trial, outcome: Outcome) -> str:
    """What has become of an optimum, in words."""
    change = 100.0 * (outcome.trajectory.duration / best.found.times.sum() - 1.0)
    return f"slowed down by {change:.3g} %" if change >= 0.0 else f"shortened by {-change:.3g} %"


def _raise_penalty(
    problem: Problem, task: SplineTask, times: np.ndarray, settings: Settings
) -> Search:
    """Optima for one c_t after the other, until one could be flown faster by closeness at most."""
    aim = 1.0 - 0.5 * settings.closeness
    longest = LONGEST * times.sum()
    best: Trial | None = None
    slow: Trial | None = None  # the last that keeps every limit
    fast: Trial | None = None  # the last that does not
    before: Trial | None = None  # fast, if the last c_t is a FACTOR below its own
    ending = Ending.ROUNDS
    descents = iterations = 0
    road = beyond = np.empty((0, len(times)))  # up to the best one, and from there on
    first = _evaluate(task, times, settings)
    penalty = first.price if first.price > 0.0 else first.effort / times.sum()
    while descents < ROUNDS and times.sum() < longest:
        last = _trial(problem, task, descend(task, times, settings, penalty=penalty), penalty)
        descents += 1
        iterations += last.found.iterations
        beyond = _latest(settings, beyond, _road(last.found))
        if last.stretch <= 1.0 or (slow is None and (best is None or last.stretch < best.stretch)):
            best = last
            road, beyond = _latest(settings, road, beyond), beyond[:0]
        if last.stretch > 1.0:
            fast = last
        else:
            slow = last
            if last.stretch >= 1.0 - settings.closeness:
                ending = Ending.MET
                break
        if slow is None or fast is None:
            times = last.found.times * min(max(last.stretch / aim, 1.0 / FACTOR), FACTOR)
            penalty = _evaluate(task, times, settings).price
            trusted = penalty > last.penalty if fast is None else 0.0 < penalty < last.penalty
            if not trusted:
                if before is not None and slow is None and _idle(before, last):
                    ending = Ending.BEYOND
                    break
                times = last.found.times
                penalty = last.penalty * (FACTOR if fast is None else 1.0 / FACTOR)
            before = None if trusted else fast
        elif fast.penalty <= slow.penalty * (1.0 + NARROW):
            ending = Ending.JUMP
            break
        else:
            share = math.log(aim / slow.stretch) / math.log(fast.stretch / slow.stretch)
            share = min(max(share, EDGE), 1.0 - EDGE)
            times = slow.found.times * (fast.found.times / slow.found.times) ** share
            penalty = slow.penalty * (fast.penalty / slow.penalty) ** share
    assert best is not None  # the first one is, at least
    return Search(best, ending, iterations, road)


def _idle(before: Trial, last: Trial) -> bool:
    """Whether a FACTOR less of c_t has made next to no difference."""
    spared = before.stretch - last.stretch
    longer = last.found.times.sum() / before.found.times.sum() - 1.0
    return spared <= IDLE * (last.stretch - 1.0) and longer <= IDLE


def _road(found: Descended) -> np.ndarray:
    """(n, K) s: the first iterations of a descent as far as there is room, and its end."""
    whole = len(found.road) > found.iterations
    return found.road if whole else np.concatenate((found.road[:-1], found.times[None]))


def _latest(settings: Settings, *roads: np.ndarray) -> np.ndarray:
    """One road after the other, as much of the end as there is room for."""
    joined = np.concatenate(roads)
    rows = max(settings.history_size // joined.shape[1], 1)
    return joined[-rows:]


def _evaluate(task: SplineTask, times: np.ndarray, settings: Settings) -> Descended:
    """Cost and gradient where the times are."""
    return descend(task, times, settings, penalty=None, iterations=0)


def _trial(problem: Problem, task: SplineTask, found: Descended, penalty: float) -> Trial:
    """How an optimum stands to the limits."""
    stretched = stretch_to_limits(task.solve(found.times), problem.limits)
    return Trial(penalty, found, np.inf if stretched is None else stretched[1])
