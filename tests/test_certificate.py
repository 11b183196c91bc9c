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
from peakflight.kernels import bounds, turning
from peakflight.limits import limited_values
from peakflight.result import JOINT_TOLERANCE, WAYPOINT_TOLERANCE

kernels = pytest.mark.kernels

NAMES = [kind.name for kind in KINDS[: bounds.ROTORS]]
"""Rotor thrusts are in `test_rotors.py`."""
ORDERS = {kind.name: kind.order for kind in KINDS}
CLOSE = 1e-9
"""How far above an attained value a bound of kappa may be, relative."""
ROUNDING = Fraction(1, 10**12)
"""Of the square of a bound, relative to the square of the size of its terms."""
QUOTIENTS = ("tilt", "least_thrust_acceleration", "body_rate", "angular_acceleration")
TURNS = ("body_rate", "angular_acceleration")
CAP = 1e9
"""Kappa where no bound exists."""


def kernel_bounds(coefficients, times, limits):
    """Upper bound and attained value (K, kinds) of kappa, and where (normalised time)."""
    shape = (len(times), len(NAMES))
    upper, lower, place = np.empty(shape), np.empty(shape), np.empty(shape)
    degree = coefficients.shape[1] - 1
    tables, limits = bounds.lookup_tables(degree), np.array(limits)
    bounds.certify(
        coefficients, np.array(times), limits, GRAVITY, tables, TOLERANCE, upper, lower, place,
        bounds.quotients_workspace(degree) if np.isfinite(limits[4:6]).any() else None,
        turning.workspace(degree) if np.isfinite(limits[bounds.TURNING :]).any() else None,
        None, 1,
    )  # fmt: skip
    return upper, lower, place


def test_a_kind_whose_workspace_is_left_out_has_no_bound():
    coefficients, times = np.zeros((1, 4, 3)), np.ones(1)
    limits = np.array([5.0, np.nan, np.nan, np.nan, 1.5, 1.0, 3.0, 3.0, 30.0, 1.0])
    upper, lower, place = (np.empty((1, len(KINDS))) for _ in range(3))
    bounds.certify(
        coefficients, times, limits, GRAVITY, bounds.lookup_tables(3), TOLERANCE, upper, lower,
        place, None, None, None, 1,
    )  # fmt: skip
    assert upper[0, 0] <= 1e-9
    assert (upper[0, 4:] > 1.0).all(), "hovering keeps them all, but nothing has looked"


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


def free_fall_within(rng, size):
    """Thrust all but vanishes at one point; in normalised time, for h = 1."""
    piece = rng.normal(size=(size, 3)) * np.array([1.0, 1.0, 9.0])
    if size > 2:
        u = rng.uniform(0.1, 0.9)
        factors = np.array([perm(j, 2) * u ** max(j - 2, 0) for j in range(size)])
        there = factors @ piece + [0.0, 0.0, GRAVITY]
        piece[2] -= there / 2 * (1.0 - 10.0 ** rng.uniform(-15.0, -1.0))
    return piece


def vertical_motion(rng, size):
    """Up and down, exactly or all but: the thrust direction does not turn."""
    piece = rng.normal(size=(size, 3)) * [1.0, 1.0, 3.0]
    piece[:, :2] *= rng.choice([0.0, 1e-12, 1e-6])
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
    near_free_fall, free_fall_within, vertical_motion, real_flight,
)  # fmt: skip
IN_METRES = (near_free_fall, free_fall_within)
"""Shapes that are about gravity: for h = 1, not to be scaled."""  # fmt: skip


def nasty_pieces(shape, count, seed):
    """(N+1, 3) coefficients by time and a duration, of every size and degree."""
    rng = np.random.default_rng([seed, SHAPES.index(shape)])
    for index in range(count):
        size = int(rng.integers(2, 13))
        piece = shape(rng, size)
        duration = 10.0 ** rng.uniform(-4.0, 4.0)
        if shape in IN_METRES:
            duration = 1.0
        if index % 2 and shape not in IN_METRES:
            piece = piece * 10.0 ** rng.uniform(-60.0, 60.0)
        yield piece * duration ** -np.arange(float(size))[:, None], duration, rng


# ---- the truth ------------------------------------------------------------------------------


class Truth:
    """What one kind is about on one piece: in rationals, at the best points that floats find."""

    def __init__(self, kind, coefficients, duration, also=0.0):
        self.kind, self.duration, self.also = kind, duration, float(also)
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
        """The derivative (with gravity, if it is the second) at the best points and one more."""
        found = []
        for u in (*self.points[:3], self.also):
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

    def kappa(self, values, limit):
        """Peak over limit of one sample, in floats."""
        x, y, z = (float(value) for value in values)
        norm = math.hypot(x, y, z)
        if self.kind == "tilt":
            return math.atan2(math.hypot(x, y), z) / limit
        return limit / norm if self.kind == "least_thrust_acceleration" else norm / limit

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
    return bound**2 * limit**2 < truth.square and not (truth.kind in TURNS and kappa == CAP)


