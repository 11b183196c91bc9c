"""Turning about the thrust: the free nose, limits about the body, and rotors with a yaw."""

import json
import math
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import peakflight as pf
from peakflight.errors import InvalidProblem
from peakflight.kernels import lines, twisting
from peakflight.kernels.jit import kernel
from peakflight.limits import GRAVITY, KINDS, ROTORS, limited_values
from peakflight.trajectory import Trajectory
from peakflight.twist import turning_about_z, untwisted
from peakflight.twist_certificate import TOLERANCE, _cut, certify_twist
from peakflight.vehicle import Vehicle
from peakflight.yaw import BODY_KINDS

COURSES = Path(__file__).parent.parent / "examples" / "courses"
RACER = pf.find_vehicle("racing-quad").on_rotors()
ODD = Vehicle(
    name="odd",
    mass=0.5,
    inertia=(2.0e-3, 2.3e-3, 3.5e-3),
    rotor_positions=((0.1, -0.1), (-0.1, -0.1), (-0.1, 0.1), (0.1, 0.1)),
    spins=(-1, 1, -1, 1),
    rotor_thrust=(0.05, 4.0),
    torque_per_thrust=0.02,
    motor_lag=0.02,
    drag=(0.2, 0.35),
    limits=pf.Limits(speed=8.0),
).on_rotors()
"""Everything that rotor limits count: drag along and across, and unequal inertia."""
WAYPOINTS = np.array([[0, 0, 1], [3, 0.5, 1.6], [3.5, 3, 1.0], [0.5, 3.5, 2.0], [0, 1, 1]], float)


def course(name):
    return pf.read_course(COURSES / f"{name}.json").waypoints


def seen(plan, rate=1e4):
    """What an independent model of the vehicle does along a plan, sampled."""
    count = int(plan.duration * rate)
    times = np.linspace(plan.trajectory.start_time, plan.trajectory.end_time, count)
    return pf.planned_states(plan, times)


def assert_as_seen(plan):
    """Feasible, and what is certified lies above what samples show, but not far."""
    assert plan.report.feasible, plan.message
    states, limits = seen(plan), plan.problem.limits
    least, most = limits.least_rotor_thrust, limits.rotor_thrust
    assert states.rotor_thrust.max() <= most * (1.0 + 1e-9)
    assert states.rotor_thrust.min() >= least - 1e-9 * most
    about_z = (states.body_rate[:, 2], states.angular_acceleration[:, 2])
    for kind, values in zip(BODY_KINDS, about_z, strict=True):
        limit = plan.problem.heading.limits.get(kind)
        if limit is not None:
            reached = np.abs(values).max() / limit
            kappa = plan.report.peaks[kind.name].max()
            # samples miss what lasts less than 0.1 ms, and both are rounded
            assert reached * (1.0 - 1e-9) - 1e-9 <= kappa <= reached * 1.01 + 2.0 * TOLERANCE
    again = pf.Plan.from_dict(json.loads(json.dumps(plan.to_dict())))
    assert pf.certify_plan(again).to_dict() == plan.report.to_dict()


# ---- arithmetic on lines ----------------------------------------------------------------------


@kernel
def one_over_root(line):
    return lines.inverse_root((line[0], line[1], line[2]))


@pytest.mark.kernels
def test_inverse_root_holds_all_along_the_line():
    rng = np.random.default_rng(1)
    for _ in range(300):
        centre, slope, radius = 10.0 ** rng.uniform(-3, 3), rng.normal(), 10.0 ** rng.uniform(-9, 0)
        line = np.array([centre, 0.4 * slope * centre, 0.1 * radius * centre])
        root = one_over_root(line)
        if not root[2] < np.inf:
            assert abs(line[1]) + line[2] >= 0.99 * centre
            continue
        at = np.linspace(-1.0, 1.0, 41)
        for side in (-1.0, 1.0):
            values = 1.0 / np.sqrt(line[0] + line[1] * at + side * line[2])
            assert (np.abs(values - (root[0] + root[1] * at)) <= root[2] * (1.0 + 1e-12)).all()


