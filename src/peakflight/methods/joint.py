"""The complete problem (Eq. peak_opt_complete): durations and coefficients found together.

The paper states it and approaches it in turns; here it is solved as it stands, by the interior
point of `kernels.interior`. First every leg is one polynomial; then legs are cut where no limit is
at work for part of the time, by exact subdivision, and all is solved again from there.
"""

import math
import time
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from peakflight.errors import InvalidProblem, Status
from peakflight.methods import (
    OTHER_STARTS,
    Outcome,
    limit_kernels,
    peak,
    require,
    require_whole,
)
from peakflight.methods.classes import complete, without_class
from peakflight.methods.exchange import exchanged
from peakflight.methods.feasible import made_feasible
from peakflight.methods.idle import idle_times, parts_for
from peakflight.methods.interior_run import (
    AGAIN,
    FRESH,
    GOING_ON,
    WARM,
    Run,
    Task,
    run_from,
    run_interior,
)
from peakflight.methods.start import given, guess, start_of
from peakflight.problem import Problem
from peakflight.result import History, Plan
from peakflight.trajectory import Trajectory

STARTS = ("guess", "proportional", "peak")
ROUGH = 1e-3
"""Tolerance of a solution that is only cut into pieces."""
ROUNDS = 3
"""Most rounds of cutting legs."""
ENOUGH = 1.3
"""Times the allowance of idle time; a cut for less is not worth its iterations."""
EASE, EASE_OF_MANY = 1.0, 0.0
"""Of the guess, for whole legs and where legs are cut: which of them ends better was measured."""
GAIN_OF_CUT = 1e-3
"""Relative gain of a cut below which legs are not cut again."""
TRIAL = 1e-4
"""Tolerance of a solution that only says what an exchange of pieces is worth, unless a coarser one
is asked for."""
MOST_EXCHANGED = 64
"""Pieces in all up to which they are exchanged one by one: of more, one is worth too little for the
time that it takes to find out."""
FEW = 4
"""Legs up to which one polynomial a leg, at rest in jerk too, may be slower than the spline."""
MISSED = 0.02
"""Part of the time by which an answer under limits on rotors may be slower than its best run,
before other starts are tried."""
RETRIES = 4
"""Runs from where a run has stalled; a new barrier often gets it going."""
TIE = 1e-8
"""Relative difference of durations that is rounding: an exact stretch is closed to 1e-9."""
FELL_BACK = "joint found nothing faster than peak, whose plan this is"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Tuning of `joint`."""

    pieces: int | Literal["auto"] = "auto"
    """Polynomials in each leg; "auto" cuts legs where it pays, and keeps those of a plan to begin
    from."""
    max_pieces: int | None = None
    """Most polynomials in all; None for no limit of its own (a Crazyflie holds 31)."""
    exchanges: int = 10
    """Most rounds in which, where max_pieces is up to 64 and too few, one piece is cut and another
    merged, as long as it pays; 0 leaves them where idle time puts them."""
    effort: float = 0.0
    """Weight of the integral of what the problem minimizes beside the total time, in s^6/m^2 for
    jerk and s^8/m^2 for snap: from the fastest, 0, to the smoothest."""
    initial: Literal["guess", "proportional", "peak"] | Plan = "guess"
    """Where to begin: from a guess of durations and velocities, from another method's result, or
    from a plan, best of the same course with something changed."""
    time_limit: float | None = None
    """s, after which the best plan so far is returned; None for no limit."""
    tolerance: float = 1e-4
    """Relative: of the gap, the stretch and the decrement at which the problem counts as solved; of
    the stretch up to ten times as much where nothing more is gained."""
    idle_tolerance: float = 1.2e-3
    """Part of the flight during which no limit may be at work, before legs are cut for it."""
    iterations: int = 150
    """Most iterations of one run; there are a few."""

    def __post_init__(self) -> None:
        if self.pieces != "auto":
            if isinstance(self.pieces, str):
                raise InvalidProblem(
                    f"setting pieces is {self.pieces!r}; it must be auto or a whole number"
                )
            require_whole("pieces", self.pieces, 1, 1000)
        if self.max_pieces is not None:
            require_whole("max_pieces", self.max_pieces, 1, 10**7)
        require_whole("exchanges", self.exchanges, 0, 1000)
        require("effort", self.effort, 0.0, 1e9)
        named = isinstance(self.initial, str) and self.initial in STARTS
        if not (named or isinstance(self.initial, Plan)):
            raise InvalidProblem(
                f"setting initial is {self.initial!r}; it must be {', '.join(STARTS)} or a plan"
            )
        if self.time_limit is not None:
            require("time_limit", self.time_limit, 0.0, 1e9)
        require("tolerance", self.tolerance, 1e-9, 1e-1)
        require("idle_tolerance", self.idle_tolerance, 1e-6, 1.0)
        require_whole("iterations", self.iterations, 1, 10**6)


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the kinds of limit and of effort."""
    return f"joint-{'effort' if settings.effort else 'time'}{limit_kernels(problem)}"