def is_far_above(truth, kappa, limit):
    """Whether a bound of kappa is further than CLOSE above the truth, or than rounding explains."""
    bound, limit, wide = Fraction(float(kappa)), Fraction(limit), Fraction(1 + CLOSE)
    if truth.kind == "tilt":
        return float(bound * limit) > truth.angle * (1.0 + CLOSE)
    if truth.kind == "least_thrust_acceleration":
        return bound**2 * truth.square > (wide * limit) ** 2
    rounding = ROUNDING * Fraction(truth.size) ** 2 if truth.cancels else 0
    return bound**2 * limit**2 > wide**2 * truth.square + rounding


class TurnTruth:
    """As `Truth`, for how fast the thrust direction turns."""

    def __init__(self, kind, coefficients, duration, also=0.0):
        self.kind, self.duration, self.also = kind, duration, float(also)
        self.rows = [  # of acceleration with gravity, jerk, snap
            [
                [perm(j, order) * Fraction(float(x)) for x in coefficients[j]]
                for j in range(order, len(coefficients))
            ] or [[Fraction(0)] * 3]
            for order in (2, 3, 4)
        ]  # fmt: skip
        self.rows[0][0][2] += Fraction(GRAVITY)
        terms = [[[x * Fraction(duration) ** j for x in row] for j, row in enumerate(rows)]
                 for rows in self.rows]  # fmt: skip
        self.sizes = [max(sum(abs(row[d]) for row in rows) for d in range(3)) for rows in terms]
        thrust = self.sizes[0] or Fraction(1)
        pace = Fraction(max(self.sizes[1] / thrust, math.sqrt(self.sizes[2] / thrust)) or 1)
        columns = [  # in units of thrust and time in which all are about 1
            np.array([[float(x / (thrust * pace**order)) for x in row] for row in rows])
            for order, rows in enumerate(terms)
        ]
        points, width = np.linspace(0.0, 1.0, 257), 1.0 / 256
        for _ in range(4):
            f, j, s = (np.polynomial.polynomial.polyval(points, c) for c in columns)
            with np.errstate(all="ignore"):
                top, bottom = self._parts(f, j, s)
                best = float(points[np.argmax(np.nan_to_num(top / bottom, nan=0.0, posinf=0.0))])
            points = np.linspace(max(best - width, 0.0), min(best + width, 1.0), 65)
            width /= 30.0
        self.points = [best, 0.0, 1.0, self.also]

    def _parts(self, f, j, s):
        """Numerator and denominator of the square of the value, from derivatives of F / |F|."""
        length, along, turn = dot(f, f), dot(f, j), cross(f, j)
        if self.kind == "body_rate":
            return dot(turn, turn), length**2
        turn = [length * x - 2 * along * y for x, y in zip(cross(f, s), turn, strict=True)]
        return dot(turn, turn), length**4

    @cached_property
    def exact(self):
        """Thrust, numerator and denominator at the points."""
        found = []
        for u in self.points:
            t = Fraction(u) * Fraction(self.duration)
            motion = []
            for rows in self.rows:
                values = [Fraction(0)] * 3
                for row in reversed(rows):
                    values = [value * t + x for value, x in zip(values, row, strict=True)]
                motion.append(values)
            found.append((dot(motion[0], motion[0]), *self._parts(*motion)))
        return found

    @cached_property
    def square(self):
        """Square of the largest value that was found, exactly; without bound in free fall."""
        if any(bottom == 0 for _, _, bottom in self.exact):
            return Fraction(10) ** 40
        return max(top / bottom for _, top, bottom in self.exact)

    def kappa(self, values, limit):
        """Value over limit of one sample, in floats."""
        return math.sqrt(values[1] / values[2]) / limit

    @cached_property
    def cancels(self):
        """Whether thrust all but vanishes somewhere, or terms of the numerator all but cancel."""
        thrust, jerk, snap = self.sizes
        thrust += Fraction(2 * GRAVITY)  # which may have cancelled
        for length, top, bottom in self.exact:
            if length < (thrust / 30) ** 2:
                return True
            if bottom and top / bottom == self.square:
                whole = length * jerk**2
                if self.kind == "angular_acceleration":
                    whole = length**2 * (length * snap**2 + jerk**4)
                if top * 900 < whole:
                    return True
        return False


def dot(one, other):
    return sum(x * y for x, y in zip(one, other, strict=True))


def cross(one, other):
    (a, b, c), (x, y, z) = one, other
    return [b * z - c * y, c * x - a * z, a * y - b * x]


def truth_of(kind, *arguments, **options):
    return (TurnTruth if kind in TURNS else Truth)(kind, *arguments, **options)


# ---- bounds against the truth ---------------------------------------------------------------