# ---- the free nose ----------------------------------------------------------------------------


@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda vehicle: vehicle.name)
def test_a_free_nose_does_not_turn_about_the_thrust(vehicle):
    made = pf.plan(WAYPOINTS, vehicle=vehicle)
    assert made.problem.heading.policy == "free"
    rates = seen(made).body_rate
    assert np.abs(rates[:, 2]).max() <= 1e-3 * np.abs(rates).max()
    assert_as_seen(made)


def test_the_free_yaw_is_better_on_finer_parts():
    flight = pf.plan(WAYPOINTS, vehicle=RACER).trajectory
    times = np.linspace(flight.start_time, flight.end_time, 5000)
    worst = []
    for parts in (10, 20, 40):
        yaw = untwisted(flight, np.full(len(flight), parts), RACER.airframe)
        worst.append(np.abs(turning_about_z(flight, yaw, times, RACER.airframe)[0]).max())
    # the fifth power of the parts, at least the third over joints and short pieces
    assert worst[1] <= worst[0] / 8.0
    assert worst[2] <= worst[1] / 8.0


def test_parts_are_halved_where_the_thrust_swings_past_straight_down():
    """Down at more than gravity, past the vertical: the yaw swings round."""
    lean = np.array([[0, 0, 0], [0.3, 0, 0], [0, 1.0, -GRAVITY / 2 - 2.5], [3.0, 0, 0]], float)
    flight = Trajectory(lean[None], [0.4])
    times = np.linspace(0.0, 0.4, 4001)
    worst, parts = [], []
    for closeness in (np.inf, 1e-1, 1e-4):
        yaw = untwisted(flight, np.array([4]), None, closeness=closeness)
        worst.append(np.abs(turning_about_z(flight, yaw, times, None)[1]).max())
        parts.append(len(yaw))
        for order in range(2):
            ends = yaw.at(np.arange(len(yaw)), yaw.segment_times, order)[:-1]
            begins = yaw.at(np.arange(1, len(yaw)), np.zeros(len(yaw) - 1), order)
            assert np.abs(ends - begins).max() <= 1e-9 * (1.0 + np.abs(begins).max())
    assert parts[0] == 4 < parts[1] < parts[2]
    assert worst[0] > 1.0
    assert worst[1] <= 2.0 * 1e-1  # looked at in three places of each part
    assert worst[2] <= 2.0 * 1e-4


def test_a_reserve_of_hardly_anything_is_a_limit():
    """Rotors that may stop: what is set aside may be less than the least that a limit can be."""
    spared = RACER.limits.sparing({"least_rotor_thrust": 1e-9})
    assert 0.0 < spared.least_rotor_thrust <= 1e-6


def test_straight_up_the_nose_stays():
    made = pf.plan([[0, 0, 0], [0, 0, 2]], vehicle=RACER)
    assert not made.yaw_motion.coefficients.any()
    assert made.report.feasible


def random_motion(rng, count):
    """(4, count, 3) derivatives 1 to 4 of the sizes that they have in fast flight."""
    return rng.normal(size=(4, count, 3)) * np.array([4.0, 7.0, 60.0, 900.0])[:, None, None]


def swing_of(derivatives, vehicle):
    """Thrust over mass, b, and its angular velocity and acceleration, from derivatives of b."""
    velocity, acceleration, jerk, snap = derivatives
    across, along = np.array(vehicle.drag) / vehicle.mass
    force = acceleration + np.array([0.0, 0.0, GRAVITY]) + across * velocity
    change, bent = jerk + across * acceleration, snap + across * jerk
    size = np.linalg.norm(force, axis=1, keepdims=True)
    b = force / size
    growth = (b * change).sum(axis=1, keepdims=True)
    first = (change - growth * b) / size
    bend = (first * change + b * bent).sum(axis=1, keepdims=True)
    second = (bent - bend * b - 2.0 * growth * first) / size
    thrust = size[:, 0] + (along - across) * (b * velocity).sum(axis=1)
    return thrust, b, np.cross(b, first), np.cross(b, second)


