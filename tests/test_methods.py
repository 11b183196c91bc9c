"""Every method of the registry, the planner around them, and what is particular to each."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakflight import (
    GRAVITY,
    KINDS,
    InvalidProblem,
    Limits,
    Plan,
    Problem,
    Status,
    Trajectory,
    certify,
    certify_plan,
    minimum_effort_spline,
    plan,
    read_course,
    stretch_to_limits,
)
from peakflight import methods as registry
from peakflight.certificate import peak_ratios
from peakflight.limits import keeps, limited_values
from peakflight.methods import METHODS, algorithm1, peak, proportional
from peakflight.methods.algorithm1 import Algorithm1Settings, update_times

COURSES = sorted((Path(__file__).parent.parent / "examples" / "courses").glob("*.json"))
JERK = {"limits": Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)}
SNAP = {
    "limits": Limits(speed=5.0, thrust_acceleration=14.5, jerk=54.0, snap=800.0),
    "minimize": "snap",
}
PAPER = {**SNAP, "degree": 5}
CLASSES = {"jerk": JERK, "snap": SNAP, "snap at degree 5": PAPER}
BEST = {
    "jerk": {
        "tight_then_fast": 4.7148, "mfbo_traj_2": 4.6369, "random_10": 6.6040,
        "pmm_slalom": 29.3463, "uzh_19wp": 56.2267, "random_100": 70.5013,
    },
    "snap": {
        "tight_then_fast": 5.1162, "mfbo_traj_2": 4.8904, "random_10": 7.2549,
        "pmm_slalom": 32.6289, "uzh_19wp": 57.7787, "random_100": 76.1404,
    },
}  # fmt: skip
"""s; the best that anything has found for these splines, `anchors.md`."""

every_method = pytest.mark.parametrize("method", METHODS)
every_class = pytest.mark.parametrize("name", CLASSES)
hypothetical = settings(max_examples=12, deadline=None, derandomize=True)


def random_course(rng, legs, shortest=0.3, longest=3.0):
    """(legs+1, 3) with legs of any direction, their lengths even in the logarithm."""
    lengths = np.exp(rng.uniform(np.log(shortest), np.log(longest), size=legs))
    directions = rng.normal(size=(legs, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.cumsum(np.vstack((rng.normal(size=3), lengths[:, None] * directions)), axis=0)


def check(made, *, start=None, end=None, samples=300):
    """Everything that a solved plan promises, without the certificate's help."""
    problem, trajectory = made.problem, made.trajectory
    if made.method == "joint":  # how often it is solved, and to what: tests/test_joint.py
        assert made.status in {Status.SOLVED, Status.NO_PROGRESS, Status.ITERATION_LIMIT}
    else:
        assert made.status is Status.SOLVED, made.message
        assert made.message == ""
    assert made.feasible
    assert made.report.problems == ()
    assert certify_plan(made).to_dict() == made.report.to_dict()
    assert len(made.pieces) == len(problem.waypoints) - 1
    assert sum(made.pieces) == len(made.trajectory)
    if made.method != "joint":
        assert set(made.pieces) == {1}
    assert made.wall_time_s > 0.0
    values = limited_values([trajectory.sample(samples, order) for order in range(1, 5)])
    for name, limit in problem.limits.to_dict().items():
        worst = values[name].min() if name.startswith("least") else values[name].max()
        slack = -1e-12 if name.startswith("least") else 1e-12
        assert keeps(name, worst, limit * (1.0 + slack)), name
        assert (made.report.peaks[name] <= 1.0).all()
    at_start, at_end = trajectory.sample(2, 0)[:, 0], trajectory.sample(2, 0)[:, 1]
    size = 1.0 + np.abs(problem.waypoints).max()
    ends = np.cumsum(made.pieces)
    firsts = ends - made.pieces
    np.testing.assert_allclose(at_start[firsts], problem.waypoints[:-1], rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(at_end[ends - 1], problem.waypoints[1:], rtol=0, atol=1e-9 * size)
    for order in range(1, problem.spline_class.continuity + 1):
        pieces = trajectory.sample(2, order)
        jumps = np.abs(pieces[1:, 0] - pieces[:-1, 1])
        shortest = trajectory.segment_times.min()
        assert (jumps <= 1e-7 * (np.abs(pieces).max() + size / shortest**order)).all()
    for state, t in ((start, 0.0), (end, trajectory.end_time)):
        for order, wanted in enumerate(state or [[0.0] * 3] * problem.spline_class.end_orders, 1):
            found = trajectory(t, order)
            expected = np.where(np.isnan(wanted), found, wanted)
            tolerance = 1e-9 * (1.0 + size / trajectory.segment_times[[0, -1]].min() ** order)
            np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)
    return made


# ---- public courses -------------------------------------------------------------------------


def test_there_are_the_public_courses():
    assert {path.stem for path in COURSES} >= set(BEST["jerk"])


@every_method
@every_class
@pytest.mark.parametrize("path", COURSES, ids=lambda path: path.stem)
def test_public_courses_are_solved(method, name, path):
    made = check(plan(read_course(path).waypoints, method=method, **CLASSES[name]))
    assert made.method == method
    assert made.report.worst >= 1.0 - 2e-9  # as fast as this path can be flown
    assert len(made.history.segment_times[-1]) == len(made.trajectory)


