"""The certificate: never below the truth, close to it, and never feasible where it is not."""

import math
from fractions import Fraction
from functools import cached_property
from itertools import product
from math import perm

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import chebyshev

from peakflight import (
    GRAVITY,
    KINDS,
    InvalidProblem,
    Limits,
    Problem,
    Trajectory,
    certify,
    certify_plan,
    minimum_effort_spline,
    plan,
    stretch_to_limits,
)
from peakflight.certificate import TOLERANCE, peak_ratios
from peakflight.kernels import bounds
from peakflight.limits import limited_values
from peakflight.result import JOINT_TOLERANCE, WAYPOINT_TOLERANCE

kernels = pytest.mark.kernels

NAMES = [kind.name for kind in KINDS]
ORDERS = {kind.name: kind.order for kind in KINDS}
CLOSE = 1e-9
"""How far above an attained value a bound of kappa may be, relative."""
ROUNDING = Fraction(1, 10**12)
"""Of the square of a bound, relative to the square of the size of its terms."""
QUOTIENTS = ("tilt", "least_thrust_acceleration")
CAP = 1e9
"""Kappa where no bound exists."""


def kernel_bounds(coefficients, times, limits):
    """Upper bound and attained value (K, kinds) of kappa, and where (normalised time)."""
    shape = (len(times), len(KINDS))
    upper, lower, place = np.empty(shape), np.empty(shape), np.empty(shape)
    degree = coefficients.shape[1] - 1
    tables = (*bounds.bernstein_tables(degree), bounds.falling_factorials(degree))
    bounds.certify(
        coefficients, np.array(times), np.array(limits), GRAVITY, tables, TOLERANCE, upper, lower,
        place,
    )  # fmt: skip
    return upper, lower, place


# ---- nasty pieces ---------------------------------------------------------------------------


def random_piece(rng, size):
    return rng.normal(size=(size, 3))


def one_axis(rng, size):
    piece = np.zeros((size, 3))
    piece[:, rng.integers(3)] = rng.normal(size=size)
    return piece


def noisy_line(rng, size):
    return np.outer(rng.normal(size=size), rng.normal(size=3)) + 1e-9 * rng.normal(size=(size, 3))


def uneven(rng, size):
    return rng.normal(size=(size, 3)) * 10.0 ** rng.uniform(-8.0, 8.0, size=(size, 3))


def equal_peaks(rng, size):
    """A derivative is a Chebyshev polynomial: all of its extrema are alike."""
    order = int(rng.integers(1, 5))
    if size - order < 2:
        return np.outer(np.arange(size) == size - 1, rng.normal(size=3))
    column = chebyshev.Chebyshev.basis(size - 1 - order, domain=[0.0, 1.0])
    column = column.convert(kind=np.polynomial.Polynomial).integ(order).coef
    return np.outer(np.pad(column, (0, size - len(column))), rng.normal(size=3))


def flat_peak(rng, size):
    """A power of (u - a): a root of high multiplicity, at an end or inside."""
    a = rng.choice([0.0, 0.5, 1.0, rng.uniform()])
    column = np.polynomial.Polynomial([-a, 1.0]) ** (size - 1)
    return np.outer(np.pad(column.coef, (0, size - len(column.coef))), rng.normal(size=3))


def low_degree(rng, size):
    piece = rng.normal(size=(size, 3))
    piece[rng.integers(size) :] = 0.0
    return piece


def near_free_fall(rng, size):
    """Acceleration of nearly -g, so that thrust all but vanishes; in normalised time, for h = 1."""
    piece = rng.normal(size=(size, 3)) * 10.0 ** rng.uniform(-9.0, 0.0)
    if size > 2:
        piece[2, 2] -= GRAVITY / 2
    return piece