def free_yaw(derivatives, heading, vehicle):
    """Yaw, and its rate and acceleration at which the vehicle does not turn about its thrust."""
    still = pf.flat_states(derivatives, vehicle, yaw=(heading, 0.0, 0.0))
    yaw = (heading, -still.body_rate[:, 2], 0.0)
    rate = pf.flat_states(derivatives, vehicle, yaw=yaw)
    assert np.abs(rate.body_rate[:, 2]).max() <= 1e-9
    return heading, yaw[1], -rate.angular_acceleration[:, 2]


def test_a_free_nose_asks_of_each_rotor_what_the_formula_says():
    """The torques J_x w'_x, J_y w'_y and (J_y - J_x) w_x w_y of a body that does not twist."""
    rng = np.random.default_rng(7)
    derivatives = random_motion(rng, 500)
    heading = rng.uniform(-np.pi, np.pi, 500)
    states = pf.flat_states(derivatives, ODD, yaw=free_yaw(derivatives, heading, ODD))
    thrust, b, rate, change = swing_of(derivatives, ODD)
    w, x, y, z = states.attitude.T  # to the axes of the body, in the world
    forward = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    left = np.cross(b, forward)
    rates = [(rate * axis).sum(axis=1) for axis in (forward, left)]
    changes = [(change * axis).sum(axis=1) for axis in (forward, left)]
    roll, pitch = ODD.inertia[0] * changes[0], ODD.inertia[1] * changes[1]
    about = (ODD.inertia[1] - ODD.inertia[0]) * rates[0] * rates[1] / ODD.torque_per_thrust
    lever = ODD.airframe.lever
    for i, ((ahead, beside), spin) in enumerate(zip(ODD.rotor_positions, ODD.spins, strict=True)):
        turning = (np.sign(beside) * roll - np.sign(ahead) * pitch) / lever - spin * about
        expected = 0.25 * (ODD.mass * thrust + turning)
        size = ODD.mass * thrust + np.abs(roll) / lever + np.abs(pitch) / lever + np.abs(about)
        assert (np.abs(states.rotor_thrust[:, i] - expected) <= 1e-12 * size).all()


@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda vehicle: vehicle.name)
def test_what_is_limited_is_beyond_every_free_heading(vehicle):
    """And not far, where inertia is even: some heading has it."""
    rng = np.random.default_rng(8)
    derivatives = random_motion(rng, 200)
    values = limited_values(list(derivatives), vehicle.airframe)
    most, least = np.full(200, -np.inf), np.full(200, np.inf)
    for turned in np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False):
        yaw = free_yaw(derivatives, np.full(200, turned), vehicle)
        thrusts = pf.flat_states(derivatives, vehicle, yaw=yaw).rotor_thrust
        most = np.maximum(most, thrusts.max(axis=1))
        least = np.minimum(least, thrusts.min(axis=1))
    spread = most - least
    assert (most <= values["rotor_thrust"] + 1e-12 * spread).all()
    assert (least >= values["least_rotor_thrust"] - 1e-12 * spread).all()
    if vehicle is RACER:  # headings are looked at every 2 degrees
        assert (most >= values["rotor_thrust"] - 1e-3 * spread).all()
        assert (least <= values["least_rotor_thrust"] + 1e-3 * spread).all()


