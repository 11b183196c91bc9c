"""Rotor thrusts: bounds that hold in exact arithmetic, the stretch, and plans that keep them."""

import json
import math
from dataclasses import replace
from decimal import Decimal, getcontext
from fractions import Fraction
from math import perm
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from test_certificate import IN_METRES, SHAPES, diving, nasty_pieces, wavy

from peakflight import (
    GRAVITY,
    KINDS,
    Airframe,
    InvalidProblem,
    Limits,
    Plan,
    Problem,
    Status,
    Trajectory,
    certify,
    certify_plan,
    find_vehicle,
    plan,
    planner,
    read_course,
    stretch_to_limits,
)
from peakflight.certificate import TOLERANCE, peak_ratios
from peakflight.kernels import bounds, rotors
from peakflight.limits import ROTORS, limited_values
from peakflight.methods import METHODS, Outcome, joint

kernels = pytest.mark.kernels

RACER = Airframe(mass=0.85, inertia=1e-3, lever=0.15 / math.sqrt(2.0))
"""Of Foehn et al., 2021."""
RACING = Limits(rotor_thrust=6.879, least_rotor_thrust=0.0, airframe=RACER)
CRAZYFLIE = Limits(
    rotor_thrust=0.12, least_rotor_thrust=0.0,
    airframe=Airframe(mass=0.0328, inertia=16.8e-6, lever=0.0325, drag=(0.0147, 0.0128)),
)  # fmt: skip
MOST, LEAST = (len(KINDS) - 2, len(KINDS) - 1)

getcontext().prec = 60


# ---- bounds against the truth ---------------------------------------------------------------


def exact_demands(coefficients, duration, figures, places):
    """(n, 2) T + A and g - T + A, A = c |alpha| + chi |w|^2, at normalised times, to 50 digits."""
    reach, drag, along_drag, crossed = (Fraction(float(figure)) for figure in figures)
    found = []
    for place in places:
        time = Fraction(float(place)) * Fraction(duration)
        motion = []
        for order in (1, 2, 3, 4):
            values = [Fraction(0)] * 3
            for j in range(len(coefficients) - 1, order - 1, -1):
                values = [
                    value * time + perm(j, order) * Fraction(float(x))
                    for value, x in zip(values, coefficients[j], strict=True)
                ]
            motion.append(values)
        velocity = motion[0]
        thrust, jerk, snap = (
            [x + drag * lower for x, lower in zip(*pair, strict=True)]
            for pair in zip(motion[1:], motion[:-1], strict=True)
        )
        thrust[2] += Fraction(GRAVITY)
        square = sum(x * x for x in thrust)
        if square == 0:
            found.append((Decimal("Infinity"),) * 2)
            continue
        twice = 2 * sum(x * y for x, y in zip(thrust, jerk, strict=True)) / square
        swing = [s - twice * j for s, j in zip(snap, jerk, strict=True)]
        turn = decimal(reach) * root(crossing(thrust, swing)) / decimal(square)
        turn += decimal(crossed * crossing(thrust, jerk) / square**2)
        size = root(square)
        pull = sum(x * y for x, y in zip(thrust, velocity, strict=True))
        size += decimal(along_drag * pull) / size
        found.append((size + turn, decimal(Fraction(GRAVITY)) - size + turn))
    return found


def crossing(one, other):
    """The square of the vector product."""
    (a, b, c), (x, y, z) = one, other
    return (b * z - c * y) ** 2 + (c * x - a * z) ** 2 + (a * y - b * x) ** 2


def decimal(value):
    return Decimal(value.numerator) / Decimal(value.denominator)


def root(value):
    return decimal(value).sqrt()


def kernel_bounds(coefficients, duration, values, figures):
    """Upper bound and attained value of both kinds, and where."""
    shape = (1, len(KINDS))
    upper, lower, place = np.empty(shape), np.empty(shape), np.empty(shape)
    degree = coefficients.shape[0] - 1
    limits = np.full(len(KINDS), math.nan)
    limits[[MOST, LEAST]] = values
    bounds.certify(
        coefficients[None], np.array([duration]), limits, GRAVITY, bounds.lookup_tables(degree),
        TOLERANCE, upper, lower, place, None, None, rotors.workspace(degree, figures), 1,
    )  # fmt: skip
    return upper[0], lower[0], place[0]


