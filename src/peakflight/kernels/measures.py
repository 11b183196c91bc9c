"""What the optimisers see of each kind of limit: one small unit a kind.

A measure maps a sample (velocity, acceleration, jerk, snap) to m >= 0, which is at most 1 exactly
when the sample keeps the limit, and m^(1/e) with e = EXPONENTS is, exactly or nearly, how much
slower the sample would have to be passed (design's "uniform stretch"): then no kind is stiffer than
another in the barrier of `kernels.barrier`.

The slope of (log m)/e by a derivative d is given as weight * d + vertical * e3, which suits
everything that knows no direction but gravity's. A new kind is one pair of functions, values and
slopes, a line in `measure` and `add_slopes`, an exponent and an order. Kinds are numbered as in
`limits.KINDS`.
"""

import numpy as np

from peakflight.kernels.jit import inner, vector

EXPONENTS = np.array([2, 2, 6, 8, 2, 2])
"""e of each kind."""
KIND_ORDERS = np.array([1, 2, 3, 4, 2, 2])
"""The derivative that each kind is about."""
TINY = 1e-150
"""Added to what is divided by: a sample at rest has measure zero and slope zero."""
ROUNDNESS = 1e-5
"""Least horizontal acceleration, as a part of gravity, that tilt knows: no kink when upright."""
SOFTNESS = 1e-3
"""How early, as a part of gravity, the measure of tilt bends on its way to zero."""


@inner
def measure(kind, samples, squares, count, row, limit, gravity, values):
    """Values <- m of the first `count` samples.

    samples (3, 4, S) are derivatives 1 to 4, squares (4, S) their squared norms; row: which
    derivative the kind is about, less one.
    """
    if kind == 1:
        _thrust(samples, squares, count, row, limit, gravity, values)
    elif kind == 4:
        _tilt(samples, count, row, limit, gravity, values)
    elif kind == 5:
        _least_thrust(samples, squares, count, row, limit, gravity, values)
    else:
        _norm(squares, count, row, limit, values)


@inner
def add_slopes(
    kind, samples, squares, count, row, limit, gravity, values, grown, weights, vertical
):
    """Weights (4, S), vertical (S,) += grown (S,) times the slope of (log m)/e; values hold m."""
    if kind == 1:
        _add_thrust(samples, count, row, limit, gravity, values, grown, weights, vertical)
    elif kind == 4:
        _add_tilt(samples, count, row, limit, gravity, grown, weights, vertical)
    elif kind == 5:
        _add_least_thrust(samples, squares, count, row, gravity, grown, weights, vertical)
    else:
        _add_norm(squares, count, row, 2.0 / EXPONENTS[kind], grown, weights)


@vector
def _norm(squares, count, row, limit, values):
    """|d|^2 / limit^2, for speed, jerk and snap (Eq. kapp_i)."""
    factor = 1.0 / (limit * limit)
    for q in range(count):
        values[q] = factor * squares[row, q]


@vector
def _add_norm(squares, count, row, factor, grown, weights):
    for q in range(count):
        weights[row, q] += factor * grown[q] / (squares[row, q] + TINY)


@vector
def _thrust(samples, squares, count, row, limit, gravity, values):
    """Square of the stretch that brings |a + g e3| to its limit (Eq. kappa2).

    The positive root alpha^2 of (L^2 - g^2) alpha^4 - 2 g a_z alpha^2 - |a|^2 = 0.
    """
    room = limit * limit - gravity * gravity
    inverse = 1.0 / room
    for q in range(count):
        b = gravity * samples[2, row, q]
        root = np.sqrt(b * b + room * squares[row, q])
        values[q] = (b + root) * inverse


@vector
def _add_thrust(samples, count, row, limit, gravity, values, grown, weights, vertical):
    room = limit * limit - gravity * gravity
    for q in range(count):
        root = values[q] * room - gravity * samples[2, row, q] + TINY
        weight = 0.5 * grown[q] / root
        weights[row, q] += weight / (values[q] + TINY)
        vertical[q] += gravity * weight


@vector
def _tilt(samples, count, row, limit, gravity, values):
    """Square of the stretch that brings the angle of a + g e3 to the limit: |a_xy| cot - a_z <= g.

    Smoothed where it would turn negative: there the sample cannot tilt too much anyway.
    """
    cotangent = 1.0 / np.tan(limit)
    for q in range(count):
        x = samples[0, row, q]
        y = samples[1, row, q]
        horizontal = np.sqrt(x * x + y * y + (ROUNDNESS * gravity) ** 2)
        excess = horizontal * cotangent - samples[2, row, q]
        root = np.sqrt(excess * excess + (SOFTNESS * gravity) ** 2)
        values[q] = 0.5 * (excess + root) / gravity


@vector
def _add_tilt(samples, count, row, limit, gravity, grown, weights, vertical):
    cotangent = 1.0 / np.tan(limit)
    for q in range(count):
        x = samples[0, row, q]
        y = samples[1, row, q]
        z = samples[2, row, q]
        horizontal = np.sqrt(x * x + y * y + (ROUNDNESS * gravity) ** 2)
        excess = horizontal * cotangent - z
        root = np.sqrt(excess * excess + (SOFTNESS * gravity) ** 2)
        push = 0.5 * grown[q] / root  # d(log m) = d(excess) / root
        along = push * cotangent / horizontal
        weights[row, q] += along
        vertical[q] -= push + along * z


@vector
def _least_thrust(samples, squares, count, row, limit, gravity, values):
    """limit^2 / |a + g e3|^2."""
    for q in range(count):
        z = samples[2, row, q]
        square = squares[row, q] + gravity * (2.0 * z + gravity)
        values[q] = limit * limit / (max(square, 0.0) + TINY)


@vector
def _add_least_thrust(samples, squares, count, row, gravity, grown, weights, vertical):
    for q in range(count):
        z = samples[2, row, q]
        square = squares[row, q] + gravity * (2.0 * z + gravity)
        push = grown[q] / (max(square, 0.0) + TINY)
        weights[row, q] -= push
        vertical[q] -= gravity * push
