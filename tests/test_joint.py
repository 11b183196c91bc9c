"""Method joint: what it reaches, what it keeps, and what it refuses; `replan` around it."""

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import peakflight as pf
from peakflight import Limits, Status, Trajectory
from peakflight.certificate import certify_plan
from peakflight.limits import keeps, limited_values
from peakflight.methods import joint
from peakflight.methods.idle import MOST_PARTS, idle_times, parts_for

FOLDER = Path(__file__).parent.parent / "examples" / "courses"
LIMITS = Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
COURSES = ("tight_then_fast", "mfbo_traj_2", "random_10", "pmm_slalom", "uzh_19wp")
KNOWN = {
    "degree 7": ({"pieces": 1}, 1.001, (4.420, 4.294, 5.837, 23.570, 45.676)),
    "degree 5": ({"pieces": 1, "degree": 5}, 1.001, (4.384, 4.295, 5.959, 23.959, 46.423)),
    "auto": ({}, 1.005, (4.300, 4.184, 5.681, 22.435, 43.393)),
}
"""Options, allowance, and s: the best known of the class; for auto what no trajectory can beat."""
SAME = 1e-3
"""Relative: what separates two solutions of one problem."""
every_pieces = pytest.mark.parametrize("pieces", [1, "auto"])
hypothetical = settings(max_examples=12, deadline=None, derandomize=True)