def check_pieces(shape, count, seed):
    """Returns how often the bound was shown to be close."""
    close = 0
    for coefficients, duration, rng in nasty_pieces(shape, count, seed):
        figures = np.array([10.0 ** rng.uniform(-3.0, 0.0), 0.0, 0.0, 0.0])
        if rng.uniform() < 0.5:  # with drag
            figures[1:3] = 10.0 ** rng.uniform(-2.0, 0.0), rng.normal() * 0.3
        if rng.uniform() < 0.5:  # with unequal inertia
            figures[3] = 10.0 ** rng.uniform(-3.0, 0.0)
        values = np.array([GRAVITY, GRAVITY]) * 10.0 ** rng.uniform(-1.0, 1.0, size=2)
        upper, lower, place = kernel_bounds(coefficients, duration, values, figures)
        for index, kind in enumerate((MOST, LEAST)):
            limit = Decimal(values[index])
            places = (*np.linspace(0.0, 1.0, 17), place[kind])
            truths = exact_demands(coefficients, duration, figures, places)
            truth = max(values[index] for values in truths)
            where = f"kind {kind} of {coefficients.tolist()} in {duration} s, figures {figures}"
            assert upper[kind] >= lower[kind] >= 0.0, where
            unbounded = upper[kind] == bounds.UNBOUNDED
            assert unbounded or Decimal(upper[kind]) * limit >= truth, where
            size = float(max(truths[-1][0], limit))
            if not unbounded:
                close += upper[kind] * values[index] <= lower[kind] * values[index] + 1e-9 * size
                there = float(truths[-1][index])
                # rounding, of terms that may cancel
                assert lower[kind] * values[index] <= max(there, 0.0) + 1e-6 * size, where
    return close


@pytest.mark.parametrize("shape", SHAPES)
def test_bounds_hold_in_exact_arithmetic_and_are_close(shape):
    count = 100
    close = check_pieces(shape, count, seed=3)
    print("CLOSE", shape, close / (2 * count))
    assert close > (0.3 if shape in IN_METRES else 0.6) * count


@kernels
@pytest.mark.parametrize("shape", SHAPES)
def test_bounds_of_a_few_pieces(shape):
    check_pieces(shape, 3, seed=4)


@pytest.mark.parametrize("limits", [RACING, CRAZYFLIE])
@pytest.mark.parametrize("seed", range(4))
def test_kappa_is_what_samples_show(limits, seed):
    trajectory, _ = stretch_to_limits(wavy(seed, minimize="snap"), limits)
    peaks = certify(trajectory, limits).peaks
    derivatives = [trajectory.sample(20_001, order) for order in range(1, 5)]
    sampled = limits.ratios(limited_values(derivatives, limits.airframe))
    for name in ROTORS:
        expected = sampled[name].max(axis=1)
        # samples every 0.1 ms miss a smooth peak by the square of that
        np.testing.assert_allclose(peaks[name], expected, rtol=1e-5, atol=1e-6)
        assert (peaks[name] >= expected * (1.0 - 1e-14)).all()


@kernels
def test_hover_needs_its_weight_and_nothing_more():
    still = Trajectory(np.ones((1, 1, 3)), [2.0])
    peaks = certify(still, RACING).peaks
    hover = RACER.mass * GRAVITY / 4.0
    assert peaks["rotor_thrust"][0] == pytest.approx(hover / 6.879, rel=1e-12)
    assert peaks["least_rotor_thrust"][0] <= 1e-12


def test_free_fall_has_no_bound_and_what_is_broken_is_named():
    falling = Trajectory([[[0, 0, 9], [1, 0, 0], [0, 0, -GRAVITY / 2], [1, 0, 0]]], [1.0])
    report = certify(falling, RACING)
    assert not report.feasible
    assert report.peaks["rotor_thrust"][0] == report.peaks["least_rotor_thrust"][0] == 1e9
    stretched, _ = stretch_to_limits(wavy(1, minimize="snap"), RACING)
    problems = certify(stretched.stretch(0.97), RACING).problems
    assert "least rotor thrust falls to -" in problems[-1]
    assert "below its limit of 0 N in segment" in problems[-1]


# ---- uniform stretch ------------------------------------------------------------------------


@pytest.mark.parametrize("limits", [RACING, CRAZYFLIE])
@pytest.mark.parametrize("too_slow", [1e-2, 1.0, 1e3])
@pytest.mark.parametrize("path", [wavy, diving])
def test_stretch_is_certified_and_nothing_a_little_faster_is(limits, too_slow, path):
    given = path(2, minimize="snap") if path is wavy else path(minimize="snap")
    found, factor = stretch_to_limits(given.stretch(too_slow), limits)
    assert certify(found, limits).feasible
    assert found.duration == pytest.approx(factor * too_slow * given.duration, rel=1e-12)
    assert not certify(found.stretch(1.0 - 1e-6), limits).feasible
    worst = np.nanmax(peak_ratios(found, limits))
    assert worst <= 1.0


# ---- plans ------------------------------------------------------------------------------------

COURSES = Path(__file__).parents[1] / "examples" / "courses"
RACING_RATE = replace(RACING, body_rate=15.0)


