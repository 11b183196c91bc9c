"""Certified upper bounds of what rotor thrusts are about, over whole pieces.

With drag d across and e along the thrust of a vehicle of mass m, both in proportion to the
velocity, the thrust is m (|F| + epsilon b.v) along b = F / |F|, where

    F = a + g e3 + delta v,  delta = d / m,  epsilon = (e - d) / m,

and with j and s the derivatives of F, the angular velocity and acceleration of its direction are

    w = F x j / F.F,  alpha = F x (s - 2 (F.j / F.F) j) / F.F.

Rotor thrusts are limited by |F| + epsilon b.v + A with A = c |alpha| + chi |w|^2, from above, and
by g - |F| - epsilon b.v + A, which is large where the least of them is small: c is the reach of the
airframe, chi what its unequal inertia takes (`docs/certificate.md`). There is no polynomial whose
maximum these are: norms are added.

On an interval every component of F, j, s and v lies within a radius of a line, and arithmetic on
such lines (`kernels.lines`) gives a line and a radius for all the rest. Norms are convex: that of a
line lies below its chord, and |F| above its part along any direction, which is linear again. So the
largest of two ends plus the radii is a bound, and what it is above the truth falls with the square
of the interval's length. Subdivision closes it as in `turning`. Rounding is part of the radii.
"""

import numpy as np

from peakflight.kernels.bernstein import EPSILON, control_points
from peakflight.kernels.jit import inner
from peakflight.kernels.lines import (
    ROUNDED,
    cross,
    dot,
    drawn,
    end_norm,
    inverse_root,
    keep,
    line,
    plus,
    thickness,
    times,
)
from peakflight.kernels.turning import DEPTH, NESTING, motion_at, split

SPLITS = 2000
"""Subdivisions of one piece; beyond, the bound of an interval is taken as it is."""
ROUGHEST, FALL = 1e-7, 0.5
"""A gap that a subdivision did not lower to the second part of what it was is rounding, if it is
below the first part of the limit: it stays."""
GLIMPSES = 12
"""Even intervals of a piece at whose ends is looked first, for a value near the maximum."""
REFINEMENTS, LOOKS, CLOSER = 6, 3, 0.3
"""Times that is looked again around the best, points on either side, and how much closer together
they are each time."""
SMALLEST = 1e-290
"""What underflows is not zero: added to bounds."""


F, JERK, SNAP, TURN, SPEED, AXIS, PULL, RATE, LINES = 0, 3, 6, 9, 12, 15, 18, 19, 22
"""Rows of lines: F, j, s, of which s is then what alpha is about; alpha, v, b, epsilon b.v, w."""


def workspace(degree: int, figures: np.ndarray) -> tuple[np.ndarray, ...]:
    """Scratch arrays: intervals that wait; lines; a motion at a point. And figures (4,): c in m,
    delta and epsilon in 1/s, chi in m.
    """
    n = max(degree - 1, 0)
    return np.empty((DEPTH + 3, n + 1, 12)), np.empty((LINES, 3)), np.empty((4, 3)), figures


