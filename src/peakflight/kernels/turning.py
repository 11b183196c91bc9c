"""Certified upper bounds of how fast the thrust direction turns, over whole pieces.

With F = a + g e3, jerk j and snap s, both kinds are

    |F x y| / F.F,    body rate: y = j,    angular acceleration: y = s - 2 (F.j / F.F) j.

Their squares are quotients of polynomials of four and eight times the degree of F: |F x j|^2 over
(F.F)^2 and |(F.F) (F x s) - 2 (F.j) (F x j)|^2 over (F.F)^4. Powers of F.F lose digits where F is
smaller than elsewhere in the piece. So not the quotient but F, j and s are subdivided, and the
products are formed anew on each interval: rounding is then relative to what F is there.

A product of polynomials in the Bernstein basis is the plain product of their control points, each
times its binomial coefficient ("scaled" below). Every product carries a bound of its error.
"""

from functools import lru_cache
from math import comb, frexp

import numpy as np

from peakflight.kernels.bernstein import EPSILON, control_points
from peakflight.kernels.jit import inner

DEPTH = 24
"""Intervals that wait at any one time; beyond, the hull of an interval is taken as it is."""
NESTING = 40
"""Subdivisions of subdivisions, likewise."""
SPLITS = 400
"""Subdivisions of one piece, likewise."""
GUIDED = 12
"""Subdivisions at the maximum; later ones are in the middle, in case that leads nowhere."""
NARROW = 0.05
"""In an interval this short F is all but constant: a gap that is rounding alone stays as it is."""
SLOWEST = -400
"""Least power of two of the unit of 1 / time: slower motions are small in it, but not yet lost."""
STEPS = 400
"""Most steps of the search for the stretch that a point needs, and most to close it."""
NEAREST, FURTHEST = 0.1, 3.0
"""Shortest and longest of these steps, in the logarithm of the stretch."""

NEWTON = 5
"""Steps towards the maximum before an interval is split there."""

F, JERK, SNAP, LENGTH, DOT, CROSS, OTHER, TURN, SQUARE, TOP, BOTTOM, ROWS = (
    0, 3, 6, 9, 10, 11, 14, 17, 20, 21, 22, 23,
)  # fmt: skip
"""Rows of the scratch array: scaled control points of F, j and s; F.F, F.j, F x j and F x s; the
vector whose square is the numerator; (F.F)^2; numerator and denominator."""


def _dot(one: int, other: int, degree: int, out: int) -> list[list[int]]:
    return [[one + d, other + d, degree, 1, out] for d in range(3)]


def _cross(one: int, other: int, out: int) -> list[list[int]]:
    pairs = [(d, (d + 1) % 3, (d + 2) % 3) for d in range(3)]
    return [[one + e, other + f, 1, 1, out + d] for d, e, f in pairs] + [
        [one + f, other + e, 1, -1, out + d] for d, e, f in pairs
    ]


BODY_RATE = np.array(
    [
        *_dot(F, F, 1, LENGTH),
        *_cross(F, JERK, CROSS),
        *_dot(CROSS, CROSS, 2, TOP),
        [LENGTH, LENGTH, 2, 1, BOTTOM],
    ]
)
ANGULAR_ACCELERATION = np.array(
    [
        *_dot(F, F, 1, LENGTH),
        *_dot(F, JERK, 1, DOT),
        *_cross(F, JERK, CROSS),
        *_cross(F, SNAP, OTHER),
        *([LENGTH, OTHER + d, 2, 1, TURN + d] for d in range(3)),
        *([DOT, CROSS + d, 2, -2, TURN + d] for d in range(3)),
        [LENGTH, LENGTH, 2, 1, SQUARE],
        *_dot(TURN, TURN, 4, TOP),
        [SQUARE, SQUARE, 4, 1, BOTTOM],
    ]
)
"""The formulas at the top, as rows to multiply, the degree of both (as a multiple of that of F), a
factor, and the row to add to. One loop over a table compiles sooner than many products."""


@lru_cache
def binomials(degree: int) -> np.ndarray:
    """(3, 8n+1) binomial coefficients of n, 4n and 8n, where n is the degree of a + g e3."""
    n = max(degree - 2, 0)
    return np.array([[float(comb(m, i)) for i in range(8 * n + 1)] for m in (n, 4 * n, 8 * n)])


