"""Splines of any class: against optimality conditions in rationals, and what must hold by them."""

from dataclasses import dataclass, field
from fractions import Fraction
from math import perm

import numpy as np
import pytest

from peakflight import InvalidProblem, Limits, certify, minimum_effort_spline, spline
from peakflight.problem import SplineClass, fixed_state
from peakflight.spline import SplineTask, Undetermined

kernels = pytest.mark.kernels
NAN = np.nan


@dataclass
class Case:
    """A spline problem in few legs; `exact_optimum` solves it in rationals."""

    name: str
    degree: int
    weights: dict
    continuity: int
    times: tuple = (0.5, 1.25, 0.375)
    axes: int = 1
    start: dict | None = None
    end: dict | None = None
    derivatives: dict = field(default_factory=dict)
    free: tuple = ()
    """(waypoint, axis) of positions that are free."""

    @property
    def waypoints(self):
        rng = np.random.default_rng(len(self.name))
        points = np.round(np.cumsum(rng.normal(size=(len(self.times) + 1, self.axes)), axis=0), 2)
        for waypoint, axis in self.free:
            points[waypoint, axis] = np.nan
        return points

    def solve(self):
        return minimum_effort_spline(
            self.waypoints,
            self.times,
            minimize=self.weights,
            degree=self.degree,
            continuity=self.continuity,
            start=self.start,
            end=self.end,
            derivatives=self.derivatives,
        )

    def fixed(self, axis):
        """(K+1, N) fixed derivatives 0..N-1 in one axis, NaN where free."""
        last = len(self.times)
        rest = (self.degree - 1) // 2
        table = np.full((last + 1, self.degree, self.axes), np.nan)
        table[:, 0] = self.waypoints
        table[[0, -1], 1 : rest + 1] = 0.0
        states = {0: self.start or {}, last: self.end or {}, **self.derivatives}
        for waypoint, state in states.items():
            for order, values in state.items():
                table[waypoint, order] = values
        return table[:, :, axis]