def solve(problem: Problem, settings: Settings) -> Outcome:
    """The fastest trajectory of its class, or the least of time and effort, feasible."""
    limit = math.inf if settings.time_limit is None else settings.time_limit
    deadline = time.perf_counter() + limit
    completed = complete(problem)
    task = Task(
        problem=completed,
        effort=_effort(completed, settings),
        tolerance=settings.tolerance,
        iterations=settings.iterations,
        deadline=deadline,
    )
    legs = len(completed.waypoints) - 1
    if settings.max_pieces is not None and settings.max_pieces < legs:
        raise InvalidProblem(
            f"max_pieces is {settings.max_pieces}; the course has {legs} legs, and each needs one"
        )
    if settings.max_pieces is not None and settings.pieces != "auto":
        total = legs * settings.pieces
        if total > settings.max_pieces:
            raise InvalidProblem(
                f"{settings.pieces} pieces in each of {legs} legs are {total}; max_pieces is "
                f"{settings.max_pieces}"
            )
    outcome = _best(task, problem, settings)
    iterations = outcome.iterations
    infeasible = outcome.status is Status.INFEASIBLE
    doubtful = outcome.status is not Status.SOLVED or (legs <= FEW and settings.pieces == 1)
    if not (infeasible or (doubtful and task.effort is None)):
        return outcome
    spline = without_class(problem)
    other = peak.solve(spline, peak.Settings())
    faster = other.trajectory.duration < (1.0 - TIE) * outcome.trajectory.duration
    if other.status is Status.INFEASIBLE or not (infeasible or faster):
        return outcome
    return replace(
        other,
        status=Status.TIME_LIMIT if task.is_late else Status.NO_PROGRESS,
        problem=spline,
        iterations=iterations + other.iterations,
        message=FELL_BACK,
    )


def _best(task: Task, problem: Problem, settings: Settings) -> Outcome:
    """The answer from the start that is asked for; where it misses much, of others too."""
    answers: list[Outcome] = []
    for initial in (settings.initial, *OTHER_STARTS):
        runs = _runs(task, problem, replace(settings, initial=initial))
        count = sum(run.iterations for run in runs)
        found = replace(made_feasible(task, runs), iterations=count, history=_history(runs))
        answers.append(replace(found, problem=task.problem))
        promised = min(run.objective for run in runs)
        has_ended = any(run.ended for run in runs)
        is_kept = has_ended and found.trajectory.duration <= (1.0 + MISSED) * promised
        is_free = settings.initial == "guess" and task.may_miss
        if (is_kept and found.status is not Status.INFEASIBLE) or not is_free or task.is_late:
            break
    best = min(answers, key=lambda one: (one.status is Status.INFEASIBLE, one.trajectory.duration))
    return replace(best, iterations=sum(answer.iterations for answer in answers))


def _effort(problem: Problem, settings: Settings) -> np.ndarray | None:
    """(4,) weights of the integrals of squared velocity to snap; None if nothing is weighed."""
    if settings.effort == 0.0:
        return None
    weights = np.zeros(4)
    for order, weight in enumerate(problem.spline_class.weights):
        if weight > 0.0 and not 1 <= order <= 4:
            raise InvalidProblem(
                f"minimize weighs derivative {order}; effort is about 1 to 4, velocity to snap"
            )
        if weight > 0.0:
            weights[order - 1] = settings.effort * weight
    return weights


