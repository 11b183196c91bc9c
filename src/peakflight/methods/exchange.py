"""Which legs get the pieces that there are: one is cut, another is merged, as long as it pays.

How much time a cut gains shows once all has been solved again with it; idle time and the change
that a merge makes only say which ones are worth a try.
"""

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from peakflight.limits import Limits
from peakflight.methods.idle import idle_times
from peakflight.methods.merging import changes, merge
from peakflight.trajectory import Trajectory

TRIES = 6
"""Cuts that are tried in a round, those of the idlest pieces, and merges, those that change least:
twelve gain a tenth more, in twice the time."""
WORTH = 5e-5
"""Relative gain of a round below which there is not another."""


class Solved(Protocol):
    """What comes out when a problem is solved with given pieces."""

    @property
    def trajectory(self) -> Trajectory:
        """In as many pieces as it was solved with."""

    @property
    def pieces(self) -> np.ndarray:
        """(legs,)."""

    @property
    def objective(self) -> float:
        """What is to be small."""


Run = TypeVar("Run", bound=Solved)


def exchanged(
    run: Run,
    limits: Limits,
    most: int,
    rounds: int,
    solve: Callable[[Trajectory, np.ndarray], Run | None],
) -> Run:
    """A solution in at most so many pieces, at least as good as the one to begin from.

    Parameters
    ----------
    run
        To begin from; a piece that it has not got yet is cut first.
    most
        Pieces.
    rounds
        Most exchanges.
    solve
        The solution from a motion and the (legs,) pieces that it is in; None if there is no time
        left.
    """
    for _ in range(rounds):
        better = _best_cut(run, limits, solve)
        if better is not None and len(better.trajectory) > most:
            better = _best_merge(better, solve)
        if better is None:
            break
        gain = 1.0 - better.objective / run.objective
        run = better if gain > 0.0 else run
        if gain < WORTH:
            break
    return run


def _best_cut(
    run: Run, limits: Limits, solve: Callable[[Trajectory, np.ndarray], Run | None]
) -> Run | None:
    """The best solution with one piece more."""
    leg = np.repeat(np.arange(len(run.pieces)), run.pieces)
    found = []
    for piece in np.argsort(-idle_times(run.trajectory, limits), kind="stable")[:TRIES]:
        parts = np.ones(len(leg), dtype=np.int64)
        parts[piece] = 2
        pieces = np.bincount(leg, weights=parts).astype(np.int64)
        found.append(solve(run.trajectory.subdivide(parts), pieces))
    return _best(found)


def _best_merge(run: Run, solve: Callable[[Trajectory, np.ndarray], Run | None]) -> Run | None:
    """The best solution with one piece less."""
    change = changes(run.trajectory, run.pieces)
    firsts = np.argsort(change, kind="stable")[: min(TRIES, int(np.isfinite(change).sum()))]
    return _best([solve(*merge(run.trajectory, run.pieces, int(first))) for first in firsts])


def _best(runs: list[Run | None]) -> Run | None:
    """The one of least objective; None if one is missing, for want of time."""
    found = [run for run in runs if run is not None]
    if len(found) < len(runs):
        return None
    return min(found, key=lambda run: run.objective, default=None)