@pytest.mark.parametrize("course", BEST["jerk"])
@pytest.mark.parametrize("name", BEST)
def test_peak_finds_the_best_times_known(course, name):
    path = next(path for path in COURSES if path.stem == course)
    made = plan(read_course(path).waypoints, method="peak", **CLASSES[name])
    assert made.duration <= 1.0005 * BEST[name][course]
    # faster by a part in 1e3 would not be this spline under these limits
    assert made.duration >= (1.0 - 1e-3) * BEST[name][course]


@pytest.mark.parametrize("seed", range(40))
def test_random_courses(seed):
    """From 2 to 40 legs of 5 cm to 20 m, even in the logarithm."""
    rng = np.random.default_rng(seed)
    waypoints = random_course(rng, int(rng.integers(2, 41)), 0.05, 20.0)
    options = (JERK, SNAP, PAPER)[seed % 3]
    durations = {method: check(plan(waypoints, method=method, **options)).duration
                 for method in METHODS}  # fmt: skip
    assert durations["peak"] <= durations["proportional"]


@pytest.mark.parametrize("seed", range(5))
def test_peak_finds_the_optimum_of_two_legs(seed):
    """Every ratio of two segment times, each at its exact stretch: one line to search."""
    rng = np.random.default_rng(seed)
    waypoints = random_course(rng, 2)

    def duration(logarithm):
        spline = minimum_effort_spline(waypoints, [1.0, math.exp(logarithm)])
        return stretch_to_limits(spline, JERK["limits"])[0].duration

    grid = np.linspace(-3.0, 3.0, 301)
    best = grid[np.argmin([duration(x) for x in grid])]
    fine = np.linspace(best - 0.02, best + 0.02, 401)  # the minimum is a kink: no parabola there
    optimum = min(duration(x) for x in fine)
    made = plan(waypoints, method="peak", **JERK)
    # the last barrier leaves log(samples) / 6144, and the grid half a step of 1e-4
    assert made.duration <= optimum * (1.0 + 5e-4)
    assert made.duration >= optimum * (1.0 - 1e-4)


# ---- properties -----------------------------------------------------------------------------

courses = st.builds(
    lambda seed, legs: random_course(np.random.default_rng(seed), legs),
    st.integers(0, 10_000),
    st.integers(1, 6),
)
# Rounding alone differs between two such problems, but it may end a descent an iteration earlier.
SAME = 1e-3


@every_method
@hypothetical
@given(courses, st.tuples(*[st.floats(-50.0, 50.0)] * 3))
def test_moving_a_course_changes_no_time(method, waypoints, offset):
    here = plan(waypoints, method=method, **JERK).duration
    there = plan(waypoints + offset, method=method, **JERK).duration
    assert there == pytest.approx(here, rel=SAME)


@every_method
@hypothetical
@given(courses, st.floats(-math.pi, math.pi))
def test_turning_a_course_about_the_vertical_changes_no_time(method, waypoints, angle):
    c, s = math.cos(angle), math.sin(angle)
    turned = waypoints @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    here = plan(waypoints, method=method, **JERK).duration
    assert plan(turned, method=method, **JERK).duration == pytest.approx(here, rel=SAME)


@every_method
@hypothetical
@given(courses)
def test_a_course_flown_backwards_takes_as_long(method, waypoints):
    """Accelerations of the reversed motion are the same, so gravity does not see the difference."""
    there = plan(waypoints, method=method, **JERK).duration
    back = plan(waypoints[::-1], method=method, **JERK).duration
    assert back == pytest.approx(there, rel=SAME)


@every_method
@hypothetical
@given(courses)
def test_looser_limits_are_faster(method, waypoints):
    doubled = Limits(**{name: 2 * x for name, x in JERK["limits"].to_dict().items()})
    tight = plan(waypoints, method=method, **JERK).duration
    loose = plan(waypoints, method=method, limits=doubled).duration
    assert loose < tight / 2 ** (1 / 4)  # every kind alone allows that much, snap least


@every_method
@hypothetical
@given(courses)
def test_time_grows_with_the_cube_root_of_length_under_a_jerk_limit(method, waypoints):
    limits = Limits(jerk=60.0)
    small = plan(waypoints, method=method, limits=limits).duration
    large = plan(8.0 * waypoints, method=method, limits=limits).duration
    assert large == pytest.approx(2.0 * small, rel=SAME)


@every_method
def test_planning_twice_gives_the_same(method):
    waypoints = random_course(np.random.default_rng(0), 8)
    first, second = (plan(waypoints, method=method, **JERK) for _ in range(2))
    np.testing.assert_array_equal(first.trajectory.coefficients, second.trajectory.coefficients)


# ---- limits ---------------------------------------------------------------------------------