CASES = [
    # any degree, even ones too; one weight
    Case("acceleration, degree 3, C1", 3, {2: 1}, 1),
    Case("jerk, degree 3, C1", 3, {3: 1}, 1),
    Case("velocity, degree 3, C2", 3, {1: 1}, 2),
    Case("acceleration, degree 4, C2", 4, {2: 1}, 2),
    Case("jerk, degree 4, C3", 4, {3: 1}, 3),
    Case("jerk, degree 5, C3", 5, {3: 1}, 3),
    Case("snap, degree 5, C3 (the paper)", 5, {4: 1}, 3),
    Case("snap, degree 5, C2", 5, {4: 1}, 2),
    Case("snap, degree 5, C4", 5, {4: 1}, 4),
    Case("jerk, degree 5, C1 (below r-1)", 5, {3: 1}, 1, start={1: [1]}),
    Case("acceleration, degree 5, C2", 5, {2: 1}, 2),
    Case("jerk, degree 6, C4", 6, {3: 1}, 4),
    Case("snap, degree 6, C3", 6, {4: 1}, 3),
    Case("snap, degree 6, C5 (highest)", 6, {4: 1}, 5),
    Case("jerk, degree 7, C3", 7, {3: 1}, 3),
    Case("jerk, degree 7, C4", 7, {3: 1}, 4),
    Case("crackle, degree 7, C5", 7, {5: 1}, 5),
    Case("snap, degree 8, C6", 8, {4: 1}, 6, times=(0.5, 1.25)),
    Case("snap, degree 9, C4", 9, {4: 1}, 4, times=(0.5, 1.25)),
    Case("jerk, degree 9, C0", 9, {3: 1}, 0, times=(0.5, 1.25), derivatives={1: {1: [1], 2: [0]}}),
    Case("snap, degree 10, C6", 10, {4: 1}, 6, times=(0.5, 1.25)),
    Case("jerk, degree 11, C4", 11, {3: 1}, 4, times=(0.5, 1.25)),
    Case("degree 11 itself, C5", 11, {11: 1}, 5, times=(0.5,)),
    # mixed weights
    Case("jerk and snap, degree 5", 5, {3: 1, 4: 0.03125}, 3),
    Case("jerk and snap, degree 7, C6", 7, {3: 1, 4: 0.125}, 6),
    Case("velocity to snap, degree 7", 7, {1: 0.5, 2: 0.25, 3: 1, 4: 0.125}, 4),
    Case("position and jerk", 5, {0: 40, 3: 1}, 4),
    Case("position to snap, degree 6", 6, {0: 8, 1: 2, 4: 0.25}, 3),
    Case("highest derivatives, degree 8", 8, {7: 2**-24, 8: 2**-28, 3: 64}, 4, times=(0.5, 1.25)),
    # moving and free ends
    Case("moving ends", 5, {3: 1}, 3, start={1: [2], 2: [-1]}, end={1: [1], 2: [3]}),
    Case("free ends, natural spline", 3, {2: 1}, 2, start={1: [NAN]}, end={1: [NAN]}),
    Case("free ends, min jerk", 5, {3: 1}, 4, start={1: [NAN], 2: [NAN]}, end={1: [NAN], 2: [NAN]}),
    Case("free acceleration at the end", 7, {4: 1}, 6, end={2: [NAN]}),
    Case("jerk at the start, beyond end data", 5, {3: 1}, 3, start={3: [2]}),
    Case("snap at both ends, beyond end data", 5, {3: 1}, 3, start={4: [2]}, end={4: [-3]}),
    Case("orders 3 to 5 at the start of degree 6", 6, {3: 1}, 3, start={3: [2], 4: [0], 5: [9]}),
    Case("jerk at the end of degree 6", 6, {3: 1}, 3, end={3: [2]}),
    Case("only a high order at the end", 6, {3: 1}, 2, end={1: [NAN], 2: [NAN], 4: [5]}),
    # fixed inner derivatives
    Case("inner velocity, classical but C2", 5, {3: 1}, 2, derivatives={1: {1: [1]}}),
    Case("inner velocity, classical but C3", 5, {3: 1}, 3, derivatives={1: {1: [1]}}),
    Case("inner velocity, classical but C4", 7, {4: 1}, 4, derivatives={2: {1: [1]}}),
    Case("inner state", 5, {4: 1}, 3, derivatives={2: {1: [1], 2: [0]}}),
    Case("inner velocity at every waypoint", 7, {4: 1}, 4, derivatives={1: {1: [1]}, 2: {1: [-1]}}),
    Case("inner order beyond continuity", 7, {3: 1}, 2, derivatives={1: {3: [4]}}),
    Case("inner order beyond the end data", 5, {3: 1}, 2, derivatives={1: {4: [4]}}),
    Case("inner jerk at C3", 5, {4: 1}, 3, derivatives={1: {3: [4]}}),
    Case("inner snap at C3", 5, {4: 1}, 3, derivatives={1: {4: [4]}}),
    Case("inner snap at C5, degree 7", 7, {4: 1}, 5, derivatives={1: {4: [4]}}),
    Case("inner jerk, degree 6, C2", 6, {3: 1}, 2, derivatives={1: {3: [4]}}),
    Case("per axis", 5, {3: 1}, 2, axes=3, start={1: [1, 0, NAN]}, end={2: [NAN, NAN, 1]},
         derivatives={1: {1: [NAN, 2, NAN]}, 2: {2: [0, NAN, NAN]}}),
    # free positions
    Case("free inner position", 5, {3: 1}, 4, free=((1, 0),)),
    Case("free inner position, mixed", 7, {2: 1, 4: 0.5}, 4, free=((2, 0),), axes=2),
    Case("free last position", 5, {3: 1}, 4, free=((3, 0),)),
    Case("free first and inner positions", 5, {4: 1}, 3, free=((0, 0), (2, 0))),
    Case("free positions with inner velocity", 5, {3: 1}, 4, free=((1, 0),),
         derivatives={1: {1: [3]}}),
    Case("all free but weighed", 5, {0: 3, 3: 1}, 4, free=tuple((k, 0) for k in range(4)),
         start={1: [2], 2: [0]}),
    Case("free position, degree 6, weighed", 6, {0: 1, 3: 1}, 5, free=((1, 0),)),
    # one and two legs
    Case("one leg", 7, {4: 1}, 6, times=(0.75,), start={1: [NAN]}),
    Case("one leg, degree 11, jerk", 11, {3: 1}, 4, times=(0.75,)),
    Case("two legs, C9 at degree 10", 10, {5: 1}, 9, times=(0.75, 0.5)),
]  # fmt: skip

