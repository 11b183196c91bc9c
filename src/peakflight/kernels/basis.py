"""Two-point Hermite bases on the unit interval, as exact tables.

A polynomial of degree N in normalised time u = t/h is given by its *end data*, N numbers an axis:

    row 0           p(1) - p(0)
    rows 1..nl-1    derivatives 1..nl-1 by u at u = 0, with nl = N//2 + 1
    rows nl..N-1    derivatives 1..nr-1 by u at u = 1, with nr = (N+1)//2

and by its start p(0), which rides in a last row N where it is needed. A derivative of order o by
time is the one by u over h^o. All tables are computed in rationals and rounded once.
"""

from fractions import Fraction
from functools import lru_cache
from math import factorial, perm, sqrt

import numpy as np

ORDERS = 4
"""Derivatives that limits are about: velocity to snap."""


def counts(degree: int) -> tuple[int, int]:
    """How many derivatives, position included, the end data hold on the left and on the right."""
    return degree // 2 + 1, (degree + 1) // 2


def row_orders(degree: int) -> np.ndarray:
    """(N+1,) order of the derivative in each row of the end data; 0 for the two position rows."""
    left, right = counts(degree)
    return np.array([0, *range(1, left), *range(1, right), 0])


@lru_cache
def to_monomials(degree: int) -> np.ndarray:
    """(N+1, N+1): coefficients of 1, u, u^2, ... from the end data."""
    return _floats(_monomials(degree))


@lru_cache
def from_monomials(degree: int, given: int) -> np.ndarray:
    """(N, M+1): end data of degree N from coefficients of 1, u, u^2, ... up to degree M `given`."""
    left, _ = counts(degree)
    rows = []
    for row, order in enumerate(row_orders(degree)[:degree]):
        at_start = 0 < row < left
        rows.append([_falling(i, order) * (i == order or not at_start) for i in range(given + 1)])
    rows[0][0] = 0  # the step from start to end
    return np.array(rows, dtype=float)


@lru_cache
def end_rows(degree: int) -> np.ndarray:
    """(2, N+1, N): derivative o by u at u = 0 and u = 1 from the end data, o = 0..N.

    Position (o = 0) is relative to the start.
    """
    rows = [
        [
            [sum(_falling(i, o) * c[i] * (u**(i - o) if i >= o else 0) for i in range(degree + 1))
             for c in _columns(degree)[:degree]]
            for o in range(degree + 1)
        ]
        for u in (0, 1)
    ]  # fmt: skip
    return np.array(rows, dtype=float)


@lru_cache
def energy(degree: int, order: int) -> np.ndarray:
    """(N+1, N+1) M with: integral over u of (d^order p / du^order)^2 = y' M y (Eq. minfuncP)."""
    size = degree + 1
    derived = [[_falling(i, order) * c[i] for i in range(order, size)] for c in _columns(degree)]
    count = size - order
    moments = [[Fraction(1, i + j + 1) for j in range(count)] for i in range(count)]
    halfway = [[_dot(row, moments[j]) for j in range(count)] for row in derived]
    return np.array([[float(_dot(a, b)) for b in derived] for a in halfway])


@lru_cache
def energy_roots(degree: int, order: int) -> np.ndarray:
    """(N+1, N+1) R with: integral over u of (d^order p / du^order)^2 = |R y|^2, for `energy`.

    Row j < N+1 - order holds the part of the derivative along Legendre polynomial j; the others are
    zero.
    """
    size, count = degree + 1, degree + 1 - order
    derived = [[_falling(i, order) * c[i] for i in range(order, size)] for c in _columns(degree)]
    roots = np.zeros((size, size))
    for j in range(count):  # the integral of u^i times the polynomial
        along = [Fraction(0)] * j
        along += [
            Fraction(factorial(i) ** 2, factorial(i - j) * factorial(i + j + 1))
            for i in range(j, count)
        ]
        roots[j] = sqrt(2 * j + 1) * np.array([float(_dot(row, along)) for row in derived])
    return roots


@lru_cache
def sample_tables(degree: int, count: int) -> np.ndarray:
    """(N, 4, count): derivatives 1..4 by u of each basis function at even points, ends included."""
    return derivative_tables(degree, np.linspace(0.0, 1.0, count))


def derivative_tables(degree: int, u: np.ndarray) -> np.ndarray:
    """(N, 4, S): derivatives 1..4 by u of each basis function at S points of the unit interval."""
    monomials = to_monomials(degree)[:, :degree]
    tables = np.zeros((degree, ORDERS, len(u)))
    for order in range(1, ORDERS + 1):
        for power in range(order, degree + 1):
            values = perm(power, order) * u ** (power - order)
            tables[:, order - 1] += np.outer(monomials[power], values)
    return tables


@lru_cache
def _monomials(degree: int) -> list[list[Fraction]]:
    """Inverse of the map from coefficients to (p(0), left.., p(1), right..), rows rearranged."""
    left, right = counts(degree)
    size = degree + 1
    values = [[Fraction(_falling(i, s) if i == s else 0) for i in range(size)] for s in range(left)]
    values += [[Fraction(_falling(i, s)) for i in range(size)] for s in range(right)]
    inverse = _invert(values)
    folded = []
    for row in inverse:
        start, end = row[0], row[left]  # p(0) moves p(1) with it: only row N sees it
        folded.append([end, *row[1:left], *row[left + 1 :], start + end])
    return folded


@lru_cache
def _columns(degree: int) -> list[list[Fraction]]:
    return [list(column) for column in zip(*_monomials(degree), strict=True)]


def _invert(matrix: list[list[Fraction]]) -> list[list[Fraction]]:
    """Gauss-Jordan elimination in rationals."""
    size = len(matrix)
    rows = [[*row, *(Fraction(i == j) for j in range(size))] for i, row in enumerate(matrix)]
    for i in range(size):
        pivot = next(k for k in range(i, size) if rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        scale = rows[i][i]
        rows[i] = [value / scale for value in rows[i]]
        for k in range(size):
            if k != i and rows[k][i]:
                factor = rows[k][i]
                rows[k] = [a - factor * b for a, b in zip(rows[k], rows[i], strict=True)]
    return [row[size:] for row in rows]


def _falling(power: int, order: int) -> int:
    return perm(power, order) if power >= order else 0


def _dot(a: list[Fraction], b: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True) if x and y), Fraction(0))


def _floats(matrix: list[list[Fraction]]) -> np.ndarray:
    return np.array([[float(value) for value in row] for row in matrix])