@every_method
@pytest.mark.parametrize(
    "extra",
    [
        {"tilt": 0.4},
        {"least_thrust_acceleration": 7.0},
        {"tilt": 0.4, "least_thrust_acceleration": 7.0},
        {"tilt": 1.2, "least_thrust_acceleration": 2.0},
    ],
    ids="+".join,
)
def test_tilt_and_least_thrust_are_kept(method, extra):
    for seed in range(3):
        waypoints = random_course(np.random.default_rng(seed), 6)
        free = plan(waypoints, method=method, **JERK)
        limits = Limits(**JERK["limits"].to_dict(), **extra)
        made = check(plan(waypoints, method=method, limits=limits))
        assert made.duration >= free.duration * (1.0 - SAME)
        if extra == {"tilt": 0.4, "least_thrust_acceleration": 7.0}:
            assert made.duration > free.duration
            assert {"tilt", "least_thrust_acceleration"} & set(made.report.binding)


@every_method
@pytest.mark.parametrize(
    "extra",
    [
        {"body_rate": 3.0},
        {"angular_acceleration": 15.0},
        {"body_rate": 3.0, "angular_acceleration": 15.0},
        {"tilt": 0.6, "least_thrust_acceleration": 7.0, "body_rate": 1.0},
    ],
    ids="+".join,
)
@pytest.mark.parametrize("options", [JERK, SNAP], ids=["jerk", "snap"])
def test_body_rate_and_angular_acceleration_are_kept(method, extra, options):
    bound = set()
    for seed in range(3):
        waypoints = random_course(np.random.default_rng(seed), 6)
        free = plan(waypoints, method=method, **options)
        limits = Limits(**options["limits"].to_dict(), **extra)
        made = check(plan(waypoints, method=method, **{**options, "limits": limits}))
        assert made.duration >= free.duration * (1.0 - SAME)
        bound |= set(made.report.binding)
    assert bound & {"body_rate", "angular_acceleration"}


@every_method
@pytest.mark.parametrize(
    "limits",
    [
        {"speed": 2.0},
        {"thrust_acceleration": 12.0},
        {"jerk": 30.0},
        {"snap": 200.0},
        {"speed": 3.0, "tilt": 0.5},
        {"speed": 3.0, "least_thrust_acceleration": 8.0},
        {"speed": 3.0, "body_rate": 2.0},
        {"speed": 3.0, "angular_acceleration": 10.0},
    ],
    ids="+".join,
)
def test_one_or_two_limits(method, limits):
    waypoints = random_course(np.random.default_rng(7), 5)
    made = check(plan(waypoints, method=method, limits=Limits(**limits)))
    # the stretch is closed to 1e-9; near free fall kappa may be steep in it
    faster = made.trajectory.stretch(1.0 - 2e-9)
    assert not certify(faster, made.problem.limits).feasible
    assert set(made.report.peaks) == set(limits)


@pytest.mark.parametrize("seed", [5, 39, 58])
def test_peak_is_no_slower_than_where_it_starts(seed):
    """Least thrust near hover: slowing down helps little against it, so that descents go astray."""
    waypoints = random_course(np.random.default_rng(seed), 6)
    limits = Limits(**JERK["limits"].to_dict(), least_thrust_acceleration=8.0)
    start = plan(waypoints, method="proportional", limits=limits)
    made = plan(waypoints, method="peak", limits=limits)
    assert made.feasible
    assert made.duration <= start.duration * (1.0 + 1e-8)  # each stretch is closed to 1e-9


@every_method
@pytest.mark.parametrize(
    "waypoints",
    [
        [[0, 0, 0], [0, 0, 5]],
        [[0, 0, 5], [0, 0, 0]],
        [[0, 0, 3], [0, 0, 0], [0, 0, 3]],
        [[0, 0, 0], [0, 0, 20], [0, 0, 0.5]],
    ],
    ids=["up", "down", "down and up", "up and down"],
)
def test_straight_up_and_down_with_limits_on_the_thrust_direction(method, waypoints):
    """It stays upright, but for free fall, where it is not defined."""
    limits = Limits(speed=20.0, thrust_acceleration=30.0, jerk=500.0, snap=20_000.0, tilt=0.5,
                    body_rate=5.0, angular_acceleration=50.0)  # fmt: skip
    check(plan(np.array(waypoints, dtype=float), method=method, limits=limits))


# ---- shapes of courses ----------------------------------------------------------------------


@pytest.mark.parametrize("method", ["proportional", "peak"])
@pytest.mark.parametrize("name", ["jerk", "snap"])
def test_two_waypoints_are_one_leg_whose_time_is_known(method, name):
    """Rest to rest is one polynomial: its peaks are known in closed form."""
    made = check(plan(np.array([[0.0, 0, 1], [3.0, 0, 1]]), method=method, **CLASSES[name]))
    limits = CLASSES[name]["limits"]
    u = np.linspace(0.0, 1.0, 100_001)
    powers = {"jerk": {3: 10, 4: -15, 5: 6}, "snap": {4: 35, 5: -84, 6: 70, 7: -20}}[name]
    p = np.polynomial.Polynomial([powers.get(j, 0) for j in range(8)])
    v, a, j, s = (3.0 * np.abs(p.deriv(order)(u)).max() for order in range(1, 5))
    level = math.sqrt(limits.thrust_acceleration**2 - GRAVITY**2)
    needed = max(
        v / limits.speed, math.sqrt(a / level), (j / limits.jerk) ** (1 / 3),
        (s / limits.snap) ** (1 / 4),
    )  # fmt: skip
    assert made.duration == pytest.approx(needed, rel=1e-8)