every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


def constraint_rows(case, axis, number=Fraction):
    """Rows over all coefficients of one axis, and right-hand sides, none twice."""
    size, legs = case.degree + 1, len(case.times)
    times = [number(t) for t in case.times]
    fixed = case.fixed(axis)
    rows, right = [], []

    def derivative(entries, value):
        row = [number(0)] * (size * legs)
        for piece, t, order, sign in entries:
            for j in range(order, size):
                row[piece * size + j] += sign * perm(j, order) * t ** (j - order)
        rows.append(row)
        right.append(number(value))

    for waypoint in range(legs + 1):
        for order in range(case.degree):
            known = not np.isnan(fixed[waypoint, order])
            joined = 0 < waypoint < legs and order <= case.continuity
            if joined:
                derivative([(waypoint - 1, times[waypoint - 1], order, 1),
                            (waypoint, number(0), order, -1)], 0)  # fmt: skip
            if known and waypoint < legs:
                derivative([(waypoint, number(0), order, 1)], fixed[waypoint, order])
            if known and waypoint > 0 and not joined:
                derivative([(waypoint - 1, times[waypoint - 1], order, 1)], fixed[waypoint, order])
    return rows, right


def cost_blocks(case, number=Fraction):
    """(K, N+1, N+1) of the cost in coefficients by time."""
    size = case.degree + 1
    blocks = []
    for time in case.times:
        t = number(time)
        block = [[number(0)] * size for _ in range(size)]
        for s, weight in case.weights.items():
            for i in range(s, size):
                for j in range(s, size):
                    e = i + j - 2 * s + 1
                    block[i][j] += number(weight) * perm(i, s) * perm(j, s) * t**e / e
        blocks.append(block)
    return blocks


def exact_optimum(case):
    """(K, N+1, D) from the optimality conditions (KKT), by elimination in rationals."""
    legs, size = len(case.times), case.degree + 1
    found = np.zeros((legs, size, case.axes))
    blocks = cost_blocks(case)
    for axis in range(case.axes):
        rows, right = constraint_rows(case, axis)
        unknowns, total = legs * size, legs * size + len(rows)
        matrix = [[Fraction(0)] * (total + 1) for _ in range(total)]
        for k, block in enumerate(blocks):
            for i in range(size):
                matrix[k * size + i][k * size : (k + 1) * size] = block[i]
        for m, (row, value) in enumerate(zip(rows, right, strict=True)):
            for j, entry in enumerate(row):
                matrix[unknowns + m][j] = matrix[j][unknowns + m] = entry
            matrix[unknowns + m][total] = value
        found[:, :, axis] = np.reshape(eliminate(matrix)[:unknowns], (legs, size))
    return found


