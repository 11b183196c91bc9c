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

from peakflight.certificate import peak_ratios, stretch_to_limits
from peakflight.errors import InvalidProblem, Status
from peakflight.kernels import basis, interior, unknowns
from peakflight.kernels.conditions import LEAST, Layout
from peakflight.kernels.interior import Begin
from peakflight.limits import GRAVITY
from peakflight.methods import (
    Outcome,
    limit_kernels,
    peak,
    require,
    require_whole,
)
from peakflight.methods.classes import complete, without_class
from peakflight.methods.exchange import exchanged
from peakflight.methods.idle import idle_times, parts_for
from peakflight.methods.start import Start, given, guess, start_of
from peakflight.problem import Problem
from peakflight.result import History, Plan
from peakflight.spline import coefficients_of
from peakflight.trajectory import LONGEST, SHORTEST, Trajectory

STARTS = ("guess", "proportional", "peak")
SAMPLES, SAMPLES_OF_MANY = 16, 14
"""Points of a piece at which limits are constraints: of a whole leg, and of a part of one."""
ROUGH = 1e-3
"""Tolerance of a solution that is only cut into pieces."""
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
TIGHTENINGS = 8
"""Rounds of lowering limits, where a motion that is fixed rules out the stretch."""
NARROWINGS, NARROW = 4, 20.0
"""Rounds of the same, where peaks between samples would cost more of the time than so many times
the tolerance."""
BEYOND = 1e-5
"""Part of a limit by which it is lowered further then, where it is about rotors."""
HOPELESS = 0.2
"""Excess over a limit that lowering limits is not tried for."""
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
OTHERS: tuple[Literal["peak", "proportional"], ...] = ("peak", "proportional")
"""Starts that are tried where the first leads to no run that ends, or to much less than they had
promised."""
MISSED = 0.02
"""Part of the time by which an answer under limits on rotors is then slower than its best run."""
ALIKE = 2
"""Most runs in as many pieces that are made feasible, where that may take many more runs."""
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


@dataclass(frozen=True, eq=False)
class _Task:
    """What stays the same from run to run."""

    problem: Problem
    settings: Settings
    effort: np.ndarray | None
    """(4,) weight of the integral of each squared derivative; None for none."""
    deadline: float
    """By `time.perf_counter`."""

    @property
    def is_late(self) -> bool:
        return time.perf_counter() >= self.deadline