@every_method
@pytest.mark.parametrize(
    "waypoints",
    [
        [[0, 0, 1], [1, 0, 1], [2, 0, 1], [5, 0, 1]],
        [[0, 0, 1], [2, 0, 1], [0, 0, 1], [2, 0, 1]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 4], [0, 0, 1]],
        [[0, 0, 1], [0.002, 0, 1], [30, 0, 1], [30, 0.002, 1]],
        [[1e5, -1e5, 1e3], [1e5 + 1, -1e5, 1e3], [1e5 + 1, -1e5 + 1, 1e3]],
    ],
    ids=["straight", "to and fro", "closed", "vertical", "very uneven", "far from the origin"],
)
def test_courses_of_special_shape(method, waypoints):
    check(plan(np.array(waypoints, dtype=float), method=method, **JERK))


@pytest.mark.parametrize("degree", [3, 4, 6, 7, 9, 11])
def test_other_degrees(degree):
    """Proportional only: each degree takes seconds to compile for peak, which has 5 and 7 above."""
    waypoints = random_course(np.random.default_rng(degree), 5)
    limits = Limits(speed=5.0, thrust_acceleration=15.5)
    made = check(plan(waypoints, method="proportional", limits=limits, degree=degree,
                      minimize="acceleration" if degree == 3 else "jerk"))  # fmt: skip
    assert made.trajectory.degree == degree


@every_method
def test_mixed_costs(method):
    """They have a time scale of their own, so that slowing down changes the path."""
    waypoints = random_course(np.random.default_rng(3), 5)
    options = {"minimize": {"jerk": 1.0, "velocity": 5.0}, "degree": 5}
    made = check(plan(waypoints, method=method, **JERK, **options))
    assert made.report.worst >= 1.0 - 1e-6


# ---- motion that is fixed -------------------------------------------------------------------


@every_method
@every_class
def test_moving_start_and_end(method, name):
    start = {"velocity": [1.0, 0.5, 0.0], "acceleration": [0.0, 1.0, 2.0]}
    end = {"velocity": [0.0, 0.0, -1.0]}
    for seed in range(3):
        waypoints = random_course(np.random.default_rng(seed), 5, 0.5)
        made = plan(waypoints, method=method, **CLASSES[name], start=start, end=end)
        check(made, start=list(start.values()), end=list(end.values()))
        # the start is copied into the coefficients, not computed
        np.testing.assert_array_equal(made.trajectory.coefficients[0, 0], waypoints[0])
        np.testing.assert_allclose(made.trajectory(0.0, 1), start["velocity"], rtol=1e-13)
        np.testing.assert_allclose(
            made.trajectory(0.0, 2), start["acceleration"], rtol=1e-13, atol=1e-13
        )


@every_method
def test_jerk_at_the_start_of_a_minimum_jerk_spline(method):
    waypoints = random_course(np.random.default_rng(1), 5, 0.5)
    start = {"velocity": [1, 0, 0], "acceleration": [0, 0, 0], "jerk": [0, 5, 0]}
    made = plan(waypoints, method=method, **JERK, start=start, continuity=3)
    check(made, start=list(start.values()))


@every_method
def test_free_end(method):
    """NaN leaves a derivative to the spline: passing the last waypoint at speed is quicker."""
    waypoints = random_course(np.random.default_rng(2), 4, 0.5)
    free = [[math.nan] * 3] * 2
    made = check(plan(waypoints, method=method, **JERK, end=free), end=free)
    assert made.duration < plan(waypoints, method=method, **JERK).duration
    assert np.linalg.norm(made.trajectory(made.trajectory.end_time, 1)) > 0.5


@every_method
@pytest.mark.parametrize("velocity", [[0.0, 0.0, 0.0], [1.0, -0.5, 0.0], [math.nan, 0.0, 0.5]])
def test_fixed_inner_velocity(method, velocity):
    waypoints = random_course(np.random.default_rng(4), 4, 0.5)
    made = plan(waypoints, method=method, **JERK, derivatives={2: {"velocity": velocity}})
    check(made)
    found = made.trajectory(made.waypoint_times[2], 1)
    np.testing.assert_allclose(
        found, np.where(np.isnan(velocity), found, velocity), rtol=0, atol=1e-12
    )


@every_method
@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"start": {"velocity": [6, 0, 0]}},
         "the motion fixed at waypoint 0 has speed = 6 against a limit of 5"),
        ({"end": {"acceleration": [0, 0, 9]}},
         "the motion fixed at waypoint 4 has thrust_acceleration = 18.81 against a limit of 15.5"),
        ({"derivatives": {2: {"velocity": [0, 5.5, 0]}}},
         "the motion fixed at waypoint 2 has speed = 5.5 against a limit of 5"),
    ],
    ids=["start", "end", "inside"],
)  # fmt: skip
def test_fixed_motion_beyond_a_limit_is_infeasible_and_says_why(method, fixed, message):
    waypoints = random_course(np.random.default_rng(5), 4)
    made = plan(waypoints, method=method, **JERK, **fixed)
    assert made.status is Status.INFEASIBLE
    assert not made.feasible
    assert made.message.startswith(message)
    assert len(made.report.problems) >= 1
    assert np.isfinite(made.trajectory.coefficients).all()
    assert Plan.from_dict(json.loads(json.dumps(made.to_dict()))).status is Status.INFEASIBLE


