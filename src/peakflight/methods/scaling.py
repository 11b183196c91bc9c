"""The last step of every method: the fastest feasible scale of its segment times."""

import math

import numpy as np

from peakflight.certificate import peak_ratios, stretch_to_limits
from peakflight.errors import Status
from peakflight.limits import KINDS
from peakflight.methods import Outcome
from peakflight.problem import Problem
from peakflight.spline import SplineTask
from peakflight.trajectory import Trajectory

_ROOTS = np.array([1.0 / kind.order for kind in KINDS])
GROWTH = 1.15
"""Step of the search for a feasible scale, when slowing down changes the path."""
LONGEST = 1e3
"""Give up when even this many times slower is not feasible."""
CLOSENESS = 1e-9
"""Relative width at which the search for the smallest feasible scale ends."""


def proportional_times(problem: Problem) -> np.ndarray:
    """(K,) s, proportional to distance: the paper's initial guess, at the speed limit if any."""
    return problem.leg_lengths / (problem.limits.speed or 1.0)


def estimated_stretch(ratios: np.ndarray) -> float:
    """Uniform stretch that peak ratios (K, len(KINDS)) ask for: exact for norms, else an estimate.

    Derivative s falls with the power s of the stretch; what gravity is part of, less simply.
    """
    return float(np.fmax.reduce(ratios**_ROOTS, axis=None))


def finish(
    problem: Problem, task: SplineTask, times: np.ndarray, *, status: Status = Status.SOLVED
) -> Outcome:
    """The trajectory of the given segment times at the smallest feasible scale.

    With rest at both ends and one derivative in the cost, the scale keeps the path and is the
    exact uniform stretch. Otherwise it is a search that solves the spline again at each scale.
    """
    trajectory = task.solve(times)
    if problem.is_scalable:
        stretched = stretch_to_limits(trajectory, problem.limits)
        found = None if stretched is None else stretched[0]
    else:
        found = _search(problem, task, times)
    if found is None:
        return Outcome(
            status=Status.INFEASIBLE,
            trajectory=trajectory,
            message="no scale of the segment times keeps every limit"
            + ("" if problem.is_at_rest else " with the motion that is fixed at waypoints"),
        )
    return Outcome(status=status, trajectory=found)


def _search(problem: Problem, task: SplineTask, times: np.ndarray) -> Trajectory | None:
    """Bisect for the border of feasibility nearest to the given scale, from its feasible side."""

    def attempt(scale: float) -> Trajectory | None:
        trajectory = task.solve(times * scale)
        worst = np.nanmax(peak_ratios(trajectory, problem.limits))
        return trajectory if worst <= 1.0 else None

    best = attempt(1.0)
    low = high = 1.0
    if best is None:
        while best is None:
            low, high = high, high * GROWTH
            if high > LONGEST:
                return None
            best = attempt(high)
    else:
        while (faster := attempt(low / GROWTH)) is not None and low > 1.0 / LONGEST:
            low /= GROWTH
            best = faster
        low, high = low / GROWTH, low
    while high > low * (1.0 + CLOSENESS):
        middle = math.sqrt(low * high)
        if (trajectory := attempt(middle)) is not None:
            best, high = trajectory, middle
        else:
            low = middle
    return best