def eliminate(rows):
    """Solution of an augmented system, as floats."""
    size = len(rows)
    for i in range(size):
        pivot = next(k for k in range(i, size) if rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        scale = rows[i][i]
        rows[i] = [a / scale if a else a for a in rows[i]]
        for k in range(i + 1, size):
            if rows[k][i]:
                factor = rows[k][i]
                rows[k] = [
                    a - factor * b if b else a for a, b in zip(rows[k], rows[i], strict=True)
                ]
    solution = [Fraction(0)] * size
    for i in reversed(range(size)):
        row = rows[i]
        solution[i] = row[size] - sum((row[k] * solution[k] for k in range(i + 1, size) if row[k]),
                                      Fraction(0))  # fmt: skip
    return np.array([float(value) for value in solution])


def normalised(coefficients, times):
    """Coefficients (K, N+1, D) by powers of t/h."""
    powers = np.arange(coefficients.shape[1])[:, None]
    return coefficients * np.asarray(times)[:, None, None] ** powers


# ---- against rationals ----------------------------------------------------------------------


@kernels
@every_case
def test_matches_the_optimum_in_rationals(case):
    found, exact = case.solve(), exact_optimum(case)
    error = np.abs(normalised(found.coefficients - exact, case.times)).max()
    # 2e-13 measured; the worst are those whose weights make terms of very different size
    assert error <= 2e-12 * np.abs(normalised(exact, case.times)).max()


@kernels
@every_case
def test_keeps_what_is_fixed_and_what_is_continuous(case):
    """The constraints themselves, evaluated on the result; the optimum is the business above."""
    found = case.solve()
    sizes = np.abs(normalised(found.coefficients, case.times)).max(axis=(1, 2))
    for axis in range(case.axes):
        rows, right = constraint_rows(case, axis, number=float)
        unknowns = found.coefficients[:, :, axis].ravel()
        for row, value in zip(rows, right, strict=True):
            terms = np.array(row) * unknowns
            assert abs(terms.sum() - value) <= 1e-12 * np.abs(terms).sum() + 1e-13 * sizes.max()


# ---- many legs: conditions on the optimum ---------------------------------------------------

CLASSES = {
    "snap, degree 5, C3": ({"snap": 1.0}, 5, 3),
    "snap, degree 6, C2": ({"snap": 1.0}, 6, 2),
    "jerk, degree 5, C3, moving": ({"jerk": 1.0}, 5, 3),
    "jerk, degree 8, C6": ({"jerk": 1.0}, 8, 6),
    "acceleration to snap, degree 7, C5": ({2: 1.0, 3: 0.3, 4: 0.01}, 7, 5),
    "position and jerk, degree 5, C3": ({0: 2.0, 3: 1.0}, 5, 3),
    "crackle, degree 11, C5": ({5: 1.0}, 11, 5),
}
every_class = pytest.mark.parametrize("name", CLASSES)


def large_case(name, legs, seed, spread=5.0):
    """A problem with a bit of everything that may be fixed or free."""
    weights, degree, continuity = CLASSES[name]
    rng = np.random.default_rng(seed)
    times = tuple(np.exp(rng.uniform(-0.5, 0.5, size=legs) * np.log(spread)))
    moving = {} if "moving" not in name else {"start": {1: rng.normal(size=2)},
                                              "end": {1: [NAN, 0.0], 2: [1.0, NAN]}}  # fmt: skip
    return Case(name, degree, SplineClass.of(weights, degree).weights, continuity, times, axes=2,
                derivatives={4: {1: [NAN, 0.5]}}, free=((7, 1),), **moving)  # fmt: skip


@kernels
@every_class
def test_gradient_vanishes_on_everything_that_is_free(name):
    """First-order optimality, in the null space of the constraints by singular values."""
    case = large_case(name, legs=9, seed=3)
    case.weights = {s: w for s, w in enumerate(case.weights) if w > 0.0}
    found = case.solve()
    size = case.degree + 1
    scale = (np.array(case.times)[:, None] ** -np.arange(size)).ravel()  # to normalised time
    hessian = np.zeros((len(scale), len(scale)))
    for k, block in enumerate(cost_blocks(case, number=float)):
        hessian[k * size : (k + 1) * size, k * size : (k + 1) * size] = block
    hessian *= np.outer(scale, scale)
    for axis in range(case.axes):
        rows, _ = constraint_rows(case, axis, number=float)
        rows = np.array(rows) * scale
        rows /= np.linalg.norm(rows, axis=1, keepdims=True)
        _, values, directions = np.linalg.svd(rows)
        rank = int((values > 1e-12).sum())
        free = directions[rank:]
        assert rank == len(rows) < len(scale)
        unknowns = found.coefficients[:, :, axis].ravel() / scale
        slope = free @ hessian @ unknowns
        terms = np.abs(free) @ np.abs(hessian) @ np.abs(unknowns)
        assert (np.abs(slope) <= 1e-12 * terms.max()).all()
        curvature = np.linalg.eigvalsh(free @ hessian @ free.T)
        assert curvature.min() > 0.0  # so that the optimum is a minimum, and the only one


@kernels
@every_class
def test_axes_do_not_know_of_each_other(name):
    case = large_case(name, legs=9, seed=4)
    weights = dict(enumerate(case.weights))
    times, waypoints = case.times, case.waypoints
    together = minimum_effort_spline(
        waypoints[:, [0, 1, 0, 1]], times, minimize=weights, degree=case.degree,
        continuity=case.continuity,
    )  # fmt: skip
    assert together.axes == 4
    for axis in range(4):
        alone = minimum_effort_spline(
            waypoints[:, [axis % 2]], times, minimize=weights, degree=case.degree,
            continuity=case.continuity,
        )  # fmt: skip
        a = normalised(together.coefficients, times)[:, :, axis]
        b = normalised(alone.coefficients, times)[:, :, 0]
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * np.abs(b).max())