@every_method
def test_fixed_motion_that_turns_too_fast_is_infeasible_and_says_why(method):
    waypoints = random_course(np.random.default_rng(5), 4)
    limits = Limits(speed=5.0, thrust_acceleration=15.5, body_rate=1.0)
    start = {"velocity": [0, 0, 0], "acceleration": [0, 0, 0], "jerk": [GRAVITY * 2, 0, 0]}
    made = plan(waypoints, method=method, limits=limits, minimize="snap", start=start)
    assert made.status is Status.INFEASIBLE
    assert made.message.startswith(
        "the motion fixed at waypoint 0 has body_rate = 2 against a limit of 1"
    )


@every_method
def test_a_start_at_the_limit_that_must_turn_is_infeasible_or_kept(method):
    """Full speed away from the course: whatever the answer, the report is true."""
    waypoints = np.array([[0.0, 0, 1], [1.0, 0, 1], [2.0, 1, 1]])
    made = plan(waypoints, method=method, **JERK, start={"velocity": [-4.9, 0, 0]})
    assert made.feasible == (made.status is Status.SOLVED)
    ratios = peak_ratios(made.trajectory, JERK["limits"])
    assert made.feasible == bool((ratios[:, :4] <= 1.0).all())


# ---- Algorithm 1 ----------------------------------------------------------------------------


def paper(**changes):
    return peak.Settings(variant="paper", paper=Algorithm1Settings(**changes))


def test_update_by_hand_where_a_limit_is_exceeded():
    """Eq. t_i_new_all: every segment by the largest kappa of all (Remark 3)."""
    tuned = Algorithm1Settings(learning_rate=0.25, neighbour_rate=0.5)
    new = update_times(np.array([1.0, 2.0, 4.0]), np.array([0.8, 1.4, 0.9]), tuned)
    np.testing.assert_allclose(new, np.array([1.0, 2.0, 4.0]) * 1.1, rtol=1e-15)
    edge = update_times(np.array([1.0, 2.0]), np.array([0.2, 1.0]), tuned)
    np.testing.assert_array_equal(edge, [1.0, 2.0])  # kappa >= 1 counts as exceeded


def test_update_by_hand_within_the_limits():
    """Eq. t_i_new for each segment, Eq. t_i_new_pm for its neighbours (Remark 2)."""
    tuned = Algorithm1Settings(learning_rate=0.4, neighbour_rate=0.1)
    new = update_times(np.array([1.0, 2.0, 4.0]), np.array([0.5, 0.75, 0.25]), tuned)
    expected = [
        1.0 * (1 - 0.4 * 0.5) * (1 - 0.1 * 0.25),
        2.0 * (1 - 0.4 * 0.25) * (1 - 0.1 * 0.5) * (1 - 0.1 * 0.75),
        4.0 * (1 - 0.4 * 0.75) * (1 - 0.1 * 0.25),
    ]
    np.testing.assert_allclose(new, expected, rtol=1e-15)
    alone = update_times(np.array([3.0]), np.array([0.5]), tuned)
    np.testing.assert_allclose(alone, [3.0 * 0.8], rtol=1e-15)


def test_slack_moves_the_border_between_the_two_updates():
    times, kappa = np.array([1.0, 1.0]), np.array([1.02, 0.5])
    strict = update_times(times, kappa, Algorithm1Settings())
    loose = update_times(times, kappa, Algorithm1Settings(slack=0.05))
    assert strict[0] == strict[1] > 1.0
    assert loose[1] < loose[0]


def test_history_is_the_road_of_the_equations():
    """Each recorded row follows from the one before by the update, with its own kappa."""
    waypoints = read_course(COURSES[0].parent / "mfbo_traj_2.json").waypoints
    tuned = Algorithm1Settings(iterations=25)
    made = plan(waypoints, method="peak", settings=peak.Settings(variant="paper", paper=tuned),
                **JERK)  # fmt: skip
    times, kappa = made.history.segment_times, made.history.kappa
    assert len(made.history) == made.iterations == 25
    assert kappa.shape == (25, 9, len(KINDS))
    lengths = made.problem.leg_lengths
    np.testing.assert_allclose(times[0], 5.0 * lengths / lengths.sum(), rtol=1e-14)
    for i in range(24):
        np.testing.assert_array_equal(
            times[i + 1], update_times(times[i], np.nanmax(kappa[i], axis=1), tuned)
        )
    spline = minimum_effort_spline(waypoints, times[10])
    values = limited_values([spline.sample(2001, order) for order in range(1, 5)])
    for column, name in enumerate(("speed", "thrust_acceleration", "jerk", "snap")):
        sampled = values[name].max(axis=1) / getattr(JERK["limits"], name)
        # samples miss peaks by the square of their distance
        np.testing.assert_allclose(kappa[10, :, column], sampled, rtol=1e-5)