def test_unequal_inertia_takes_what_it_takes_of_a_thrust_that_swings_evenly():
    """At w without w' rotors have no more to do than the yaw torque of unequal inertia."""
    force = np.array([0.0, 0.0, 12.0])
    rate = np.array([9.0, 0.0, 0.0])
    change = np.cross(rate, force)
    bent = np.cross(rate, change)
    velocity = np.zeros(3)
    even = replace(ODD.airframe, drag=(0.0, 0.0))
    motion = [velocity, force - [0.0, 0.0, GRAVITY], change, bent]
    values = limited_values([one[None] for one in motion], even)
    uneven = 0.5 * 3e-4 * 81.0 / (ODD.torque_per_thrust * ODD.mass)
    for name, sign in zip(ROTORS, (1.0, -1.0), strict=True):
        assert values[name][0] == pytest.approx(0.125 * (12.0 + sign * uneven), rel=1e-12)


@pytest.mark.parametrize("name", ["crazyflie-2.1-upgrade", "crazyflie-brushless"])
def test_a_free_nose_takes_no_more_than_was_planned_for(name):
    """Unequal inertia is in the plan: the proof with the yaw finds nothing else to slow it for."""
    vehicle = pf.find_vehicle(name).on_rotors()
    made = pf.plan(WAYPOINTS, vehicle=vehicle)
    assert_as_seen(made)
    assert "slowed" not in made.message
    without = pf.certify(made.trajectory, made.problem.limits).peaks
    for kind in ROTORS:
        assert (made.report.peaks[kind] <= without[kind] + 1e-3).all()
        even = replace(made.problem.limits.airframe, inertia_difference=0.0)
        easier = pf.certify(made.trajectory, replace(made.problem.limits, airframe=even)).peaks
        assert (easier[kind] <= without[kind]).all()
        assert (easier[kind] < without[kind] - 1e-3).any()


# ---- limits about the body --------------------------------------------------------------------


@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize(
    "yaw",
    [
        "velocity",
        {"point": [1.5, 1.5, 0.0]},
        {"angles": [0.0, 1.0, 2.0, 3.0, 3.0]},
        {"policy": "velocity", "rate": 0.5, "acceleration": None},
        {"policy": "free", "rate": 1.0},
        {"policy": "fixed", "angle": 0.5, "rate": None, "acceleration": None},
    ],
    ids=str,
)
def test_rotors_keep_their_range_with_any_yaw(vehicle, yaw):
    assert_as_seen(pf.plan(WAYPOINTS, vehicle=vehicle, yaw=yaw))


def test_a_yaw_policy_costs_the_racer_little():
    free = pf.plan(course("uzh_19wp"), vehicle=RACER)
    yawed = pf.plan(course("uzh_19wp"), vehicle=RACER, yaw={"policy": "velocity", "rate": 3.0})
    assert_as_seen(free)
    assert_as_seen(yawed)
    assert free.duration <= 18.36
    assert yawed.duration <= 1.02 * free.duration


def test_limits_about_the_body_without_limits_on_rotors():
    limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
    heading = pf.Heading(policy="velocity", rate=1.0, acceleration=5.0, about="body")
    made = pf.plan(WAYPOINTS, limits=limits, yaw=heading)
    assert made.report.feasible, made.message
    times = np.linspace(0.0, made.duration, 20_000)
    rate, acceleration = turning_about_z(made.trajectory, made.yaw_motion, times, None)
    assert np.abs(rate).max() <= 1.0
    assert np.abs(acceleration).max() <= 5.0
    assert set(made.report.peaks) >= {"body_rate_z", "angular_acceleration_z"}


def test_a_moving_start_is_planned_again_with_room_for_the_yaw():
    made = pf.plan(WAYPOINTS, vehicle=RACER, yaw="velocity", start={"velocity": [1.0, 0.0, 0.0]})
    assert_as_seen(made)


# ---- what is proven ---------------------------------------------------------------------------


def random_flight(rng, pieces=3):
    """Pieces of degree 7 and a yaw of degree 5 with knots of its own."""
    sizes = np.array([1.0, 4.0, 4.0, 6.0, 10.0, 10.0, 8.0, 4.0])[:, None]
    flight = Trajectory(rng.normal(size=(pieces, 8, 3)) * sizes, rng.uniform(0.2, 0.9, pieces))
    ends = np.sort(rng.uniform(0.0, flight.duration, 4))
    times = np.diff(np.concatenate(([0.0], ends, [flight.duration])))
    return flight, Trajectory(rng.normal(size=(5, 6, 1)) * 3.0, times)


