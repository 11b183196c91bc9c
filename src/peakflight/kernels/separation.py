"""Certified lower bounds of the distance between two motions.

Everything here reads only coefficients and times, and shares nothing with the optimisers. On an
interval in which neither motion changes its piece, the difference of two motions is a polynomial
that lies in the hull of its Bernstein control points; its squared norm is a polynomial of twice the
degree, and nowhere smaller than the smallest of its own control points. Bisection (de Casteljau)
closes the gap between that bound and an attained value. Rounding is bounded beforehand and taken
off the distance, so that the bound holds for the polynomials in exact arithmetic.
"""

import numpy as np

from peakflight.kernels.bernstein import EPSILON
from peakflight.kernels.jit import inner, kernel

DEPTH = 50
"""Bisections of one interval, one inside the other: an interval is then 1e-15 long."""
SPLITS = 100_000
"""Bisections for one pair; beyond, the bound is what it is."""


@kernel
def nearest(coefficients, breakpoints, counts, scale, tolerance, convert, product, found, bounds):
    """Nearest approach of every pair of n motions, each in K pieces at most.

    coefficients (n, K+2, N+1, 3): ascending, piece-local; counts (n,): how many pieces each has;
    breakpoints (n, K+3): when they begin, and when the last ends. The first and the last piece of
    each are where it waits. scale (3,): factors of the axes. tolerance, m: how near the bound shall
    come to the distance.

    found (P, 2): time and distance where each pair was found nearest, pairs in the order
    (0, 1), (0, 2), ..., (1, 2), ...; bounds (P,): what the distance nowhere falls below.
    """
    size = coefficients.shape[2]
    waiting = np.empty((DEPTH + 2, size, 3))
    spans = np.empty((DEPTH + 2, 2))
    depths = np.empty(DEPTH + 2, dtype=np.int64)
    pair = 0
    for a in range(counts.size):
        for b in range(a + 1, counts.size):
            time, best = _at_borders(coefficients, breakpoints, counts, scale, a, b)
            bound = np.inf
            splits = 0
            i = 0
            j = 0
            begin = max(breakpoints[a, 0], breakpoints[b, 0])
            last = min(breakpoints[a, counts[a]], breakpoints[b, counts[b]])
            while i < counts[a] and j < counts[b] and begin < last:
                end = min(breakpoints[a, i + 1], breakpoints[b, j + 1])
                if end > begin:
                    error = _difference(
                        coefficients, breakpoints, scale, a, i, b, j, begin, end, convert,
                        waiting[0],
                    )  # fmt: skip
                    spans[0, 0], spans[0, 1] = begin, end
                    depths[0] = 0
                    top = 1
                    while top > 0:
                        top -= 1
                        low, span = _least(waiting[top], product)
                        moved = 2 * coefficients.shape[2] * (depths[top] + 2) * EPSILON * span
                        low = low - error - moved
                        if not low < np.inf:  # numbers that overflow prove nothing
                            bound = 0.0
                            continue
                        low = max(low, 0.0)
                        if low >= best - tolerance or depths[top] >= DEPTH or splits >= SPLITS:
                            bound = min(bound, low)
                            continue
                        splits += 1
                        middle = 0.5 * (spans[top, 0] + spans[top, 1])
                        stop, deep = spans[top, 1], depths[top] + 1
                        _bisect(waiting[top], waiting[top + 1])
                        distance = _norm(waiting[top + 1, 0])
                        if distance < best:
                            best, time = distance, middle
                        spans[top, 1] = middle
                        spans[top + 1, 0], spans[top + 1, 1] = middle, stop
                        depths[top], depths[top + 1] = deep, deep
                        top += 2
                begin = end
                if breakpoints[a, i + 1] <= end:
                    i += 1
                if breakpoints[b, j + 1] <= end:
                    j += 1
            found[pair, 0], found[pair, 1] = time, best
            bound = min(bound, best)
            bounds[pair] = bound if bound < np.inf else 0.0
            pair += 1