@inner
def largest_demand(
    sign, limit, coefficients, piece, time, gravity, tables, tolerance, points, rotors, ends
):
    """Bounds of the largest demand from above (sign 1) or below (-1), see the top, over a piece.

    Closed to a tolerance that is relative to the limit, or to the value if that is larger. tables:
    as in `bounds`; points (n+1, 3), rotors (`workspace`) and ends (depth, 4) are scratch. Returns
    an attained value (but for rounding), at least 0, an upper bound, and where.
    """
    stack, lines, motion, figures = rotors
    degree = stack.shape[1] - 1
    errors = np.zeros(4)
    sizes = np.zeros(4)
    if not control_columns(
        coefficients, piece, time, figures[1], gravity, tables[0], tables[2], points, stack, errors,
        sizes,
    ):  # fmt: skip
        return np.inf, np.inf, 0.0
    point = np.empty(12)
    low, place = _attained(
        sign, coefficients, piece, time, figures, gravity, tables[2], motion, point
    )
    high = 0.0
    splits = 0
    waiting = 1
    ends[0, 0] = 0.0
    ends[0, 1] = 1.0
    ends[0, 2] = 0.0
    ends[0, 3] = np.inf
    while waiting > 0:
        waiting -= 1
        nesting = ends[waiting, 2]
        bound = np.inf
        if draw(stack, waiting, degree, errors, sizes, nesting, figures[2], lines):
            bound = _bound(sign, lines, figures, gravity)
        size = max(low, limit)
        gap = bound - max(
            _demand(sign, stack[waiting, 0], figures, gravity),
            _demand(sign, stack[waiting, degree], figures, gravity),
        )
        if (
            bound <= low + tolerance * size
            or (gap <= ROUGHEST * size and gap > FALL * ends[waiting, 3])
            or waiting >= DEPTH
            or splits >= SPLITS
            or nesting >= NESTING
        ):
            high = max(high, bound)
            if high == np.inf:
                break
            continue
        split(stack, waiting, degree, 0.5)
        middle = 0.5 * (ends[waiting, 0] + ends[waiting, 1])
        ends[waiting + 1, 0] = ends[waiting, 0]
        ends[waiting + 1, 1] = middle
        ends[waiting, 0] = middle
        ends[waiting, 2] = nesting + 1.0
        ends[waiting + 1, 2] = nesting + 1.0
        ends[waiting, 3] = gap
        ends[waiting + 1, 3] = gap
        value = _demand(sign, stack[waiting, 0], figures, gravity)
        if low < value < np.inf:
            low = value
            place = middle
        splits += 1
        waiting += 2
    return low, max(low, high), place


@inner
def control_columns(
    coefficients, piece, time, drag, gravity, convert, factorials, points, stack, errors, sizes
):
    """stack[0] <- control points of F, j, s and v, three columns each, in (n+1, 12).

    errors, sizes (4,) <- bounds of their errors and sizes. Returns whether there are such.
    """
    degree = stack.shape[1] - 1
    for order in range(1, 5):
        row = (order + 2) % 4  # v last
        errors[row], sizes[row] = control_points(
            coefficients, piece, time, order, degree, 0.0, convert, factorials, points
        )
        if not errors[row] < np.inf:  # overflow, or not a number
            return False
        for i in range(degree + 1):
            for d in range(3):
                stack[0, i, 3 * row + d] = points[i, d]
    for row in (2, 1, 0):
        lower = (row + 3) % 4
        for i in range(degree + 1):
            for d in range(3):
                stack[0, i, 3 * row + d] += drag * stack[0, i, 3 * lower + d]
        sizes[row] += drag * sizes[lower]
        errors[row] += drag * errors[lower]
    for i in range(degree + 1):
        stack[0, i, 2] += gravity
    sizes[0] += gravity
    for row in range(3):
        errors[row] += 4.0 * EPSILON * sizes[row]
    return True


@inner
def _attained(sign, coefficients, piece, time, figures, gravity, factorials, motion, point):
    """A value near the maximum of what is limited, at least 0, and where it is attained."""
    low = 0.0
    place = 0.0
    centre = 0.5
    step = 1.0 / GLIMPSES
    half = GLIMPSES // 2
    for _ in range(REFINEMENTS + 1):
        for i in range(-half, half + 1):
            at = min(max(centre + i * step, 0.0), 1.0)
            motion_at(4, coefficients, piece, at * time, factorials, motion)
            for d in range(3):
                point[9 + d] = motion[0, d]
                for row in range(3):
                    point[3 * row + d] = motion[row + 1, d] + figures[1] * motion[row, d]
            point[2] += gravity
            value = _demand(sign, point, figures, gravity)
            if low < value < np.inf:
                low = value
                place = at
        centre = place
        step *= CLOSER
        half = LOOKS
    return low, place


