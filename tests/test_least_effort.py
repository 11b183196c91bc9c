"""Mellinger's and Bry's methods, and the descent on the spline's optimal cost that they share."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from peakflight import (
    InvalidProblem,
    Limits,
    Problem,
    Status,
    minimum_effort_spline,
    plan,
    read_course,
    stretch_to_limits,
)
from peakflight.kernels import basis
from peakflight.methods import METHODS, bry, mellinger
from peakflight.methods.least_effort import DescentSettings, descend
from peakflight.spline import SplineTask

FOLDER = Path(__file__).parent.parent / "examples" / "courses"
COURSES = {path.stem: path for path in sorted(FOLDER.iterdir()) if path.suffix != ".md"}
JERK = {"limits": Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)}
SNAP = {
    "limits": Limits(speed=5.0, thrust_acceleration=14.5, jerk=54.0, snap=800.0),
    "minimize": "snap",
}
CLASSES = {"jerk": JERK, "snap": SNAP, "snap at degree 5": {**SNAP, "degree": 5}}
MIXED = {**JERK, "minimize": {"jerk": 1.0, "snap": 0.01}}
MOVING = {
    "start": {"velocity": [1.0, 0.5, 0.0], "acceleration": [0.0, 1.0, 2.0]},
    "end": {"velocity": [0.0, 0.0, -1.0]},
}
CASES = {
    **CLASSES,
    "mixed": MIXED,
    "moving": {**JERK, **MOVING},
    "moving, snap at degree 5": {**CLASSES["snap at degree 5"], **MOVING},
}
FURTHER = {
    "degree 9": {**JERK, "minimize": {5: 1.0}},
    "jerk at degree 7": {**JERK, "degree": 7},
    "position and jerk": {**JERK, "minimize": {0: 5.0, 3: 1.0}},
    "moving, mixed": {**MIXED, **MOVING},
    "inner velocity": {**JERK, "derivatives": {2: {"velocity": [1.0, math.nan, 0.0]}}},
    "inner order beyond the end data": {**JERK, "derivatives": {2: {3: [3.0, math.nan, 0.0]}}},
    "free end": {**JERK, "end": {1: [math.nan] * 3, 2: [math.nan] * 3}},
}

SHORT = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
"""m."""

every_case = pytest.mark.parametrize("case", CASES)
every_course = pytest.mark.parametrize("path", COURSES.values(), ids=COURSES)


def random_course(legs, seed):
    """(legs+1, 3) with legs of 0.3 to 3 m in any direction."""
    rng = np.random.default_rng(seed)
    lengths = np.exp(rng.uniform(np.log(0.3), np.log(3.0), size=legs))
    directions = rng.normal(size=(legs, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.cumsum(np.vstack((rng.normal(size=3), lengths[:, None] * directions)), axis=0)


def random_times(legs, seed):
    return np.exp(np.random.default_rng(seed).uniform(-0.7, 0.7, size=legs))


def cost(problem, times):
    """Eq. minfuncP of the best coefficients: the slow way, from the coefficients."""
    spline_class = problem.spline_class
    spline = minimum_effort_spline(
        problem.waypoints, times, minimize=spline_class.weights, degree=spline_class.degree,
        continuity=spline_class.continuity, start=problem.start, end=problem.end,
        derivatives=problem.derivatives,
    )  # fmt: skip
    nodes, weights = np.polynomial.legendre.leggauss(spline_class.degree + 1)  # exact
    total = 0.0
    for coefficients, time in zip(spline.coefficients, times, strict=True):
        for order, weight in enumerate(spline_class.weights):
            for axis in coefficients.T:
                p = np.polynomial.Polynomial(axis).deriv(order)
                squares = p(0.5 * time * (1.0 + nodes)) ** 2
                total += weight * 0.5 * time * (weights @ squares)
    return total


def at(problem, times):
    """Cost and gradient by the kernel."""
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    found = descend(task, np.array(times), DescentSettings(), penalty=None, iterations=0)
    return found.effort, found.gradient


# ---- the cost and its gradient --------------------------------------------------------------


@pytest.mark.kernels
@pytest.mark.parametrize("degree", [3, 5, 7, 11])
def test_roots_of_the_energy(degree):
    for order in range(degree + 1):
        roots, energy = basis.energy_roots(degree, order), basis.energy(degree, order)
        np.testing.assert_allclose(roots.T @ roots, energy, rtol=0, atol=1e-13 * energy.max())
        assert (roots[degree + 1 - order :] == 0.0).all()


@pytest.mark.kernels
@pytest.mark.parametrize("case", [*CASES, *FURTHER])
def test_cost_and_gradient(case):
    """Central differences of the slow cost, exact for polynomials of degree 4."""
    problem = Problem(random_course(4, 1), **{**CASES, **FURTHER}[case])
    times = random_times(4, 2)
    value, gradient = at(problem, times)
    assert value == pytest.approx(cost(problem, times), rel=1e-9)
    expected = np.empty(4)
    for k in range(4):
        step = 1e-3 * times[k] * np.eye(4)[k]

        def along(s, step=step):
            return cost(problem, times + s * step)

        near, far = along(1) - along(-1), along(2) - along(-2)
        expected[k] = (8.0 * near - far) / (12.0 * step.sum())
    np.testing.assert_allclose(gradient, expected, rtol=1e-6, atol=1e-7 * np.abs(expected).max())


@pytest.mark.kernels
def test_cost_falls_with_its_power_of_the_scale():
    """At rest f(a t) = a^(1-2r) f(t): why the shape does not depend on the total, nor on c_t."""
    for options, order in ((JERK, 3), (SNAP, 4)):
        problem = Problem(random_course(6, 0), **options)
        times = random_times(6, 0)
        once, twice = at(problem, times)[0], at(problem, 2.0 * times)[0]
        assert twice == pytest.approx(once * 2.0 ** (1 - 2 * order), rel=1e-12)


# ---- mellinger ------------------------------------------------------------------------------


@every_case
@pytest.mark.parametrize("seed", range(3))
def test_mellinger_never_raises_the_cost_at_a_fixed_total(case, seed):
    problem = Problem(random_course(3 + 4 * seed, seed), **CASES[case])
    made = plan(problem, method="mellinger")
    road = made.history.segment_times
    assert len(road) == made.iterations + 1 > 3
    assert (road > 0.0).all()
    np.testing.assert_allclose(road.sum(axis=1), road[0].sum(), rtol=1e-12)  # rounding of a sum
    costs = np.array([at(problem, times)[0] for times in road])
    assert (np.diff(costs) <= 1e-13 * costs[1:]).all()  # the kernel refines once less
    assert costs[-1] < 0.9 * costs[0]
    lengths = problem.leg_lengths
    np.testing.assert_allclose(road[0] / road[0].sum(), lengths / lengths.sum(), rtol=1e-12)


@every_course
@pytest.mark.parametrize("name", CLASSES)
def test_mellinger_ends_where_every_segment_is_worth_the_same(name, path):
    problem = Problem(read_course(path).waypoints, **CLASSES[name])
    made = plan(problem, method="mellinger")
    road = made.history.segment_times
    costs = np.array([at(problem, times)[0] for times in road])
    assert (np.diff(costs) <= 1e-13 * costs[1:]).all()
    _, gradient = at(problem, road[-1])
    mean = (road[-1] @ gradient) / road[-1].sum()
    np.testing.assert_allclose(gradient, mean, rtol=1e-3)
    shares = road[-1] / road[-1].sum()
    np.testing.assert_allclose(made.segment_times / made.duration, shares, rtol=1e-9)


@every_case
def test_mellinger_finds_what_scipy_finds(case):
    """The slow twin: a general solver with its own differences, on the slow cost."""
    problem = Problem(random_course(3, 5), **CASES[case])
    road = plan(problem, method="mellinger").history.segment_times
    total = road[0].sum()
    unit = cost(problem, road[0])

    def times_of(x):  # the last share makes up the total
        shares = np.exp(np.append(x, 0.0))
        return total * shares / shares.sum()

    best = minimize(
        lambda x: cost(problem, times_of(x)) / unit, np.log(road[0][:-1] / road[0][-1]),
        method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-12, "maxiter": 4000},
    )  # fmt: skip
    assert cost(problem, road[-1]) <= best.fun * unit * (1.0 + 1e-8)
    np.testing.assert_allclose(road[-1], times_of(best.x), rtol=1e-4)


# ---- bry ------------------------------------------------------------------------------------


@every_case
@pytest.mark.parametrize("penalty", [1.0, 1e4])
def test_at_a_given_penalty_a_second_costs_as_much_on_every_segment(case, penalty):
    """Stationarity of Eq. BryOpt: df/dt_k = -c_t for every k."""
    problem = Problem(random_course(7, 3), **CASES[case])
    made = plan(problem, method="bry", time_penalty=penalty)
    road = made.history.segment_times
    _, gradient = at(problem, road[-1])
    np.testing.assert_allclose(gradient, -penalty, rtol=1e-3)
    costs = [at(problem, times)[0] + penalty * times.sum() for times in road[1:]]
    assert (np.diff(costs) <= 1e-13 * np.abs(costs[1:])).all()


def test_a_penalty_that_the_limits_allow_is_kept():
    waypoints = random_course(7, 3)
    gentle, brisk = (plan(waypoints, method="bry", **JERK, time_penalty=c) for c in (1.0, 64.0))
    for made in (gentle, brisk):
        assert made.status is Status.SOLVED
        assert made.feasible
        assert made.message == ""
        assert made.report.worst < 1.0
        np.testing.assert_array_equal(made.segment_times, made.history.segment_times[-1])
    # J scales, so that the shape is the same and the times go with the 2r-th root
    np.testing.assert_allclose(gentle.segment_times, 2.0 * brisk.segment_times, rtol=1e-4)


def test_a_penalty_that_is_too_much_is_slowed_down_and_that_is_said():
    waypoints = random_course(7, 3)
    made = plan(waypoints, method="bry", **JERK, time_penalty=1e8)
    assert made.status is Status.SOLVED
    assert made.feasible
    assert made.message.startswith("time_penalty 1e+08 asks for more than the limits allow: slowed")
    assert made.duration > made.history.segment_times[-1].sum()
    best = plan(waypoints, method="bry", **JERK)
    assert made.duration == pytest.approx(best.duration, rel=1e-4)


@every_case
@pytest.mark.parametrize("closeness", [1e-2, 1e-3])
def test_the_penalty_is_raised_until_a_limit_is_reached(case, closeness):
    problem = Problem(random_course(6, 4), **CASES[case])
    made = plan(problem, method="bry", closeness=closeness)
    assert made.status is Status.SOLVED
    last = made.history.segment_times[-1]
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    _, stretch = stretch_to_limits(task.solve(last), problem.limits)
    assert 1.0 - closeness <= stretch <= 1.0
    _, gradient = at(problem, last)
    np.testing.assert_allclose(gradient, gradient.mean(), rtol=1e-3)
    assert last.sum() * (1.0 - 2.0 * closeness) <= made.duration <= last.sum()
    assert made.report.worst >= 1.0 - 1e-8


def test_where_every_optimum_exceeds_the_limits_that_is_said():
    """Position in the cost holds the total back: no c_t from 0 on is slow enough."""
    problem = Problem(SHORT, **{**JERK, "minimize": {0: 1.0, 3: 1e-3}})
    made = plan(problem, method="bry")
    assert made.status is Status.NO_PROGRESS
    assert made.feasible
    said = re.fullmatch(
        r"even without a penalty on time the optimum exceeds the limits; "
        r"it was slowed down by ([\d.]+) %",
        made.message,
    )
    last = made.history.segment_times[-1]
    slower = 100.0 * (made.duration / last.sum() - 1.0)
    assert float(said[1]) == pytest.approx(slower, rel=5e-3)  # three digits
    least = plan(problem, method="bry", time_penalty=1e-6)
    assert least.duration == pytest.approx(made.duration, rel=1e-2)  # where the search gives up
    assert made.iterations < 200  # 40 rounds took 275


def test_where_the_optimum_jumps_across_the_limits_that_is_said():
    fast = {"velocity": [2.0, 0.0, 0.0]}
    made = plan(SHORT[:2], method="bry", **JERK, start=fast, end=fast)
    assert made.status is Status.NO_PROGRESS
    assert made.feasible
    assert made.message == (
        "at time_penalty 7.97381 the optimum jumps across the limits; the one within was "
        "shortened by 82 %, and is the optimum of no time_penalty"
    )
    assert made.duration == pytest.approx(0.967, abs=5e-4)  # as the docs say
    assert made.history.segment_times[-1].sum() == pytest.approx(5.37, abs=5e-3)


def test_where_no_penalty_was_found_in_time_that_is_said(monkeypatch):
    monkeypatch.setattr(bry, "ROUNDS", 1)
    made = plan(random_course(6, 4), method="bry", **MOVING, **JERK)
    assert made.status is Status.ITERATION_LIMIT
    assert made.feasible
    assert made.message.startswith("no time_penalty was found at which the optimum reaches")


@pytest.mark.parametrize("minimize", ["jerk", {2: 1.0, 3: 1e-3}])
@pytest.mark.parametrize(
    ("penalty", "side"),
    [(1e-100, "above"), (1e-20, "above"), (1e20, "below"), (1e50, "below"), (1e100, "below")],
)
def test_a_penalty_for_an_absurd_total_is_refused(minimize, penalty, side):
    text = rf"^setting time_penalty is {re.escape(f'{penalty:g}')}; it asks for a total time {side}"
    with pytest.raises(InvalidProblem, match=text):
        plan(SHORT, method="bry", **{**JERK, "minimize": minimize}, time_penalty=penalty)


@pytest.mark.parametrize("name", CLASSES)
@every_course
def test_bry_is_mellinger_where_slowing_down_keeps_the_path(name, path):
    waypoints = read_course(path).waypoints
    one, other = (plan(waypoints, method=m, **CLASSES[name]) for m in ("mellinger", "bry"))
    # both stop where 1e-5 of the gradient remains
    assert one.duration == pytest.approx(other.duration, rel=1e-4)


def test_bry_is_not_mellinger_where_it_does_not():
    waypoints = read_course(COURSES["tight_then_fast"]).waypoints
    for options in (MIXED, {**JERK, **MOVING}):
        one, other = (plan(waypoints, method=m, **options) for m in ("mellinger", "bry"))
        assert abs(one.duration / other.duration - 1.0) > 1e-3


# ---- both -----------------------------------------------------------------------------------

both = pytest.mark.parametrize("method", ["mellinger", "bry"])


@both
@every_course
@pytest.mark.parametrize("name", ["jerk", "snap"])
def test_public_courses_with_moving_starts(method, name, path):
    waypoints = read_course(path).waypoints
    made = plan(waypoints, method=method, **CLASSES[name], **MOVING)
    assert made.status is Status.SOLVED
    assert made.feasible
    assert made.message == ""


@every_course
@pytest.mark.parametrize("name", CLASSES)
def test_peak_is_no_slower(name, path):
    waypoints = read_course(path).waypoints
    best = plan(waypoints, method="peak", **CLASSES[name]).duration
    for method in ("proportional", "mellinger", "bry"):
        assert best <= plan(waypoints, method=method, **CLASSES[name]).duration * (1.0 + 5e-4)


@every_course
@pytest.mark.parametrize("options", [JERK, SNAP], ids=["jerk", "snap"])
def test_joint_is_the_fastest(options, path):
    """Of every method, by its defaults, on every public course and at the paper's limits."""
    waypoints = read_course(path).waypoints
    rows = {method: plan(waypoints, method=method, **options) for method in METHODS}
    assert all(made.feasible for made in rows.values())
    best = rows.pop("joint").duration
    assert all(best < made.duration for made in rows.values())