@kernels
def test_the_paper_class_has_continuous_jerk_and_jumping_snap():
    rng = np.random.default_rng(5)
    waypoints, times = np.cumsum(rng.normal(size=(8, 3)), axis=0), rng.uniform(0.5, 1.5, size=7)
    found = minimum_effort_spline(waypoints, times, minimize="snap", degree=5)
    limits = Limits(speed=1.0)
    assert certify(found, limits, waypoints=waypoints, continuity=3).joint_residual <= 1e-13
    assert certify(found, limits, continuity=4).joint_residual >= 1e-2


@kernels
def test_continuity_costs_only_beyond_what_the_optimum_has_by_itself():
    """Minimum jerk at degree 6 is the quintic spline, which is C4: C2 to C4 ask for nothing."""
    rng = np.random.default_rng(6)
    waypoints, times = np.cumsum(rng.normal(size=(6, 1)), axis=0), rng.uniform(0.5, 1.5, size=5)
    nodes, weights = np.polynomial.legendre.leggauss(8)

    def effort(continuity):
        found = minimum_effort_spline(waypoints, times, degree=6, continuity=continuity)
        jerk = found.at(np.arange(5)[:, None], 0.5 * times[:, None] * (nodes + 1.0), 3)[:, :, 0]
        return (0.5 * times[:, None] * weights * jerk**2).sum()

    quintic = minimum_effort_spline(waypoints, times, degree=5).elevate(6)
    for continuity in (2, 3, 4):
        found = minimum_effort_spline(waypoints, times, degree=6, continuity=continuity)
        difference = normalised(found.coefficients - quintic.coefficients, times)
        size = np.abs(normalised(found.coefficients, times)).max()
        assert np.abs(difference).max() <= 1e-11 * size
    assert effort(5) > 1.01 * effort(4)


# ---- problems without one answer ------------------------------------------------------------

