"""The same motion on fewer pieces: neighbours in a leg become one where that changes it least."""

import numpy as np

from peakflight.kernels import basis
from peakflight.spline import coefficients_of
from peakflight.trajectory import Trajectory

SAMPLES = 33
"""Points at which two motions are compared."""


def merged(
    trajectory: Trajectory, pieces: np.ndarray, most_pieces: int
) -> tuple[Trajectory, np.ndarray]:
    """A trajectory on at most so many pieces, or one a leg, and the (legs,) pieces that it has.

    Derivatives up to the highest that two pieces can share stay as they are at the joints that are
    left. The pair for which that one changes least is merged first, in the integral of its square.
    To begin from: it need not keep any limit.
    """
    while len(trajectory) > max(most_pieces, len(pieces)):
        first = int(np.argmin(changes(trajectory, pieces)))
        trajectory, pieces = merge(trajectory, pieces, first)
    return trajectory, pieces


def merge(trajectory: Trajectory, pieces: np.ndarray, first: int) -> tuple[Trajectory, np.ndarray]:
    """A piece and the next one, of the same leg, as one."""
    pair = _pairs(trajectory)
    coefficients = np.concatenate(
        (
            trajectory.coefficients[:first],
            pair.coefficients[first : first + 1],
            trajectory.coefficients[first + 2 :],
        )
    )
    times = np.delete(trajectory.segment_times, first + 1)
    times[first] = pair.segment_times[first]
    fewer = np.array(pieces)
    fewer[_legs(pieces)[first]] -= 1
    return Trajectory(coefficients, times, trajectory.start_time), fewer


def changes(trajectory: Trajectory, pieces: np.ndarray) -> np.ndarray:
    """(K-1,) integral of the squared change if a piece becomes one with the next.

    Of the highest derivative that two pieces share; infinite across a waypoint.
    """
    pair = _pairs(trajectory)
    order = basis.counts(trajectory.degree)[1] - 1
    first = np.arange(len(pair))[:, None]
    t = pair.segment_times[:, None] * ((np.arange(SAMPLES) + 0.5) / SAMPLES)
    border = trajectory.segment_times[:-1, None]
    later = t > border
    change = pair.at(first, t, order) - trajectory.at(first + later, t - border * later, order)
    integral = (change**2).sum(axis=2).mean(axis=1) * pair.segment_times
    legs = _legs(pieces)
    found: np.ndarray = np.where(legs[1:] == legs[:-1], integral, np.inf)
    return found


def _pairs(trajectory: Trajectory) -> Trajectory:
    """(K-1) polynomials from the beginning of a piece to the end of the next; they overlap."""
    degree, first = trajectory.degree, np.arange(len(trajectory) - 1)
    left, _ = basis.counts(degree)
    times = trajectory.segment_times
    total = times[:-1] + times[1:]
    data = np.empty((len(first), degree, trajectory.axes))
    for row, order in enumerate(basis.row_orders(degree)[:degree].tolist()):
        at_start = 0 < row < left
        value = trajectory.at(
            first if at_start else first + 1, 0.0 if at_start else times[1:], order
        )
        data[:, row] = value * total[:, None] ** order
    begins = trajectory.coefficients[:-1, 0]
    data[:, 0] -= begins
    return Trajectory(coefficients_of(data, begins, total), total)


def _legs(pieces: np.ndarray) -> np.ndarray:
    """(K,) the leg of each piece."""
    return np.repeat(np.arange(len(pieces)), pieces)