def check_pieces(shape, count, seed):
    """Returns on how many pieces times kinds the bound was shown to be close."""
    close = 0
    for coefficients, duration, rng in nasty_pieces(shape, count, seed):
        truths = [truth_of(kind, coefficients, duration) for kind in NAMES]
        peaks = [t.angle if t.kind == "tilt" else math.sqrt(t.square) for t in truths]
        limits = [(peak or 1.0) * 10.0 ** rng.uniform(-1.0, 1.0) for peak in peaks]
        upper, lower, place = kernel_bounds(coefficients[None], [duration], limits)
        assert not np.isnan(upper).any()
        assert (lower <= upper).all()
        assert ((place >= 0.0) & (place <= 1.0)).all()
        for index, (kind, limit) in enumerate(zip(NAMES, limits, strict=True)):
            # roots of nasty polynomials are rough: look where the kernel says, too
            truth = truth_of(kind, coefficients, duration, also=place[0, index])
            where = f"{kind} of {coefficients.tolist()} in {duration} s"
            assert not is_below(truth, upper[0, index], limit), where
            if not (kind in QUOTIENTS and truth.cancels):
                assert not is_far_above(truth, upper[0, index], limit), where
            if not truth.cancels:
                close += 1
                attained = truth.kappa(truth.exact[-1], limit)
                assert attained == pytest.approx(lower[0, index], rel=CLOSE), where
    return close


@pytest.mark.parametrize("shape", SHAPES)
def test_bounds_hold_in_exact_arithmetic_and_are_close(shape):
    count = 180  # times eleven shapes and eight kinds
    close = check_pieces(shape, count, seed=1)
    print("CLOSE", shape, close / (8 * count))
    assert close > 2 * count


@kernels
@pytest.mark.parametrize("shape", SHAPES)
def test_bounds_of_a_few_pieces(shape):
    check_pieces(shape, 3, seed=2)


def test_kinds_that_are_not_limited_are_not_judged():
    piece = np.random.default_rng(0).normal(size=(1, 6, 3))
    for chosen in (("speed", "snap"), ("snap", "body_rate"), ("angular_acceleration",)):
        expected = [name in chosen for name in NAMES]
        upper, lower, _ = kernel_bounds(piece, [1.0], np.where(expected, 2.0, math.nan))
        np.testing.assert_array_equal(np.isfinite(upper[0]), expected)
        np.testing.assert_array_equal(np.isfinite(lower[0]), expected)


@kernels
@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_derivatives_that_vanish_have_kappa_zero(size):
    """Degrees 0 to 3: no snap, no jerk, no acceleration beside gravity, no motion."""
    piece = np.ones((1, size, 3))
    upper, lower, _ = kernel_bounds(piece, [2.0], [1.0, 20.0, 1.0, 1.0, 0.5, 2.0, 1.0, 1.0])
    for kind in ("speed", "jerk", "snap", *TURNS):
        index = NAMES.index(kind)
        least = 3 if kind in TURNS else ORDERS[kind]  # without jerk nothing turns
        assert (upper[0, index] == lower[0, index] == 0.0) == (least >= size)
    if size <= 2:
        hover = [GRAVITY / 20.0, 0.0, 2.0 / GRAVITY]
        names = ("thrust_acceleration", "tilt", "least_thrust_acceleration")
        for kind, kappa in zip(names, hover, strict=True):
            assert upper[0, NAMES.index(kind)] == pytest.approx(kappa, rel=1e-14)


@kernels
def test_bounds_do_not_grow_when_a_piece_is_cut():
    """The hull of a part lies in the hull of the whole; the attained maximum is in one of them."""
    rng = np.random.default_rng(3)
    limits = Limits(speed=1.0, thrust_acceleration=20.0, jerk=1.0, snap=1.0)
    for _ in range(5):
        whole = Trajectory(rng.normal(size=(1, 8, 3)), [1.5])
        parts = whole.split(float(rng.uniform(0.1, 1.4)))
        peaks = [peak_ratios(part, limits)[0, :4] for part in parts]
        np.testing.assert_allclose(
            np.max(peaks, axis=0), peak_ratios(whole, limits)[0, :4], rtol=2e-9
        )


def test_free_fall_has_no_least_thrust_and_no_tilt():
    falling = Trajectory([[[0, 0, 9], [1, 0, 0], [0, 0, -GRAVITY / 2]]], [1.0])
    limits = Limits(least_thrust_acceleration=1.0, tilt=0.5, body_rate=1.0,
                    angular_acceleration=1.0)  # fmt: skip
    report = certify(falling, limits)
    assert not report.feasible
    assert all(report.peaks[name][0] == CAP for name in TURNS)
    assert report.peaks["least_thrust_acceleration"][0] == CAP
    assert report.peaks["tilt"][0] == pytest.approx(math.pi / 0.5)
    upside_down = Trajectory([[[0, 0, 9], [1, 0, 0], [1, 0, -GRAVITY]]], [1.0])
    assert certify(upside_down, limits).peaks["tilt"][0] >= math.atan2(2, -GRAVITY) / 0.5