NOT_ONE_ANSWER = {
    "all positions free": {"minimize": "jerk", "known": 0},
    "all positions free, mixed cost": {"minimize": {2: 1.0, 3: 1.0}, "degree": 5, "known": 0},
    "one position known, free ends": {"minimize": "jerk", "known": 1, "free_ends": 2},
    "two positions known, free ends": {"minimize": "jerk", "known": 2, "free_ends": 2},
    "snap, pieces that do not hang together": {"minimize": "snap", "degree": 7, "continuity": 0},
    "snap, degree 5, C0": {"minimize": "snap", "degree": 5, "continuity": 0},
    "the highest derivative only": {"minimize": {11: 1.0}, "degree": 11, "continuity": 1},
    "contradiction: degree 3, C2, acceleration at both ends": {
        "minimize": "jerk", "degree": 3, "continuity": 2, "start": {2: [1.0]}, "end": {2: [1.0]},
    },
    "contradiction: degree 4, C3, acceleration at both ends": {
        "minimize": "jerk", "degree": 4, "continuity": 3, "start": {2: [0.0]}, "end": {2: [1.0]},
    },
    "contradiction: degree 5, C4, jerk at the start": {
        "minimize": "snap", "degree": 5, "continuity": 4, "start": {3: [1.0]},
    },
    "contradiction: degree 5, C4, inner velocity of the classical one": {
        "minimize": "jerk", "degree": 5, "continuity": 4, "derivatives": {1: {1: [1.0]}},
    },
    "contradiction: degree 5, C4, jerk at the start of the classical one": {
        "minimize": "jerk", "start": {3: [0.0]},
    },
    "contradiction: degree 5, C4, inner velocity": {
        "minimize": "snap", "degree": 5, "continuity": 4, "derivatives": {1: {1: [1.0]}},
    },
}  # fmt: skip


@kernels
@pytest.mark.parametrize("name", NOT_ONE_ANSWER)
def test_refuses_what_has_no_answer_or_many(name):
    """Twenty instances each: rounding may make a singular matrix look regular by chance."""
    options = dict(NOT_ONE_ANSWER[name])
    known, free_ends = options.pop("known", None), options.pop("free_ends", 0)
    if free_ends:
        state = np.full((free_ends, 1), np.nan)
        options |= {"start": state, "end": state}
    for seed in range(20):
        rng = np.random.default_rng(seed)
        legs = int(rng.integers(3, 9))
        waypoints = np.cumsum(rng.normal(size=(legs + 1, 1)), axis=0)
        if known is not None:
            waypoints[known:] = np.nan
        times = np.exp(rng.uniform(-2.0, 2.0, size=legs))
        with pytest.raises(Undetermined, match="do not determine one trajectory"):
            minimum_effort_spline(waypoints, times, **options)


@kernels
def test_one_more_condition_makes_it_determined():
    """The neighbours of problems above that do have one answer."""
    times = [0.7, 1.3, 0.4]
    rng = np.random.default_rng(2)
    state = np.full((2, 1), np.nan)
    points = rng.normal(size=(4, 1))
    points[3] = np.nan
    straight = minimum_effort_spline(points, times, start=state, end=state)
    # three points, free ends: the parabola through them has no jerk at all
    assert np.abs(normalised(straight.coefficients[:, 3:], times)).max() <= 1e-12
    free = np.full((4, 1), np.nan)
    still = minimum_effort_spline(free, times, minimize={0: 1.0, 3: 1.0}, degree=5)
    assert np.abs(still.coefficients).max() <= 1e-12
    fine = minimum_effort_spline(points[:2], [0.5], minimize={11: 1.0}, degree=11, continuity=5)
    assert np.isfinite(fine.coefficients).all()


# ---- size -----------------------------------------------------------------------------------


def test_ten_thousand_legs_of_very_different_durations():
    rng = np.random.default_rng(1)
    times = np.exp(rng.uniform(-0.5, 0.5, size=10_000) * np.log(1e4))
    assert times.max() / times.min() > 9e3
    waypoints = np.cumsum(rng.normal(size=(10_001, 3)), axis=0)
    found = minimum_effort_spline(waypoints, times, minimize="snap", degree=5)
    assert np.isfinite(found.coefficients).all()
    report = certify(found, Limits(speed=1.0), continuity=3)
    assert report.joint_residual <= 1e-8  # the tolerance of every certificate
    np.testing.assert_array_equal(found.coefficients[:, 0], waypoints[:-1])


def workspace_bytes(legs, options):
    def count(value):
        if isinstance(value, np.ndarray):
            return value.nbytes
        return sum(map(count, value)) if isinstance(value, tuple) else 0

    spline_class = SplineClass.of(*options)
    rest = spline_class.end_orders
    fixed = {k: fixed_state("end", {1: [NAN, 0, 0]}, 3, spline_class.degree, zeros=rest)
             for k in (0, legs)}  # fmt: skip
    task = SplineTask.of(np.zeros((legs + 1, 3)), spline_class, fixed)
    assert task.simple is None
    return count(task.layered)