@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize("seed", range(10))
def test_bounds_lie_above_an_independent_model_and_close(vehicle, seed):
    flight, yaw = random_flight(np.random.default_rng(seed))
    heading = pf.Heading(policy="velocity", rate=3.0, acceleration=20.0, about="body")
    problem = pf.Problem(WAYPOINTS, vehicle=vehicle, yaw=heading)
    peaks, _ = certify_twist(problem, heading, yaw, flight)
    for k, (begin, duration) in enumerate(
        zip(flight.breakpoints[:-1], flight.segment_times, strict=True)
    ):
        times = begin + duration * np.linspace(1e-9, 1.0 - 1e-9, 20_001)
        turn = [yaw(times, order)[:, 0] for order in range(3)]
        states = pf.states_along(flight, times, vehicle, yaw=turn)
        if not np.isfinite(peaks["rotor_thrust"][k]) or states.thrust_acceleration.min() < 0.5:
            continue
        for kind, values, limit in (
            ("body_rate_z", states.body_rate[:, 2], 3.0),
            ("angular_acceleration_z", states.angular_acceleration[:, 2], 20.0),
        ):
            reached = np.abs(values).max() / limit
            assert reached * (1.0 - 1e-9) <= peaks[kind][k] <= reached * (1.0 + 1e-3) + 1e-5
        sampled = problem.limits.ratios(
            {
                **dict.fromkeys((kind.name for kind in KINDS), np.ones(1)),
                "rotor_thrust": states.rotor_thrust.max(),
                "least_rotor_thrust": states.rotor_thrust.min(),
            }
        )
        for name in ROTORS:
            assert peaks[name][k] >= sampled[name] * (1.0 - 1e-12)


def demands(flight, yaw, vehicle, times):
    """(2, n) N, the most and the least of a rotor at the worst heading: what is bounded."""
    derivatives = [flight(times, order) for order in range(1, 5)]
    thrust, b, rate, change = swing_of(derivatives, vehicle)
    turn = [yaw(times, order)[:, 0] for order in range(3)]
    states = pf.states_along(flight, times, vehicle, yaw=turn)
    about, faster = states.body_rate[:, 2], np.abs(states.angular_acceleration[:, 2])
    reach, _, _, crossed, ratio, spin, twisting = vehicle.airframe.steering
    swung = change + ratio * about[:, None] * np.cross(rate, b)
    size = np.linalg.norm(rate, axis=1)
    turning = reach * np.linalg.norm(swung, axis=1) + spin * faster
    turning += (twisting * np.abs(about) + crossed * size) * size
    return 0.25 * vehicle.mass * np.stack([thrust + turning, thrust - turning])


@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda vehicle: vehicle.name)
@pytest.mark.parametrize(("aside", "rounding"), [(0.3, 1e-4), (0.1, 1e-4), (0.03, 2e-3)], ids=str)
def test_bounds_are_close_where_the_thrust_swings_past_straight_down(vehicle, aside, rounding):
    """Its yaw swings round there, and what that takes cancels all but for rounding.

    1 + b_3 falls to 3e-3, 3e-4 and 3e-5.
    """
    fall = np.array(
        [[0, 0, 0], [1.0, 0, 0], [-2.0, aside, -GRAVITY / 2 - 4.0], [6.0, 0, 0.5]], float
    )
    flight = Trajectory(fall[None], [0.4])
    yaw = untwisted(flight, np.array([4]), vehicle.airframe, closeness=1e-3)
    problem = pf.Problem(WAYPOINTS, vehicle=vehicle)
    peaks, _ = certify_twist(problem, problem.heading, yaw, flight)
    times = np.linspace(1e-9, 0.4 - 1e-9, 400_001)
    most, least = demands(flight, yaw, vehicle, times)
    hover = 0.25 * vehicle.mass * GRAVITY
    for name, reached in (
        ("rotor_thrust", most.max() / problem.limits.rotor_thrust),
        ("least_rotor_thrust", (hover - least.min()) / (hover - vehicle.rotor_thrust[0])),
    ):
        assert reached * (1.0 - 1e-9) <= peaks[name][0] <= reached + rounding * max(reached, 1.0)


