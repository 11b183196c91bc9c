"""The same flight on fewer pieces: neighbours in a leg become one where that changes jerk least."""

from dataclasses import replace

import numpy as np

from peakflight.formats.flight_files.flight_format import hermite
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

ORDERS = 4
"""Position to jerk stay as they are at the ends of what is merged."""
SAMPLES = 33
"""Points at which jerk is compared."""
SHAPES = hermite(ORDERS)


def merged(plan: Plan, most_pieces: int) -> Plan:
    """A plan on at most so many pieces, or one a leg: to begin from, not proven to keep anything.

    The pair whose jerk changes least, in the integral of its square, is merged first.
    """
    times = plan.segment_times.tolist()
    coefficients = list(plan.trajectory.elevate(2 * ORDERS - 1).coefficients)
    legs = np.repeat(np.arange(len(plan.pieces)), plan.pieces).tolist()
    changes = [_change(coefficients, times, legs, first) for first in range(len(times) - 1)]
    while len(times) > max(most_pieces, len(plan.pieces)):
        first = int(np.argmin(changes))
        coefficients[first : first + 2] = [_joined(coefficients, times, first)]
        times[first : first + 2] = [times[first] + times[first + 1]]
        del legs[first + 1], changes[first]
        for near in (first - 1, first):
            if 0 <= near < len(changes):
                changes[near] = _change(coefficients, times, legs, near)
    trajectory = Trajectory(np.array(coefficients), np.array(times), plan.trajectory.start_time)
    return replace(plan, trajectory=trajectory, pieces=tuple(np.bincount(legs).tolist()))


def _joined(coefficients: list[np.ndarray], times: list[float], first: int) -> np.ndarray:
    """(8, D) the polynomial from the beginning of a piece to the end of the next."""
    pair = _pair(coefficients, times, first)
    total = pair.duration
    begin = [pair.at(0, 0.0, order) * total**order for order in range(ORDERS)]
    end = [pair.at(1, times[first + 1], order) * total**order for order in range(ORDERS)]
    powers = total ** np.arange(2.0 * ORDERS)[:, None]
    joined: np.ndarray = SHAPES @ np.array(begin + end) / powers
    return joined


def _change(
    coefficients: list[np.ndarray], times: list[float], legs: list[int], first: int
) -> float:
    """Integral of the squared change of jerk; infinite across a waypoint."""
    if legs[first] != legs[first + 1]:
        return np.inf
    pair = _pair(coefficients, times, first)
    one = Trajectory(
        _joined(coefficients, times, first)[None], pair.segment_times.sum(keepdims=True)
    )
    t = np.linspace(0.0, pair.duration, SAMPLES)
    change = ((one(t, ORDERS - 1) - pair(t, ORDERS - 1)) ** 2).sum(axis=1)
    return float(change.mean() * pair.duration)


def _pair(coefficients: list[np.ndarray], times: list[float], first: int) -> Trajectory:
    return Trajectory(np.array(coefficients[first : first + 2]), np.array(times[first : first + 2]))