# ---- thrust and the other formulas against dense sampling -----------------------------------


def wavy(seed, legs=4, minimize="jerk", stretch=1.0):
    rng = np.random.default_rng(seed)
    waypoints = np.cumsum(rng.normal(size=(legs + 1, 3)), axis=0)
    times = rng.uniform(0.5, 1.5, size=legs)
    return minimum_effort_spline(waypoints, times, minimize=minimize).stretch(stretch)


def sampled_values(trajectory, count=20_001):
    return limited_values([trajectory.sample(count, order) for order in range(1, 5)])


@pytest.mark.parametrize("seed", range(3))
def test_kappa_is_what_samples_show(seed):
    """With the definitions written out once more: Eq. kapp_i and Eq. kappa2 (Remark 1)."""
    trajectory = wavy(seed, stretch=1.3)
    limits = Limits(speed=3.0, thrust_acceleration=15.0, jerk=30.0, snap=300.0, tilt=0.7,
                    least_thrust_acceleration=5.0, body_rate=6.0,
                    angular_acceleration=50.0)  # fmt: skip
    peaks = certify(trajectory, limits).peaks
    v, a, j, s = (trajectory.sample(20_001, order) for order in range(1, 5))
    f = a + np.array([0.0, 0.0, 9.81])
    thrust = np.sqrt(f[..., 0] ** 2 + f[..., 1] ** 2 + f[..., 2] ** 2)
    by_hand = {
        "speed": np.sqrt((v**2).sum(axis=-1)).max(axis=1) / 3.0,
        "thrust_acceleration": thrust.max(axis=1) / 15.0,
        "jerk": np.sqrt((j**2).sum(axis=-1)).max(axis=1) / 30.0,
        "snap": np.sqrt((s**2).sum(axis=-1)).max(axis=1) / 300.0,
        "tilt": np.arccos(np.clip(f[..., 2] / thrust, -1, 1)).max(axis=1) / 0.7,
        "least_thrust_acceleration": 5.0 / thrust.min(axis=1),
    }
    n = f / thrust[..., None]  # the thrust direction and its derivatives, as quotients
    first = (n * j).sum(axis=-1)
    rate = (j - n * first[..., None]) / thrust[..., None]
    second = (rate * j + n * s).sum(axis=-1)
    change = (s - 2 * rate * first[..., None] - n * second[..., None]) / thrust[..., None]
    by_hand["body_rate"] = np.linalg.norm(rate, axis=-1).max(axis=1) / 6.0
    turn = np.linalg.norm(np.cross(n, change), axis=-1)
    by_hand["angular_acceleration"] = turn.max(axis=1) / 50.0
    for name, expected in by_hand.items():
        # samples every 0.1 ms miss a smooth peak by the square of that
        np.testing.assert_allclose(peaks[name], expected, rtol=1e-6)
        assert (peaks[name] >= expected * (1.0 - 1e-14)).all()


def test_gravity_makes_climbing_harder_than_diving():
    up = Trajectory([[[0, 0, 0], [0, 0, 0], [0, 0, 2.0]]], [1.0])
    down = Trajectory([[[0, 0, 0], [0, 0, 0], [0, 0, -2.0]]], [1.0])
    limits = Limits(thrust_acceleration=20.0)
    assert certify(up, limits).worst == pytest.approx((GRAVITY + 4.0) / 20.0, rel=1e-13)
    assert certify(down, limits).worst == pytest.approx((GRAVITY - 4.0) / 20.0, rel=1e-13)


# ---- uniform stretch ------------------------------------------------------------------------

ALL = {
    "speed": 5.0, "thrust_acceleration": 15.5, "jerk": 62.0, "snap": 800.0, "tilt": 0.6,
    "least_thrust_acceleration": 6.0, "body_rate": 4.0, "angular_acceleration": 20.0,
}  # fmt: skip
LIMIT_SETS = [{name: value} for name, value in ALL.items()] + [
    {name: ALL[name] for name in NAMES[:4]},
    ALL,
]
every_set = pytest.mark.parametrize(
    "values", LIMIT_SETS, ids=lambda v: "+".join(v) if len(v) < 8 else "all"
)


def turning_stretch(name, limit, motion):
    """(n,) stretches from which on samples keep a limit, by bisection of their logarithm.

    From a stretch on at which all do, down to the first at which one does not.
    """

    def worst(stretch):
        return limited_values([d / stretch**k for k, d in enumerate(motion, start=1)])[name].max()

    high = 1.0
    while worst(high) > limit:
        high *= 1.5
    low = high
    while worst(low) <= limit:
        low, high = low / 1.1, low
    for _ in range(30):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if worst(middle) <= limit else (middle, high)
    return np.array([high])