@dataclass(frozen=True, eq=False)
class _Run:
    """What came out of one run of the interior point."""

    trajectory: Trajectory
    pieces: np.ndarray
    objective: float
    """Of the trajectory, as far as samples tell."""
    ended: bool
    """Whether it met its own tolerance."""
    solved: bool
    """Whether it met that of the settings."""
    code: int
    iterations: int
    dual: np.ndarray
    """Multipliers of the constraints."""


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the kinds of limit and of effort."""
    return f"joint-{'effort' if settings.effort else 'time'}{limit_kernels(problem)}"


def solve(problem: Problem, settings: Settings) -> Outcome:
    """The fastest trajectory of its class, or the least of time and effort, feasible."""
    limit = math.inf if settings.time_limit is None else settings.time_limit
    deadline = time.perf_counter() + limit
    completed = complete(problem)
    task = _Task(completed, settings, _effort(completed, settings), deadline)
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
    outcome = _best(task, problem)
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


def _best(task: _Task, problem: Problem) -> Outcome:
    """The answer from the start that is asked for; where it misses much, of others too."""
    answers: list[Outcome] = []
    for initial in (task.settings.initial, *OTHERS):
        settings = replace(task.settings, initial=initial)
        runs = _runs(replace(task, settings=settings), problem)
        count = sum(run.iterations for run in runs)
        found = replace(_finished(task, runs), iterations=count, history=_history(runs))
        answers.append(replace(found, problem=task.problem))
        promised = min(run.objective for run in runs)
        has_ended = any(run.ended for run in runs)
        is_kept = has_ended and found.trajectory.duration <= (1.0 + MISSED) * promised
        is_free = task.settings.initial == "guess" and _may_miss(task.problem)
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


def _runs(task: _Task, problem: Problem) -> list[_Run]:
    """Run by run towards the answer: whole legs first, then cut where it pays."""
    settings = task.settings
    begin, most = FRESH, settings.max_pieces
    start = given(settings.initial, problem, task.problem, pieces=settings.pieces, most=most)
    cuts = settings.pieces != 1
    if start is None:
        start = guess(task.problem, EASE_OF_MANY if cuts else EASE)
    elif isinstance(settings.initial, Plan):
        begin = WARM
        cuts = cuts and not (start.pieces > 1).any()
    runs = [_run(task, start, begin, ROUGH if cuts else settings.tolerance)]
    has_stalled = cuts and not runs[0].ended
    if has_stalled:
        runs.append(_from(task, runs[0], GOING_ON))
        runs += _again(task, runs[-1])
        has_stalled = not runs[-1].solved
    for _ in range(ROUNDS if cuts else 0):
        last = runs[-1]
        parts = _parts(task, last)
        if not last.ended or task.is_late or (parts == 1).all():
            break
        runs.append(_from(task, _cut(last, parts), GOING_ON))
        if not runs[-1].ended:
            runs += _again(task, runs[-1])
        if runs[-1].objective > (1.0 - GAIN_OF_CUT) * last.objective:
            break
    if cuts and _is_short(task, runs[-1]):
        runs[-1:] = _exchanged(task, runs[-1])
    if runs[-1].ended and not runs[-1].solved:  # nothing to cut: only a rough run so far
        runs.append(_from(task, runs[-1], GOING_ON))
    return runs if has_stalled else runs + _again(task, runs[-1])


def _again(task: _Task, run: _Run) -> list[_Run]:
    """Runs from where one has stalled, until one does not."""
    runs: list[_Run] = []
    while not run.solved and len(runs) < RETRIES and not task.is_late:
        run = _from(task, run, AGAIN)
        runs.append(run)
    return runs


def _from(task: _Task, run: _Run, begin: Begin, limits: np.ndarray | None = None) -> _Run:
    """Run again from where a run has ended."""
    start = start_of(run.trajectory, run.pieces, task.problem)
    return _run(task, start, begin, limits=limits)


def _cut(run: _Run, parts: np.ndarray) -> _Run:
    """The same motion in more pieces: (K,) parts of each."""
    leg = np.repeat(np.arange(len(run.pieces)), run.pieces)
    pieces = np.bincount(leg, weights=parts).astype(np.int64)
    return replace(run, trajectory=run.trajectory.subdivide(parts), pieces=pieces)


def _parts(task: _Task, run: _Run) -> np.ndarray:
    """(K,) into how many parts each piece is cut next."""
    settings = task.settings
    whole = (run.pieces == 1).all()
    if settings.pieces != "auto":
        return np.full(len(run.trajectory), settings.pieces if whole else 1)
    if task.effort is not None:  # limits are not what holds it back: in halves, as long as it pays
        parts = np.full(len(run.trajectory), 2)
        most = settings.max_pieces
        return parts if most is None or parts.sum() <= most else np.ones_like(parts)
    idle = idle_times(run.trajectory, task.problem.limits)
    allowance = settings.idle_tolerance * run.trajectory.duration
    if idle.sum() < ENOUGH * allowance:
        return np.ones(len(idle), dtype=np.int64)
    return parts_for(idle, allowance, settings.max_pieces)


def _is_short(task: _Task, run: _Run) -> bool:
    """Whether there are fewer pieces than would pay, so that it matters where they are."""
    settings, problem = task.settings, task.problem
    most = settings.max_pieces
    if settings.pieces != "auto" or most is None or task.effort is not None:
        return False
    if not (len(run.pieces) < most <= MOST_EXCHANGED and problem.is_at_rest):
        return False
    if settings.exchanges == 0 or _may_miss(problem):  # samples do not say then what is faster
        return False
    idle = idle_times(run.trajectory, problem.limits).sum()
    return bool(idle >= ENOUGH * settings.idle_tolerance * run.trajectory.duration)


def _exchanged(task: _Task, run: _Run) -> list[_Run]:
    """A run, and one with its pieces where they help more if there is such."""
    spent = 0
    settings = task.settings

    def solve(trajectory: Trajectory, pieces: np.ndarray) -> _Run | None:
        nonlocal spent
        if task.is_late:
            return None
        start = start_of(trajectory, pieces, task.problem)
        tried = _run(task, start, GOING_ON, max(settings.tolerance, TRIAL))
        spent += tried.iterations
        return tried

    assert settings.max_pieces is not None
    found = exchanged(run, task.problem.limits, settings.max_pieces, settings.exchanges, solve)
    if found is run:
        return [replace(run, iterations=run.iterations + spent)]
    return [run, replace(found, iterations=spent)]


def _run(
    task: _Task,
    start: Start,
    begin: Begin,
    tolerance: float | None = None,
    limits: np.ndarray | None = None,
) -> _Run:
    """Run the interior point from a start."""
    problem, settings = task.problem, task.settings
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
    tolerance = settings.tolerance if tolerance is None else tolerance
    if not _eases(problem) and begin in (GOING_ON, AGAIN):
        begin = begin._replace(margin=0.0, slack=WARM.slack)
    at_once = settings.iterations if math.isinf(task.deadline) else CHUNK
    code, left, anew = interior.LIMIT, settings.iterations, True
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
    return _Run(
        Trajectory(coefficients, times),
        start.pieces,
        float(work.marks[interior.BEST]),
        ended,
        ended and tolerance <= settings.tolerance,
        code,
        int(work.marks[interior.COUNT]),
        work.dual,
    )


def _eases(problem: Problem) -> bool:
    """Whether a little slower is a little easier, so that runs go on from a stretch.

    It is not with motion that is fixed, nor for rotors: a stretch turns F.
    """
    return problem.is_at_rest and problem.limits.figures is None


def _may_miss(problem: Problem) -> bool:
    """Whether answers may be much slower than the runs they are from: a stretch turns F."""
    return problem.is_at_rest and problem.limits.figures is not None


def _is_sound(layout: Layout, x: np.ndarray) -> bool:
    """Whether unknowns are numbers that a trajectory can have."""
    times = x[layout.clock]
    return bool(
        np.isfinite(x).all()
        and (times > math.log(SHORTEST)).all()
        and (times < math.log(LONGEST)).all()
    )


def _finished(task: _Task, runs: list[_Run]) -> Outcome:
    """The best run, made feasible exactly."""
    best: Outcome | None = None
    tried: list[int] = []
    for run in sorted(runs, key=lambda run: run.objective):
        if _may_miss(task.problem) and tried.count(len(run.trajectory)) == ALIKE:
            continue
        tried.append(len(run.trajectory))
        if task.problem.is_at_rest:
            found, last = _stretched(task, run)
        else:
            found, last = _tightened(task, run)
        if found is not None and (best is None or found.duration < best.trajectory.duration):
            best = Outcome(
                status=_status(task, last),
                trajectory=found,
                pieces=tuple(run.pieces.tolist()),
                memory=last.dual,
            )
        least = 1.0 + NARROW * task.settings.tolerance
        missed = found is None or found.duration > least * run.trajectory.duration
        if best is not None and (_eases(task.problem) or task.is_late or not missed):
            break
    if best is not None:
        return best
    return Outcome(
        status=Status.INFEASIBLE,
        trajectory=runs[-1].trajectory,
        pieces=tuple(runs[-1].pieces.tolist()),
        message="no trajectory within the limits was found"
        + ("" if task.problem.is_at_rest else " with the motion that is fixed at waypoints"),
    )


def _stretched(task: _Task, run: _Run) -> tuple[Trajectory | None, _Run]:
    """The exact uniform stretch; with effort, only where limits are exceeded.

    Where it costs more than samples told, limits are lowered and the problem is solved again: a
    narrow peak between samples need not slow down the whole flight. For rotors there may be no
    stretch that is worth having; then limits are lowered until the motion keeps them as it is.
    """
    limits, eases = task.problem.limits, _eases(task.problem)
    least = 1.0 + NARROW * task.settings.tolerance
    lowered = limits.as_array()
    best, answer = None, run
    for _ in range(NARROWINGS if eases else TIGHTENINGS):
        found: Trajectory | None = run.trajectory
        if task.effort is None or _excess(task, run.trajectory).any():
            stretched = stretch_to_limits(run.trajectory, limits)
            found = None if stretched is None else stretched[0]
        if found is not None and (best is None or found.duration < best.duration):
            best, answer = found, run
        missed = found is None or found.duration > least * run.trajectory.duration
        if task.is_late or not missed:
            break
        excess = _excess(task, run.trajectory)
        if not eases:
            excess = np.where(excess > 0.0, 2.0 * excess + BEYOND, 0.0)
        lowered = _lowered(lowered, np.fmin(excess, HOPELESS))
        run = _from(task, run, GOING_ON if eases else WARM, lowered)
    if best is not None and best.duration > least * answer.trajectory.duration:
        answer = replace(answer, solved=False)
    return best, answer


def _excess(task: _Task, trajectory: Trajectory) -> np.ndarray:
    """(len(KINDS),) by how much each limit is exceeded, relative; 0 where it is kept or not set."""
    ratios = np.fmax.reduce(peak_ratios(trajectory, task.problem.limits), axis=0)
    return np.fmax(ratios - 1.0, 0.0)


def _lowered(limits: np.ndarray, excess: np.ndarray) -> np.ndarray:
    """What kernels hold kinds to (len(KINDS),), lowered by an excess; raised where from below."""
    from_below = np.arange(len(limits)) == LEAST
    return np.where(from_below, limits / (1.0 - excess), limits * (1.0 - excess))


def _tightened(task: _Task, run: _Run) -> tuple[Trajectory | None, _Run]:
    """The answer with motion that is fixed, which rules out the stretch: under lower limits."""
    lowered = task.problem.limits.as_array()
    for _ in range(TIGHTENINGS):
        excess = _excess(task, run.trajectory)
        if not excess.any():
            return run.trajectory, run
        if not excess.max() < HOPELESS:
            break
        lowered = _lowered(lowered, np.where(excess > 0.0, 2.0 * excess + 1e-8, 0.0))
        run = _from(task, run, WARM, lowered)
    return None, run


def _status(task: _Task, run: _Run) -> Status:
    if task.is_late:
        return Status.TIME_LIMIT
    if run.solved:
        return Status.SOLVED
    return Status.ITERATION_LIMIT if run.code == interior.LIMIT else Status.NO_PROGRESS


def _history(runs: list[_Run]) -> History:
    """Segment times of the runs that had as many pieces as the last."""
    count = len(runs[-1].trajectory)
    alike = [run.trajectory.segment_times for run in runs if len(run.trajectory) == count]
    return History(segment_times=np.array(alike))