@both
@pytest.mark.parametrize("options", [JERK, SNAP], ids=["jerk", "snap"])
def test_a_thousand_legs(method, options):
    made = plan(random_course(1000, 0), method=method, **options)
    assert made.status is Status.SOLVED
    assert made.feasible


@pytest.mark.parametrize("changes", [{}, {"time_penalty": 1e3}], ids=["mellinger", "bry"])
@pytest.mark.parametrize("options", [JERK, MIXED], ids=["jerk", "mixed"])
def test_the_iteration_limit_is_said_and_the_plan_still_keeps_the_limits(changes, options):
    method = "bry" if changes else "mellinger"
    made = plan(random_course(12, 0), method=method, iterations=2, **changes, **options)
    assert made.status is Status.ITERATION_LIMIT
    assert made.feasible
    assert made.iterations == 2
    assert len(made.history) == 3


@both
def test_the_history_is_as_long_as_is_asked(method):
    waypoints = random_course(10, 0)
    made = plan(waypoints, method=method, **JERK)
    short = plan(waypoints, method=method, **JERK, history_size=59)
    assert short.history.segment_times.shape == (5, 10)
    np.testing.assert_array_equal(short.segment_times, made.segment_times)
    if method == "mellinger":
        np.testing.assert_array_equal(short.history.segment_times, made.history.segment_times[:5])
    least = plan(waypoints, method=method, **JERK, history_size=1)
    assert least.history.segment_times.shape == (1, 10)