def random_course(seed, legs=None, shortest=0.3, longest=3.0):
    """(legs+1, 3) with legs of any direction, their lengths even in the logarithm."""
    rng = np.random.default_rng(seed)
    legs = int(rng.integers(2, 41)) if legs is None else legs
    lengths = np.exp(rng.uniform(np.log(shortest), np.log(longest), size=legs))
    directions = rng.normal(size=(legs, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.cumsum(np.vstack((rng.normal(size=3), lengths[:, None] * directions)), axis=0)


def plan(waypoints, **options):
    return pf.plan(waypoints, **{"method": "joint", "limits": LIMITS, **options})


ENDED = (Status.SOLVED, Status.NO_PROGRESS, Status.ITERATION_LIMIT)
"""How a run may end where limits leave so much open that polynomials do not get to the optimum."""


def check(made, status=(Status.SOLVED,)):
    """Everything that a plan promises, without the certificate's help."""
    problem, trajectory = made.problem, made.trajectory
    assert made.status in status, made.message
    assert made.feasible
    assert certify_plan(made).to_dict() == made.report.to_dict()
    assert len(made.pieces) == len(problem.waypoints) - 1
    assert min(made.pieces) >= 1
    assert sum(made.pieces) == len(trajectory) == len(made.segment_times)
    for name, limit in problem.limits.to_dict().items():
        values = limited_values([trajectory.sample(100, order) for order in range(1, 5)])[name]
        least = name.startswith("least")
        worst = values.min() if least else values.max()
        assert keeps(name, worst, limit * (1.0 - 1e-12 if least else 1.0 + 1e-12)), name
    size = 1.0 + np.abs(problem.waypoints).max()
    passed = trajectory(made.waypoint_times)
    np.testing.assert_allclose(passed, problem.waypoints, rtol=0, atol=1e-9 * size)
    shortest = trajectory.segment_times.min()
    for order in range(problem.spline_class.continuity + 1):
        ends = trajectory.sample(2, order)
        jumps = np.abs(ends[1:, 0] - ends[:-1, 1])
        assert (jumps <= 1e-7 * (np.abs(ends).max() + size / shortest**order)).all()
    return made


def integral_of_square(trajectory, order):
    """Of a derivative over the flight, by Gauss-Legendre: exact to degree 23."""
    u, weights = np.polynomial.legendre.leggauss(12)
    return sum(
        0.5 * duration * weights @ (trajectory.at(k, 0.5 * (u + 1.0) * duration, order) ** 2).sum(1)
        for k, duration in enumerate(trajectory.segment_times)
    )


# ---- how fast -------------------------------------------------------------------------------


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("name", KNOWN)
def test_public_courses_are_flown_in_the_best_times_known(course, name):
    options, allowance, durations = KNOWN[name]
    best = durations[COURSES.index(course)]
    waypoints = pf.read_course(FOLDER / f"{course}.json").waypoints
    made = check(plan(waypoints, **options))
    assert made.method == "joint"
    assert made.message == ""
    assert made.duration <= allowance * best
    assert made.duration >= best * (1.0 - 1e-3)  # or it would not be the best of its class
    assert made.trajectory.degree == made.problem.degree == options.get("degree", 7)
    assert made.problem.continuity == (made.trajectory.degree - 1) // 2
    if name == "auto":
        assert sum(made.pieces) > len(made.pieces)
    else:
        assert set(made.pieces) == {1}


@every_pieces
@pytest.mark.parametrize("seed", range(14))
def test_random_courses_are_flown_faster_than_by_peak(seed, pieces):
    """From 2 to 40 legs of 5 cm to 20 m, even in the logarithm."""
    waypoints = random_course(seed, None, 0.05, 20.0)
    known = Status.SOLVED, Status.ITERATION_LIMIT, Status.NO_PROGRESS
    made = check(plan(waypoints, pieces=pieces), status=known)
    assert made.duration <= pf.plan(waypoints, method="peak", limits=LIMITS).duration


@pytest.mark.parametrize(
    ("seed", "pieces"),
    [
        *((seed, 1) for seed in range(14)),
        *((seed, "auto") for seed in range(14)),
    ],
)
def test_three_starts_end_in_the_same_place(seed, pieces):
    waypoints = random_course(seed, None, 0.05, 20.0)
    durations = [
        check(plan(waypoints, pieces=pieces, initial=initial), status=ENDED).duration
        for initial in joint.STARTS
    ]
    assert max(durations) <= 1.01 * min(durations)


def test_more_pieces_are_faster():
    for seed in range(3):
        waypoints = random_course(seed, 6)
        durations = [check(plan(waypoints, pieces=n)).duration for n in (1, 2, 3, "auto")]
        assert durations[0] > max(durations[1:])
        assert durations[1] >= durations[2] * (1.0 - SAME)
        assert durations[3] <= durations[2] * (1.0 + 2e-3)  # the allowance of idle time, twice


@pytest.mark.parametrize("pieces", [1, "auto"])
@pytest.mark.parametrize(
    ("degree", "continuity"),
    [(3, 1), (4, 1), (5, 2), (6, 2), (7, 2), (7, 3), (8, 3), (9, 4), (10, 4), (11, 5)],
)
def test_degrees_and_continuities(degree, continuity, pieces):
    made = check(plan(random_course(3, 6), degree=degree, continuity=continuity, pieces=pieces))
    assert made.trajectory.degree == degree
    ends = made.trajectory.sample(2, continuity + 1)
    assert np.abs(ends[1:, 0] - ends[:-1, 1]).max() > 1e-3  # free where it need not be smooth


def test_less_continuity_is_no_slower():
    waypoints = random_course(3, 6)
    durations = [
        check(plan(waypoints, pieces=1, degree=7, continuity=c)).duration for c in (1, 2, 3)
    ]
    assert durations[0] <= durations[1] * (1.0 + SAME)
    assert durations[1] <= durations[2] * (1.0 + SAME)


@pytest.mark.parametrize("degree", [5, 7])
def test_one_leg_of_one_piece_is_known(degree):
    """Rest to rest is one polynomial: its peaks are known in closed form."""
    made = check(plan([[0.0, 0, 1], [3.0, 0, 1]], pieces=1, degree=degree))
    powers = {5: {3: 10, 4: -15, 5: 6}, 7: {4: 35, 5: -84, 6: 70, 7: -20}}[degree]
    p = np.polynomial.Polynomial([powers.get(j, 0) for j in range(8)])
    u = np.linspace(0.0, 1.0, 100_001)
    v, a, j, s = (3.0 * np.abs(p.deriv(order)(u)).max() for order in range(1, 5))
    level = math.sqrt(15.5**2 - pf.GRAVITY**2)
    needed = max(v / 5.0, math.sqrt(a / level), (j / 62.0) ** (1 / 3), (s / 800.0) ** (1 / 4))
    assert made.duration == pytest.approx(needed, rel=1e-8)


@pytest.mark.parametrize(
    ("name", "limit", "order"),
    [
        ("speed", 2.0, 1),
        ("jerk", 30.0, 3),
        ("snap", 200.0, 4),
    ],
)
def test_one_limit_alone_on_a_straight_leg_is_known(name, limit, order):
    """No motion from rest to rest is faster than d (n-1)! = 4 L (T/4)^n, and pieces approach it.

    Not so for thrust: a path that dips has more of it for the way ahead.
    """
    made = check(plan([[0.0, 0, 1], [3.0, 0, 1]], limits=Limits(**{name: limit})))
    bound = 4.0 * (3.0 * math.factorial(order - 1) / (4.0 * limit)) ** (1.0 / order)
    assert made.duration >= bound * (1.0 - 1e-9)
    assert made.duration <= bound * 1.005


def test_joint_is_the_default_method():
    assert pf.plan(random_course(0, 2), limits=LIMITS).method == "joint"


def test_planning_twice_gives_the_same():
    first, second = (plan(random_course(0, 8)) for _ in range(2))
    np.testing.assert_array_equal(first.trajectory.coefficients, second.trajectory.coefficients)


# ---- pieces ---------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3, 5, np.int64(2)])
def test_a_number_of_pieces_is_what_each_leg_has(count):
    made = check(plan(random_course(1, 4), pieces=count))
    assert made.pieces == (count,) * 4
    assert made.history.segment_times.shape[1] == 4 * count


@pytest.mark.parametrize("most", [6, 7, 10, 15, 31])
def test_no_more_pieces_than_the_vehicle_holds(most):
    waypoints = random_course(3, 6)
    free = plan(waypoints)
    made = check(plan(waypoints, max_pieces=most))
    assert sum(made.pieces) <= most
    assert made.duration >= free.duration * (1.0 - SAME)
    if most == 6:
        assert made.duration == pytest.approx(plan(waypoints, pieces=1).duration, rel=SAME)


def test_more_room_for_pieces_is_faster():
    waypoints = random_course(3, 6)
    durations = [plan(waypoints, max_pieces=most).duration for most in (6, 8, 12, 20)]
    assert durations == sorted(durations, reverse=True)


def test_no_more_pieces_than_the_vehicle_holds_from_a_plan_that_has_more():
    waypoints = random_course(3, 6)
    last = plan(waypoints, pieces=3)
    made = check(pf.replan(last, max_pieces=12))
    assert sum(made.pieces) <= 12


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"max_pieces": 5}, "max_pieces is 5; the course has 6 legs, and each needs one"),
        ({"max_pieces": 17, "pieces": 3},
         "3 pieces in each of 6 legs are 18; max_pieces is 17"),
    ],
)  # fmt: skip
def test_too_little_room_for_pieces_is_refused(options, message):
    with pytest.raises(pf.InvalidProblem, match=f"^{message}$"):
        plan(random_course(3, 6), **options)


