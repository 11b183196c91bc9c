"""Certified upper bounds of what rotor thrusts are about, over whole pieces.

With F = a + g e3, jerk j, snap s and the angular acceleration of the thrust direction

    alpha = F x (s - 2 (F.j / F.F) j) / F.F,

rotor thrusts are limited by |F| + c |alpha|, from above, and by g - |F| + c |alpha|, which is large
where the least of them is small. There is no polynomial whose maximum these are: norms are added.

On an interval every component of F, j and s lies within a radius of a line, and arithmetic on such
lines (`kernels.lines`) gives a line and a radius for every component of alpha. Norms are
convex: that of a line lies below its chord, and |F| above its part along any direction, which is
linear again. So the largest of two ends plus the radii is a bound, and what it is above the truth
falls with the square of the interval's length. Subdivision closes it as in `turning`. Rounding is
part of the radii.
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
    inverse,
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


def workspace(degree: int, reach: np.ndarray) -> tuple[np.ndarray, ...]:
    """Scratch arrays: intervals that wait; lines; a motion at a point. And the reach (1,), m."""
    n = max(degree - 2, 0)
    return np.empty((DEPTH + 3, n + 1, 9)), np.empty((12, 3)), np.empty((3, 3)), reach


@inner
def largest_demand(
    sign, limit, coefficients, piece, time, gravity, tables, tolerance, points, rotors, ends
):
    """Bounds of the largest |F| + c |alpha| (sign 1) or g - |F| + c |alpha| (-1) over a piece.

    Closed to a tolerance that is relative to the limit, or to the value if that is larger. tables:
    as in `bounds`; points (n+1, 3), rotors (`workspace`) and ends (depth, 4) are scratch. Returns
    an attained value (but for rounding), at least 0, an upper bound, and where.
    """
    stack, lines, motion, reach = rotors
    degree = stack.shape[1] - 1
    errors = np.zeros(3)
    sizes = np.zeros(3)
    for vector in range(3):
        errors[vector], sizes[vector] = control_points(
            coefficients, piece, time, vector + 2, degree, gravity if vector == 0 else 0.0,
            tables[0], tables[2], points,
        )  # fmt: skip
        if not errors[vector] < np.inf:  # overflow, or not a number
            return np.inf, np.inf, 0.0
        for i in range(degree + 1):
            for d in range(3):
                stack[0, i, 3 * vector + d] = points[i, d]
    low, place = _attained(sign, coefficients, piece, time, reach[0], gravity, tables[2], motion)
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
        if draw(stack, waiting, degree, errors, sizes, nesting, lines):
            bound = _bound(sign, lines, reach[0], gravity)
        size = max(low, limit)
        gap = bound - max(
            _demand(sign, stack[waiting, 0], reach[0], gravity, 0.0),
            _demand(sign, stack[waiting, degree], reach[0], gravity, 0.0),
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
        value = _demand(sign, stack[waiting, 0], reach[0], gravity, 0.0)
        if low < value < np.inf:
            low = value
            place = middle
        splits += 1
        waiting += 2
    return low, max(low, high), place


@inner
def _attained(sign, coefficients, piece, time, reach, gravity, factorials, motion):
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
            value = _demand(sign, motion.reshape(-1), reach, gravity, gravity)
            if low < value < np.inf:
                low = value
                place = at
        centre = place
        step *= CLOSER
        half = LOOKS
    return low, place


@inner
def _demand(sign, point, reach, gravity, lift):
    """What is limited, of a motion (9,): acceleration with `lift` added to get F, jerk and snap."""
    x = point[0]
    y = point[1]
    z = point[2] + lift
    square = x * x + y * y + z * z
    twice = 2.0 * (x * point[3] + y * point[4] + z * point[5]) / square
    u = point[6] - twice * point[3]
    v = point[7] - twice * point[4]
    w = point[8] - twice * point[5]
    e = y * w - z * v
    f = z * u - x * w
    h = x * v - y * u
    turn = reach * np.sqrt(e * e + f * f + h * h) / square
    rest = gravity if sign < 0.0 else 0.0
    return rest + sign * np.sqrt(square) + turn


@inner
def draw(stack, row, degree, errors, sizes, nesting, lines):
    """Lines <- centre, slope and radius of each component of F, j, s and alpha on an interval.

    The slope is by a variable from -1 to 1. Returns whether there is thrust all along: without it
    alpha is not drawn.
    """
    for c in range(9):
        vector = c // 3
        # each subdivision rounds `degree` sums, by half an EPSILON of the size
        lost = errors[vector] + (degree * nesting + 16.0) * EPSILON * sizes[vector]
        keep(lines, c, drawn(stack, row, c, degree, lost))
    square = dot(lines, 0, 0)
    share = inverse(square)
    if not share[2] < np.inf:
        return False
    twice = times(dot(lines, 0, 3), share)
    twice = (-2.0 * twice[0], -2.0 * twice[1], 2.0 * twice[2])
    for d in range(3):  # s - 2 (F.j / F.F) j, in place of s
        swing = plus(line(lines, 6 + d), times(twice, line(lines, 3 + d)))
        keep(lines, 6 + d, swing)
    cross(lines, 0, 6, 9)
    for d in range(3):
        keep(lines, 9 + d, times(line(lines, 9 + d), share))
    return True


@inner
def _bound(sign, lines, reach, gravity):
    """Upper bound of what is limited, from the lines of F and alpha."""
    centre = np.sqrt(lines[0, 0] ** 2 + lines[1, 0] ** 2 + lines[2, 0] ** 2) * (1.0 + ROUNDED)
    bound = -np.inf
    size = gravity
    for side in range(2):
        way = 2.0 * side - 1.0
        thrust = end_norm(lines, 0, way)
        turn = reach * end_norm(lines, 9, way)
        size = max(size, gravity + thrust + turn)
        if sign > 0.0:
            bound = max(bound, thrust + turn)
        else:
            bound = max(bound, gravity - along(lines, way) / centre + turn)
    bound += thickness(lines, 0) + reach * thickness(lines, 9)
    bound = bound * (1.0 + ROUNDED) + 2.0 * ROUNDED * size + SMALLEST
    return np.inf if np.isnan(bound) else bound


@inner
def along(lines, way):
    """F at one end of its lines, along its centre, times the size of that."""
    total = 0.0
    for d in range(3):
        total += lines[d, 0] * (lines[d, 0] + way * lines[d, 1])
    return total