def required_stretch(trajectory, values, count=4001):
    """Uniform stretch that samples ask for, from the equation of each kind (design notes)."""
    v, a, j, s = (np.concatenate(trajectory.sample(count, order)) for order in range(1, 5))
    square, vertical = (a**2).sum(axis=1), a[:, 2]

    def larger_root(level, sign):
        """|a|^2 + 2 g a_z x + g^2 x^2 = level^2 x^2, x = stretch^2; 0 where there is no root."""
        room = sign * (level**2 - GRAVITY**2)
        b = sign * GRAVITY * vertical
        inside = b**2 + sign * room * square
        real = (inside >= 0.0) & ((b > 0.0) | (sign > 0.0))
        return np.sqrt(np.where(real, b + np.sqrt(np.where(real, inside, 0.0)), 0.0) / room)

    asked = {
        "speed": lambda x: np.linalg.norm(v, axis=1) / x,
        "thrust_acceleration": lambda x: larger_root(x, 1.0),
        "jerk": lambda x: (np.linalg.norm(j, axis=1) / x) ** (1 / 3),
        "snap": lambda x: (np.linalg.norm(s, axis=1) / x) ** (1 / 4),
        "tilt": lambda x: np.sqrt(
            (np.hypot(a[:, 0], a[:, 1]) / np.tan(x) - vertical).clip(0.0) / GRAVITY
        ),
        "least_thrust_acceleration": lambda x: larger_root(x, -1.0),
        "body_rate": lambda x: turning_stretch("body_rate", x, (v, a, j, s)),
        "angular_acceleration": lambda x: turning_stretch("angular_acceleration", x, (v, a, j, s)),
    }
    return max(asked[name](value).max() for name, value in values.items())


def diving(minimize="jerk", stretch=1.0):
    """Mostly up and down, so that thrust falls below its least value at any moderate speed."""
    waypoints = [[0, 0, 1], [0.3, 0, 3], [0.5, 0.2, 0.5], [0.2, 0.6, 3], [0, 0.4, 1]]
    times = [1.0, 1.2, 0.9, 1.1]
    return minimum_effort_spline(waypoints, times, minimize=minimize).stretch(stretch)


@every_set
@pytest.mark.parametrize("too_slow", [1e-4, 0.3, 1.0, 7.0, 1e4])
@pytest.mark.parametrize("minimize", ["jerk", "snap"])
@pytest.mark.parametrize("path", [wavy, diving])
def test_stretch_is_exact_from_anywhere(values, too_slow, minimize, path):
    limits = Limits(**values)
    seed = {"seed": len(values)} if path is wavy else {}
    given = path(**seed, minimize=minimize, stretch=too_slow)
    found, factor = stretch_to_limits(given, limits)
    report = certify(found, limits)
    assert report.feasible
    # the path is the same, flown at another speed
    np.testing.assert_allclose(found.segment_times, factor * given.segment_times, rtol=1e-15)
    powers = np.arange(given.degree + 1.0)
    terms = given.coefficients * given.segment_times[:, None, None] ** powers[:, None]
    stretched = found.coefficients * found.segment_times[:, None, None] ** powers[:, None]
    np.testing.assert_allclose(stretched, terms, rtol=1e-14, atol=1e-14 * np.abs(terms).max())
    if values == {"least_thrust_acceleration": 6.0} and (path is wavy or too_slow < 0.3):
        return  # a path that does not dive, or is flown so fast that thrust never vanishes
    # the stretch is closed to 1e-9; where little thrust is left, its direction changes faster
    on_direction = {"tilt", *TURNS} & set(values)
    assert 1.0 - (1e-8 if on_direction else 2e-9) <= report.worst <= 1.0
    # samples miss the worst point by the square of their distance
    assert factor == pytest.approx(required_stretch(given, values), rel=1e-6)


@every_set
@pytest.mark.parametrize("seed", range(4))
def test_nothing_faster_keeps_the_limits(values, seed):
    limits = Limits(**values)
    path = diving() if seed == 3 else wavy(10 + seed)
    if seed < 3 and values == {"least_thrust_acceleration": 6.0}:
        values = {**values, "speed": 5.0}  # some paths never dive, and nothing slows them down
        limits = Limits(**values)
    found, _ = stretch_to_limits(path, limits)
    assert not certify(found.stretch(1.0 - 1e-7), limits).feasible
    assert certify(found.stretch(1.0 + 1e-7), limits).feasible


@pytest.mark.parametrize(
    ("values", "power"), [({"speed": 2.0}, 1), ({"jerk": 2.0}, 3), ({"snap": 2.0}, 4)]
)
def test_stretch_follows_the_power_of_the_derivative(values, power):
    found, _ = stretch_to_limits(wavy(1), Limits(**values))
    looser, _ = stretch_to_limits(wavy(1), Limits(**{name: 2 * x for name, x in values.items()}))
    assert found.duration / looser.duration == pytest.approx(2.0 ** (1.0 / power), rel=2e-9)


def test_stretch_keeps_the_start_time():
    found, _ = stretch_to_limits(wavy(1).shift(4.0), Limits(speed=1.0))
    assert found.start_time == 4.0