def real_flight(rng, size):
    """A piece of a minimum-jerk spline of moderate size."""
    states = rng.normal(size=(6, 3)) * np.array([1, 3, 9, 1, 3, 9])[:, None]
    rows = [[perm(j, s) * u ** (j - s) if j >= s else 0.0 for j in range(6)]
            for u in (0.0, 1.0) for s in range(3)]  # fmt: skip
    piece = np.zeros((max(size, 6), 3))
    piece[:6] = np.linalg.solve(rows, states)
    return piece[:size]


SHAPES = (
    random_piece, one_axis, noisy_line, uneven, equal_peaks, flat_peak, low_degree,
    near_free_fall, real_flight,
)  # fmt: skip


def nasty_pieces(shape, count, seed):
    """(N+1, 3) coefficients by time and a duration, of every size and degree."""
    rng = np.random.default_rng([seed, SHAPES.index(shape)])
    for index in range(count):
        size = int(rng.integers(2, 13))
        piece = shape(rng, size)
        duration = 10.0 ** rng.uniform(-4.0, 4.0)
        if shape is near_free_fall:
            duration = 1.0
        if index % 2 and shape is not near_free_fall:
            piece = piece * 10.0 ** rng.uniform(-60.0, 60.0)
        yield piece * duration ** -np.arange(float(size))[:, None], duration, rng


# ---- the truth ------------------------------------------------------------------------------


class Truth:
    """What one kind is about on one piece: in rationals, at the best points that floats find."""

    def __init__(self, kind, coefficients, duration):
        self.kind, self.duration = kind, duration
        order = ORDERS[kind]
        self.rows = [  # of the derivative, ascending
            [perm(j, order) * Fraction(float(x)) for x in coefficients[j]]
            for j in range(order, len(coefficients))
        ] or [[Fraction(0)] * 3]
        if order == 2:
            self.rows[0][2] += Fraction(GRAVITY)
        powers = [Fraction(duration) ** j for j in range(len(self.rows))]
        largest = max(abs(x) * p for row, p in zip(self.rows, powers, strict=True) for x in row)
        scale = float(largest) or 1.0
        columns = np.array(
            [[float(x * p) / scale for x in row]
             for row, p in zip(self.rows, powers, strict=True)]
        ).T  # fmt: skip
        # the sum of the sizes of all terms, to which rounding is relative; gravity may have
        # cancelled one of them
        self.size = np.linalg.norm(np.abs(columns).sum(axis=1)) * scale
        self.size += 2 * GRAVITY if order == 2 else 0.0
        self.points, values = self._candidates(columns)
        self.values = values * scale

    def _candidates(self, columns):
        """(n,) points where the maximum may be, best first, and (3, n) what is there."""
        squares = [np.convolve(column, column) for column in columns]
        if self.kind == "tilt":
            top = np.polynomial.Polynomial(squares[0] + squares[1])
            bottom = np.polynomial.Polynomial(squares[2])
            stationary = top.deriv() * bottom - top * bottom.deriv()
        else:
            stationary = np.polynomial.Polynomial(sum(squares)).deriv()
        coefficients = np.trim_zeros(stationary.coef, "b")
        roots = np.roots(coefficients[::-1]).real if len(coefficients) > 1 else np.zeros(0)
        points = np.concatenate((np.linspace(0.0, 1.0, 17), roots[(roots > 0) & (roots < 1)]))
        values = np.array([np.polynomial.polynomial.polyval(points, c) for c in columns])
        if self.kind == "tilt":
            merit = np.arctan2(np.hypot(values[0], values[1]), values[2])
        else:
            merit = (values**2).sum(axis=0) * (-1.0 if self.kind.startswith("least") else 1.0)
        best = np.argsort(-merit)
        return points[best], values[:, best]

    @cached_property
    def exact(self):
        """The derivative (with gravity, if it is the second) at the three best points."""
        found = []
        for u in self.points[:3]:
            t = Fraction(float(u)) * Fraction(self.duration)
            values = [Fraction(0)] * 3
            for row in reversed(self.rows):
                values = [value * t + x for value, x in zip(values, row, strict=True)]
            found.append(values)
        return found

    @cached_property
    def square(self):
        """Largest squared norm that was found (least, for the least thrust), exactly."""
        found = [sum(x * x for x in values) for values in self.exact]
        return min(found) if self.kind.startswith("least") else max(found)

    @cached_property
    def angle(self):
        """Largest tilt that was found, rad; from rationals, so good to its last digits."""
        angles = []
        for x, y, z in self.exact:
            size = max(abs(x), abs(y), abs(z)) or Fraction(1)
            across = float((x * x + y * y) / (size * size))
            angles.append(math.atan2(math.sqrt(across), float(z / size)))
        return max(angles)

    @cached_property
    def cancels(self):
        """Whether terms cancel so much that rounding of a bound shows in its ninth digit.

        For tilt and least thrust, whose bounds are quotients, also where the thrust nearly
        vanishes or points down: there may be no bound at all.
        """
        least = self.size / 30.0
        if self.kind == "tilt":
            return np.hypot(*self.values[:2]).max() < least or self.values[2].min() < least
        return self.square < Fraction(least) ** 2


