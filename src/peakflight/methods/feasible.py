"""Runs made feasible exactly: the interior point knows limits at samples, the certificate all."""

from dataclasses import replace

import numpy as np

from peakflight.certificate import peak_ratios, stretch_to_limits
from peakflight.errors import Status
from peakflight.kernels import interior
from peakflight.kernels.conditions import LEAST
from peakflight.methods import Outcome
from peakflight.methods.interior_run import GOING_ON, WARM, Run, Task, run_from
from peakflight.trajectory import Trajectory

TIGHTENINGS = 8
"""Rounds of lowering limits, where a motion that is fixed rules out the stretch."""
NARROWINGS, NARROW = 4, 20.0
"""Rounds of the same, where peaks between samples would cost more of the time than so many times
the tolerance."""
BEYOND = 1e-5
"""Part of a limit by which it is lowered further then, where it is about rotors."""
HOPELESS = 0.2
"""Excess over a limit that lowering limits is not tried for."""
ALIKE = 2
"""Most runs in as many pieces that are made feasible, where that may take many more runs."""


def made_feasible(task: Task, runs: list[Run]) -> Outcome:
    """The best run, made feasible exactly."""
    best: Outcome | None = None
    tried: list[int] = []
    for run in sorted(runs, key=lambda run: run.objective):
        if task.may_miss and tried.count(len(run.trajectory)) == ALIKE:
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
        least = 1.0 + NARROW * task.tolerance
        missed = found is None or found.duration > least * run.trajectory.duration
        if best is not None and (task.eases or task.is_late or not missed):
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


def _stretched(task: Task, run: Run) -> tuple[Trajectory | None, Run]:
    """The exact uniform stretch; with effort, only where limits are exceeded.

    Where it costs more than samples told, limits are lowered and the problem is solved again: a
    narrow peak between samples need not slow down the whole flight. For rotors there may be no
    stretch that is worth having; then limits are lowered until the motion keeps them as it is.
    """
    limits, eases = task.problem.limits, task.eases
    least = 1.0 + NARROW * task.tolerance
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
        run = run_from(task, run, GOING_ON if eases else WARM, lowered)
    if best is not None and best.duration > least * answer.trajectory.duration:
        answer = replace(answer, solved=False)
    return best, answer


def _excess(task: Task, trajectory: Trajectory) -> np.ndarray:
    """(len(KINDS),) by how much each limit is exceeded, relative; 0 where it is kept or not set."""
    ratios = np.fmax.reduce(peak_ratios(trajectory, task.problem.limits), axis=0)
    return np.fmax(ratios - 1.0, 0.0)


def _lowered(limits: np.ndarray, excess: np.ndarray) -> np.ndarray:
    """What kernels hold kinds to (len(KINDS),), lowered by an excess; raised where from below."""
    from_below = np.arange(len(limits)) == LEAST
    return np.where(from_below, limits / (1.0 - excess), limits * (1.0 - excess))


def _tightened(task: Task, run: Run) -> tuple[Trajectory | None, Run]:
    """The answer with motion that is fixed, which rules out the stretch: under lower limits."""
    lowered = task.problem.limits.as_array()
    for _ in range(TIGHTENINGS):
        excess = _excess(task, run.trajectory)
        if not excess.any():
            return run.trajectory, run
        if not excess.max() < HOPELESS:
            break
        lowered = _lowered(lowered, np.where(excess > 0.0, 2.0 * excess + 1e-8, 0.0))
        run = run_from(task, run, WARM, lowered)
    return None, run


def _status(task: Task, run: Run) -> Status:
    if task.is_late:
        return Status.TIME_LIMIT
    if run.solved:
        return Status.SOLVED
    return Status.ITERATION_LIMIT if run.code == interior.LIMIT else Status.NO_PROGRESS