def test_the_bound_is_what_the_formula_gives_at_the_worst_heading():
    """Rotors of an even vehicle in hover that spins faster and faster: by hand."""
    spin = 4.0
    hover = Trajectory(np.ones((1, 1, 3)), [1.0])
    yaw = Trajectory(np.array([[[0.0], [0.0], [0.5 * spin]]]), [1.0])
    heading = pf.Heading(policy="free", rate=5.0, acceleration=5.0)
    problem = pf.Problem(WAYPOINTS, vehicle=RACER, yaw=heading)
    peaks, _ = certify_twist(problem, heading, yaw, hover)
    assert peaks["body_rate_z"] == pytest.approx(spin / 5.0, rel=1e-6)
    assert peaks["angular_acceleration_z"] == pytest.approx(spin / 5.0, rel=1e-6)
    share = RACER.mass * GRAVITY / 4.0
    turning = RACER.inertia[2] * spin / (4.0 * RACER.torque_per_thrust)
    assert peaks["rotor_thrust"] == pytest.approx((share + turning) / RACER.rotor_thrust[1])


@pytest.mark.parametrize(
    "coefficients", [[0.0, 0.0, 1e308, -1e308], [0.0, 0.0, 1e300, -1e300]], ids=str
)
def test_a_yaw_beyond_numbers_is_not_proven(coefficients):
    rest = pf.plan([[0, 0, 1], [1, 0, 1]], vehicle=RACER, method="proportional")
    slow = rest.trajectory.stretch(4.0 / rest.duration)
    heading = pf.Heading(policy="free", rate=None, acceleration=20.0)
    problem = replace(rest.problem, yaw=heading)
    yaw = Trajectory(np.array(coefficients)[None, :, None], [slow.duration])
    with np.errstate(over="ignore", invalid="ignore"):
        peaks, problems = certify_twist(problem, heading, yaw, slow)
    assert peaks["angular_acceleration_z"].max() > 1e6
    assert peaks["rotor_thrust"].max() > 1.0
    assert problems


def test_a_segment_too_short_for_a_part_of_the_yaw_is_not_proven():
    """Its borders are the same, as far as times are told apart."""
    coefficients = np.zeros((3, 4, 3))
    coefficients[:, 2, 0] = 2.5
    coefficients[1, 3, 1] = 1e3
    flight = Trajectory(coefficients, [1000.0, 1.5e-9, 1000.0])
    heading = pf.Heading(policy="free")
    problem = pf.Problem(WAYPOINTS, vehicle=RACER, yaw=heading)
    yaw = Trajectory(np.zeros((2, 1, 1)), [1000.0, flight.duration - 1000.0])
    peaks, problems = certify_twist(problem, heading, yaw, flight)
    assert peaks["body_rate_z"][1] > 1.0
    assert problems


@pytest.mark.parametrize("degree", [5, 7, 11])
def test_a_cut_yaw_is_wrong_by_no_more_than_is_said(degree):
    chebyshev = np.polynomial.chebyshev.Chebyshev.basis(degree, domain=[0.0, 1.0])
    powers = chebyshev.convert(kind=np.polynomial.Polynomial, domain=[-1, 1], window=[-1, 1]).coef
    yaw = Trajectory(powers[None, :, None], [1.0])
    parts, lost = _cut(yaw, np.array([0.73]))
    offset = Fraction(float(parts.breakpoints[1]))
    for order in (1, 2):
        for place in np.linspace(0.0, 0.27, 28):
            exact = sum(
                math.perm(j, order) * Fraction(float(c)) * (offset + Fraction(place)) ** (j - order)
                for j, c in enumerate(powers)
                if j >= order
            )
            shifted = sum(
                math.perm(j, order) * Fraction(float(c)) * Fraction(place) ** (j - order)
                for j, c in enumerate(parts.coefficients[1, :, 0])
                if j >= order
            )
            assert abs(exact - shifted) <= lost[1, order - 1]