def test_what_never_moves_need_not_be_stretched():
    still = Trajectory(np.ones((2, 1, 3)), [1.0, 2.0])
    found, factor = stretch_to_limits(still, Limits(**ALL))
    assert factor == 1.0
    assert certify(found, Limits(**ALL)).feasible


def test_a_vertical_dive_is_slowed_until_it_is_no_longer_weightless():
    """No tilt short of free fall, and no bound in it: feasible, though kappa is nowhere near 1."""
    up_and_down = minimum_effort_spline([[0, 0, 3], [0, 0, 0], [0, 0, 3]], [1.0, 1.0])
    limits = Limits(tilt=0.5)
    found, _ = stretch_to_limits(up_and_down, limits)
    assert certify(found, limits).feasible
    # a bound of the tilt needs some thrust left: a millionth of gravity is enough
    lowest = found.sample(2001, 2)[..., 2].min()
    assert -GRAVITY < lowest < -GRAVITY * (1.0 - 1e-4)


def test_speed_exactly_at_its_limit():
    """Rounding up leaves the bound a hair above 1: not proven, and said so; a hair slower is."""
    steady = Trajectory([[[0, 0, 1], [3.0, 4.0, 0.0]]], [2.0])
    report = certify(steady, Limits(speed=5.0))
    assert 1.0 <= report.worst <= 1.0 + 1e-13
    assert report.feasible == (report.worst == 1.0)
    found, factor = stretch_to_limits(steady, Limits(speed=5.0))
    assert factor == pytest.approx(1.0, abs=2e-9)
    assert certify(found, Limits(speed=5.0)).feasible


# ---- the report -----------------------------------------------------------------------------

GENTLE = Limits(speed=20.0, thrust_acceleration=60.0)


def tampered(trajectory, piece, power, change):
    coefficients = trajectory.coefficients.copy()
    coefficients[piece, power] += change
    return Trajectory(coefficients, trajectory.segment_times)


@kernels
def test_an_honest_trajectory_is_reported_so():
    trajectory = wavy(2)
    at = np.append(trajectory.breakpoints[:-1], trajectory.end_time)
    report = certify(trajectory, GENTLE, waypoints=trajectory(at), continuity=4)
    assert report.feasible
    assert report.problems == ()
    assert report.joint_residual <= 1e-12
    assert report.waypoint_error <= 1e-12
    assert set(report.peaks) == {"speed", "thrust_acceleration"}
    assert all(kappa.shape == (4,) for kappa in report.peaks.values())


@kernels
@pytest.mark.parametrize(
    ("power", "name"),
    [(0, "position"), (1, "velocity"), (2, "acceleration"), (3, "jerk"), (4, "snap")],
)
def test_a_jump_is_found_and_named(power, name):
    """A changed coefficient of the last piece jumps at one joint, by a known amount."""
    trajectory = wavy(2)
    changed = tampered(trajectory, 3, power, [3e-4, 0.0, 4e-4])
    report = certify(changed, GENTLE, continuity=4)
    c, h = changed.coefficients[2:], changed.segment_times[2:]
    size = max((np.abs(c[k, j]) * h[k] ** (j - power)).max() for k in (0, 1) for j in range(1, 6))
    size = max(size, np.abs(c[0, 0]).max()) if power == 0 else size
    assert report.joint_residual == pytest.approx(5e-4 / size, rel=1e-6)
    assert not report.feasible
    assert len(report.problems) == 1
    assert report.problems[0].startswith(f"{name} jumps at the end of segment 2, by ")
    below = certify(changed, GENTLE, continuity=max(power - 1, 0))
    assert below.feasible == (power > 0)


def test_jumps_below_the_tolerance_are_rounding_and_above_are_not():
    trajectory = wavy(2)
    c, h = trajectory.coefficients[2:], trajectory.segment_times[2:]
    size = max((np.abs(c[k, j]) * h[k] ** (j - 2)).max() for k in (0, 1) for j in range(1, 6))
    for part, feasible in ((0.9, True), (1.1, False)):
        changed = tampered(trajectory, 3, 2, [0.0, part * JOINT_TOLERANCE * size, 0.0])
        assert certify(changed, GENTLE).feasible == feasible


def test_a_jump_in_the_middle_of_many_is_the_one_named():
    trajectory = wavy(3, legs=40)
    report = certify(tampered(trajectory, 17, 0, 1.0), GENTLE)
    assert "at the end of segment 16" in report.problems[0] or "segment 17" in report.problems[0]


@pytest.mark.parametrize("index", [0, 1, 3, 4])
def test_a_missed_waypoint_is_named(index):
    trajectory = wavy(2)
    at = np.append(trajectory.breakpoints[:-1], trajectory.end_time)
    waypoints = trajectory(at)
    waypoints[index] += [0.0, 0.3, -0.4]
    report = certify(trajectory, GENTLE, waypoints=waypoints)
    assert report.waypoint_error == pytest.approx(0.5, rel=1e-9)
    assert report.problems == (f"waypoint {index} is missed by 0.5 m",)
    assert not report.feasible
    assert certify(trajectory, GENTLE).feasible  # nobody asked