@inner
def _demand(sign, point, figures, gravity):
    """What is limited, of F, j, s and v (12,)."""
    x = point[0]
    y = point[1]
    z = point[2]
    square = x * x + y * y + z * z
    twice = 2.0 * (x * point[3] + y * point[4] + z * point[5]) / square
    e = y * point[5] - z * point[4]
    f = z * point[3] - x * point[5]
    h = x * point[4] - y * point[3]
    turn = figures[3] * (e * e + f * f + h * h) / (square * square)
    u = point[6] - twice * point[3]
    v = point[7] - twice * point[4]
    w = point[8] - twice * point[5]
    e = y * w - z * v
    f = z * u - x * w
    h = x * v - y * u
    turn += figures[0] * np.sqrt(e * e + f * f + h * h) / square
    thrust = np.sqrt(square)
    thrust += figures[2] * (x * point[9] + y * point[10] + z * point[11]) / thrust
    rest = gravity if sign < 0.0 else 0.0
    return rest + sign * thrust + turn


@inner
def draw(stack, row, degree, errors, sizes, nesting, along_drag, lines):
    """Lines <- all of the rows at the top on an interval; along_drag: epsilon.

    The slope is by a variable from -1 to 1. Returns whether there is thrust all along: without it
    the rest is not drawn.
    """
    for c in range(12):
        vector = c // 3
        # each subdivision rounds `degree` sums, by half an EPSILON of the size
        lost = errors[vector] + (degree * nesting + 16.0) * EPSILON * sizes[vector]
        keep(lines, c if c < 9 else c + 3, drawn(stack, row, c, degree, lost))
    share = inverse_root(dot(lines, F, F))
    if not share[2] < np.inf:
        return False
    square = times(share, share)
    twice = times(dot(lines, F, JERK), square)
    twice = (-2.0 * twice[0], -2.0 * twice[1], 2.0 * twice[2])
    for d in range(3):  # s - 2 (F.j / F.F) j, in place of s
        swing = plus(line(lines, SNAP + d), times(twice, line(lines, JERK + d)))
        keep(lines, SNAP + d, swing)
    cross(lines, F, SNAP, TURN)
    cross(lines, F, JERK, RATE)
    for d in range(3):
        keep(lines, TURN + d, times(line(lines, TURN + d), square))
        keep(lines, RATE + d, times(line(lines, RATE + d), square))
        keep(lines, AXIS + d, times(line(lines, F + d), share))
    pull = dot(lines, AXIS, SPEED)
    size = abs(pull[0]) + abs(pull[1]) + pull[2]
    radius = abs(along_drag) * (pull[2] + ROUNDED * size)
    keep(lines, PULL, (along_drag * pull[0], along_drag * pull[1], radius))
    return True


@inner
def _bound(sign, lines, figures, gravity):
    """Upper bound of what is limited, from the lines of F, alpha and w."""
    centre = np.sqrt(lines[0, 0] ** 2 + lines[1, 0] ** 2 + lines[2, 0] ** 2) * (1.0 + ROUNDED)
    bound = -np.inf
    size = gravity
    for side in range(2):
        way = 2.0 * side - 1.0
        thrust = end_norm(lines, F, way)
        rate = end_norm(lines, RATE, way) + thickness(lines, RATE)
        turn = figures[0] * end_norm(lines, TURN, way) + figures[3] * rate * rate
        pull = lines[PULL, 0] + way * lines[PULL, 1]
        size = max(size, gravity + thrust + abs(pull) + turn)
        if sign > 0.0:
            bound = max(bound, thrust + pull + turn)
        else:
            bound = max(bound, gravity - along(lines, way) / centre - pull + turn)
    bound += thickness(lines, F) + lines[PULL, 2] + figures[0] * thickness(lines, TURN)
    bound = bound * (1.0 + ROUNDED) + 2.0 * ROUNDED * size + SMALLEST
    return np.inf if np.isnan(bound) else bound


@inner
def along(lines, way):
    """F at one end of its lines, along its centre, times the size of that."""
    total = 0.0
    for d in range(3):
        total += lines[d, 0] * (lines[d, 0] + way * lines[d, 1])
    return total