# ---- effort ---------------------------------------------------------------------------------


@pytest.mark.parametrize("minimize", ["jerk", "snap"])
def test_effort_goes_from_the_fastest_to_the_smoothest(minimize):
    waypoints, order = random_course(3, 6), {"jerk": 3, "snap": 4}[minimize]
    weights = np.array([0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1.0, 100.0])
    made = [check(plan(waypoints, pieces=1, minimize=minimize, effort=w)) for w in weights]
    durations = np.array([each.duration for each in made])
    efforts = np.array([integral_of_square(each.trajectory, order) for each in made])
    assert (np.diff(durations) > -SAME * durations[1:]).all()
    assert (np.diff(efforts) < SAME * efforts[1:]).all()
    assert durations[0] <= durations.min() * (1.0 + SAME)
    assert durations[-1] > 5.0 * durations[0]
    assert efforts[-1] < 1e-3 * efforts[0]
    # each is the best by its own weight
    for weight, duration, effort in zip(weights, durations, efforts, strict=True):
        own = duration + weight * effort
        assert own <= (durations + weight * efforts).min() * (1.0 + SAME)


@pytest.mark.parametrize("minimize", ["jerk", "snap"])
def test_much_effort_takes_its_known_part_of_the_time(minimize):
    """Far below the limits T + w c / T^n is least, with n = 2 order - 1: the effort is T / n."""
    order = {"jerk": 3, "snap": 4}[minimize]
    made = check(plan(random_course(3, 6), pieces=1, minimize=minimize, effort=10.0))
    effort = 10.0 * integral_of_square(made.trajectory, order)
    # flat near the optimum: 1e-4 of the objective are some 1e-2 of the duration
    assert effort == pytest.approx(made.duration / (2 * order - 1), rel=0.2)
    assert made.report.worst < 1.0  # hover alone is a good part of the thrust limit


def test_effort_with_pieces_and_a_moving_start():
    waypoints, start = random_course(3, 6), {"velocity": [1.0, 0.5, 0.0]}
    fast, smooth = (
        check(plan(waypoints, max_pieces=12, start=start, effort=w)) for w in (0.0, 1e-3)
    )
    assert smooth.duration > fast.duration
    assert integral_of_square(smooth.trajectory, 3) < 0.5 * integral_of_square(fast.trajectory, 3)


def test_effort_of_what_is_not_limited_is_refused():
    with pytest.raises(pf.InvalidProblem, match="effort is about 1 to 4, velocity to snap"):
        plan(random_course(3, 3), effort=1.0, minimize={5: 1.0}, degree=9, continuity=4)


# ---- limits ---------------------------------------------------------------------------------


@every_pieces
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "extra",
    [{"tilt": 0.4}, {"tilt": 0.4, "least_thrust_acceleration": 7.0}],
    ids="+".join,
)
def test_tilt_and_least_thrust_are_kept_and_bind(extra, seed, pieces):
    waypoints = random_course(seed, 6)
    made = check(plan(waypoints, limits=replace(LIMITS, **extra), pieces=pieces), status=ENDED)
    assert made.duration > 1.05 * plan(waypoints, pieces=pieces).duration
    for name in extra:
        assert made.report.peaks[name].max() > 0.99


@pytest.mark.parametrize(
    ("seed", "pieces"),
    [(seed, pieces) for seed in (0, 1, 2, 3, 7) for pieces in (1, "auto")],
)
def test_least_thrust_alone(seed, pieces):
    limits = replace(LIMITS, least_thrust_acceleration=7.0)
    made = check(plan(random_course(seed, 6), limits=limits, pieces=pieces), status=ENDED)
    assert made.duration < pf.plan(made.problem.waypoints, method="peak", limits=limits).duration
    if made.status is Status.SOLVED and seed != 3:  # which flies so anyway
        assert made.report.peaks["least_thrust_acceleration"].max() > 0.99


@pytest.mark.parametrize("seed", range(8))
def test_never_slower_than_peak_near_hover(seed):
    """Least thrust near hover is hard for an interior point, which often stalls on it."""
    limits = replace(LIMITS, least_thrust_acceleration=8.5)
    waypoints = random_course(seed, 6)
    made = plan(waypoints, limits=limits, pieces=1)
    assert made.feasible
    assert made.duration <= pf.plan(waypoints, method="peak", limits=limits).duration


@every_pieces
@pytest.mark.parametrize(
    "limits",
    [
        {"speed": 2.0},
        {"thrust_acceleration": 12.0},
        {"jerk": 30.0},
        {"snap": 200.0},
        {"speed": 3.0, "tilt": 0.5},
    ],
    ids="+".join,
)
def test_one_or_two_limits(limits, pieces):
    made = check(plan(random_course(7, 5), limits=Limits(**limits), pieces=pieces), status=ENDED)
    assert made.report.worst >= 1.0 - 1e-8
    assert set(made.report.peaks) == set(limits)