def test_waypoints_count_as_passed_within_the_tolerance():
    trajectory = wavy(2)
    at = np.append(trajectory.breakpoints[:-1], trajectory.end_time)
    waypoints = trajectory(at)
    allowed = WAYPOINT_TOLERANCE * (1.0 + np.abs(waypoints).max())
    for part, feasible in ((0.9, True), (1.1, False)):
        moved = waypoints.copy()
        moved[2, 0] += part * allowed
        assert certify(trajectory, GENTLE, waypoints=moved).feasible == feasible


def test_every_limit_that_is_broken_is_named_with_its_worst_segment():
    trajectory = wavy(2)
    values = sampled_values(trajectory, 2001)
    limits = Limits(speed=0.5 * values["speed"].max(), jerk=2.0 * values["jerk"].max(),
                    snap=0.25 * values["snap"].max())  # fmt: skip
    report = certify(trajectory, limits)
    segment = {name: int(values[name].max(axis=1).argmax()) for name in values}
    assert len(report.problems) == 2
    # samples miss the peaks by the square of their distance, which is below the sixth digit
    speed, snap = limits.speed, limits.snap
    assert report.problems == (
        f"speed reaches 2 times its limit of {speed:g} m/s in segment {segment['speed']}",
        f"snap reaches 4 times its limit of {snap:g} m/s^4 in segment {segment['snap']}",
    )


def test_several_pieces_a_leg():
    whole = wavy(2, legs=2)
    first, second = whole.pieces()
    cut = Trajectory.concatenate([*first.split(0.2), *second.split(second.start_time + 0.3)])
    waypoints = whole([0.0, whole.breakpoints[1], whole.end_time])
    assert certify(cut, GENTLE, waypoints=waypoints, pieces=(2, 2), continuity=4).feasible
    assert not certify(cut, GENTLE, waypoints=waypoints, pieces=(1, 3)).feasible
    for pieces in ((1, 2), (0, 4), (5, -1), (2.5, 1.5), (4,) * 2):
        with pytest.raises(InvalidProblem, match="pieces must be whole numbers from 1 that add up"):
            certify(cut, GENTLE, waypoints=waypoints, pieces=pieces)
    with pytest.raises(InvalidProblem, match=r"waypoints has shape \(3, 3\); it must be \(5, 3\)"):
        certify(cut, GENTLE, waypoints=waypoints)


@pytest.mark.parametrize("call", [certify, stretch_to_limits, peak_ratios])
@pytest.mark.parametrize("axes", [1, 2, 4])
def test_limits_are_about_three_axes(call, axes):
    flat = Trajectory(np.ones((1, 2, axes)), [1.0])
    with pytest.raises(InvalidProblem, match=f"the trajectory has {axes} axes; limits are about"):
        call(flat, Limits(speed=1.0))


def test_a_negative_continuity_is_refused():
    with pytest.raises(InvalidProblem, match="continuity is -1; it must be 0 or more"):
        certify(wavy(2), GENTLE, continuity=-1)


def test_a_short_piece_excuses_no_jump_that_a_limit_would_notice():
    """Relative to h = 1 us, 0.01 m/s^2 is nothing; it is not nothing in flight."""
    for jump, feasible in ((1e-3, True), (0.1, False)):
        pieces = [[[0, 0, 1], [1, 0, 0], [0, 0, 0]], [[1, 0, 1], [1, 0, 0], [0, jump / 2, 0]]]
        moving = Trajectory(pieces, [1.0, 1e-6])
        report = certify(moving, GENTLE)
        assert report.feasible == feasible
        assert bool(report.problems) != feasible


@kernels
def test_what_is_fixed_is_proven_to_be_met():
    trajectory = wavy(2)
    at = np.append(trajectory.breakpoints[:-1], trajectory.end_time)
    states = {
        index: np.array([trajectory(t, order) for order in range(1, 5)])
        for index, t in zip((0, 2, 4), at[[0, 2, 4]], strict=True)
    }
    options = {"waypoints": trajectory(at), "continuity": 4}
    report = certify(trajectory, GENTLE, fixed=states, **options)
    assert report.feasible
    assert report.state_error <= 1e-13
    for index, order, name in ((0, 1, "velocity"), (2, 3, "jerk"), (4, 4, "snap")):
        wrong = {key: state.copy() for key, state in states.items()}
        wrong[index][order - 1, 1] += 1e-3
        report = certify(trajectory, GENTLE, fixed=wrong, **options)
        assert not report.feasible
        assert report.problems == (
            f"{name} at waypoint {index} is not the one that is fixed there",
        )
        assert report.state_error > JOINT_TOLERANCE
        wrong[index][order - 1, 1] = math.nan
        assert certify(trajectory, GENTLE, fixed=wrong, **options).feasible