@inner
def _at_borders(coefficients, breakpoints, counts, scale, a, b):
    """Time and distance at which two motions are nearest where a piece of either begins or ends."""
    time = max(breakpoints[a, 0], breakpoints[b, 0])
    last = min(breakpoints[a, counts[a]], breakpoints[b, counts[b]])
    best = np.inf
    when = time
    i = 0
    j = 0
    while True:
        while i < counts[a] - 1 and breakpoints[a, i + 1] <= time:
            i += 1
        while j < counts[b] - 1 and breakpoints[b, j + 1] <= time:
            j += 1
        square = 0.0
        for d in range(3):
            one = _value(coefficients[a, i], d, time - breakpoints[a, i])
            two = _value(coefficients[b, j], d, time - breakpoints[b, j])
            square += (scale[d] * (one - two)) ** 2
        if np.sqrt(square) < best:
            best = np.sqrt(square)
            when = time
        if time >= last:
            return when, best
        time = min(breakpoints[a, i + 1], breakpoints[b, j + 1], last)


@inner
def _value(piece, axis, time):
    value = 0.0
    for power in range(piece.shape[0] - 1, -1, -1):
        value = value * time + piece[power, axis]
    return value


@inner
def _difference(coefficients, breakpoints, scale, a, i, b, j, begin, end, convert, points):
    """Points (N+1, 3) <- Bernstein control points of a minus b, scaled, from begin to end.

    Returns a bound of the distance by which rounding may have moved any of them.
    """
    size = coefficients.shape[2]
    degree = size - 1
    points[:] = 0.0
    error = 0.0
    for which in range(2):
        piece = coefficients[a, i] if which == 0 else coefficients[b, j]
        start = begin - (breakpoints[a, i] if which == 0 else breakpoints[b, j])
        sign = 1.0 if which == 0 else -1.0
        length = end - begin
        reach = abs(start) + length
        late = max(abs(begin), abs(end))
        for d in range(3):
            large = 0.0
            speed = 0.0
            power = 1.0
            for m in range(size):
                large += abs(piece[m, d]) * power
                if m + 1 < size:
                    speed += (m + 1) * abs(piece[m + 1, d]) * power
                power *= reach
            # times are rounded once where pieces begin, and once where they are taken apart
            error += scale[d] * EPSILON * ((8 * size + 16) * large + 4.0 * speed * late)
            grown = 1.0
            for m in range(size):
                # coefficient m around `start`, in a time that runs from 0 to 1
                value = 0.0
                ways = 1.0
                back = 1.0
                for n in range(m, size):
                    value += ways * back * piece[n, d]
                    back *= start
                    ways = ways * (n + 1) / (n + 1 - m)
                value *= grown
                grown *= length
                for p in range(m, size):
                    points[p, d] += sign * scale[d] * convert[degree, p, m] * value
    return error


@inner
def _least(points, product):
    """What the norm of a polynomial is nowhere below, but for rounding; and the size of its points.

    Points (N+1, 3) are its control points; those of its squared norm have theirs as sums of
    products. Infinite where numbers overflow.
    """
    size = points.shape[0]
    degree = size - 1
    least = np.inf
    largest = 0.0
    for k in range(2 * degree + 1):
        total = 0.0
        gross = 0.0
        for i in range(max(0, k - degree), min(k, degree) + 1):
            dot = 0.0
            for d in range(3):
                term = points[i, d] * points[k - i, d]
                dot += term
                gross += product[degree, i, k - i] * abs(term)
            total += product[degree, i, k - i] * dot
        value = total - (2 * size + 8) * EPSILON * gross
        if not value < np.inf:  # a minimum would pass over what is not a number
            return np.inf, 0.0
        least = min(least, value)
    for i in range(size):
        largest = max(largest, _norm(points[i]))
    return np.sqrt(max(least, 0.0)), largest


@inner
def _norm(vector):
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@inner
def _bisect(points, right):
    """Points <- those of the first half, right <- those of the second (de Casteljau)."""
    size = points.shape[0]
    for d in range(3):
        for i in range(size):
            right[i, d] = points[i, d]
        for level in range(1, size):
            # right[i] holds level - 1; the first of each level belongs to the first half
            for i in range(size - level):
                right[i, d] = 0.5 * (right[i, d] + right[i + 1, d])
            points[level, d] = right[0, d]