def workspace(degree: int) -> tuple[np.ndarray, ...]:
    """Scratch arrays: intervals that wait; products on one of them; a motion at a point.

    And figures for `required_stretch`, of a vehicle that has none.
    """
    n = max(degree - 2, 0)
    stack = np.empty((DEPTH + 3, n + 1, 9))
    return stack, np.empty((ROWS, 8 * n + 1)), np.empty((4, 3)), np.zeros(4)


@inner
def largest_turn(order, coefficients, piece, time, gravity, tables, tolerance, points, turns, ends):
    """Bounds of the square of the body rate (order 3) or angular acceleration (4) over a piece.

    tables: as in `bounds`; points (n+1, 3), turns (`workspace`) and ends (depth, 3) are scratch.
    Returns an attained value (but for rounding), an upper bound, and where.
    """
    stack, work, _, _ = turns
    degree = stack.shape[1] - 1
    errors, unit = _vectors(
        order, coefficients, piece, time, degree, gravity, tables, points, stack
    )
    if not errors[0] + errors[1] + errors[2] < np.inf:  # overflow, not a number, or no thrust
        return np.inf, np.inf, 0.0
    binomial = tables[3]
    row = order - 2
    size = degree * (4 if order == 3 else 8)
    low = 0.0
    high = 0.0
    place = 0.0
    splits = 0
    waiting = 1
    ends[0, 0] = 0.0
    ends[0, 1] = 1.0
    ends[0, 2] = 0.0
    while waiting > 0:
        waiting -= 1
        above, below = _products(order, degree, stack, waiting, errors, ends, binomial, work)
        for side in range(2):
            if work[BOTTOM, side * size] > below:
                value = work[TOP, side * size] / work[BOTTOM, side * size]
                if value > low:
                    low = value
                    place = ends[waiting, side]
        enough = low * (1.0 + tolerance)
        bound = 0.0
        index = 0
        is_settled = True  # but for rounding, which is in `above` and `below`
        for i in range(size + 1):
            top = work[TOP, i]
            bottom = work[BOTTOM, i]
            value = np.inf
            if bottom > binomial[row, i] * below:
                value = (top + binomial[row, i] * above) / (bottom - binomial[row, i] * below)
                value *= 1.0 + 8.0 * EPSILON
                if top > enough * bottom and top > binomial[row, i] * above:
                    is_settled = False
            else:
                is_settled = False
            if value > bound:
                bound = value
                index = i
        width = ends[waiting, 1] - ends[waiting, 0]
        if (
            bound <= enough
            or (is_settled and width <= NARROW)
            or waiting >= DEPTH
            or splits >= SPLITS
            or ends[waiting, 2] >= NESTING
        ):
            high = max(high, bound)
            if high == np.inf:
                break
            continue
        at = 0.5
        if splits < GUIDED and 0 < index < size:
            at = _newton(work, size, index / size)
        split(stack, waiting, degree, at)
        middle = ends[waiting, 0] + at * width
        ends[waiting + 1, 0] = ends[waiting, 0]
        ends[waiting + 1, 1] = middle
        ends[waiting, 0] = middle
        ends[waiting, 2] += 1.0
        ends[waiting + 1, 2] = ends[waiting, 2]
        splits += 1
        waiting += 2
    if high > 0.0:  # what underflows is not zero
        high = max(high * unit, 1e-290)
    return low * unit, max(high, low * unit), place