@every_pieces
def test_looser_limits_are_faster(pieces):
    waypoints = random_course(5, 6)
    reference = plan(waypoints, pieces=pieces).duration
    for name, limit in LIMITS.to_dict().items():
        loose = plan(waypoints, limits=replace(LIMITS, **{name: 1.5 * limit}), pieces=pieces)
        tight = plan(waypoints, limits=replace(LIMITS, **{name: limit / 1.4}), pieces=pieces)
        assert loose.duration <= reference * (1.0 + SAME)
        assert tight.duration >= reference * (1.0 - SAME)


# ---- motion that is fixed -------------------------------------------------------------------

START = {"velocity": [1.0, 0.5, 0.0], "acceleration": [0.0, 1.0, 2.0]}
END = {"velocity": [0.0, 0.0, -1.0]}


@every_pieces
@pytest.mark.parametrize("degree", [5, 7])
@pytest.mark.parametrize("seed", range(3))
def test_moving_start_and_end(seed, degree, pieces):
    waypoints = random_course(seed, 5, 0.5)
    made = check(plan(waypoints, start=START, end=END, degree=degree, pieces=pieces))
    trajectory = made.trajectory
    assert made.report.state_error < 1e-8
    for order, wanted in enumerate(START.values(), start=1):
        np.testing.assert_allclose(trajectory(0.0, order), wanted, rtol=0, atol=1e-10)
    at_end = trajectory(trajectory.end_time, 1)
    np.testing.assert_allclose(at_end, END["velocity"], rtol=0, atol=1e-9)
    other = pf.plan(waypoints, method="peak", limits=LIMITS, start=START, end=END)
    assert made.duration < other.duration


def test_free_end_is_faster():
    waypoints = random_course(2, 4, 0.5)
    made = check(plan(waypoints, end=[[math.nan] * 3] * 3))
    assert made.duration < plan(waypoints).duration
    assert np.linalg.norm(made.trajectory(made.trajectory.end_time, 1)) > 0.5


@pytest.mark.parametrize("velocity", [[0.0, 0.0, 0.0], [1.0, -0.5, 0.0], [math.nan, 0.0, 0.5]])
def test_fixed_inner_velocity(velocity):
    waypoints = random_course(4, 4, 0.5)
    made = check(plan(waypoints, derivatives={2: {"velocity": velocity}}))
    found = made.trajectory(made.waypoint_times[2], 1)
    np.testing.assert_allclose(
        found, np.where(np.isnan(velocity), found, velocity), rtol=0, atol=1e-9
    )
    assert made.duration > plan(waypoints).duration


def test_the_degree_grows_with_what_is_fixed():
    made = check(plan(random_course(2, 5), start={"snap": [0.0, 0.0, 9.0]}))
    assert made.trajectory.degree == 9
    np.testing.assert_allclose(made.trajectory(0.0, 4), [0, 0, 9.0], rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": {"snap": [0, 0, 9]}, "degree": 7},
         "snap is fixed at a waypoint; method joint fixes up to jerk at degree 7"),
        ({"end": {"jerk": [0, 0, 9]}, "degree": 5},
         "jerk is fixed at a waypoint; method joint fixes up to acceleration at degree 5"),
        ({"derivatives": {1: {"jerk": [1, 0, 0]}}, "degree": 6},
         "jerk is fixed at a waypoint; method joint fixes up to acceleration at degree 6"),
        ({"degree": 7, "continuity": 4},
         "continuity is 4; method joint has up to 3 at degree 7"),
        ({"degree": 5, "continuity": 3},
         "continuity is 3; method joint has up to 2 at degree 5"),
        ({"degree": 6, "continuity": 3},
         "continuity is 3; method joint has up to 2 at degree 6"),
    ],
)  # fmt: skip
def test_what_the_degree_does_not_hold_is_refused(options, message):
    with pytest.raises(pf.InvalidProblem, match=f"^{message}$"):
        plan(random_course(2, 5), **options)


@every_pieces
@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        ({"start": {"velocity": [6, 0, 0]}},
         "the motion fixed at waypoint 0 has speed = 6 against a limit of 5"),
        ({"end": {"acceleration": [0, 0, 9]}},
         "the motion fixed at waypoint 5 has thrust_acceleration = 18.81 against a limit of 15.5"),
        ({"derivatives": {2: {"velocity": [0, 5.5, 0]}}},
         "the motion fixed at waypoint 2 has speed = 5.5 against a limit of 5"),
        ({"start": {"velocity": [600, 0, 0]}},
         "the motion fixed at waypoint 0 has speed = 600 against a limit of 5"),
        ({"start": {"jerk": [0, 90, 0]}},
         "the motion fixed at waypoint 0 has jerk = 90 against a limit of 62"),
    ],
    ids=["start", "end", "inside", "far beyond", "jerk"],
)  # fmt: skip
def test_fixed_motion_beyond_a_limit_is_infeasible(fixed, message, pieces):
    made = plan(random_course(2, 5, 0.5), pieces=pieces, **fixed)
    assert made.status is Status.INFEASIBLE
    assert not made.feasible
    assert made.message.startswith(message)