@pytest.mark.parametrize(
    ("course", "duration"), [("mfbo_traj_2", 4.71), ("pmm_slalom", 30.0), ("random_10", 6.9)]
)
def test_algorithm_1_converges_by_its_rule_at_stated_rates(course, duration):
    """Learning rate 0.5 and neighbour rate 0.05, with a slack that lets it leave Remark 3."""
    waypoints = read_course(COURSES[0].parent / f"{course}.json").waypoints
    tuned = paper(learning_rate=0.5, neighbour_rate=0.05, slack=0.01)
    made = check(plan(waypoints, method="peak", settings=tuned, **JERK))
    assert made.iterations < 100
    last = np.nanmax(made.history.kappa[-1], axis=1)
    assert (np.abs(last - 1.0) <= 0.05).all()  # the paper's [0.95, 1.05]
    before = np.abs(np.nanmax(made.history.kappa[:-1], axis=2) - 1.0).max(axis=1)
    assert (before > 0.05).all()  # and it stops at once
    assert made.duration == pytest.approx(duration, rel=0.01)
    best = plan(waypoints, method="peak", **JERK).duration
    assert best <= made.duration


def test_the_band_is_open():
    waypoints = read_course(COURSES[0].parent / "pmm_slalom.json").waypoints
    iterations = [
        plan(waypoints, method="peak", **JERK,
             settings=paper(learning_rate=0.5, slack=0.01, band=band)).iterations
        for band in (0.3, 0.1, 0.05)
    ]  # fmt: skip
    assert iterations == sorted(iterations)
    assert iterations[0] < iterations[-1]


def test_without_convergence_the_best_iterate_is_handed_back():
    waypoints = read_course(COURSES[0].parent / "tight_then_fast.json").waypoints
    made = plan(waypoints, method="peak", settings=paper(iterations=40), **JERK)
    assert made.status is Status.ITERATION_LIMIT
    assert made.feasible
    assert made.iterations == 40
    assert "did not meet its convergence rule in 40 iterations" in made.message
    first = plan(waypoints, method="peak", settings=paper(iterations=1), **JERK)
    longer = plan(waypoints, method="peak", settings=paper(iterations=400), **JERK)
    assert longer.duration <= made.duration < first.duration
    candidates = [
        stretch_to_limits(minimum_effort_spline(waypoints, times), JERK["limits"])[0].duration
        for times in made.history.segment_times
    ]
    # the best is chosen by an estimate that takes gravity for part of the acceleration
    assert min(candidates) <= made.duration <= 1.02 * min(candidates)
    assert made.duration < 0.9 * max(candidates)
    assert first.duration == pytest.approx(
        plan(waypoints, method="proportional", **JERK).duration, rel=1e-8
    )


def test_a_learning_rate_that_is_too_large_still_ends_with_a_plan():
    waypoints = read_course(COURSES[0].parent / "tight_then_fast.json").waypoints
    made = plan(waypoints, method="peak", settings=paper(learning_rate=1.0), **JERK)
    assert made.feasible
    assert made.status is Status.ITERATION_LIMIT


def test_the_start_and_the_size_of_the_history_are_open():
    waypoints = read_course(COURSES[0].parent / "mfbo_traj_2.json").waypoints
    made = plan(waypoints, method="peak", **JERK,
                settings=paper(start_duration=None, history_size=9 * 7, iterations=30))  # fmt: skip
    assert made.history.segment_times.shape == (7, 9)
    assert made.history.kappa.shape == (7, 9, len(KINDS))
    np.testing.assert_allclose(
        made.history.segment_times[0], made.problem.leg_lengths / 5.0, rtol=1e-14
    )
    assert made.iterations == 30


@pytest.mark.parametrize("name", ["snap", "snap at degree 5"])
def test_algorithm_1_for_minimum_snap(name):
    waypoints = read_course(COURSES[0].parent / "mfbo_traj_2.json").waypoints
    made = plan(waypoints, method="peak", settings=paper(learning_rate=0.5, slack=0.01),
                **CLASSES[name])  # fmt: skip
    assert made.feasible


# ---- peak -----------------------------------------------------------------------------------


def test_history_of_peak_begins_feasible_in_all_but_name_and_ends_at_the_shape_of_the_plan():
    waypoints = read_course(COURSES[0].parent / "random_10.json").waypoints
    made = plan(waypoints, method="peak", **JERK)
    assert len(made.history) == made.iterations + 1
    assert made.history.kappa is None
    shares = made.history.segment_times / made.history.segment_times.sum(axis=1, keepdims=True)
    final = made.segment_times / made.duration
    np.testing.assert_allclose(shares[-1], final, rtol=1e-9)
    lengths = made.problem.leg_lengths
    np.testing.assert_allclose(shares[0], lengths / lengths.sum(), rtol=1e-12)
    short = plan(waypoints, method="peak", settings=peak.Settings(history_size=50), **JERK)
    assert len(short.history) == 6
    np.testing.assert_array_equal(short.segment_times, made.segment_times)


