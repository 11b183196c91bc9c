"""Arithmetic on quantities that lie within a radius of a line, for certified bounds on intervals.

A quantity is a tuple (centre, slope, radius): with a variable from -1 to 1, it is within the radius
of centre + slope times the variable. Everything here gives what holds in exact arithmetic: rounding
is part of the radii, and what is of second order in the slopes.
"""

import numpy as np

from peakflight.kernels.bernstein import EPSILON
from peakflight.kernels.jit import inner

ROUNDED = 8.0 * EPSILON
"""Rounding of a line, relative to the sizes of what it was made of; and of a radius."""


@inner
def drawn(stack, row, column, degree, lost):
    """The line along a polynomial of an interval, from its control points stack[row, :, column].

    lost: what they are wrong by at most.
    """
    first = stack[row, 0, column]
    last = stack[row, degree, column]
    below = 0.0
    above = 0.0
    for i in range(1, degree):
        off = stack[row, i, column] - (first + i * (last - first) / degree)
        below = min(below, off)
        above = max(above, off)
    centre = 0.5 * (first + last) + 0.5 * (below + above)
    return centre, 0.5 * (last - first), 0.5 * (above - below) + lost


@inner
def line(lines, row):
    """The quantity in a row."""
    return lines[row, 0], lines[row, 1], lines[row, 2]


@inner
def keep(lines, row, line):
    """Row <- a quantity."""
    for i in range(3):
        lines[row, i] = line[i]


@inner
def dot(lines, one, other):
    """Scalar product of the vectors in three rows each."""
    x = times(line(lines, one), line(lines, other))
    y = times(line(lines, one + 1), line(lines, other + 1))
    z = times(line(lines, one + 2), line(lines, other + 2))
    return plus(plus(x, y), z)


@inner
def plus(one, other):
    """Sum of two quantities that lie within a radius of a line each."""
    size = abs(one[0]) + abs(one[1]) + abs(other[0]) + abs(other[1])
    radius = one[2] + other[2] + ROUNDED * size
    return one[0] + other[0], one[1] + other[1], radius * (1.0 + ROUNDED)


@inner
def times(one, other):
    """Product; the square of the variable is from 0 to 1: half of it joins the centre."""
    one_size = abs(one[0]) + abs(one[1])
    other_size = abs(other[0]) + abs(other[1])
    bow = 0.5 * one[1] * other[1]
    radius = (
        abs(bow) + one_size * other[2] + other_size * one[2] + one[2] * other[2]
        + ROUNDED * one_size * other_size
    )  # fmt: skip
    return (
        one[0] * other[0] + bow,
        one[0] * other[1] + one[1] * other[0],
        radius * (1.0 + ROUNDED),
    )


@inner
def inverse(line):
    """One over a positive quantity; of infinite radius if it may vanish.

    1 / (c + d) = 1/c - d/c^2 + d^2 / (c^2 (c + d)), of which the last is positive.
    """
    off = (abs(line[1]) + line[2]) * (1.0 + ROUNDED)
    least = line[0] * (1.0 - ROUNDED) - off
    if not least > 0.0:
        return 0.0, 0.0, np.inf
    value = 1.0 / line[0]
    rest = 0.5 * (off * value) * (off * value) / least
    radius = rest + line[2] * value * value + ROUNDED * (value + rest)
    return value + rest, -line[1] * value * value, radius * (1.0 + ROUNDED)


@inner
def inverse_root(line):
    """One over the square root of a positive quantity; of infinite radius if it may vanish.

    1 / sqrt(c + d) = (1 - d / (2c)) / sqrt(c) and a rest from 0 to 3/8 (d/c)^2 sqrt(c^4 / least^5).
    """
    off = (abs(line[1]) + line[2]) * (1.0 + ROUNDED)
    least = line[0] * (1.0 - ROUNDED) - off
    if not least > 0.0:
        return 0.0, 0.0, np.inf
    value = 1.0 / np.sqrt(line[0])
    share = line[0] / least
    rest = 0.1875 * (off / line[0]) * (off / line[0]) * share * share * np.sqrt(share) * value
    slope = -0.5 * line[1] * value / line[0]
    radius = rest + 0.5 * line[2] * value / line[0] + ROUNDED * (value + rest)
    return value + rest, slope, radius * (1.0 + ROUNDED)


@inner
def negative(line):
    """A quantity with the other sign."""
    return -line[0], -line[1], line[2]


@inner
def cross(lines, one, other, out):
    """Rows from `out` on <- the vector product of the vectors in three rows each."""
    for d in range(3):
        e = (d + 1) % 3
        f = (d + 2) % 3
        ahead = times(line(lines, one + e), line(lines, other + f))
        behind = times(line(lines, one + f), line(lines, other + e))
        keep(lines, out + d, plus(ahead, negative(behind)))


@inner
def end_norm(lines, row, way):
    """Norm of the vector in three rows at one end of its lines (way 1 or -1), without the radii."""
    total = 0.0
    for d in range(3):
        end = lines[row + d, 0] + way * lines[row + d, 1]
        total += end * end
    return np.sqrt(total)


@inner
def thickness(lines, row):
    """Norm of the radii of the vector in three rows."""
    total = 0.0
    for d in range(3):
        total += lines[row + d, 2] * lines[row + d, 2]
    return np.sqrt(total)
