"""How well pieces meet each other and the waypoints, from coefficients alone."""

import numpy as np

from peakflight.kernels.jit import inner, kernel


@kernel
def residuals(coefficients, times, continuity, factorials, waypoints, firsts):
    """Largest jump at the joints and largest miss of a waypoint.

    continuity: derivatives 0..continuity should not jump; factorials (N+1, N+1): factor of
    coefficient j in derivative s; waypoints (legs+1, D); firsts (legs,): first piece of each leg.

    Returns the largest jump of a derivative, relative to the size that the motion of the two
    pieces gives it, s! max_j |c_j h^j| / h^s over j >= 1; the joint (end of that piece) and the
    derivative where it is; and the largest distance from a waypoint, in metres, and its index.
    """
    count, size, axes = coefficients.shape
    worst = 0.0
    joint = 0
    order = 0
    for k in range(count - 1):
        for s in range(continuity + 1):
            jump = 0.0
            for d in range(axes):
                end = _at_end(coefficients, times, factorials, k, s, d)
                start = factorials[s, s] * coefficients[k + 1, s, d] if s < size else 0.0
                jump += (end - start) ** 2
            scale = 0.0
            for piece in range(k, k + 2):
                power = 1.0
                for j in range(1, size):
                    power *= times[piece]
                    for d in range(axes):
                        scale = max(
                            scale, abs(coefficients[piece, j, d]) * power / times[piece] ** s
                        )
            scale *= factorials[s, s] if s < size else 1.0
            if s == 0:  # a position is as exact as its coordinates
                for d in range(axes):
                    scale = max(scale, abs(coefficients[k, 0, d]))
            if np.sqrt(jump) > worst * scale:
                worst = np.sqrt(jump) / scale if scale > 0.0 else np.inf
                joint = k
                order = s
    miss = 0.0
    waypoint = 0
    for leg in range(firsts.size + 1):
        distance = 0.0
        for d in range(axes):
            if leg < firsts.size:
                value = coefficients[firsts[leg], 0, d]
            else:
                value = _at_end(coefficients, times, factorials, count - 1, 0, d)
            distance += (value - waypoints[leg, d]) ** 2
        if not np.sqrt(distance) <= miss:
            miss = np.sqrt(distance)
            waypoint = leg
    return worst, joint, order, miss, waypoint


@inner
def _at_end(coefficients, times, factorials, piece, order, axis):
    """A derivative at the end of a piece."""
    value = 0.0
    for j in range(coefficients.shape[1] - 1, order - 1, -1):
        value = value * times[piece] + factorials[order, j] * coefficients[piece, j, axis]
    return value
