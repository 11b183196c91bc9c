"""Algorithm 1 of the paper to the letter: alternating peak optimisation.

Each iteration solves the spline, takes kappa_k, the largest peak ratio of each segment, and then
slows everything by Eq. t_i_new_all where a limit is exceeded anywhere (Remark 3), or else moves
each segment by Eq. t_i_new and its neighbours by Eq. t_i_new_pm (Remark 2). Peaks are certified
rather than sampled, thrust counts gravity (Remark 1).
"""

from dataclasses import dataclass

import numpy as np

from peakflight.certificate import peak_ratios
from peakflight.errors import Status
from peakflight.methods import Outcome, require
from peakflight.methods.scaling import estimated_stretch, finish, proportional_times
from peakflight.problem import Problem
from peakflight.result import History
from peakflight.spline import SplineTask

DIVERGED = 1e6
"""Give up when the segment times have grown or shrunk by this factor."""


@dataclass(frozen=True, kw_only=True)
class Algorithm1Settings:
    """Tuning of Algorithm 1."""

    learning_rate: float = 0.4
    """delta_1 of Eq. t_i_new and Eq. t_i_new_all."""
    neighbour_rate: float = 0.05
    """delta_2 of Eq. t_i_new_pm; the paper does not print either rate."""
    band: float = 0.05
    """Converged when every segment's largest kappa is within 1 -+ band: [0.95, 1.05]."""
    slack: float = 0.0
    """Limits count as exceeded from kappa = 1 + slack on; the paper has 0."""
    start_duration: float | None = 5.0
    """Total of the initial guess, s (the paper's 5 s); None starts at the speed limit."""
    iterations: int = 2000
    """Most iterations."""
    history_size: int = 1_000_000
    """Most segment times kept for the history, of all iterations together."""

    def __post_init__(self) -> None:
        require("learning_rate", self.learning_rate, 0.0, 1.0)
        require("neighbour_rate", self.neighbour_rate, 0.0, 1.0)
        require("band", self.band, 0.0, 1.0)
        require("slack", self.slack, 0.0, 1.0)
        if self.start_duration is not None:
            require("start_duration", self.start_duration, 1e-3, 1e6)
        require("iterations", self.iterations, 1, 10**7)
        require("history_size", self.history_size, 1, 10**9)


def solve(problem: Problem, settings: Algorithm1Settings) -> Outcome:
    """Iterate to the paper's convergence rule; hand back the best iterate, made feasible.

    The best iterate is the one with the shortest total time once stretched by the excess that its
    largest kappa shows; that is the last one if the rule was met.
    """
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    times = proportional_times(problem)
    if settings.start_duration is not None:
        times = times * (settings.start_duration / times.sum())
    first = times.sum()
    rows = max(settings.history_size // len(times), 1)
    kept: list[np.ndarray] = []
    peaks: list[np.ndarray] = []
    best, shortest = times, np.inf
    converged = diverged = False
    iteration = 0
    while not converged and iteration < settings.iterations:
        iteration += 1
        ratios = peak_ratios(task.solve(times), problem.limits)
        if len(kept) < rows:
            kept.append(times)
            peaks.append(ratios)
        kappa = np.nanmax(ratios, axis=1)
        bound = times.sum() * estimated_stretch(ratios)
        converged = bool((np.abs(kappa - 1.0) <= settings.band).all())
        if bound < shortest or converged:
            best, shortest = times, bound
        times = update_times(times, kappa, settings)
        diverged = not 1.0 / DIVERGED < times.sum() / first < DIVERGED
        if diverged:
            break
    outcome = finish(problem, task, best)
    message = outcome.message
    if outcome.status is Status.SOLVED and not converged:
        ended = "diverged after" if diverged else "did not meet its convergence rule in"
        message = (
            f"Algorithm 1 {ended} {iteration} iterations; this is its best iterate, stretched to "
            "the limits"
        )
    status = outcome.status
    if status is Status.SOLVED and not converged:
        status = Status.NO_PROGRESS if diverged else Status.ITERATION_LIMIT
    return Outcome(
        status=status,
        trajectory=outcome.trajectory,
        iterations=iteration,
        history=History(segment_times=np.array(kept), kappa=np.array(peaks)),
        message=message,
    )


def update_times(times: np.ndarray, kappa: np.ndarray, settings: Algorithm1Settings) -> np.ndarray:
    """One update of the (K,) segment times from the (K,) largest kappa of each segment."""
    worst = kappa.max()
    if worst >= 1.0 + settings.slack:
        return times * (1.0 - settings.learning_rate * (1.0 - worst))  # Eq. t_i_new_all
    new = times * (1.0 - settings.learning_rate * (1.0 - kappa))  # Eq. t_i_new
    neighbour = 1.0 - settings.neighbour_rate * (1.0 - kappa)  # Eq. t_i_new_pm
    new[:-1] *= neighbour[1:]
    new[1:] *= neighbour[:-1]
    return new
