"""Splines of degree 2r-1 with least r-th derivative: kernel against twins, theory and scipy."""

from fractions import Fraction
from math import perm

import numpy as np
import pytest
from scipy.interpolate import BPoly, CubicSpline, make_interp_spline

from peakflight import Limits, Trajectory, certify, minimum_effort_spline, spline
from peakflight.problem import SplineClass, fixed_state
from peakflight.spline import SplineTask

DEGREES = (3, 5, 7, 9, 11)
COST_ORDERS = {degree: (degree + 1) // 2 for degree in DEGREES}

kernels = pytest.mark.kernels
every_degree = pytest.mark.parametrize("degree", DEGREES)


def classical(waypoints, times, degree, **fixed):
    return minimum_effort_spline(waypoints, times, minimize={COST_ORDERS[degree]: 1.0}, **fixed)


def end_states(degree, axes, seed):
    rng = np.random.default_rng(seed)
    shape = (COST_ORDERS[degree] - 1, axes)
    return rng.normal(size=shape), rng.normal(size=shape)


def random_walk(rng, legs, axes=3):
    return np.cumsum(rng.normal(size=(legs + 1, axes)), axis=0)


def spread_times(rng, legs, spread):
    """Durations between 1/sqrt(spread) and sqrt(spread) s, evenly in their logarithm."""
    return np.exp(rng.uniform(-0.5, 0.5, size=legs) * np.log(spread))


def solve_exactly(matrix, right):
    """Gauss elimination in rationals."""
    size = len(matrix)
    rows = [[*row, *values] for row, values in zip(matrix, right, strict=True)]
    for i in range(size):
        pivot = next(k for k in range(i, size) if rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        for k in range(i + 1, size):
            if rows[k][i]:
                factor = rows[k][i] / rows[i][i]
                rows[k] = [
                    a - factor * b if b else a for a, b in zip(rows[k], rows[i], strict=True)
                ]
    solution = [None] * size
    for i in reversed(range(size)):
        known = [
            value - sum((rows[i][k] * solution[k][d] for k in range(i + 1, size)), Fraction(0))
            for d, value in enumerate(rows[i][size:])
        ]
        solution[i] = [value / rows[i][i] for value in known]
    return solution


def exact_twin(waypoints, times, degree, start, end):
    """(K, N+1, D) coefficients of the C^(2r-2) spline of degree 2r-1, in rationals.

    The theory: least effort is the one spline of this smoothness. No cost appears here.
    """
    waypoints, times, start, end = (
        np.vectorize(Fraction)(np.asarray(a, dtype=float)) for a in (waypoints, times, start, end)
    )
    legs, size, half = len(times), degree + 1, (degree + 1) // 2

    def row(entries):
        full = [Fraction(0)] * (legs * size)
        for piece, t, order, sign in entries:
            for j in range(order, size):
                full[piece * size + j] += sign * perm(j, order) * t ** (j - order)
        return full

    matrix, right = [], []
    for k in range(legs):
        matrix += [row([(k, Fraction(0), 0, 1)]), row([(k, times[k], 0, 1)])]
        right += [waypoints[k], waypoints[k + 1]]
    for order in range(1, half):
        matrix += [row([(0, Fraction(0), order, 1)]), row([(legs - 1, times[-1], order, 1)])]
        right += [start[order - 1], end[order - 1]]
    for k in range(legs - 1):
        for order in range(1, 2 * half - 1):
            matrix.append(row([(k, times[k], order, 1), (k + 1, Fraction(0), order, -1)]))
            right.append(np.full(waypoints.shape[1], Fraction(0)))
    solution = np.array(solve_exactly(matrix, right)).astype(float)
    return solution.reshape(legs, size, -1)


def relative_error(trajectory, coefficients):
    """Largest difference of coefficients in normalised time, by the largest of its piece."""
    powers = trajectory.segment_times[:, None] ** np.arange(coefficients.shape[1])
    expected = coefficients * powers[:, :, None]
    error = np.abs(trajectory.coefficients * powers[:, :, None] - expected).max(axis=(1, 2))
    return (error / np.abs(expected).max(axis=(1, 2))).max()


def motion_sizes(trajectory):
    """(K,) largest term of each piece's polynomial, m: what its values are rounded by."""
    powers = np.arange(1.0, trajectory.degree + 1.0)
    terms = np.abs(trajectory.coefficients[:, 1:]).max(axis=2)
    return (terms * trajectory.segment_times[:, None] ** powers).max(axis=1)


def joint_jumps(trajectory, highest):
    """Largest jump of a derivative up to `highest`, by the size that the motion gives it.

    As `Report.joint_residual` defines it, in plain NumPy.
    """
    c, h = trajectory.coefficients, trajectory.segment_times
    powers = np.arange(c.shape[1])
    worst = 0.0
    for order in range(highest + 1):
        factors = np.array([float(perm(j, order)) for j in range(order, c.shape[1])])
        at_end = np.einsum("kjd,kj->kd", c[:, order:] * factors[:, None],
                           h[:, None] ** powers[: c.shape[1] - order])  # fmt: skip
        at_start = perm(order, order) * c[:, order]
        jump = np.linalg.norm(at_end[:-1] - at_start[1:], axis=1)
        size = perm(order, order) * motion_sizes(trajectory) / h**order
        size = np.maximum(size[:-1], size[1:])
        if order == 0:
            size = np.maximum(size, np.abs(c[:-1, 0]).max(axis=1))
        worst = max(worst, (jump / size).max())
    return worst


# ---- against the exact twin -----------------------------------------------------------------


@kernels
@every_degree
@pytest.mark.parametrize("legs", [1, 2, 3])
def test_matches_rationals(degree, legs):
    rng = np.random.default_rng(degree + 100 * legs)
    times = np.array([0.4375, 1.5, 0.03125])[:legs]  # short binary fractions keep rationals short
    waypoints = np.round(random_walk(rng, legs), 2)
    start, end = (np.round(state, 1) for state in end_states(degree, 3, seed=legs))
    found = classical(waypoints, times, degree, start=start, end=end)
    exact = exact_twin(waypoints, times, degree, start, end)
    # about ten times what joints 48:1 apart measure: a digit is lost with every derivative more
    assert relative_error(found, exact) <= 10.0 ** (0.6 * degree - 16)


@kernels
@pytest.mark.parametrize("axes", [1, 2, 4])
def test_any_number_of_axes(axes):
    rng = np.random.default_rng(axes)
    waypoints, times = random_walk(rng, 3, axes), np.array([0.5, 2.0, 0.75])
    start, end = end_states(5, axes, seed=3)
    found = classical(waypoints, times, 5, start=start, end=end)
    assert found.axes == axes
    assert relative_error(found, exact_twin(waypoints, times, 5, start, end)) <= 1e-13
    for axis in range(axes):  # axes do not know of each other
        alone = classical(
            waypoints[:, [axis]], times, 5, start=start[:, [axis]], end=end[:, [axis]]
        )
        np.testing.assert_allclose(
            found.coefficients[:, :, axis], alone.coefficients[:, :, 0], rtol=1e-11, atol=1e-12
        )


# ---- against the general kernel -------------------------------------------------------------


@kernels
@every_degree
def test_matches_the_general_kernel(degree, monkeypatch):
    rng = np.random.default_rng(degree)
    waypoints, times = random_walk(rng, 8), spread_times(rng, 8, 30.0)
    start, end = end_states(degree, 3, seed=1)
    plain = classical(waypoints, times, degree, start=start, end=end)
    monkeypatch.setattr(spline, "is_plain", lambda *_: False)
    spline_class = SplineClass.of({COST_ORDERS[degree]: 1.0})
    fixed = {
        0: fixed_state("start", start, 3, degree, zeros=0),
        8: fixed_state("end", end, 3, degree, zeros=0),
    }
    task = SplineTask.of(waypoints, spline_class, fixed)
    assert task.simple is None
    # two factorisations, each good to cond * 1e-16; the condition grows with the degree
    assert relative_error(plain, task.solve(times).coefficients) <= 10.0 ** (degree - 16)


# ---- against scipy --------------------------------------------------------------------------


def test_degree_3_is_the_clamped_cubic_spline():
    rng = np.random.default_rng(0)
    waypoints, times = random_walk(rng, 12), spread_times(rng, 12, 100.0)
    start, end = end_states(3, 3, seed=0)
    found = classical(waypoints, times, 3, start=start, end=end)
    twin = CubicSpline(found.breakpoints, waypoints, bc_type=((1, start[0]), (1, end[0])))
    # breakpoints are sums of durations: they, not the spline, are rounded by 1e-16 of the total
    coefficients = twin.c[::-1].transpose(1, 0, 2)
    assert relative_error(found, coefficients) <= 1e-11


@pytest.mark.parametrize("degree", [5, 7])
def test_is_the_interpolating_b_spline_with_given_end_derivatives(degree):
    rng = np.random.default_rng(degree)
    waypoints, times = random_walk(rng, 10), spread_times(rng, 10, 5.0)
    start, end = end_states(degree, 3, seed=2)
    found = classical(waypoints, times, degree, start=start, end=end)
    bc_type = tuple(list(enumerate(state, start=1)) for state in (start, end))
    twin = make_interp_spline(found.breakpoints, waypoints, k=degree, bc_type=bc_type)
    t = np.linspace(0.0, found.end_time, 500)
    for order in range(degree):
        expected = twin(t, order)
        # the B-spline collocation matrix is the worse conditioned of the two
        np.testing.assert_allclose(
            found(t, order), expected, rtol=0, atol=1e-8 * np.abs(expected).max()
        )


# ---- what the optimum must be like ----------------------------------------------------------


@kernels
@every_degree
def test_optimum_is_smooth_to_order_2r_minus_2(degree):
    rng = np.random.default_rng(degree)
    waypoints, times = random_walk(rng, 10), spread_times(rng, 10, 10.0)
    start, end = end_states(degree, 3, seed=5)
    found = classical(waypoints, times, degree, start=start, end=end)
    # jumps above r-1 are not built in: they measure how well the equations are solved
    assert joint_jumps(found, degree - 1) <= 1e-10
    assert joint_jumps(found, degree) > 1e-3  # and the highest derivative does jump


@kernels
@every_degree
def test_passes_waypoints_and_meets_both_end_states(degree):
    rng = np.random.default_rng(degree)
    waypoints, times = random_walk(rng, 6), spread_times(rng, 6, 10.0)
    start, end = end_states(degree, 3, seed=6)
    found = classical(waypoints, times, degree, start=start, end=end)
    at = np.append(found.breakpoints[:-1], found.end_time)
    # positions and start derivatives are copied, the rest is one sum of N+1 terms
    np.testing.assert_array_equal(found.coefficients[:, 0], waypoints[:-1])
    np.testing.assert_allclose(found(at), waypoints, rtol=0, atol=1e-12)
    for order in range(1, len(start) + 1):
        np.testing.assert_allclose(found(0.0, order), start[order - 1], rtol=1e-14)
        last = found.at(5, times[5], order)
        size = perm(degree, order) * motion_sizes(found)[5] / times[5] ** order
        np.testing.assert_allclose(last, end[order - 1], rtol=0, atol=1e-13 * size)


@kernels
@every_degree
def test_every_admissible_change_is_orthogonal(degree):
    """Optimality: the r-th derivative is orthogonal to that of whatever vanishes at waypoints.

    By Pythagoras, every such change costs more.
    """
    rng = np.random.default_rng(degree)
    r, legs = COST_ORDERS[degree], 5
    waypoints, times = random_walk(rng, legs), spread_times(rng, legs, 5.0)
    start, end = end_states(degree, 3, seed=7)
    found = classical(waypoints, times, degree, start=start, end=end)
    nodes, weights = np.polynomial.legendre.leggauss(2 * degree)  # exact for these products

    def inner_product(a, b):
        total = 0.0
        for begin, time in zip(found.breakpoints, times, strict=False):
            t = begin + 0.5 * time * (nodes + 1.0)
            total += 0.5 * time * weights @ (a(t) * b(t)).sum(axis=1)
        return total

    def effort(t):
        return found(t, r)

    for _ in range(10):
        states = np.zeros((legs + 1, r, 3))
        states[1:-1, 1:] = rng.normal(size=(legs - 1, r - 1, 3))
        states *= times.min() ** -np.arange(r)[:, None]
        change = BPoly.from_derivatives(found.breakpoints, states).derivative(r)
        size = np.sqrt(inner_product(effort, effort) * inner_product(change, change))
        # two integrals of polynomials of degree 2r-2: rounding, times what cancels between legs
        assert abs(inner_product(effort, change)) <= 1e-9 * size
        assert size > 0.0


@kernels
@pytest.mark.parametrize(
    ("degree", "speed", "acceleration"),
    [
        (3, 3 / 2, 6.0),
        (5, 15 / 8, 10 / np.sqrt(3)),
        (7, 35 / 16, 84 / (5 * np.sqrt(5))),
        (9, 315 / 128, None),
        (11, 693 / 256, None),
    ],
)
def test_one_leg_from_rest_to_rest(degree, speed, acceleration):
    """Analytic: derivative of the regularised incomplete beta function."""
    duration, origin, offset = 1.7, np.array([3.0, 0.0, 1.0]), np.array([1.0, -2.0, 2.0])
    found = classical([origin, origin + offset], [duration], degree)
    middle = found(duration / 2, 1)
    np.testing.assert_allclose(middle, speed * offset / duration, rtol=1e-13)
    np.testing.assert_allclose(found(duration / 2), origin + offset / 2, rtol=1e-14)
    if acceleration is not None:
        t = np.linspace(0.0, duration, 200_001)
        peak = np.linalg.norm(found(t, 2), axis=1).max()
        # the peak of a grid is below the true one by the square of its step
        assert peak == pytest.approx(acceleration * 3.0 / duration**2, rel=1e-9)
        report = certify(found, Limits(speed=speed * 3.0 / duration))
        assert report.worst == pytest.approx(1.0, rel=1e-9)


@kernels
@every_degree
def test_scaling_time_and_space_scales_the_spline(degree):
    rng = np.random.default_rng(degree)
    waypoints, times = random_walk(rng, 4), spread_times(rng, 4, 5.0)
    found = classical(waypoints, times, degree)
    longer = classical(2.0 * waypoints, 4.0 * times, degree)  # powers of two: no rounding differs
    expected = 2.0 * found.coefficients * 4.0 ** -np.arange(degree + 1.0)[:, None]
    np.testing.assert_array_equal(longer.coefficients, expected)


@kernels
@every_degree
def test_reversed_waypoints_give_the_reversed_spline(degree):
    rng = np.random.default_rng(degree)
    waypoints, times = random_walk(rng, 5), spread_times(rng, 5, 5.0)
    start, end = end_states(degree, 3, seed=8)
    signs = (-1.0) ** np.arange(1, len(start) + 1)[:, None]
    found = classical(waypoints, times, degree, start=start, end=end)
    back = classical(
        waypoints[::-1], times[::-1], degree, start=signs * end, end=signs * start
    ).reverse()
    assert relative_error(found, back.coefficients) <= 1e-10


# ---- size -----------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [5, 7])
def test_ten_thousand_legs_of_very_different_durations(degree):
    rng = np.random.default_rng(degree)
    times = spread_times(rng, 10_000, 1e4)
    assert times.max() / times.min() > 9e3
    waypoints = random_walk(rng, 10_000)
    found = classical(waypoints, times, degree)
    assert np.isfinite(found.coefficients).all()
    assert joint_jumps(found, degree - 1) <= 1e-8
    np.testing.assert_array_equal(found.coefficients[:, 0], waypoints[:-1])
    missed = np.abs(found.at(np.arange(10_000), times) - waypoints[1:]).max(axis=1)
    # a long leg between short ones swings far out: its end is a sum of terms that large
    assert (missed <= 1e-13 * (motion_sizes(found) + np.abs(waypoints).max())).all()
    report = certify(found, Limits(tilt=1.0), waypoints=waypoints, continuity=degree - 1)
    assert report.joint_residual <= 1e-8
    # both measure the same jumps, each with rounding of its own
    assert report.joint_residual == pytest.approx(joint_jumps(found, degree - 1), rel=0.5)


def test_durations_are_spread_across_neighbours():
    """Alternating legs of 0.1 ms and 1 s: the worst that 10,000:1 can do."""
    times = np.where(np.arange(1000) % 2, 1e-4, 1.0)
    waypoints = np.zeros((1001, 3))
    waypoints[1:] = np.cumsum(np.random.default_rng(1).normal(size=(1000, 3)) * times[:, None], 0)
    for degree in (5, 7):
        assert joint_jumps(classical(waypoints, times, degree), degree - 1) <= 1e-8


def workspace_bytes(legs):
    def count(value):
        if isinstance(value, np.ndarray):
            return value.nbytes
        return sum(map(count, value)) if isinstance(value, tuple) else 0

    fixed = {k: fixed_state("end", None, 3, 5, zeros=2) for k in (0, legs)}
    task = SplineTask.of(np.zeros((legs + 1, 3)), SplineClass.of("jerk"), fixed)
    assert task.layered is None
    return count(task.simple)


def test_memory_grows_with_the_number_of_legs_and_not_its_square():
    small, large = workspace_bytes(1_000), workspace_bytes(10_000)
    assert large < 10.5 * small
    assert large < 1_000 * 10_000  # bytes: a few small blocks a leg


def test_result_is_a_trajectory_that_shares_nothing():
    waypoints = np.array([[0.0, 0, 0], [1, 1, 1], [2, 0, 1]])
    times = np.array([1.0, 2.0])
    found = minimum_effort_spline(waypoints, times)
    before = found.coefficients.copy()
    waypoints[:] = 9.0
    times[:] = 9.0
    assert isinstance(found, Trajectory)
    assert found.degree == 5
    np.testing.assert_array_equal(found.coefficients, before)
    np.testing.assert_array_equal(found.segment_times, [1.0, 2.0])


def test_a_task_may_be_solved_again_for_other_times():
    rng = np.random.default_rng(4)
    waypoints = random_walk(rng, 6)
    fixed = {k: fixed_state("end", None, 3, 5, zeros=2) for k in (0, 6)}
    task = SplineTask.of(waypoints, SplineClass.of("jerk"), fixed)
    first_times, other_times = spread_times(rng, 6, 5.0), spread_times(rng, 6, 5.0)
    first = task.solve(first_times)
    kept = first.coefficients.copy()
    task.solve(other_times)
    np.testing.assert_array_equal(first.coefficients, kept)
    np.testing.assert_array_equal(task.solve(first_times).coefficients, kept)