@pytest.mark.parametrize(
    "break_it",
    [
        lambda yaw: None,
        lambda yaw: yaw.shift(0.1),
        lambda yaw: yaw.stretch(0.5),
    ],
)
def test_a_yaw_that_does_not_fit_proves_nothing(break_it):
    made = pf.plan(WAYPOINTS, vehicle=RACER)
    report = pf.certify_plan(replace(made, yaw_motion=break_it(made.yaw_motion)))
    assert not report.feasible
    assert report.peaks["rotor_thrust"].min() > 1.0


def test_a_yaw_that_twists_too_fast_is_said():
    made = pf.plan(WAYPOINTS, vehicle=RACER, yaw={"policy": "free", "rate": 1.0})
    times = made.yaw_motion.segment_times
    spun = made.yaw_motion.coefficients.copy()
    spun[:, 0, 0] += 2.0 * made.yaw_motion.breakpoints[:-1]
    spun[:, 1] += 2.0
    report = pf.certify_plan(replace(made, yaw_motion=Trajectory(spun, times)))
    assert not report.feasible
    assert any(line.startswith("body rate about z reaches 2") for line in report.problems)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"policy": "velocity", "about": "nose"}, "it must be yaw or body"),
        ({"policy": "free", "about": "yaw"}, "a free nose is limited about the body"),
        ({"policy": "free", "angle": 1.0}, "has no use for angle"),
        ({"policy": "velocity", "about": "body", "rate": -1.0}, "limit body_rate_z is -1"),
    ],
)
def test_headings_that_make_no_sense(fields, words):
    with pytest.raises(InvalidProblem, match=words):
        pf.Heading(**fields)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"yaw_inertia": 1e-3}, "give both"),
        ({"drag": (0.1,)}, "two numbers"),
        ({"drag": (0.1, -0.1)}, "both must be from 0"),
        ({"drag": (0.1, math.nan)}, "both must be from 0"),
        ({"inertia_difference": 2e-3}, "below the inertia"),
        ({"inertia_difference": 2e-4}, "and yaw_inertia must be given with it"),
        ({"inertia_difference": math.nan}, "must be from 0"),
        ({"inertia_difference": "x"}, "inertia_difference is 'x'; it must be a number"),
        ({"inertia_difference": True}, "it must be a number"),
        ({"inertia_difference": 10**400}, "inertia_difference is above"),
    ],
)
def test_airframes_that_make_no_sense(fields, words):
    with pytest.raises(InvalidProblem, match=words):
        pf.Airframe(mass=0.85, inertia=1e-3, lever=0.1, **fields)


def test_an_airframe_through_json():
    limits = ODD.limits
    assert pf.Limits.from_dict(json.loads(json.dumps(limits.to_dict()))) == limits


@pytest.mark.kernels
def test_an_inverted_vehicle_has_no_bound():
    falling = Trajectory(np.array([[[0, 0, 0], [0, 0, 0], [0, 0, -12.0]]], float), [0.5])
    yaw = Trajectory(np.zeros((1, 1, 1)), [0.5])
    heading = pf.Heading(policy="free")
    problem = pf.Problem(WAYPOINTS, vehicle=RACER, yaw=heading)
    peaks, problems = certify_twist(problem, heading, yaw, falling)
    assert peaks["body_rate_z"][0] > 1e6
    assert problems
    assert len(BODY_KINDS) + len(ROTORS) == twisting.COUNT