def test_stopping_early_is_said_and_feasible():
    waypoints = read_course(COURSES[0].parent / "random_10.json").waypoints
    made = plan(waypoints, method="peak", settings=peak.Settings(stage_iterations=2), **JERK)
    assert made.status is Status.ITERATION_LIMIT
    assert made.feasible
    assert made.iterations <= 2 * len(peak.LADDER)
    assert made.duration >= plan(waypoints, method="peak", **JERK).duration * (1.0 - 1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"variant": "papers"}, "unknown variant 'papers'; known are descent, paper"),
        ({"ladder": ()}, "setting stages of the ladder is 0; it must be from 1 to 100"),
        ({"ladder": ((8, 24, 1e-2), (10, 96, 1e-3))}, "stage 1 of the ladder is 10 samples, power"),
        ({"ladder": ((8, 25, 1e-2),)}, "stage 0 of the ladder is 8 samples, power 25, .* 24 times"),
        ({"ladder": ((8, 3, 1e-2),)}, "stage 0 of the ladder is 8 samples, power 3, .* from 6 on"),
        ({"ladder": ((128, 24, 1e-2),)}, "stage 0 of the ladder is 128 samples"),
        ({"ladder": ((8, 24, 0.0),)}, "stage 0 of the ladder .* decrease 0.0; .* between 0 and 1"),
        ({"stage_iterations": 0}, "setting stage_iterations is 0; it must be from 1 to"),
        ({"memory": 0}, "setting memory is 0; it must be from 1 to 1000"),
        ({"history_size": -1}, "setting history_size is -1; it must be from 1 to"),
    ],
)
def test_settings_of_peak_are_checked(changes, message):
    with pytest.raises(InvalidProblem, match=f"^{message}"):
        peak.Settings(**changes)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("learning_rate", 1.5), ("neighbour_rate", -0.1), ("band", math.nan), ("slack", -1e-3),
        ("start_duration", -5.0), ("start_duration", 0.0), ("iterations", 0), ("history_size", 0),
    ],
)  # fmt: skip
def test_settings_of_algorithm_1_are_checked(name, value):
    with pytest.raises(InvalidProblem, match=f"^setting {name} is {value}; it must be from"):
        Algorithm1Settings(**{name: value})


def test_a_rougher_ladder_ends_near_the_best():
    waypoints = read_course(COURSES[0].parent / "random_10.json").waypoints
    ladder = (*peak.LADDER[:4], *peak.LADDER[3:4] * 2)  # of the same length, or it compiles again
    rough = plan(waypoints, method="peak", settings=peak.Settings(ladder=ladder), **JERK)
    best = plan(waypoints, method="peak", **JERK)
    assert best.duration <= rough.duration * (1.0 + 1e-4)
    assert rough.duration <= 1.02 * best.duration


# ---- proportional ---------------------------------------------------------------------------


def test_proportional_times_are_proportional():
    waypoints = random_course(np.random.default_rng(0), 7)
    made = plan(waypoints, method="proportional", **JERK)
    lengths = made.problem.leg_lengths
    np.testing.assert_allclose(
        made.segment_times / made.duration, lengths / lengths.sum(), rtol=1e-13
    )
    assert made.iterations == 0
    np.testing.assert_array_equal(made.history.segment_times, [made.segment_times])


# ---- the planner ----------------------------------------------------------------------------

CORNER = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.5]])


def test_the_registry_names_modules_that_solve():
    for name, summary in METHODS.items():
        module = registry.find(name)
        assert module.__name__ == f"peakflight.methods.{name}"
        assert callable(module.solve)
        assert module.kernels(Problem(CORNER, **JERK), module.Settings())
        assert "\n" not in summary
    with pytest.raises(
        InvalidProblem, match="unknown method 'magic'; known are proportional, mell"
    ):
        registry.find("magic")


def test_the_default_method_is_joint():
    assert plan(CORNER, **JERK).method == "joint"