def course(name):
    return read_course(COURSES / f"{name}.json").waypoints


def rotors_by_difference(trajectory, airframe, rate=10_000.0):
    """(n, 4) thrusts of an X whose frame is carried along without twisting, and (n, 3) body rates.

    From attitude matrices at `rate` Hz: the body rates are their logarithms, the torque follows
    from differences of those and Euler's equations, and the mixer of the X does the rest.
    """
    times = np.arange(0.5 / rate, trajectory.duration, 1.0 / rate)
    thrust = trajectory(trajectory.start_time + times, 2)
    thrust[:, 2] += GRAVITY
    size = np.linalg.norm(thrust, axis=1)
    up = thrust / size[:, None]
    frames = np.empty((len(times), 3, 3))
    forward = np.array([1.0, 0.0, 0.0])
    for i, axis in enumerate(up):
        if i:  # the rotation along the great circle from one direction to the next
            last = up[i - 1]
            forward = forward - (forward @ axis) / (1.0 + last @ axis) * (last + axis)
        forward = forward - (forward @ axis) * axis
        forward /= np.linalg.norm(forward)
        frames[i] = np.column_stack((forward, np.cross(axis, forward), axis))
    steps = np.einsum("nji,njk->nik", frames[:-1], frames[1:])
    turn = 0.5 * np.stack(
        [steps[:, 2, 1] - steps[:, 1, 2], steps[:, 0, 2] - steps[:, 2, 0],
         steps[:, 1, 0] - steps[:, 0, 1]], axis=1,
    )  # fmt: skip
    rates = turn * rate  # sines of angles of 1e-3 rad: good to 1e-7 of them
    inertia = np.array([1.0, 1.0, 1.7]) * airframe.inertia
    middle = 0.5 * (rates[1:] + rates[:-1])
    torque = inertia * np.diff(rates, axis=0) * rate + np.cross(middle, inertia * middle)
    by_roll, by_pitch = (torque[:, :2] / (4.0 * airframe.lever)).T
    # the worst heading: the frame turned about its thrust axis
    worst = np.hypot(by_roll, by_pitch) * math.sqrt(2.0)
    share = airframe.mass * size[1:-1] / 4.0
    signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    thrusts = [share + x * by_roll + y * by_pitch for x, y in signs]
    thrusts = np.stack([*thrusts, share + worst, share - worst])
    return thrusts.T, rates, torque


@pytest.mark.parametrize("name", ["tight_then_fast", "mfbo_traj_2"])
def test_every_rotor_is_within_its_range_along_the_whole_flight(name):
    made = plan(course(name), limits=RACING_RATE)
    assert made.report.feasible
    thrusts, rates, torque = rotors_by_difference(made.trajectory, RACER)
    inner = slice(20, -20)  # snap jumps at joints and at both ends: differences smear that
    # differences over 0.1 ms are good to 1e-3 of what changes within 0.1 s
    assert thrusts[inner].max() <= RACING.rotor_thrust * 1.002
    assert thrusts[inner].min() >= -0.002 * RACING.rotor_thrust
    assert np.abs(rates[:, 2]).max() <= 1e-6 * np.abs(rates).max()
    assert np.abs(torque[:, 2]).max() <= 1e-3 * np.abs(torque).max()
    assert np.linalg.norm(rates, axis=1).max() <= 15.0 * 1.0001
    # and they are used: the flight is at some limit all the time
    assert thrusts.max() >= 0.99 * RACING.rotor_thrust


def test_the_racing_course_is_as_fast_as_it_should_be():
    made = plan(course("uzh_19wp"), limits=RACING_RATE)
    assert (made.status, made.report.feasible) == (Status.SOLVED, True)
    assert made.duration <= 18.36


@pytest.mark.parametrize("name", ["mfbo_traj_2", "random_10"])
def test_three_starts_end_alike_on_slow_courses_with_short_legs(name):
    found = [
        plan(course(name), limits=RACING_RATE, initial=initial)
        for initial in ("guess", "proportional", "peak")
    ]
    assert all(made.report.feasible for made in found)
    durations = [made.duration for made in found]
    assert max(durations) <= 1.01 * min(durations)