def _runs(task: Task, problem: Problem, settings: Settings) -> list[Run]:
    """Run by run towards the answer: whole legs first, then cut where it pays."""
    begin, most = FRESH, settings.max_pieces
    start = given(settings.initial, problem, task.problem, pieces=settings.pieces, most=most)
    cuts = settings.pieces != 1
    if start is None:
        start = guess(task.problem, EASE_OF_MANY if cuts else EASE)
    elif isinstance(settings.initial, Plan):
        begin = WARM
        cuts = cuts and not (start.pieces > 1).any()
    runs = [run_interior(task, start, begin, ROUGH if cuts else None)]
    has_stalled = cuts and not runs[0].ended
    if has_stalled:
        runs.append(run_from(task, runs[0], GOING_ON))
        runs += _again(task, runs[-1])
        has_stalled = not runs[-1].solved
    for _ in range(ROUNDS if cuts else 0):
        last = runs[-1]
        parts = _parts(task, last, settings)
        if not last.ended or task.is_late or (parts == 1).all():
            break
        runs.append(run_from(task, _cut(last, parts), GOING_ON))
        if not runs[-1].ended:
            runs += _again(task, runs[-1])
        if runs[-1].objective > (1.0 - GAIN_OF_CUT) * last.objective:
            break
    if cuts and _is_short(task, runs[-1], settings):
        runs[-1:] = _exchanged(task, runs[-1], settings)
    if runs[-1].ended and not runs[-1].solved:  # nothing to cut: only a rough run so far
        runs.append(run_from(task, runs[-1], GOING_ON))
    return runs if has_stalled else runs + _again(task, runs[-1])


def _again(task: Task, run: Run) -> list[Run]:
    """Runs from where one has stalled, until one does not."""
    runs: list[Run] = []
    while not run.solved and len(runs) < RETRIES and not task.is_late:
        run = run_from(task, run, AGAIN)
        runs.append(run)
    return runs


def _cut(run: Run, parts: np.ndarray) -> Run:
    """The same motion in more pieces: (K,) parts of each."""
    leg = np.repeat(np.arange(len(run.pieces)), run.pieces)
    pieces = np.bincount(leg, weights=parts).astype(np.int64)
    return replace(run, trajectory=run.trajectory.subdivide(parts), pieces=pieces)


def _parts(task: Task, run: Run, settings: Settings) -> np.ndarray:
    """(K,) into how many parts each piece is cut next."""
    whole = (run.pieces == 1).all()
    if settings.pieces != "auto":
        return np.full(len(run.trajectory), settings.pieces if whole else 1)
    if task.effort is not None:  # limits are not what holds it back: in halves, as long as it pays
        parts = np.full(len(run.trajectory), 2)
        most = settings.max_pieces
        return parts if most is None or parts.sum() <= most else np.ones_like(parts)
    idle = _idle(task, run, settings)
    if idle is None:
        return np.ones(len(run.trajectory), dtype=np.int64)
    allowance = settings.idle_tolerance * run.trajectory.duration
    return parts_for(idle, allowance, settings.max_pieces)


def _idle(task: Task, run: Run, settings: Settings) -> np.ndarray | None:
    """(K,) s of each piece without a limit at work; None if a cut for all of them does not pay."""
    idle = idle_times(run.trajectory, task.problem.limits)
    pays = idle.sum() >= ENOUGH * settings.idle_tolerance * run.trajectory.duration
    return idle if pays else None


def _is_short(task: Task, run: Run, settings: Settings) -> bool:
    """Whether there are fewer pieces than would pay, so that it matters where they are."""
    most = settings.max_pieces
    if settings.pieces != "auto" or most is None or task.effort is not None:
        return False
    if not (len(run.pieces) < most <= MOST_EXCHANGED and task.problem.is_at_rest):
        return False
    if settings.exchanges == 0 or task.may_miss:  # samples do not say then what is faster
        return False
    return _idle(task, run, settings) is not None


def _exchanged(task: Task, run: Run, settings: Settings) -> list[Run]:
    """A run, and one with its pieces where they help more if there is such."""
    spent = 0

    def solve(trajectory: Trajectory, pieces: np.ndarray) -> Run | None:
        nonlocal spent
        if task.is_late:
            return None
        start = start_of(trajectory, pieces, task.problem)
        tried = run_interior(task, start, GOING_ON, max(task.tolerance, TRIAL))
        spent += tried.iterations
        return tried

    assert settings.max_pieces is not None
    found = exchanged(run, task.problem.limits, settings.max_pieces, settings.exchanges, solve)
    if found is run:
        return [replace(run, iterations=run.iterations + spent)]
    return [run, replace(found, iterations=spent)]


def _history(runs: list[Run]) -> History:
    """Segment times of the runs that had their pieces where the last has."""
    last = runs[-1].pieces
    alike = [run.trajectory.segment_times for run in runs if np.array_equal(run.pieces, last)]
    return History(segment_times=np.array(alike))