@pytest.mark.parametrize("initial", ["proportional", "peak"])
def test_starts_that_hold_what_is_fixed(initial):
    """The minimum-jerk spline has no room for a fixed jerk; another one has."""
    start = {"jerk": [0.0, 9.0, 0.0], "velocity": [0.5, 0.0, 0.0]}
    made = check(plan(random_course(2, 5, 0.5), start=start, initial=initial, pieces=1))
    np.testing.assert_allclose(made.trajectory(0.0, 3), start["jerk"], rtol=0, atol=1e-8)
    other = check(plan(random_course(2, 5, 0.5), start=start, pieces=1))
    assert made.duration == pytest.approx(other.duration, rel=1e-2)


def test_fixed_motion_that_leaves_no_way_out_is_infeasible():
    """As fast as allowed, straight away from a waypoint that is near."""
    waypoints = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0]])
    made = plan(waypoints, start={"velocity": [5.0, 0, 0]}, end={"velocity": [0, 0, 5.0]})
    assert made.status in {Status.INFEASIBLE, Status.SOLVED}
    assert made.feasible == (made.status is Status.SOLVED)


# ---- time limits ----------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [0, 1e-9, 1e-3, 0.01, 0.03])
@pytest.mark.parametrize("course", ["uzh_19wp", "random_100"])
def test_out_of_time_there_is_a_plan_all_the_same(course, limit):
    waypoints = pf.read_course(FOLDER / f"{course}.json").waypoints
    plan(waypoints[:3])  # compiled before the clock runs
    began = time.perf_counter()
    made = plan(waypoints, time_limit=limit)
    # last come a few iterations that are not interrupted, and the certificate; machines are busy
    assert time.perf_counter() - began < limit + 1.0
    check(made, status=(Status.TIME_LIMIT, Status.SOLVED))
    if limit < 1e-6:
        assert made.status is Status.TIME_LIMIT


def test_more_time_is_no_slower():
    waypoints = pf.read_course(FOLDER / "random_100.json").waypoints
    durations = [plan(waypoints, time_limit=limit).duration for limit in (0.0, 60.0)]
    assert durations[1] < durations[0]
    assert check(plan(waypoints, time_limit=60.0)).duration == durations[1]


def test_a_time_limit_that_is_not_reached_changes_nothing_much():
    waypoints = random_course(5, 8)
    made = check(plan(waypoints, time_limit=60.0))
    assert made.duration == pytest.approx(plan(waypoints).duration, rel=SAME)


@pytest.mark.parametrize("limit", [0.0, 0.002])
@pytest.mark.parametrize("seed", range(3))
def test_out_of_time_with_a_moving_start(seed, limit):
    waypoints = random_course(seed, 5, 0.5)
    made = plan(waypoints, start=START, end=END, time_limit=limit)
    check(made, status=(Status.TIME_LIMIT, Status.SOLVED))


# ---- settings -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pieces": 0}, "setting pieces is 0; it must be from 1 to 1000"),
        ({"pieces": "many"}, "setting pieces is 'many'; it must be auto or a whole number"),
        ({"pieces": True}, "setting pieces is True; it must be a whole number"),
        ({"pieces": 1.5}, "setting pieces is 1.5; it must be a whole number"),
        ({"pieces": None}, "setting pieces is None; it must be a whole number"),
        ({"max_pieces": 0}, "setting max_pieces is 0; it must be from 1"),
        ({"max_pieces": 7.5}, "setting max_pieces is 7.5; it must be a whole number"),
        ({"max_pieces": "x"}, "setting max_pieces is 'x'; it must be a whole number"),
        ({"effort": math.nan}, "setting effort is nan; it must be from 0"),
        ({"effort": -1.0}, "setting effort is -1.0; it must be from 0"),
        ({"effort": "x"}, "setting effort is 'x'; it must be from 0"),
        ({"initial": "x"},
         "setting initial is 'x'; it must be guess, proportional, peak or a plan"),
        ({"initial": None}, "setting initial is None; it must be guess"),
        ({"initial": np.zeros(3)}, "setting initial is array"),
        ({"time_limit": -1.0}, "setting time_limit is -1.0; it must be from 0"),
        ({"time_limit": math.nan}, "setting time_limit is nan; it must be from 0"),
        ({"tolerance": 0.0}, "setting tolerance is 0.0; it must be from 1e-09 to 0.1"),
        ({"tolerance": None}, "setting tolerance is None; it must be from 1e-09 to 0.1"),
        ({"idle_tolerance": 2.0}, "setting idle_tolerance is 2.0; it must be from 1e-06 to 1"),
        ({"iterations": 0}, "setting iterations is 0; it must be from 1"),
        ({"iterations": 2.5}, "setting iterations is 2.5; it must be a whole number"),
        ({"peices": 1}, "unknown option 'peices'"),
    ],
)  # fmt: skip
def test_settings_that_make_no_sense_are_refused(options, message):
    waypoints = random_course(3, 6)
    with pytest.raises(pf.InvalidProblem, match=f"^{message}"):
        plan(waypoints, **options)
    if "peices" not in options:
        with pytest.raises(pf.InvalidProblem, match=f"^{message}"):
            joint.Settings(**options)


def test_settings_are_options_of_plan():
    waypoints = random_course(3, 4)
    problem = pf.Problem(waypoints, limits=LIMITS)
    by_settings = plan(waypoints, settings=joint.Settings(pieces=2))
    others = [
        plan(waypoints, pieces=2),
        pf.plan(problem, method="joint", pieces=2),
        pf.plan(problem, method="joint", settings=joint.Settings(pieces=2)),
        plan(waypoints, pieces=2, settings=joint.Settings(pieces=3)),
    ]
    for other in others:
        assert other.pieces == (2,) * 4
        assert other.settings == {"pieces": 2}
        np.testing.assert_array_equal(
            other.trajectory.coefficients, by_settings.trajectory.coefficients
        )


