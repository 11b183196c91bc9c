"""Derivatives of a piece in the Bernstein basis: what certified bounds are built from."""

from functools import lru_cache
from math import comb, perm

import numpy as np

from peakflight.kernels.jit import inner

EPSILON = 2.220446049250313e-16


@lru_cache
def bernstein_tables(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Conversions for degrees up to `degree`.

    Returns
    -------
    (N+1, N+1, N+1) for each degree n, control point i from coefficient j of u^j; and
    (N+1, N+1, N+1) for each n, the weight of control points i, j in number i+j of a product.
    """
    size = degree + 1
    convert = np.zeros((size, size, size))
    product = np.zeros((size, size, size))
    for n in range(size):
        for i in range(n + 1):
            for j in range(n + 1):
                product[n, i, j] = comb(n, i) * comb(n, j) / comb(2 * n, i + j)
                if j <= i:
                    convert[n, i, j] = comb(i, j) / comb(n, j)
    return convert, product


@lru_cache
def falling_factorials(degree: int) -> np.ndarray:
    """(max(N, 4) + 1, N+1): factor of coefficient j in derivative s, j! / (j-s)!."""
    orders = range(max(degree, 4) + 1)
    return np.array([[float(perm(j, s)) for j in range(degree + 1)] for s in orders])


@inner
def control_points(coefficients, piece, time, order, degree, gravity, convert, factorials, points):
    """Points (n+1, 3) <- Bernstein control points of a derivative, with g added to the third axis.

    degree: n, at least that of the derivative. Returns a bound of the rounding error of each
    point, and of the size of all points.
    """
    terms = coefficients.shape[1] - order
    worst = 0.0
    for i in range(degree + 1):
        total = 0.0
        for d in range(3):
            value = gravity if d == 2 else 0.0
            size = abs(value)
            power = 1.0
            for j in range(min(i + 1, terms)):
                term = (
                    convert[degree, i, j] * factorials[order, j + order]
                    * coefficients[piece, j + order, d] * power
                )  # fmt: skip
                value += term
                size += abs(term)
                power *= time
            points[i, d] = value
            total += size * size
        worst = max(worst, total)
    size = np.sqrt(worst)
    if terms <= 0:
        return 0.0, size
    return (2 * degree + 8) * EPSILON * size, size