def is_below(truth, kappa, limit):
    """Whether a bound of kappa is below the truth, decided in rationals."""
    bound, limit = Fraction(float(kappa)), Fraction(limit)
    if truth.kind == "tilt":  # the arc tangent is good to an ulp or two
        return float(bound * limit) < truth.angle * (1.0 - 4e-16)
    if truth.kind == "least_thrust_acceleration":
        return bound**2 * truth.square < limit**2 and kappa < CAP
    return bound**2 * limit**2 < truth.square


def is_far_above(truth, kappa, limit):
    """Whether a bound of kappa is further than CLOSE above the truth, or than rounding explains."""
    bound, limit, wide = Fraction(float(kappa)), Fraction(limit), Fraction(1 + CLOSE)
    if truth.kind == "tilt":
        return float(bound * limit) > truth.angle * (1.0 + CLOSE)
    if truth.kind == "least_thrust_acceleration":
        return bound**2 * truth.square > (wide * limit) ** 2
    rounding = ROUNDING * Fraction(truth.size) ** 2 if truth.cancels else 0
    return bound**2 * limit**2 > wide**2 * truth.square + rounding


# ---- bounds against the truth ---------------------------------------------------------------


def check_pieces(shape, count, seed):
    """Returns on how many pieces times kinds the bound was shown to be close."""
    close = 0
    for coefficients, duration, rng in nasty_pieces(shape, count, seed):
        truths = [Truth(kind, coefficients, duration) for kind in NAMES]
        peaks = [t.angle if t.kind == "tilt" else math.sqrt(t.square) for t in truths]
        limits = [(peak or 1.0) * 10.0 ** rng.uniform(-1.0, 1.0) for peak in peaks]
        upper, lower, place = kernel_bounds(coefficients[None], [duration], limits)
        assert not np.isnan(upper).any()
        assert (lower <= upper).all()
        assert ((place >= 0.0) & (place <= 1.0)).all()
        for index, (truth, limit) in enumerate(zip(truths, limits, strict=True)):
            where = f"{truth.kind} of {coefficients.tolist()} in {duration} s"
            assert not is_below(truth, upper[0, index], limit), where
            if not (truth.kind in QUOTIENTS and truth.cancels):
                assert not is_far_above(truth, upper[0, index], limit), where
            close += not truth.cancels
    return close


@pytest.mark.parametrize("shape", SHAPES)
def test_bounds_hold_in_exact_arithmetic_and_are_close(shape):
    count = 225  # times nine shapes and six kinds
    close = check_pieces(shape, count, seed=1)
    print("CLOSE", shape, close / (6 * count))
    assert close > 2 * count


@kernels
@pytest.mark.parametrize("shape", SHAPES)
def test_bounds_of_a_few_pieces(shape):
    check_pieces(shape, 3, seed=2)