def test_what_is_fixed_where_no_waypoint_is_given_is_refused():
    trajectory = wavy(2)
    start = np.zeros((2, 3))
    with pytest.raises(InvalidProblem):
        certify(trajectory, GENTLE, fixed={0: start})
    with pytest.raises(InvalidProblem):
        certify(wavy(2, legs=1), GENTLE, waypoints=np.zeros((2, 3)), fixed={7: start})


def test_a_plan_is_proven_again_from_its_own_file():
    made = plan(np.array([[0.0, 0, 1], [1, 0, 1], [1, 1, 1.5]]), method="proportional",
                limits=Limits(speed=2.0, thrust_acceleration=15.0))  # fmt: skip
    report = certify_plan(made)
    assert report.feasible
    assert report.to_dict() == made.report.to_dict()


# ---- infeasible is never reported feasible --------------------------------------------------


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.data())
def test_feasible_is_never_claimed_falsely(data):
    """Random trajectories with limits right around their peaks, a part in 1e-15 to 1e-3 off."""
    seed = data.draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    legs, degree = data.draw(st.integers(1, 3)), data.draw(st.sampled_from([5, 7]))
    minimize = {5: "jerk", 7: "snap"}[degree]
    waypoints = np.cumsum(rng.normal(size=(legs + 1, 3)) * 10.0 ** rng.uniform(-2, 2), axis=0)
    times = 10.0 ** rng.uniform(-0.5, 0.5, size=legs)
    trajectory = minimum_effort_spline(waypoints, times, minimize=minimize)
    if data.draw(st.booleans()):  # gentle enough for tilt and least thrust to mean something
        trajectory, _ = stretch_to_limits(trajectory, Limits(thrust_acceleration=15.0))
    values = sampled_values(trajectory, 501)
    limits = {}
    for name in data.draw(st.sets(st.sampled_from(NAMES), min_size=1)):
        offset = 10.0 ** data.draw(st.floats(-15.0, -3.0)) * data.draw(st.sampled_from([-1, 1]))
        worst = values[name].min() if name.startswith("least") else values[name].max()
        limits[name] = worst * (1.0 - offset if name.startswith("least") else 1.0 + offset)
    allowed = {"thrust_acceleration": (GRAVITY, np.inf), "tilt": (0.0, math.pi / 2),
               "least_thrust_acceleration": (0.0, GRAVITY)}  # fmt: skip
    limits = {
        name: value for name, value in limits.items()
        if allowed.get(name, (0.0, np.inf))[0] < value < allowed.get(name, (0.0, np.inf))[1]
    }  # fmt: skip
    if not limits:
        return
    report = certify(trajectory, Limits(**limits))
    dense = sampled_values(trajectory, 2001)
    for name, limit in limits.items():
        kept = (
            dense[name].min() >= limit * (1.0 - 1e-12)
            if name.startswith("least")
            else dense[name].max() <= limit * (1.0 + 1e-12)
        )
        if report.feasible:
            assert kept, name
        if report.peaks[name].max() <= 1.0:
            assert kept, name


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1), st.sampled_from(NAMES), st.floats(1e-8, 1e-2))
def test_feasible_is_claimed_where_there_is_room(seed, name, room):
    trajectory, _ = stretch_to_limits(wavy(seed, legs=2), Limits(**ALL))
    worst = peak_ratios(trajectory, Limits(**{name: ALL[name]}))[:, NAMES.index(name)].max()
    needed = ALL[name] * (worst if not name.startswith("least") else 1.0 / worst)
    loose = needed * (1.0 + room if not name.startswith("least") else 1.0 - room)
    if name == "thrust_acceleration" and loose <= GRAVITY:
        return
    if name == "least_thrust_acceleration" and loose >= GRAVITY:
        return
    assert certify(trajectory, Limits(**{name: loose})).feasible


def test_every_piece_is_looked_at():
    """A single bad piece among many good ones, anywhere."""
    limits = Limits(speed=10.0)
    trajectory = wavy(4, legs=30)
    for piece, sign in product((0, 13, 29), (-1.0, 1.0)):
        report = certify(tampered(trajectory, piece, 5, sign * 500.0), limits)
        assert not report.feasible
        assert int(np.argmax(report.peaks["speed"])) == piece


def test_limits_of_a_problem_are_certified_with_its_own_continuity():
    points = [[0, 0, 1], [1, 0, 1], [2, 1, 1]]
    problem = Problem(points, limits=GENTLE, minimize="snap", degree=5)
    spline = minimum_effort_spline(points, [1.0, 1.0], minimize="snap", degree=5)
    assert certify(spline, GENTLE, continuity=problem.spline_class.continuity).feasible
    assert not certify(spline, GENTLE, continuity=problem.spline_class.continuity + 1).feasible