def test_the_history_of_bry_is_in_the_order_run_and_ends_at_the_plan(monkeypatch):
    problem = Problem(random_course(6, 4), **MIXED)
    trials = []
    descend = bry.descend

    def watched(*arguments, **options):
        found = descend(*arguments, **options)
        if options.get("iterations") is None:
            trials.append(found)
        return found

    monkeypatch.setattr(bry, "descend", watched)
    made = plan(problem, method="bry")
    assert len(trials) > 2
    run = np.concatenate([found.road for found in trials])
    np.testing.assert_array_equal(made.history.segment_times, run)
    np.testing.assert_array_equal(run[-1], trials[-1].times)
    rows = len(run) - len(trials[0].road) // 2  # there is room for each, not for all
    short = plan(problem, method="bry", history_size=6 * rows)
    np.testing.assert_array_equal(short.history.segment_times, run[-rows:])
    least = plan(problem, method="bry", history_size=1)
    np.testing.assert_array_equal(least.history.segment_times, run[-1:])
    trials.clear()
    fast = {"velocity": [2.0, 0.0, 0.0]}
    jump = plan(SHORT[:2], method="bry", **JERK, start=fast, end=fast)
    assert jump.iterations == sum(found.iterations for found in trials)


@both
def test_a_tolerance_of_zero_ends_at_rounding(method):
    made = plan(random_course(5, 0), method=method, **JERK, tolerance=0.0)
    assert made.status is Status.SOLVED
    best = plan(random_course(5, 0), method=method, **JERK)
    assert made.duration == pytest.approx(best.duration, rel=1e-4)


@pytest.mark.parametrize(
    ("name", "value"),
    [("tolerance", -1e-3), ("tolerance", math.nan), ("iterations", 0), ("history_size", 0)],
)
@pytest.mark.parametrize("module", [mellinger, bry])
def test_settings_are_checked(module, name, value):
    with pytest.raises(InvalidProblem, match=f"^setting {name} is {value}; it must be from"):
        module.Settings(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("time_penalty", 0.0), ("time_penalty", -1.0), ("time_penalty", math.inf),
        ("time_penalty", "much"), ("closeness", 0.0), ("closeness", 1.0),
    ],
)  # fmt: skip
def test_settings_of_bry_are_checked(name, value):
    with pytest.raises(InvalidProblem, match=f"^setting {name} is {value!r}; it must be from"):
        bry.Settings(**{name: value})
