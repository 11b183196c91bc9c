"""How well pieces meet each other and the waypoints, from coefficients alone."""

import numpy as np

from peakflight.kernels.jit import inner, kernel


@kernel
def residuals(coefficients, times, continuity, factorials, waypoints, firsts, caps, tolerance):
    """Largest jump at the joints and largest miss of a waypoint.

    continuity: derivatives 0..continuity should not jump; factorials (., N+1): factor of
    coefficient j in derivative s; waypoints (legs+1, D); firsts (legs,): first piece of each leg;
    caps (continuity+1,): jump of each derivative that counts as `tolerance`, however large the
    motion makes the derivative.

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
            scale = max(
                _scale(coefficients, times, factorials, k, s),
                _scale(coefficients, times, factorials, k + 1, s),
            )
            if s == 0:  # a position is as exact as its coordinates: 1e-12 of them, or 1 nm
                scale = max(scale, 0.1)
                for d in range(axes):
                    scale = max(scale, 1e-4 * abs(coefficients[k, 0, d]))
            error = np.sqrt(jump) / scale if 0.0 < scale < np.inf else np.sqrt(jump) / caps[s]
            error = max(error, tolerance * (np.sqrt(jump) / caps[s]))
            if not error <= worst:
                worst = np.inf if np.isnan(error) else error
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


@kernel
def state_errors(coefficients, times, factorials, pieces, at_end, states):
    """Largest difference between the motion and what is fixed, relative as in `residuals`.

    states (F, n, D): derivatives from velocity on, NaN where free, at the start of each of pieces
    (F,), or at its end where at_end (F,) says so. Returns it with its number and derivative.
    """
    worst = 0.0
    where = 0
    order = 0
    for i in range(pieces.size):
        k = pieces[i]
        for s in range(1, states.shape[1] + 1):
            difference = 0.0
            for d in range(coefficients.shape[2]):
                if not np.isnan(states[i, s - 1, d]):
                    value = 0.0
                    if s < coefficients.shape[1]:
                        value = factorials[s, s] * coefficients[k, s, d]
                        if at_end[i]:
                            value = _at_end(coefficients, times, factorials, k, s, d)
                    difference += (value - states[i, s - 1, d]) ** 2
            scale = _scale(coefficients, times, factorials, k, s)
            if not np.sqrt(difference) <= worst * scale:
                worst = np.sqrt(difference) / scale if scale > 0.0 else np.inf
                where = i
                order = s
    return worst, where, order


@inner
def _scale(coefficients, times, factorials, piece, order):
    """Size that the motion of a piece gives a derivative: s! max_j |c_j h^j| / h^s."""
    scale = 0.0
    power = 1.0
    for j in range(1, coefficients.shape[1]):
        power *= times[piece]
        for d in range(coefficients.shape[2]):
            scale = max(scale, abs(coefficients[piece, j, d]) * power)
    if order < coefficients.shape[1]:
        scale *= factorials[order, order]
    return scale / times[piece] ** order


@inner
def _at_end(coefficients, times, factorials, piece, order, axis):
    """A derivative at the end of a piece."""
    value = 0.0
    for j in range(coefficients.shape[1] - 1, order - 1, -1):
        value = value * times[piece] + factorials[order, j] * coefficients[piece, j, axis]
    return value