def any_direction(index):
    """(legs+1, 3) legs of 0.2 to 10 m, even in the logarithm, in any direction."""
    rng = np.random.default_rng([20240229, index])
    legs = int(rng.integers(4, 13))
    directions = rng.normal(size=(legs, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lengths = np.exp(rng.uniform(*np.log((0.2, 10.0)), size=(legs, 1)))
    return np.vstack((np.zeros(3), np.cumsum(lengths * directions, axis=0)))


@pytest.mark.parametrize(
    ("vehicle", "index"),
    [
        ("crazyflie-2.1", 4),  # past straight down, where the proof was loose
        ("hummingbird", 5),  # likewise, upright
        ("crazyflie-brushless", 9),  # unequal inertia
        ("racing-quad", 0),  # stalled before legs were cut
        ("racing-quad", 7),  # and never solved from the guess
    ],
)
def test_no_other_start_is_much_faster(vehicle, index):
    problem = Problem(any_direction(index), vehicle=find_vehicle(vehicle).on_rotors())
    made = plan(problem)
    assert made.report.feasible
    others = [plan(problem, initial="peak"), plan(problem, method="peak")]
    assert made.duration <= 1.05 * min(other.duration for other in others if other.feasible)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("limits", [RACING, CRAZYFLIE])
def test_every_method_keeps_rotor_limits(method, limits):
    rng = np.random.default_rng(5)
    waypoints = np.cumsum(rng.normal(size=(5, 3)), axis=0)
    made = plan(waypoints, limits=limits, method=method)
    assert made.report.feasible
    derivatives = [made.trajectory.sample(2000, order) for order in range(1, 5)]
    values = limited_values(derivatives, limits.airframe)
    assert values["rotor_thrust"].max() <= limits.rotor_thrust * (1.0 + 1e-12)
    assert values["least_rotor_thrust"].min() >= -1e-12
    again = Plan.from_dict(json.loads(json.dumps(made.to_dict())))
    assert again.problem.limits == limits
    assert certify_plan(again).feasible


def test_planning_for_rotors_beats_slowing_down():
    waypoints = course("tight_then_fast")
    slowed = plan(waypoints, limits=RACING_RATE, method="proportional").duration
    spline = plan(waypoints, limits=RACING_RATE, method="peak").duration
    joint = plan(waypoints, limits=RACING_RATE).duration
    assert joint < spline < slowed


# ---- what cannot be proven is refused ---------------------------------------------------------


WAYPOINTS = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.5], [3.0, 2.0, 1.0]])


@pytest.mark.parametrize("yaw", [0.0, "velocity", [0.0, 1.0, 2.0]])
def test_a_yaw_beside_limits_on_rotors_needs_to_know_what_steering_takes(yaw):
    with pytest.raises(InvalidProblem, match="needs yaw_inertia and torque_per_thrust"):
        Problem(WAYPOINTS, limits=RACING, yaw=yaw)


def test_limits_about_another_airframe_than_the_vehicle_are_refused():
    racer = find_vehicle("racing-quad").on_rotors()
    assert Problem(any_direction(0), vehicle=racer).limits == racer.limits
    other = replace(racer.limits, airframe=replace(racer.airframe, mass=0.4))
    with pytest.raises(InvalidProblem, match="vehicle racing-quad has Airframe"):
        Problem(any_direction(0), vehicle=racer, limits=other)


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, 1e-200, 10**400, "heavy", True])
def test_an_airframe_that_makes_no_sense_is_refused(mass):
    with pytest.raises(InvalidProblem, match=r"^airframe mass is "):
        Airframe(mass=mass, inertia=1e-3, lever=0.1)


# ---- other starts -----------------------------------------------------------------------------


class Flown(NamedTuple):
    """As much of a flight with its yaw as the planner looks at."""

    trajectory: Trajectory
    report: SimpleNamespace


@pytest.mark.parametrize(
    ("lasts", "tried"),
    [
        ({"guess": 5.05}, ["guess"]),
        ({"guess": 7.0, "peak": 5.09}, ["guess", "peak"]),
        ({"guess": 7.0, "peak": 9.0, "proportional": 6.0}, ["guess", "peak", "proportional"]),
    ],
)
def test_where_the_yaw_slows_a_flight_much_other_starts_are_tried(monkeypatch, lasts, tried):
    """Flights of 5 s, which last so long with their yaw."""
    problem = Problem(any_direction(0), vehicle=find_vehicle("racing-quad").on_rotors())
    begun = []

    def reserving(method, problem, settings):
        begun.append(settings.initial)
        line = Trajectory(np.ones((1, 1, 3)), [lasts[settings.initial]])
        outcome = Outcome(status=Status.SOLVED, trajectory=line, iterations=10)
        return (outcome, Flown(line, SimpleNamespace(feasible=True))), 5.0

    monkeypatch.setattr(planner, "_reserving", reserving)
    outcome, flight = planner._answered("joint", problem, joint.Settings())
    assert begun == tried
    assert flight.trajectory.duration == min(lasts.values())
    assert outcome.iterations == 10 * len(tried)
    begun.clear()
    free = Problem(any_direction(0), vehicle="racing-quad")
    planner._answered("joint", free, joint.Settings())
    planner._answered("joint", problem, joint.Settings(initial="guess", time_limit=0.0))
    assert begun == ["guess", "guess"]