@every_method
def test_a_problem_and_its_parts_give_the_same_plan(method):
    options = {"minimize": "snap", "degree": 7, "yaw": [0.0, 1.0, 2.0], "limits": SNAP["limits"]}
    from_parts = plan(CORNER, method=method, **options)
    from_problem = plan(Problem(CORNER, **options), method=method)
    np.testing.assert_array_equal(
        from_parts.trajectory.coefficients, from_problem.trajectory.coefficients
    )
    np.testing.assert_array_equal(from_parts.problem.yaw, [0.0, 1.0, 2.0])
    assert from_problem.problem.spline_class == from_parts.problem.spline_class
    assert from_parts.version


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plan(CORNER), r"limits is missing; give limits=peakflight.Limits\(speed="),
        (lambda: plan(CORNER, **JERK, method="magic"), "unknown method 'magic'; known are"),
        (lambda: plan(CORNER, **JERK, cost="jerk"), "unknown option 'cost'"),
        (lambda: plan(CORNER, **JERK, minimise="jerk"), "unknown option 'minimise'"),
        (lambda: plan(CORNER[:1], **JERK), "1 waypoint given; a trajectory needs at least two"),
        (lambda: plan([[0, 0], [1, 1]], **JERK), r"waypoints has shape \(2, 2\); it must be"),
        (lambda: plan([[0, 0, 0], [math.nan, 1, 1]], **JERK), "waypoint 1 has x = nan; it must"),
        (lambda: plan("course.csv", **JERK), "waypoints must be numbers"),
        (
            lambda: plan(CORNER * 1e-5, **JERK),
            "all 3 waypoints lie within 1 mm; a trajectory needs",
        ),
        (
            lambda: plan(Problem(CORNER, **JERK), limits=JERK["limits"]),
            "limits given beside a Problem, which has its own",
        ),
        (
            lambda: plan(Problem(CORNER, **JERK), degree=7, minimize="snap"),
            "degree, minimize given beside a Problem, which has its own",
        ),
        (
            lambda: plan(CORNER, **JERK, method="peak", settings=proportional.Settings()),
            r"settings is Settings\(\); method peak takes its own Settings "
            r"\(peakflight.methods.peak.Settings\)",
        ),
        (
            lambda: plan(CORNER, **JERK, method="proportional", settings=peak.Settings()),
            "settings is .* method proportional takes its own Settings",
        ),
        (
            lambda: plan(CORNER, **JERK, method="peak", settings=Algorithm1Settings()),
            "settings is .* method peak takes its own Settings",
        ),
        (lambda: plan(CORNER, **JERK, settings={"memory": 3}), r"settings is \{'memory': 3\}; met"),
        (
            lambda: plan(CORNER, **JERK, method="peak", start={"jerk": [0, 0, 0]}),
            "the cost and what is fixed do not determine one trajectory",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(call, message):
    with pytest.raises(InvalidProblem, match=f"^{message}"):
        call()


@every_method
def test_waypoints_that_are_near_are_merged_and_the_plan_says_so(method):
    near = np.vstack((CORNER[:2], CORNER[1] + [0, 0, 4e-4], CORNER[2:]))
    made = plan(near, method=method, **JERK, yaw=[0.0, 1.0, 1.0, 2.0])
    assert made.feasible
    assert made.message == "waypoint 2 is 0.4 mm from waypoint 1: merged"
    np.testing.assert_array_equal(made.problem.waypoints, CORNER)
    np.testing.assert_array_equal(made.problem.yaw, [0.0, 1.0, 2.0])
    again = plan(CORNER, method=method, **JERK)
    np.testing.assert_array_equal(made.segment_times, again.segment_times)
    given = Problem(near, **JERK)  # a Problem is taken as it is
    assert len(plan(given, method=method).problem.waypoints) == 4


def test_merging_does_not_move_derivatives_to_another_waypoint():
    """Waypoint 1 is merged away: what is fixed at 2 must hold at that place, or be refused."""
    near = np.vstack((CORNER[:1], CORNER[0] + [0, 0, 4e-4], CORNER[1:], [[3.0, 1.0, 1.0]]))
    options = {"method": "proportional", **JERK, "derivatives": {2: {"velocity": [0.5, 0.5, 0]}}}
    try:
        made = plan(near, **options)
    except InvalidProblem:
        return
    index = int(np.flatnonzero((made.problem.waypoints == near[2]).all(axis=1))[0])
    velocity = made.trajectory(made.waypoint_times[index], 1)
    np.testing.assert_allclose(velocity, [0.5, 0.5, 0.0], atol=1e-12)


@every_method
def test_plans_are_saved_with_all_that_matters(method, tmp_path):
    made = plan(CORNER, method=method, **PAPER, start={"velocity": [0.5, math.nan, 0.0]})
    made.save(tmp_path / "plan.json")
    copy = Plan.load(tmp_path / "plan.json")
    np.testing.assert_array_equal(copy.trajectory.coefficients, made.trajectory.coefficients)
    assert copy.problem.spline_class == made.problem.spline_class
    assert certify_plan(copy).to_dict() == made.report.to_dict()
    np.testing.assert_array_equal(copy.history.segment_times, made.history.segment_times)


def test_a_method_that_lies_is_found_out(monkeypatch):
    """The certificate has the last word, whatever a method says of its own answer."""
    solve = proportional.solve

    def lie(problem, tuned):
        outcome = solve(problem, tuned)
        return replace(outcome, trajectory=outcome.trajectory.stretch(0.99))

    monkeypatch.setattr(proportional, "solve", lie)
    made = plan(CORNER, method="proportional", **JERK)
    assert not made.feasible
    assert made.status is Status.NUMERICAL
    assert "times its limit of" in made.message

    def bend(problem, tuned):
        outcome = solve(problem, tuned)
        coefficients = outcome.trajectory.coefficients.copy()
        coefficients[1, 0, 0] += 1e-6
        bent = Trajectory(coefficients, outcome.trajectory.segment_times * 1.1)
        return replace(outcome, trajectory=bent)

    monkeypatch.setattr(proportional, "solve", bend)
    made = plan(CORNER, method="proportional", **JERK)
    assert made.status is Status.NUMERICAL
    assert "waypoint" in made.message


def test_settings_reach_algorithm_1():
    seen = []
    original = algorithm1.solve

    def spy(problem, tuned):
        seen.append(tuned)
        return original(problem, tuned)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(algorithm1, "solve", spy)
        plan(CORNER, method="peak", settings=paper(learning_rate=0.45), **JERK)
    assert seen == [Algorithm1Settings(learning_rate=0.45)]