def test_options_of_another_method_are_named():
    waypoints = random_course(3, 4)
    problem = pf.Problem(waypoints, limits=LIMITS)
    with pytest.raises(pf.InvalidProblem, match=r"^unknown option 'pieces'"):
        pf.plan(waypoints, limits=LIMITS, method="peak", pieces=1)
    with pytest.raises(pf.InvalidProblem, match=r"^unknown option 'pieces'"):
        pf.plan(problem, method="peak", pieces=1)
    with pytest.raises(pf.InvalidProblem, match=r"^unknown option 'wings'"):
        pf.plan(problem, method="joint", pieces=1, wings=2)
    with pytest.raises(pf.InvalidProblem, match=r"^degree given beside a Problem"):
        pf.plan(problem, method="joint", degree=5)


def test_few_iterations_say_so():
    made = plan(random_course(3, 6), iterations=2, pieces=1)
    check(made, status=(Status.ITERATION_LIMIT, Status.NO_PROGRESS))
    assert made.duration <= pf.plan(random_course(3, 6), method="peak", limits=LIMITS).duration


@pytest.mark.parametrize("degree", [3, 5, 7, 9, 11])
def test_falling_back_holds_what_the_degree_fixes(degree):
    """Rest is more derivatives at higher degrees: the spline of peak must have room for them."""
    made = plan(random_course(3, 6), degree=degree, iterations=1, pieces=1)
    check(made, status=(Status.ITERATION_LIMIT, Status.NO_PROGRESS))
    for order in range(1, (degree - 1) // 2 + 1):
        ends = made.trajectory([0.0, made.trajectory.end_time], order)
        size = np.abs(made.trajectory.sample(9, order)).max()
        np.testing.assert_allclose(ends, 0.0, rtol=0, atol=1e-7 * size)


# ---- planning again -------------------------------------------------------------------------

both_methods = pytest.mark.parametrize("method", ["joint", "peak"])


def loaded(made, folder):
    made.save(folder / "plan.json")
    return pf.Plan.load(folder / "plan.json")


@both_methods
@pytest.mark.parametrize("from_file", [False, True], ids=["at once", "from a file"])
@pytest.mark.parametrize("seed", range(3))
def test_replan_after_a_waypoint_has_moved(method, seed, from_file, tmp_path):
    waypoints = random_course(seed, 8)
    last = pf.plan(waypoints, method=method, limits=LIMITS)
    if from_file:
        last = loaded(last, tmp_path)
    moved = waypoints.copy()
    moved[3] += [0.03, -0.03, 0.02]
    made = check(pf.replan(last, waypoints=moved))
    assert made.method == method
    assert made.pieces == last.pieces
    np.testing.assert_array_equal(made.problem.waypoints, moved)
    fresh = pf.plan(moved, method=method, limits=LIMITS)
    assert made.duration <= fresh.duration * 1.002  # the pieces are those of the last plan


@every_pieces
def test_replanning_takes_fewer_iterations(pieces):
    again, anew = 0, 0
    for seed in range(10):
        waypoints = random_course(seed, 10)
        last = plan(waypoints, pieces=pieces)
        waypoints[3] += [0.03, -0.03, 0.02]
        again += check(pf.replan(last, waypoints=waypoints, pieces=pieces), ENDED).iterations
        anew += check(plan(waypoints, pieces=pieces), ENDED).iterations
    assert again < 0.8 * anew


@both_methods
@pytest.mark.parametrize("change", [{"speed": 4.0, "jerk": 50.0}, {"tilt": 0.5}, {"snap": None}])
def test_replan_after_a_limit_has_changed(method, change):
    waypoints = random_course(3, 6)
    limits = replace(LIMITS, **change)
    made = check(pf.replan(pf.plan(waypoints, method=method, limits=LIMITS), limits=limits))
    assert made.problem.limits == limits
    fresh = pf.plan(waypoints, method=method, limits=limits)
    assert made.duration <= 1.005 * fresh.duration  # the pieces are those of the last plan


@both_methods
def test_replan_after_a_waypoint_was_added_or_left_out(method, tmp_path):
    waypoints = random_course(3, 6)
    last = pf.plan(waypoints, method=method, limits=LIMITS)
    more = np.insert(waypoints, 3, waypoints[2:4].mean(axis=0) + 0.1, axis=0)
    for other in (more, waypoints[:-1]):
        for plan_ in (last, loaded(last, tmp_path)):
            made = check(pf.replan(plan_, waypoints=other))
            assert len(made.pieces) == len(other) - 1
            fresh = pf.plan(other, method=method, limits=LIMITS)
            assert made.duration == pytest.approx(fresh.duration, rel=SAME)


@both_methods
def test_replan_of_the_same(method, tmp_path):
    waypoints = random_course(3, 6)
    last = pf.plan(waypoints, method=method, limits=LIMITS, yaw=np.arange(7.0))
    for plan_ in (last, loaded(last, tmp_path)):
        made = check(pf.replan(plan_))
        assert made.duration == pytest.approx(last.duration, rel=SAME)
        np.testing.assert_array_equal(made.problem.yaw, np.arange(7.0))


@both_methods
def test_replan_far_away_and_with_another_start(method):
    waypoints = random_course(3, 6)
    last = pf.plan(waypoints, method=method, limits=LIMITS)
    far = waypoints + np.random.default_rng(0).normal(size=waypoints.shape)
    made = check(pf.replan(last, waypoints=far))
    fresh = pf.plan(far, method=method, limits=LIMITS)
    assert made.duration <= 1.01 * fresh.duration
    moving = check(pf.replan(last, start={"velocity": [1.0, 0.0, 0.0]}))
    np.testing.assert_allclose(moving.trajectory(0.0, 1), [1.0, 0.0, 0.0], atol=1e-10)
    check(pf.replan(moving, waypoints=far))


@both_methods
def test_replan_refuses_what_it_does_not_know(method):
    last = pf.plan(random_course(3, 3), method=method, limits=LIMITS)
    with pytest.raises(pf.InvalidProblem, match=r"^unknown option 'wings'"):
        pf.replan(last, wings=2)
    with pytest.raises(pf.InvalidProblem, match=r"^waypoint 1 repeats waypoint 0"):
        pf.replan(last, waypoints=np.zeros((3, 3)))


def test_replan_takes_settings_of_joint():
    waypoints = random_course(3, 6)
    last = plan(waypoints)
    assert pf.replan(last, pieces=1).pieces == (1,) * 6
    assert pf.replan(last, time_limit=0.0).status is Status.TIME_LIMIT
    for initial in ("proportional", "peak"):
        again = check(pf.replan(last, initial=initial))
        assert again.duration == pytest.approx(last.duration, rel=SAME)


def test_joint_begins_from_a_plan_of_peak():
    waypoints = random_course(3, 6)
    other = pf.plan(waypoints, method="peak", limits=LIMITS)
    made = check(plan(waypoints, initial=other))
    assert made.duration == pytest.approx(plan(waypoints).duration, rel=SAME)


# ---- properties -----------------------------------------------------------------------------

courses = st.builds(random_course, st.integers(0, 10_000), st.integers(1, 6))


@every_pieces
@hypothetical
@given(courses, st.tuples(*[st.floats(-50.0, 50.0)] * 3))
def test_moving_a_course_changes_no_time(pieces, waypoints, offset):
    here = plan(waypoints, pieces=pieces).duration
    assert plan(waypoints + offset, pieces=pieces).duration == pytest.approx(here, rel=SAME)


@every_pieces
@hypothetical
@given(courses, st.floats(-math.pi, math.pi))
def test_turning_a_course_about_the_vertical_changes_no_time(pieces, waypoints, angle):
    c, s = math.cos(angle), math.sin(angle)
    turned = waypoints @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    here = plan(waypoints, pieces=pieces).duration
    assert plan(turned, pieces=pieces).duration == pytest.approx(here, rel=SAME)


@every_pieces
@hypothetical
@given(courses)
def test_a_course_flown_backwards_takes_as_long(pieces, waypoints):
    there = plan(waypoints, pieces=pieces).duration
    assert plan(waypoints[::-1], pieces=pieces).duration == pytest.approx(there, rel=SAME)


@every_pieces
@hypothetical
@given(courses, st.floats(0.5, 2.0), st.floats(0.5, 2.0))
def test_time_and_length_have_no_scale_without_gravity(pieces, waypoints, longer, slower):
    """Lengths times a factor, limits with them; and derivative s over the s-th power of another."""
    limits = {"speed": 3.0, "jerk": 60.0, "snap": 800.0}
    here = plan(waypoints, limits=Limits(**limits), pieces=pieces).duration
    scaled = Limits(
        **{
            name: limit * longer / slower**order
            for (name, limit), order in zip(limits.items(), (1, 3, 4), strict=True)
        }
    )
    there = plan(longer * waypoints, limits=scaled, pieces=pieces).duration
    assert there == pytest.approx(slower * here, rel=SAME)


# ---- subdivision ----------------------------------------------------------------------------


@pytest.mark.parametrize("parts", [1, 3, [1, 2, 5], np.array([4, 1, 1], dtype=np.int32)])
@pytest.mark.parametrize("degree", [3, 7, 8])
def test_subdivision_is_the_same_motion(degree, parts):
    rng = np.random.default_rng(degree)
    times = rng.uniform(0.5, 1.5, size=3)
    whole = Trajectory(rng.normal(size=(3, degree + 1, 3)), times, 2.0)
    cut = whole.subdivide(parts)
    counts = np.broadcast_to(parts, 3)
    assert len(cut) == counts.sum()
    assert cut.degree == degree
    assert cut.start_time == 2.0
    np.testing.assert_allclose(cut.segment_times, np.repeat(times / counts, counts), rtol=1e-15)
    np.testing.assert_allclose(
        cut.breakpoints[np.append(0, np.cumsum(counts))], whole.breakpoints, rtol=1e-14
    )
    parent = np.repeat(np.arange(3), counts)
    offset = np.concatenate([np.arange(n) * t / n for n, t in zip(counts, times, strict=True)])
    terms = Trajectory(np.abs(whole.coefficients), times)  # rounding has their size
    for order in range(degree + 2):
        for u in np.linspace(0.0, 1.0, 5):
            local = u * cut.segment_times
            size = terms.at(parent, offset + local, order)
            error = np.abs(
                cut.at(np.arange(len(cut)), local, order) - whole.at(parent, offset + local, order)
            )
            assert (error <= 1e-13 * size).all()


def test_subdivision_into_one_part_changes_no_bit():
    made = plan(random_course(0, 4), pieces=1).trajectory
    np.testing.assert_array_equal(made.subdivide(1).coefficients, made.coefficients)


@pytest.mark.parametrize("parts", [0, -1, 1.5, 2.0, [1, 0, 2], [1.0, 2.0, 1.0], True, "2"])
def test_subdivision_into_what_is_not_a_number_of_parts_is_refused(parts):
    whole = Trajectory(np.ones((3, 4, 3)), np.ones(3))
    with pytest.raises(ValueError, match="parts must be whole numbers from 1"):
        whole.subdivide(parts)


def test_subdivision_needs_parts_for_every_piece():
    with pytest.raises(ValueError, match=r"\(2,\)"):
        Trajectory(np.ones((3, 4, 3)), np.ones(3)).subdivide([1, 2])


# ---- idle time ------------------------------------------------------------------------------


def monomial(power, factor, seconds=2.0):
    """One piece along a direction: its derivative of order `power` is constant, of this size."""
    direction = np.array([2.0, -1.0, 2.0]) / 3.0
    coefficients = np.zeros((1, 5, 3))
    coefficients[0, power] = factor / math.factorial(power) * direction
    return Trajectory(coefficients, [seconds])


@pytest.mark.parametrize(
    ("name", "order"), [("speed", 1), ("jerk", 3), ("snap", 4)], ids=["speed", "jerk", "snap"]
)
def test_there_is_no_idle_time_at_a_limit(name, order):
    at_limit = idle_times(monomial(order, 3.0), Limits(**{name: 3.0}))
    np.testing.assert_allclose(at_limit, [0.0], atol=1e-14)
    # a third slower: derivatives are 1.5^-order of the limit, and a third of the time is idle
    slow = idle_times(monomial(order, 3.0 / 1.5**order), Limits(**{name: 3.0}))
    np.testing.assert_allclose(slow, [2.0 / 3.0], rtol=1e-12)
    beyond = idle_times(monomial(order, 5.0), Limits(**{name: 3.0}))
    np.testing.assert_allclose(beyond, [0.0], atol=1e-14)


def test_idle_time_is_about_the_limit_that_is_nearest():
    motion = monomial(1, 3.0)
    assert idle_times(motion, Limits(speed=3.0, jerk=1.0))[0] == pytest.approx(0.0, abs=1e-14)
    assert idle_times(motion, Limits(speed=6.0, jerk=1.0))[0] == pytest.approx(1.0)
    least = Limits(speed=6.0, least_thrust_acceleration=pf.GRAVITY / 1.44)  # in square roots
    assert idle_times(motion, least)[0] == pytest.approx(2.0 * (1.0 - 1.0 / 1.2))
    hover = Trajectory(np.zeros((1, 2, 3)), [2.0])
    assert idle_times(hover, Limits(speed=6.0))[0] == pytest.approx(2.0)


def test_idle_time_of_plans_falls_with_pieces():
    waypoints = random_course(3, 6)
    idle = [
        idle_times(made.trajectory, LIMITS).sum() / made.duration
        for made in (plan(waypoints, pieces=1), plan(waypoints))
    ]
    assert 0.0 < idle[1] < 0.2 * idle[0]


def test_parts_are_as_many_as_the_allowance_asks_for():
    rng = np.random.default_rng(0)
    for _ in range(50):
        idle = rng.uniform(0.0, 1.0, size=8) ** 3
        parts = parts_for(idle, 0.3, None)
        assert parts.dtype == np.int64
        assert parts.min() >= 1
        assert parts.max() <= MOST_PARTS
        assert (parts[np.argsort(idle)] == np.sort(parts)).all()  # more where more is idle
        if parts.max() < MOST_PARTS:  # rounded, so only about
            assert (idle / parts**2).sum() < 2.0 * 0.3
        finer = parts_for(idle, 0.03, None)
        assert (finer >= parts).all()


def test_parts_are_no_more_than_allowed():
    rng = np.random.default_rng(1)
    for _ in range(50):
        idle = rng.uniform(0.0, 1.0, size=8) ** 3
        wanted = parts_for(idle, 1e-3, None).sum()
        totals = [parts_for(idle, 1e-3, most).sum() for most in range(8, 40)]
        assert all(total <= most for total, most in zip(totals, range(8, 40), strict=True))
        assert totals == sorted(totals)
        assert totals[0] == 8
        assert totals[-1] == wanted
        # idle times differ, so that pieces come one by one, but where rounding takes two at once
        assert sum(t == min(m, wanted) for t, m in zip(totals, range(8, 40), strict=True)) > 28


def test_legs_alike_share_what_there_is():
    for most in range(8, 33):
        parts = parts_for(np.full(8, 0.5), 1e-4, most)
        assert parts.sum() == most
        assert parts.max() - parts.min() <= 1


def test_nothing_idle_needs_no_parts():
    np.testing.assert_array_equal(parts_for(np.zeros(4), 0.1, None), [1, 1, 1, 1])
    np.testing.assert_array_equal(parts_for(np.array([0.0, -1e-20]), 0.1, 2), [1, 1])