@every_class
def test_memory_grows_with_the_number_of_legs_and_not_its_square(name):
    small, large = workspace_bytes(200, CLASSES[name]), workspace_bytes(2_000, CLASSES[name])
    assert large < 10.5 * small
    assert large < 20_000 * 2_000  # bytes: a band a leg, not a dense matrix


# ---- which kernel, and what is refused ------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "plain"),
    [
        ({}, True),
        ({"minimize": "snap"}, True),
        ({"minimize": "jerk", "continuity": 2}, True),
        ({"start": {"velocity": [1, 2, 3]}, "end": {"acceleration": [0, 0, 1]}}, True),
        ({"derivatives": {1: {"velocity": [NAN, NAN, NAN]}}}, True),
        ({"minimize": "jerk", "continuity": 1}, False),
        ({"minimize": "snap", "degree": 5}, False),
        ({"minimize": {"jerk": 1, "snap": 1}}, False),
        ({"start": {"velocity": [NAN, 0, 0]}}, False),
        ({"start": {"jerk": [0, 0, 0]}, "continuity": 3}, False),
        ({"derivatives": {1: {"velocity": [0, NAN, NAN]}}}, False),
    ],
)
def test_the_quick_kernel_serves_the_classical_case_and_no_other(options, plain, monkeypatch):
    tasks = []
    of = SplineTask.of
    monkeypatch.setattr(
        spline.SplineTask, "of", staticmethod(lambda *a: tasks.append(of(*a)) or tasks[-1])
    )
    minimum_effort_spline([[0, 0, 1], [1, 0, 1], [1, 2, 1]], [1.0, 2.0], **options)
    assert (tasks[0].layered is None) == plain


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"waypoints": [[0.0, 0.0]]}, "waypoints must be two at least"),
        ({"waypoints": [[0.0], [np.inf], [1.0]]}, "waypoints must be two at least, and finite"),
        ({"waypoints": [0.0, 1.0, 2.0]}, r"waypoints has shape \(3,\); it must be \(n, n\)"),
        ({"segment_times": [1.0]}, r"segment_times has shape \(1,\); it must be \(2\)"),
        ({"segment_times": [1.0, 0.0]}, "segment 1 lasts 0.0 s; it must be positive"),
        ({"segment_times": [NAN, 1.0]}, "segment 0 lasts nan s; it must be positive"),
        ({"segment_times": [np.inf, 1.0]}, "segment 0 lasts inf s; it must be positive"),
        ({"degree": 2}, "degree is 2; it must be 3 to 11"),
        ({"degree": 12}, "degree is 12; it must be 3 to 11"),
        ({"degree": 5, "continuity": 5}, "continuity is 5; degree 5 allows 0 to 4"),
        ({"minimize": {6: 1.0}, "degree": 5}, "minimize weighs derivative 6, which is zero at"),
        ({"derivatives": {0: {1: [0]}}}, "derivatives at waypoint 0: inner ones are 1 to 1"),
        ({"derivatives": {2: {1: [0]}}}, "derivatives at waypoint 2: inner ones are 1 to 1"),
        ({"derivatives": {1: {5: [0]}}}, "waypoint 1 fixes derivative 5; degree 5 allows up to 4"),
        ({"start": {1: [np.inf]}}, "start has an infinite derivative"),
        ({"end": {1: [0, 0]}}, r"end derivative 1 has shape \(2,\); it must be \(1\)"),
    ],
)
def test_bad_arguments_are_refused(change, message):
    values = {"waypoints": [[0.0], [1.0], [3.0]], "segment_times": [1.0, 2.0], **change}
    with pytest.raises(InvalidProblem, match=f"^{message}"):
        minimum_effort_spline(values.pop("waypoints"), values.pop("segment_times"), **values)