@inner
def _vectors(order, coefficients, piece, time, degree, gravity, tables, points, stack):
    """stack[0] <- control points of F, j and s, each in units that make them at most 1.

    Those of F, and of time, are powers of two: nothing is rounded, and the quotients, which know
    no unit but time's, neither overflow nor underflow. Returns bounds of their errors, infinite
    where there is no bound, and the square of the unit of the result.
    """
    errors = np.zeros(3)
    exponents = np.zeros(3, dtype=np.int64)
    faster = np.int64(SLOWEST)  # power of two of the unit of 1 / time
    for vector in range(order - 1):
        error, size = control_points(
            coefficients, piece, time, vector + 2, degree, gravity if vector == 0 else 0.0,
            tables[0], tables[2], points,
        )  # fmt: skip
        if not error < np.inf or (vector == 0 and size == 0.0):
            errors[0] = np.inf
            return errors, 0.0
        errors[vector] = error
        exponents[vector] = frexp(size)[1]
        if vector > 0 and size > 0.0:
            steps = exponents[vector] - exponents[0]
            faster = max(faster, steps if vector == 1 else (steps + 1) // 2)
        for i in range(degree + 1):
            for d in range(3):
                stack[0, i, 3 * vector + d] = points[i, d]
    for vector in range(order - 1):
        scale = 2.0 ** -(exponents[0] + vector * faster)
        errors[vector] *= scale
        for i in range(degree + 1):
            for d in range(3):
                stack[0, i, 3 * vector + d] *= scale
    return errors, 2.0 ** (2 * (order - 2) * faster)


@inner
def _products(order, degree, stack, row, errors, ends, binomial, work):
    """Scaled control points of numerator and denominator on the interval of a row, in `work`.

    Returns bounds of the errors of those control points, before they are scaled.
    """
    size = np.zeros(3)
    error = np.zeros(3)
    for vector in range(order - 1):
        largest = 0.0
        for i in range(degree + 1):
            square = 0.0
            for d in range(3):
                value = stack[row, i, 3 * vector + d]
                square += value * value
                work[3 * vector + d, i] = binomial[0, i] * value
            largest = max(largest, square)
        size[vector] = np.sqrt(largest)
        # each subdivision rounds `degree` times, by less than 2 EPSILON of what was at most 1
        lost = 2.0 * degree * EPSILON * ends[row, 2] if errors[vector] > 0.0 else 0.0
        error[vector] = errors[vector] + lost
    for out in range(LENGTH, ROWS):
        for i in range(work.shape[1]):
            work[out, i] = 0.0
    program = BODY_RATE if order == 3 else ANGULAR_ACCELERATION
    for step in range(program.shape[0]):
        one, other, times, factor, out = program[step]
        for i in range(times * degree + 1):
            value = factor * work[one, i]
            for k in range(times * degree + 1):
                work[out, i + k] += value * work[other, k]
    length, length_error = _product(size[0], error[0], size[0], error[0], degree)
    turn, turn_error = _product(size[0], error[0], size[1], error[1], degree)
    degree *= 2
    if order == 4:
        other, other_error = _product(size[0], error[0], size[2], error[2], degree)
        first, first_error = _product(length, length_error, other, other_error, degree)
        second, second_error = _product(turn, turn_error, turn, turn_error, degree)
        turn, turn_error = first + 2.0 * second, first_error + 2.0 * second_error
        length, length_error = _product(length, length_error, length, length_error, degree)
        degree *= 2
    _, above = _product(turn, turn_error, turn, turn_error, degree)
    _, below = _product(length, length_error, length, length_error, degree)
    return above, below


@inner
def _product(one, one_error, other, other_error, degree):
    """Bounds of the size, and its error, of a product of polynomials of a degree, from theirs.

    Each control point is a mean of products, so that errors propagate as in products of numbers.
    It is a sum of at most 3 (degree + 1) terms, for a vector in three entries, each term rounded
    three times more: less than 2 degree + 10 EPSILON of the product of the sizes, of which the
    rest is for what is of second order, and for the rounding of sizes and errors themselves.
    """
    carried = one * other_error + one_error * other + one_error * other_error
    size = one * other
    return size, (1.0 + 1e-12) * carried + (2 * degree + 20) * EPSILON * size


@inner
def _newton(work, size, at):
    """Where the quotient has its maximum, near `at`; 0.5 if that leads nowhere.

    In t = u / (1 - u), scaled control points are the coefficients of powers.
    """
    for _ in range(NEWTON):
        t = at / (1.0 - at)
        top = 0.0
        top_slope = 0.0
        top_curve = 0.0
        bottom = 0.0
        bottom_slope = 0.0
        bottom_curve = 0.0
        for i in range(size, -1, -1):
            top_curve = top_curve * t + top_slope
            top_slope = top_slope * t + top
            top = top * t + work[TOP, i]
            bottom_curve = bottom_curve * t + bottom_slope
            bottom_slope = bottom_slope * t + bottom
            bottom = bottom * t + work[BOTTOM, i]
        slope = top_slope * bottom - top * bottom_slope
        curve = 2.0 * (top_curve * bottom - top * bottom_curve)
        if not curve < 0.0:
            break
        t -= slope / curve
        last = at
        at = t / (1.0 + t)
        if not 1e-6 < at < 1.0 - 1e-6:
            return 0.5
        if abs(at - last) < 1e-8:
            break
    return at if 1e-6 < at < 1.0 - 1e-6 else 0.5


@inner
def split(stack, row, degree, at):
    """De Casteljau: row + 1 <- the part before `at`, row <- the part after."""
    rest = 1.0 - at
    for c in range(stack.shape[2]):
        stack[row + 1, 0, c] = stack[row, 0, c]
    for level in range(degree):
        for i in range(degree - level):
            for c in range(stack.shape[2]):
                stack[row, i, c] = rest * stack[row, i, c] + at * stack[row, i + 1, c]
        for c in range(stack.shape[2]):
            stack[row + 1, level + 1, c] = stack[row, 0, c]


@inner
def required_stretch(
    order, sign, figures, coefficients, piece, time, place, limit, gravity, factorials, motion
):
    """Uniform stretch from which on a point keeps a limit; 0 if it always does.

    order, sign, figures: what is limited, see `_excess`; motion (4, 3) is scratch. Searched for
    from where the point is, with steps towards the border that a power law would not overstep, then
    closed by false position.
    """
    motion_at(order, coefficients, piece, place * time, factorials, motion)
    low = 0.0
    value = _excess(order, sign, figures, motion, low, limit, gravity)
    if value <= -700.0:
        return 0.0
    sense = 1.0 if value > 0.0 else -1.0
    high = low
    other = value
    steps = 0
    while other * sense > 0.0:
        low = high
        value = other
        high = low + sense * min(max(NEAREST, abs(value) / 8.0), FURTHEST)
        other = _excess(order, sign, figures, motion, high, limit, gravity)
        steps += 1
        if steps > STEPS:
            return np.exp(high)
    for _ in range(STEPS):
        middle = (low * other - high * value) / (other - value)
        found = _excess(order, sign, figures, motion, middle, limit, gravity)
        if found * other <= 0.0:
            low = high
            value = other
        else:
            value *= 0.5  # Illinois: an end that stays counts half
        high = middle
        other = found
        if abs(other) < 1e-14 or abs(high - low) < 1e-15:
            break
    return np.exp(high)


@inner
def motion_at(order, coefficients, piece, time, factorials, motion):
    """Motion (4, 3) <- velocity to the derivative `order` of a piece, at a time."""
    for s in range(1, order + 1):
        for d in range(3):
            value = 0.0
            for j in range(coefficients.shape[1] - 1, s - 1, -1):
                value = value * time + factorials[s, j] * coefficients[piece, j, d]
            motion[s - 1, d] = value


@inner
def _excess(order, sign, figures, motion, log_stretch, limit, gravity):
    """Logarithm of value over limit of a point, stretched; between -700 and 50.

    The value is how fast the thrust direction turns (order 3) or how fast that changes (4) if sign
    is 0, else what `rotors` is about; figures are those of `rotors`, of which drag counts anyway.
    """
    power = np.exp(-log_stretch)
    square = power * power
    drag = figures[1]
    x = motion[1, 0] * square + drag * motion[0, 0] * power
    y = motion[1, 1] * square + drag * motion[0, 1] * power
    z = motion[1, 2] * square + drag * motion[0, 2] * power + gravity
    length = x * x + y * y + z * z
    u = motion[2, 0] * (square * power) + drag * motion[1, 0] * square
    v = motion[2, 1] * (square * power) + drag * motion[1, 1] * square
    w = motion[2, 2] * (square * power) + drag * motion[1, 2] * square
    rate = 0.0
    if sign != 0.0:
        along = (x * u + y * v + z * w) / length
        rate = max(u * u + v * v + w * w - along * along * length, 0.0) / length
    if order == 4:
        along = 2.0 * (x * u + y * v + z * w) / length
        drag *= square * power
        u = motion[3, 0] * (square * square) + drag * motion[2, 0] - along * u
        v = motion[3, 1] * (square * square) + drag * motion[2, 1] - along * v
        w = motion[3, 2] * (square * square) + drag * motion[2, 2] - along * w
    e = y * w - z * v
    f = z * u - x * w
    h = x * v - y * u
    turn = np.sqrt(e * e + f * f + h * h)
    value = turn / length
    if sign != 0.0:
        rest = gravity if sign < 0.0 else 0.0
        thrust = np.sqrt(length)
        pull = x * motion[0, 0] + y * motion[0, 1] + z * motion[0, 2]
        thrust += figures[2] * power * pull / thrust
        value = rest + sign * thrust + figures[0] * value + figures[3] * rate
    if np.isnan(value):
        return 50.0
    return max(min(np.log(value / limit), 50.0), -700.0) if value > 0.0 else -700.0
