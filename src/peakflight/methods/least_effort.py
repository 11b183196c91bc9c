"""What `mellinger` and `bry` share: segment times at which the optimal spline costs least."""

from dataclasses import dataclass

import numpy as np

from peakflight.certificate import peak_ratios
from peakflight.errors import Status
from peakflight.kernels import basis, effort
from peakflight.methods import require, spline_kernels
from peakflight.methods.scaling import estimated_stretch, proportional_times
from peakflight.problem import Problem
from peakflight.spline import SplineTask

ROUNDING = 1e-3
"""A descent that finds nothing lower has reached its minimum if no more of the gradient remains."""


@dataclass(frozen=True, kw_only=True)
class DescentSettings:
    """Tuning of a descent on the optimal cost."""

    tolerance: float = 1e-5
    """Part of the cost's gradient that the projected one is at the end."""
    iterations: int = 1000
    """Most iterations of one descent."""
    history_size: int = 1_000_000
    """Most segment times kept for the history, of all iterations together."""

    def __post_init__(self) -> None:
        require("tolerance", self.tolerance, 0.0, 1.0)
        require("iterations", self.iterations, 1, 10**7)
        require("history_size", self.history_size, 1, 10**9)


@dataclass(frozen=True, eq=False)
class Descended:
    """Where a descent has ended."""

    times: np.ndarray
    """(K,) s."""
    effort: float
    """f, the cost of the spline."""
    gradient: np.ndarray
    """(K,) df/dt."""
    iterations: int
    road: np.ndarray
    """(n, K) s, where it began and after each of the first iterations."""
    status: Status

    @property
    def price(self) -> float:
        """The c_t at which J would not change if all times were stretched a little."""
        return float(-(self.times @ self.gradient) / self.times.sum())


def descend(
    task: SplineTask,
    times: np.ndarray,
    settings: DescentSettings,
    *,
    penalty: float | None,
    iterations: int | None = None,
) -> Descended:
    """Minimise J (Eq. BryOpt) from the given times, or f at their total (Eq. timecost).

    penalty: c_t; None keeps the total. iterations: instead of those of the settings.
    """
    begin, times = times, times.copy()
    count, spline_class = len(times), task.spline_class
    orders = np.flatnonzero(spline_class.weights)
    weights = np.array(spline_class.weights)[orders]
    roots = np.array([basis.energy_roots(spline_class.degree, int(order)) for order in orders])
    rows = settings.history_size // count - 1
    longest = settings.iterations if iterations is None else iterations
    gradient = np.full(count, np.nan)
    road = np.empty((max(min(rows, longest), 0), count))
    value, remaining, done, stalled = effort.descend(
        task.rows, task.waypoints, task.simple, task.layered, times, (orders, weights, roots),
        penalty or 0.0, penalty is None, settings.tolerance, longest,
        effort.workspace(count, spline_class.degree), gradient, road,
    )  # fmt: skip
    status = Status.SOLVED
    if not remaining <= settings.tolerance:
        status = Status.ITERATION_LIMIT
        if stalled or not value < np.inf:
            status = Status.SOLVED if remaining <= ROUNDING else Status.NO_PROGRESS
    road = np.concatenate((begin[None], road[:done]))
    return Descended(times, value, gradient, done, road, status)


def first_times(problem: Problem, task: SplineTask) -> np.ndarray:
    """(K,) s, proportional to distance, at the scale that their peaks ask for."""
    times = proportional_times(problem)
    return times * estimated_stretch(peak_ratios(task.solve(times), problem.limits))


def kernels_for(problem: Problem) -> str:
    """Both methods have the same."""
    return f"effort-{spline_kernels(problem)}"
