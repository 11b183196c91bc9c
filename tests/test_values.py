"""The values that go in and come out: what they refuse, that they are frozen, JSON, operations."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.interpolate import PPoly

from peakflight import (
    GRAVITY,
    KINDS,
    Airframe,
    History,
    InvalidFile,
    InvalidProblem,
    Limits,
    Plan,
    Problem,
    Report,
    Status,
    Trajectory,
)
from peakflight.limits import ROTORS, keeps, limited_values
from peakflight.problem import SplineClass

LIMITS = Limits(speed=5.0, thrust_acceleration=15.5)
POINTS = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 2.0, 1.5]]
NAN = math.nan


def refuses(message, call, *args, **kwargs):
    """Whether a call is refused with a message that begins like this, in one line."""
    with pytest.raises(InvalidProblem, match=f"^{message}") as caught:
        call(*args, **kwargs)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, ValueError)


def assert_read_only(array):
    assert not array.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0.0


def assert_frozen(value):
    for field in dataclasses.fields(value):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(value, field.name, None)


def through_json(value):
    return json.loads(json.dumps(value.to_dict(), allow_nan=False))


# ---- Limits ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "no limit is set; set at least one, such as speed=5.0"),
        ({"speed": 0.0}, "limit speed is 0; it must be positive and finite"),
        ({"speed": -1.0}, "limit speed is -1; it must be positive and finite"),
        ({"jerk": NAN}, "limit jerk is nan; it must be positive and finite"),
        ({"snap": math.inf}, "limit snap is inf; it must be positive and finite"),
        ({"speed": 1e-7}, "limit speed is 1e-07; it must be from 1e-06 to 1e\\+09"),
        ({"jerk": 2e9}, "limit jerk is 2e\\+09; it must be from 1e-06 to 1e\\+09"),
        ({"speed": "fast"}, "limit speed is 'fast'; it must be a number"),
        ({"speed": [1, 2]}, r"limit speed is \[1, 2\]; it must be a number"),
        (
            {"thrust_acceleration": 9.81},
            r"limit thrust_acceleration is 9.81 m/s\^2; it must be above gravity \(9.81 m/s\^2\)",
        ),
        ({"thrust_acceleration": 5.0}, r"limit thrust_acceleration is 5 m/s\^2; it must be above"),
        ({"tilt": 1.6}, r"limit tilt is 1.6 rad; it must be below pi/2 \(write 50deg"),
        ({"tilt": math.pi / 2}, "limit tilt is 1.5708 rad; it must be below pi/2"),
        (
            {"least_thrust_acceleration": 9.81, "speed": 1.0},
            r"limit least_thrust_acceleration is 9.81 m/s\^2; it must be below gravity",
        ),
    ],
)
def test_limits_refuse(values, message):
    refuses(message, Limits, **values)


def test_limits_are_frozen_floats_in_the_order_of_kinds():
    limits = Limits(snap=800, speed=np.float32(5.0), tilt=0.5)
    assert_frozen(limits)
    assert (type(limits.snap), type(limits.speed)) == (float, float)
    assert [kind.name for kind in limits.active] == ["speed", "snap", "tilt"]
    np.testing.assert_array_equal(limits.as_array(), [5.0, NAN, NAN, 800.0, 0.5, *[NAN] * 5])
    assert limits.to_dict() == {"speed": 5.0, "snap": 800.0, "tilt": 0.5}
    assert limits == Limits(speed=5.0, snap=800.0, tilt=0.5)
    assert [field.name for field in dataclasses.fields(Limits)][:-1] == [
        kind.name for kind in KINDS
    ]


def test_unknown_limits_are_named():
    refuses("unknown limit 'velocity'; known are speed, thrust_acceleration", Limits.from_dict,
            {"velocity": 5.0})  # fmt: skip


positive = st.floats(1e-6, 1e9)
AIRFRAME = Airframe(mass=0.85, inertia=1e-3, lever=0.106)
HOVER = 0.85 * GRAVITY / 4.0
LIMIT_VALUES = {
    "rotor_thrust": st.floats(HOVER, 1e9, exclude_min=True),
    "least_rotor_thrust": st.just(0.0) | st.floats(1e-6, HOVER, exclude_max=True),
    "thrust_acceleration": st.floats(GRAVITY, 1e9, exclude_min=True),
    "tilt": st.floats(1e-6, math.pi / 2, exclude_max=True),
    "least_thrust_acceleration": st.floats(1e-6, GRAVITY, exclude_max=True),
}
limits_strategy = (
    st.fixed_dictionaries(
        {"speed": positive},
        optional={kind.name: LIMIT_VALUES.get(kind.name, positive) for kind in KINDS[1:]}
        | {"airframe": st.just(AIRFRAME)},
    )
    .filter(lambda values: not set(values) & set(ROTORS) or "airframe" in values)
    .map(lambda values: Limits(**values))
)


@settings(deadline=None, derandomize=True)
@given(limits_strategy)
def test_limits_through_json(limits):
    assert Limits.from_dict(through_json(limits)) == limits


def test_limited_values_of_a_known_motion():
    velocity, acceleration = np.array([3.0, 4.0, 0.0]), np.array([GRAVITY, 0.0, 0.0])
    jerk, snap = np.array([0.0, 0.0, -2.0]), np.array([[1.0, 2.0, 2.0], [0.0, 0.0, 0.0]])
    values = limited_values([velocity, acceleration, jerk, snap])
    assert values["speed"] == 5.0
    assert values["thrust_acceleration"] == pytest.approx(GRAVITY * math.sqrt(2.0))
    assert values["least_thrust_acceleration"] == values["thrust_acceleration"]
    assert values["tilt"] == pytest.approx(math.pi / 4)
    assert values["jerk"] == 2.0
    np.testing.assert_array_equal(values["snap"], [3.0, 0.0])
    # F = g (1, 0, 1), j = (0, 0, -2): F x j = (0, 2 g, 0), r = -1 / g, s - 2 r j = s - 4 / g e3
    assert values["body_rate"] == pytest.approx(1.0 / GRAVITY)
    x, y, z = 1.0, 2.0, 2.0 - 4.0 / GRAVITY
    first = np.linalg.norm([-y, x - z, y]) / (2.0 * GRAVITY)
    np.testing.assert_allclose(values["angular_acceleration"], [first, 2.0 / GRAVITY**2])
    assert set(values) == {kind.name for kind in KINDS} - set(ROTORS)
    assert set(limited_values([velocity])) == {"speed"}
    assert "jerk" not in limited_values([velocity, acceleration])
    upside_down = limited_values([velocity, np.array([0.0, 0.0, -2 * GRAVITY])])
    assert upside_down["tilt"] == pytest.approx(math.pi)
    falling = limited_values([velocity, np.array([0.0, 0.0, -GRAVITY]), jerk, snap[0]])
    assert falling["body_rate"] == falling["angular_acceleration"] == math.inf


def test_turning_is_the_motion_of_the_thrust_direction():
    """A thrust that turns in a plane, alone and while it grows."""
    t, rate, change, growth = 0.3, 1.7, 2.3, 0.6
    angle = rate * t + 0.5 * change * t**2
    speed = rate + change * t
    n, across = (
        np.array([np.cos(angle), 0, np.sin(angle)]),
        np.array([-np.sin(angle), 0, np.cos(angle)]),
    )
    for level in (GRAVITY, 0.5):
        size = level * (1.0 + growth * t)
        thrust = size * n
        jerk = level * growth * n + size * speed * across
        snap = 2 * level * growth * speed * across + size * (change * across - speed**2 * n)
        values = limited_values([np.zeros(3), thrust - [0.0, 0.0, GRAVITY], jerk, snap])
        assert values["body_rate"] == pytest.approx(speed)
        assert values["angular_acceleration"] == pytest.approx(change)


def test_rotor_thrusts_are_what_the_worst_heading_needs():
    """The mixer of an X, over headings: nothing outside, and both ends attained."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        v, a, j, s = rng.normal(size=(4, 3)) * np.array([5.0, 5.0, 50.0, 900.0])[:, None]
        values = limited_values([v, a, j, s], AIRFRAME)
        collective = AIRFRAME.mass * values["thrust_acceleration"]
        torque = AIRFRAME.inertia * values["angular_acceleration"]
        angle = np.linspace(0.0, 2.0 * np.pi, 2001)  # of the torque, seen from the body
        by_roll, by_pitch = torque * np.cos(angle), torque * np.sin(angle)
        rotors = np.array(
            [collective / 4 + (y * by_roll + x * by_pitch) / (4 * AIRFRAME.lever)
             for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
        )  # fmt: skip
        assert values["rotor_thrust"] == pytest.approx(rotors.max(), rel=1e-6)
        assert values["least_rotor_thrust"] == pytest.approx(rotors.min(), rel=1e-6, abs=1e-6)


def test_kappa_of_rotor_thrust_and_the_value_it_stands_for():
    limits = Limits(rotor_thrust=6.0, least_rotor_thrust=0.5, airframe=AIRFRAME, speed=2.0)
    values = {"speed": 1.0, "rotor_thrust": 3.0, "least_rotor_thrust": np.array([0.5, 0.0, 9.0])}
    ratios = limits.ratios(values)
    assert ratios["rotor_thrust"] == 0.5
    np.testing.assert_allclose(ratios["least_rotor_thrust"], [1.0, HOVER / (HOVER - 0.5), 0.0])
    least = KINDS[[kind.name for kind in KINDS].index("least_rotor_thrust")]
    assert limits.attained(least, float(ratios["least_rotor_thrust"][1])) == pytest.approx(0.0)
    assert limits.attained(least, 1e9) is None
    np.testing.assert_allclose(limits.as_array()[-2:], [24.0 / 0.85, GRAVITY - 2.0 / 0.85])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"rotor_thrust": 6.0}, "limit rotor_thrust is set without an airframe"),
        ({"least_rotor_thrust": 0.0}, "limit least_rotor_thrust is set without an airframe"),
        (
            {"rotor_thrust": 2.0, "airframe": AIRFRAME},
            "limit rotor_thrust is 2 N; it must be above a qu",
        ),
        (
            {"least_rotor_thrust": 2.1, "airframe": AIRFRAME},
            "limit least_rotor_thrust is 2.1 N; it must be be",
        ),
        ({"rotor_thrust": 6.0, "airframe": 3}, "airframe is 3; it must be a peakflight.Airframe"),
        ({"airframe": AIRFRAME}, "no limit is set"),
        (
            {"least_rotor_thrust": -1.0, "airframe": AIRFRAME},
            "limit least_rotor_thrust is -1; it must be posi",
        ),
    ],
)
def test_rotor_limits_refuse(values, message):
    refuses(message, Limits, **values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"mass": 0.0}, "airframe mass is 0.0; it must be from"),
        ({"lever": "long"}, "airframe lever is 'long'; it must be a number"),
        ({"inertia": math.inf}, "airframe inertia is inf; it must be from"),
    ],
)
def test_airframe_refuses(values, message):
    refuses(message, Airframe, **{"mass": 1.0, "inertia": 1e-3, "lever": 0.1, **values})


def test_airframe_from_what_is_none():
    refuses("airframe is {'mass': 1.0}; it must have mass, inertia, lever", Limits.from_dict,
            {"speed": 1.0, "airframe": {"mass": 1.0}})  # fmt: skip


def test_keeps_is_from_above_and_for_least_thrust_from_below():
    assert keeps("speed", 5.0, 5.0)
    assert not keeps("speed", 5.1, 5.0)
    assert keeps("least_thrust_acceleration", 5.0, 5.0)
    assert not keeps("least_thrust_acceleration", 4.9, 5.0)


# ---- SplineClass ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("jerk",), (5, 4)),
        (("snap",), (7, 6)),
        (("acceleration",), (3, 2)),
        (("velocity",), (3, 0)),
        (("snap", 5), (5, 3)),
        (("jerk", 9), (9, 4)),
        (("jerk", 3), (3, 1)),
        (("jerk", 7, 3), (7, 3)),
        (({"jerk": 1, 4: 0.5},), (7, 6)),
        (({"3": 2.0},), (5, 4)),
        (([0, 0, 0, 1.0],), (5, 4)),
        (({"crackle": 1}, 11), (11, 8)),
        ((np.array([0.0, 0.0, 1.0]),), (3, 2)),
    ],
)
def test_what_is_left_out_of_a_class_is_filled_in(arguments, expected):
    found = SplineClass.of(*arguments)
    assert (found.degree, found.continuity) == expected
    assert len(found.weights) == found.degree + 1


@pytest.mark.parametrize(
    ("arguments", "continuity"),
    [(("jerk",), 2), (("snap",), 3), (("snap", 5), 3), (("jerk", 7), 2), (("jerk", None, 4), 4)],
)
def test_derivatives_at_inner_waypoints_lower_the_continuity_that_is_natural(arguments, continuity):
    assert SplineClass.of(*arguments, inner=True).continuity == continuity


def test_properties_of_a_class():
    jerk, paper = SplineClass.of("jerk"), SplineClass.of("snap", 5)
    assert jerk.weights == (0, 0, 0, 1.0, 0, 0)
    assert (jerk.end_orders, jerk.cost_order, jerk.is_homogeneous, jerk.is_classical) == (
        2, 3, True, True,
    )  # fmt: skip
    assert (paper.end_orders, paper.cost_order, paper.is_classical) == (2, 4, False)
    assert SplineClass.of("jerk", 5, 2).is_classical
    assert not SplineClass.of("jerk", 5, 1).is_classical
    mixed = SplineClass.of({"jerk": 1, "snap": 0.1})
    assert not mixed.is_homogeneous
    assert not mixed.is_classical
    assert SplineClass.of("jerk", 6).end_orders == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("speed",), "minimize names 'speed'; known are velocity, acceleration, jerk, snap, or"),
        (({"jerk": -1},), "minimize weighs 'jerk' by -1; it must be 0 or more"),
        (({"jerk": NAN},), "minimize weighs 'jerk' by nan; it must be 0 or more"),
        (({"jerk": "much"},), "minimize weighs 'jerk' by 'much'; it must be 0 or more"),
        (({"jerk": 0},), "minimize weighs no derivative; weigh at least one, such as jerk"),
        (({"position": 1},), "minimize weighs no derivative"),
        (([],), "minimize weighs no derivative"),
        (({-1: 1},), "minimize names -1; known are"),
        (({2.5: 1},), "minimize names 2.5; known are"),
        (("jerk", 2), "degree is 2; it must be 3 to 11"),
        (("jerk", 12), "degree is 12; it must be 3 to 11"),
        (("jerk", 5.0), "degree is 5.0; it must be a whole number"),
        (("jerk", True), "degree is True; it must be a whole number"),
        (({7: 1},), "degree is 13; it must be 3 to 11"),
        (({6: 1}, 5), "minimize weighs derivative 6, which is zero at degree 5"),
        (("jerk", 5, 5), "continuity is 5; degree 5 allows 0 to 4"),
        (("jerk", 5, -1), "continuity is -1; degree 5 allows 0 to 4"),
        (("jerk", 5, "C2"), "continuity is 'C2'; it must be a whole number"),
    ],
)
def test_classes_refuse(arguments, message):
    refuses(message, SplineClass.of, *arguments)


# ---- Problem --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"waypoints": [[0, 0, 0]]}, "1 waypoint given; a trajectory needs at least two"),
        ({"waypoints": np.zeros((0, 3))}, "0 waypoints given; a trajectory needs at least two"),
        ({"waypoints": [[0, 0], [1, 1]]}, r"waypoints has shape \(2, 2\); it must be \(n, 3\)"),
        ({"waypoints": [0, 0, 1]}, r"waypoints has shape \(3,\); it must be \(n, 3\)"),
        ({"waypoints": [[0, 0, 0], [1, 1]]}, "waypoints must be numbers in an array, all rows of"),
        ({"waypoints": "abc"}, "waypoints must be numbers in an array"),
        ({"waypoints": [[0, 0, 0], [0, NAN, 1]]}, "waypoint 1 has y = nan; it must be finite"),
        ({"waypoints": [[0, 0, math.inf], [0, 0, 1]]}, "waypoint 0 has z = inf; it must be finite"),
        (
            {"waypoints": [*POINTS, POINTS[2], POINTS[0]]},
            r"waypoint 3 repeats waypoint 2 \(1, 2, 1.5\); merge them first \(peakflight.tidy",
        ),
        ({"limits": {"speed": 5.0}}, r"limits is \{'speed': 5.0\}; it must be a peakflight.Limits"),
        (
            {"limits": Limits(tilt=0.5, least_thrust_acceleration=3.0)},
            "none of the limits speed, thrust_acceleration, jerk, snap, rotor_thrust is set; "
            "set at least one",
        ),
        ({"minimize": "comfort"}, "minimize names 'comfort'"),
        ({"degree": 1}, "degree is 1; it must be 3 to 11"),
        ({"continuity": 9}, "continuity is 9; degree 5 allows 0 to 4"),
        ({"yaw": [0.0, 1.0]}, r"yaw has shape \(2,\); it must be \(3\)"),
        ({"yaw": [0.0, NAN, 1.0]}, "waypoint 1 has yaw = nan; it must be finite"),
        ({"start": {"speed": [0, 0, 0]}}, "start names derivative 'speed'; known are velocity,"),
        ({"start": {"position": [0, 0, 0]}}, "start names derivative 'position'; known are"),
        ({"end": {0: [0, 0, 0]}}, "end names derivative 0; known are velocity"),
        ({"start": {"velocity": [1, 2]}}, r"start derivative 1 has shape \(2,\); it must be \(3\)"),
        ({"start": [1.0, 2.0, 3.0]}, "start"),
        ({"start": [[1.0, 2.0]]}, r"start has shape \(1, 2\); it must be \(n, 3\)"),
        ({"end": {"jerk": [0, 0, math.inf]}}, "end has an infinite derivative"),
        ({"end": {5: [0, 0, 0]}}, "end fixes derivative 5; degree 5 allows up to 4"),
        ({"derivatives": {0: {1: [0, 0, 0]}}}, "derivatives are given at waypoint 0; inner"),
        ({"derivatives": {2: {1: [0, 0, 0]}}}, r"derivatives are given at waypoint 2; .* 1 to 1"),
        ({"derivatives": {1: {"nap": [0, 0, 0]}}}, "waypoint 1 names derivative 'nap'"),
    ],
)
def test_problems_refuse(change, message):
    values = {"waypoints": POINTS, "limits": LIMITS, **change}
    refuses(message, Problem, values.pop("waypoints"), **values)


def test_a_problem_is_frozen_and_shares_nothing():
    points, velocity = np.array(POINTS), np.ones(3)
    weights, inner = {"jerk": 1.0}, {1: {"velocity": velocity}}
    problem = Problem(points, limits=LIMITS, minimize=weights, derivatives=inner, yaw=[0, 1, 2])
    points[:] = velocity[:] = 9.0
    weights["snap"] = 3.0
    inner[1] = {"velocity": [7, 7, 7]}
    np.testing.assert_array_equal(problem.waypoints, POINTS)
    np.testing.assert_array_equal(problem.derivatives[1], [[1.0, 1.0, 1.0]])
    assert problem.spline_class.weights == (0, 0, 0, 1.0, 0, 0)
    assert problem.spline_class.degree == 5
    assert_frozen(problem)
    for array in (problem.waypoints, problem.start, problem.end, problem.yaw,
                  problem.derivatives[1]):  # fmt: skip
        assert_read_only(array)


def test_states_are_filled_in():
    """Orders left out are rest at the ends and free inside; NaN is free anywhere."""
    problem = Problem(
        POINTS,
        limits=LIMITS,
        degree=7,
        start={"velocity": [1, 2, NAN], "snap": [0, 0, 5]},
        end=[[None, 0, 3]],
        derivatives={1: {"acceleration": [1, 1, 1]}},
    )
    zeros, free = [0.0] * 3, [NAN] * 3
    np.testing.assert_array_equal(problem.start, [[1, 2, NAN], zeros, zeros, [0, 0, 5]])
    np.testing.assert_array_equal(problem.end, [[NAN, 0, 3], zeros, zeros])
    np.testing.assert_array_equal(problem.derivatives[1], [free, [1, 1, 1]])
    assert list(problem.fixed) == [0, 1, 2]
    resting = Problem(POINTS, limits=LIMITS, degree=6)
    np.testing.assert_array_equal(resting.start, [zeros, zeros])


def test_natural_degree_and_continuity():
    plain = Problem(POINTS, limits=LIMITS)
    assert (plain.degree, plain.continuity) == (None, None)
    assert (plain.spline_class.degree, plain.spline_class.continuity) == (5, 4)
    paper = Problem(POINTS, limits=LIMITS, minimize="snap", degree=5)
    assert paper.spline_class.continuity == 3
    inner = Problem(POINTS, limits=LIMITS, derivatives={1: {"velocity": [1, 0, 0]}})
    assert inner.spline_class.continuity == 2


@pytest.mark.parametrize(
    ("options", "scalable"),
    [
        ({}, True),
        ({"minimize": "snap", "degree": 5}, True),
        ({"minimize": {"jerk": 1, "snap": 1}}, False),
        ({"start": {"velocity": [0, 0, 0]}}, True),
        ({"start": {"velocity": [1, 0, 0]}}, False),
        ({"end": {"acceleration": [0, 0, -1]}}, False),
        ({"derivatives": {1: {"velocity": [0, 0, 0]}}}, True),
        ({"derivatives": {1: {"velocity": [NAN, NAN, 1]}}}, False),
        ({"end": {"velocity": [NAN, NAN, NAN]}}, True),
    ],
)
def test_slowing_down_keeps_the_path_only_without_motion_that_is_fixed(options, scalable):
    assert Problem(POINTS, limits=LIMITS, **options).is_scalable == scalable


def test_leg_lengths():
    np.testing.assert_allclose(
        Problem(POINTS, limits=LIMITS).leg_lengths, [1.0, math.sqrt(4.25)], rtol=1e-15
    )


coordinates = st.floats(-1e6, 1e6)
vectors = st.tuples(*[st.one_of(coordinates, st.just(NAN))] * 3)


@st.composite
def problems(draw):
    count = draw(st.integers(2, 6))
    points = draw(
        st.lists(st.tuples(*[coordinates] * 3), min_size=count, max_size=count, unique=True)
    )
    minimize = draw(
        st.one_of(
            st.sampled_from(["acceleration", "jerk", "snap"]),
            st.dictionaries(
                st.sampled_from(["jerk", "snap", 2, 3]), st.floats(1e-3, 1e3), min_size=1
            ),
            st.just([0.0, 0.5, 0.0, 1.0]),
        )
    )
    degree = draw(st.sampled_from([None, 5, 6, 7, 9]))
    states = st.dictionaries(st.sampled_from(["velocity", 2]), vectors, max_size=2)
    inner = {
        index: draw(states) for index in draw(st.sets(st.integers(1, count - 2)))
    } if count > 2 else {}  # fmt: skip
    limits = draw(limits_strategy)
    return Problem(
        points,
        limits=limits,
        minimize=minimize,
        degree=degree,
        start=draw(st.one_of(st.none(), states)),
        end=draw(st.one_of(st.none(), states)),
        derivatives=inner,
        yaw=None if limits.on_rotors or draw(st.booleans()) else np.linspace(0.1, 1.0, count),
    )


def assert_same_problem(a, b):
    np.testing.assert_array_equal(a.waypoints, b.waypoints)
    assert a.limits == b.limits
    assert a.spline_class == b.spline_class
    np.testing.assert_array_equal(a.start, b.start)
    np.testing.assert_array_equal(a.end, b.end)
    assert list(a.derivatives) == list(b.derivatives)
    for index in a.derivatives:
        np.testing.assert_array_equal(a.derivatives[index], b.derivatives[index])
    assert (a.yaw is None) == (b.yaw is None)
    if a.yaw is not None:
        np.testing.assert_array_equal(a.yaw, b.yaw)


@settings(deadline=None, derandomize=True)
@given(problems())
def test_problems_through_json(problem):
    """Not one bit is lost, and what was filled in stays."""
    assert_same_problem(Problem.from_dict(through_json(problem)), problem)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "waypoints is missing"),
        ({"waypoints": POINTS}, "limits is missing"),
        (
            {"waypoints": POINTS, "limits": {"speed": 1.0}, "speed": 3},
            "unknown entry 'speed' in the problem",
        ),
        ({"waypoints": POINTS, "limits": {"sped": 1.0}}, "unknown limit 'sped'; known are speed"),
    ],
)
def test_problems_from_bad_dictionaries_are_refused(values, message):
    refuses(message, Problem.from_dict, values)


# ---- Trajectory -----------------------------------------------------------------------------


def some_trajectory(seed=0, pieces=4, degree=5, axes=3, start_time=0.0):
    """Random pieces that do not meet: operations must not rely on that."""
    rng = np.random.default_rng(seed)
    coefficients = rng.normal(size=(pieces, degree + 1, axes))
    return Trajectory(coefficients, rng.uniform(0.5, 2.0, size=pieces), start_time)


def as_ppoly(trajectory):
    """Built here and not by `to_ppoly`: descending coefficients, (N+1, K, D)."""
    return PPoly(
        np.array([[trajectory.coefficients[k, j] for k in range(len(trajectory))]
                  for j in range(trajectory.degree, -1, -1)]),
        trajectory.start_time + np.concatenate(([0.0], np.cumsum(trajectory.segment_times))),
    )  # fmt: skip


def inner_times(trajectory, count=57):
    """Times that are no joints: there, values depend on the side."""
    lengths = trajectory.segment_times[:, None] * np.linspace(0.01, 0.99, count)
    return (trajectory.breakpoints[:-1, None] + lengths).ravel()


def assert_same_motion(a, b, tolerance=1e-12):
    assert a.end_time == pytest.approx(b.end_time, rel=1e-14)
    t = np.linspace(a.start_time, a.end_time, 501)[1:-1]
    for order in range(3):
        expected = b(t, order)
        # cut and shifted polynomials are rounded by the sizes of their terms
        np.testing.assert_allclose(
            a(t, order), expected, rtol=0, atol=tolerance * (1.0 + np.abs(expected).max())
        )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.ones((2, 3)), [1.0]), r"coefficients has shape \(2, 3\); it must be \(n, n, n\)"),
        ((np.ones((2, 3, 1)), [1.0]), r"coefficients have shape \(2, 3, 1\) and segment_times \(1"),
        ((np.ones((0, 3, 1)), []), r"coefficients have shape \(0, 3, 1\)"),
        ((np.ones((1, 3, 0)), [1.0]), r"coefficients have shape \(1, 3, 0\)"),
        ((np.ones((2, 3, 1)), [1.0, 0.0]), "segment 1 lasts 0.0 s; it must be positive"),
        ((np.ones((2, 3, 1)), [-1.0, 1.0]), "segment 0 lasts -1.0 s; it must be positive"),
        ((np.ones((2, 3, 1)), [1.0, NAN]), "segment 1 lasts nan s; it must be positive"),
        ((np.ones((2, 3, 1)), [1.0, 1e-10]), "segment 1 lasts 1e-10 s; .* from 1e-09 to 1e\\+09 s"),
        ((np.ones((2, 3, 1)), [1.0, math.inf]), "segment 1 lasts inf s; it must be positive"),
        (([[[1.0]], [[NAN]]], [1.0, 1.0]), "segment 1 has a coefficient that is not finite"),
        (([[[math.inf]], [[1.0]]], [1.0, 1.0]), "segment 0 has a coefficient that is not finite"),
        (([[["x"]]], [1.0]), "coefficients must be numbers in an array"),
        (([[[1.0]]], [1.0], NAN), "start_time"),
        (([[[1.0]]], [1.0], math.inf), "start_time"),
    ],
)
def test_trajectories_refuse(arguments, message):
    refuses(message, Trajectory, *arguments)


def test_a_trajectory_is_frozen_and_shares_nothing():
    coefficients, times = np.ones((2, 4, 3)), np.ones(2)
    trajectory = Trajectory(coefficients, times, 1)
    coefficients[:] = times[:] = 7.0
    np.testing.assert_array_equal(trajectory.coefficients, np.ones((2, 4, 3)))
    np.testing.assert_array_equal(trajectory.segment_times, [1.0, 1.0])
    assert_frozen(trajectory)
    for array in (trajectory.coefficients, trajectory.segment_times, trajectory.breakpoints):
        assert_read_only(array)
    assert (len(trajectory), trajectory.degree, trajectory.axes) == (2, 3, 3)
    assert (trajectory.duration, trajectory.start_time, trajectory.end_time) == (2.0, 1.0, 3.0)


@pytest.mark.parametrize("degree", [0, 1, 3, 5, 7, 11])
@pytest.mark.parametrize("axes", [1, 3, 4])
def test_values_are_those_of_a_ppoly(degree, axes):
    trajectory = some_trajectory(degree, degree=degree, axes=axes, start_time=-1.5)
    twin = as_ppoly(trajectory)
    inside = inner_times(trajectory)
    joints = trajectory.breakpoints
    for order in range(degree + 2):
        for t in (inside, joints, inside[:12].reshape(3, 4), inside[5], joints[1]):
            expected = twin(t, order) if order <= degree else np.zeros((*np.shape(t), axes))
            found = trajectory(t, order)
            assert found.shape == (*np.shape(t), axes)
            # sums of the same terms; Horner against Horner, but not in the same local time
            size = np.abs(expected).max() + np.abs(trajectory.coefficients).max()
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * size)


def test_at_a_joint_the_later_piece_counts_and_at_the_end_the_last():
    steps = Trajectory([[[1.0]], [[2.0]], [[3.0]]], [1.0, 1.0, 1.0])
    np.testing.assert_array_equal(steps([0.0, 0.5, 1.0, 2.0, 3.0])[:, 0], [1, 1, 2, 3, 3])
    assert steps(np.nextafter(1.0, 0.0))[0] == 1.0


@pytest.mark.parametrize("t", [-0.1, 3.1, NAN, math.inf, [0.5, 9.0], [[NAN], [1.0]]])
def test_times_outside_are_refused(t):
    steps = Trajectory([[[1.0]], [[2.0]]], [1.0, 2.0])
    with pytest.raises(ValueError, match=r"time .* s is outside the trajectory, .* from 0 to 3 s"):
        steps(t)


def test_times_that_rounding_put_outside_are_not():
    line = Trajectory([[[0.0], [1.0]]] * 10, [0.1] * 10, start_time=100.0)
    assert line(line.end_time + 1e-9)[0] == pytest.approx(0.1)  # 1e-9 of 101 s is allowed
    assert line(line.start_time - 1e-9)[0] == 0.0
    with pytest.raises(ValueError, match="outside"):
        line(line.end_time + 1e-6)


def test_negative_orders_are_refused():
    trajectory = some_trajectory()
    with pytest.raises(ValueError, match="derivative is -1; it must be 0 or more"):
        trajectory(0.5, -1)
    with pytest.raises(ValueError, match="order is -1; it must be 0 or more"):
        trajectory.derivative(-1)


@pytest.mark.parametrize("order", range(8))
def test_derivative_is_a_trajectory(order):
    trajectory = some_trajectory(start_time=2.0)
    found = trajectory.derivative(order)
    assert isinstance(found, Trajectory)
    assert found.degree == max(5 - order, 0)
    assert found.start_time == 2.0
    t = inner_times(trajectory)
    np.testing.assert_allclose(found(t), trajectory(t, order), rtol=1e-12, atol=1e-12)
    twin = as_ppoly(trajectory)
    expected = twin.derivative(order)(t) if 0 < order <= 5 else twin(t) * (order == 0)
    np.testing.assert_allclose(found(t), expected, rtol=0, atol=1e-9)


def test_derivative_of_a_constant_is_zero():
    still = Trajectory(np.full((2, 1, 3), 4.0), [1.0, 1.0])
    found = still.derivative()
    assert found.degree == 0
    np.testing.assert_array_equal(found.coefficients, np.zeros((2, 1, 3)))
    np.testing.assert_array_equal(still([0.5, 1.5], 1), np.zeros((2, 3)))


def test_samples_are_even_and_have_both_ends():
    trajectory = some_trajectory()
    found = trajectory.sample(5, 1)
    assert found.shape == (4, 5, 3)
    for k in range(4):
        for axis in range(3):
            twin = Polynomial(trajectory.coefficients[k, :, axis]).deriv()
            u = np.linspace(0.0, trajectory.segment_times[k], 5)
            np.testing.assert_allclose(found[k, :, axis], twin(u), rtol=1e-12, atol=1e-12)


def test_at_takes_pieces_and_local_times_of_any_shape():
    trajectory = some_trajectory()
    found = trajectory.at([[0], [3]], [0.0, 0.1, 0.2], 2)
    assert found.shape == (2, 3, 3)
    np.testing.assert_allclose(found[1, 2], trajectory.pieces()[3].at(0, 0.2, 2), rtol=1e-13)


def test_pieces_run_at_their_own_time():
    trajectory = some_trajectory(start_time=3.0)
    pieces = trajectory.pieces()
    assert len(pieces) == 4
    for k, piece in enumerate(pieces):
        assert len(piece) == 1
        assert piece.start_time == trajectory.breakpoints[k]
        middle = piece.start_time + 0.5 * piece.duration
        np.testing.assert_allclose(piece(middle), trajectory(middle), rtol=1e-12)
    assert trajectory.piece(-1).start_time == trajectory.breakpoints[-2]
    for index in (4, -5):
        with pytest.raises(IndexError, match=f"piece {index}: there are 4"):
            trajectory.piece(index)


@pytest.mark.parametrize("part", [0.1, 0.37, 0.5, 0.93])
def test_split_and_join_give_the_same_back(part):
    trajectory = some_trajectory(start_time=-2.0)
    t = trajectory.start_time + part * trajectory.duration
    before, after = trajectory.split(t)
    assert before.start_time == trajectory.start_time
    assert before.end_time == pytest.approx(t, rel=1e-14)
    assert after.start_time == pytest.approx(t, rel=1e-14)
    assert len(before) + len(after) == len(trajectory) + 1
    assert_same_motion(before.join(after), trajectory)


@pytest.mark.parametrize("joint", [1, 2, 3])
def test_split_at_a_joint_cuts_no_piece(joint):
    trajectory = some_trajectory()
    before, after = trajectory.split(float(trajectory.breakpoints[joint]))
    assert (len(before), len(after)) == (joint, 4 - joint)
    np.testing.assert_array_equal(
        np.concatenate((before.coefficients, after.coefficients)), trajectory.coefficients
    )


@pytest.mark.parametrize("t", [0.0, -1.0, 99.0, NAN])
def test_split_must_be_inside(t):
    with pytest.raises(ValueError, match="cannot split at"):
        some_trajectory().split(t)
    trajectory = some_trajectory()
    with pytest.raises(ValueError, match="cannot split at"):
        trajectory.split(trajectory.end_time)


def test_join_follows_at_once_and_raises_the_degree():
    first, second = some_trajectory(1, degree=3), some_trajectory(2, degree=5, start_time=50.0)
    joined = first.join(second)
    assert (joined.degree, len(joined), joined.start_time) == (5, 8, 0.0)
    assert joined.duration == pytest.approx(first.duration + second.duration)
    t = inner_times(first)
    np.testing.assert_allclose(joined(t), first(t), rtol=1e-12, atol=1e-12)
    late = inner_times(second)
    np.testing.assert_allclose(
        joined(late - 50.0 + first.duration), second(late), rtol=1e-9, atol=1e-9
    )
    with pytest.raises(ValueError, match="cannot join 3 axes and 2"):
        first.join(some_trajectory(axes=2))
    whole = Trajectory.concatenate([first, second, first])
    assert len(whole) == 12


def test_shift_and_translate():
    trajectory = some_trajectory()
    t = inner_times(trajectory)
    later = trajectory.shift(7.5)
    np.testing.assert_array_equal(later.coefficients, trajectory.coefficients)
    np.testing.assert_allclose(later(t + 7.5), trajectory(t), rtol=1e-9, atol=1e-9)
    moved = trajectory.translate([1.0, -2.0, 3.0])
    np.testing.assert_allclose(moved(t) - trajectory(t), np.tile([1.0, -2.0, 3.0], (len(t), 1)))
    np.testing.assert_array_equal(moved(t, 1), trajectory(t, 1))
    refuses(r"offset has shape \(2,\); it must be \(3\)", trajectory.translate, [1.0, 2.0])
    refuses("segment 0 has a coefficient that is not finite", trajectory.translate, [NAN, 0, 0])


def test_reverse_flies_backwards():
    trajectory = some_trajectory(start_time=1.0)
    back = trajectory.reverse()
    assert (back.start_time, back.end_time) == (1.0, pytest.approx(trajectory.end_time))
    t = inner_times(trajectory)
    mirrored = trajectory.start_time + trajectory.end_time - t
    for order in range(6):
        expected = (-1.0) ** order * trajectory(mirrored, order)
        size = 1.0 + np.abs(expected).max()
        np.testing.assert_allclose(back(t, order), expected, rtol=0, atol=1e-10 * size)
    assert_same_motion(back.reverse(), trajectory, tolerance=1e-11)


@pytest.mark.parametrize("factor", [0.25, 1.0, 3.7])
def test_stretch_divides_derivatives_by_powers(factor):
    trajectory = some_trajectory(start_time=2.0)
    slow = trajectory.stretch(factor)
    assert slow.start_time == 2.0
    assert slow.duration == pytest.approx(factor * trajectory.duration)
    t = inner_times(trajectory)
    for order in range(6):
        expected = trajectory(t, order) / factor**order
        size = np.abs(expected).max()
        found = slow(2.0 + factor * (t - 2.0), order)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize("factor", [0.0, -1.0, NAN, math.inf])
def test_stretch_by_nothing_sensible_is_refused(factor):
    with pytest.raises(ValueError, match=r"stretch|factor|segment|positive"):
        some_trajectory().stretch(factor)


def test_elevate_changes_the_degree_only():
    trajectory = some_trajectory()
    higher = trajectory.elevate(9)
    assert higher.degree == 9
    t = inner_times(trajectory)
    np.testing.assert_allclose(higher(t), trajectory(t), rtol=1e-13, atol=1e-13)
    assert trajectory.elevate(5).degree == 5
    with pytest.raises(ValueError, match="cannot lower the degree from 5 to 4"):
        trajectory.elevate(4)


def test_to_ppoly_is_the_same_function():
    trajectory = some_trajectory(start_time=4.0)
    found, twin = trajectory.to_ppoly(), as_ppoly(trajectory)
    np.testing.assert_array_equal(found.c, twin.c)
    np.testing.assert_array_equal(found.x, twin.x)


numbers = st.floats(-1e300, 1e300)


@settings(deadline=None, derandomize=True)
@given(st.data())
def test_trajectories_through_json(data):
    pieces, size, axes = (data.draw(st.integers(1, 4)) for _ in range(3))
    count = pieces * size * axes
    values = data.draw(st.lists(numbers, min_size=count, max_size=count))
    times = data.draw(st.lists(st.floats(1e-9, 1e9), min_size=pieces, max_size=pieces))
    trajectory = Trajectory(
        np.reshape(values, (pieces, size, axes)), times, data.draw(st.floats(-1e9, 1e9))
    )
    copy = Trajectory.from_dict(through_json(trajectory))
    np.testing.assert_array_equal(copy.coefficients, trajectory.coefficients)
    np.testing.assert_array_equal(copy.segment_times, trajectory.segment_times)
    assert copy.start_time == trajectory.start_time


@pytest.mark.parametrize("name", ["coefficients", "segment_times"])
def test_trajectories_from_incomplete_dictionaries_are_refused(name):
    values = some_trajectory().to_dict()
    del values[name]
    refuses(f"{name} is missing", Trajectory.from_dict, values)


# ---- Report, History ------------------------------------------------------------------------


def some_report(**changes):
    values = {
        "feasible": False,
        "peaks": {"speed": [0.5, 1.0, 0.2], "snap": [0.9, 0.3, 1.5]},
        "joint_residual": 1e-12,
        "waypoint_error": 0.25,
        "state_error": 1e-13,
        "problems": ["snap reaches 1.5 times its limit", "waypoint 1 is missed"],
    }
    return Report(**(values | changes))


def test_a_report_says_what_binds():
    report = some_report()
    assert report.worst == 1.5
    assert report.binding == ("snap", "speed", "snap")
    np.testing.assert_array_equal(report.segment_peaks, [0.9, 1.0, 1.5])
    assert report.binding_segments("speed") == [1]
    assert report.binding_segments("snap") == [2]
    close = some_report(peaks={"speed": [0.9989, 0.9991, 1.0]})
    assert close.binding_segments("speed") == [1, 2]


def test_a_report_is_frozen_and_shares_nothing():
    kappa = np.array([0.5, 1.0])
    report = some_report(peaks={"speed": kappa})
    kappa[:] = 9.0
    np.testing.assert_array_equal(report.peaks["speed"], [0.5, 1.0])
    assert_frozen(report)
    assert_read_only(report.peaks["speed"])
    assert isinstance(report.problems, tuple)
    refuses(r"speed has shape \(1, 2\); it must be \(n\)", some_report, peaks={"speed": [[1, 2]]})


@settings(deadline=None, derandomize=True)
@given(
    st.booleans(),
    st.dictionaries(
        st.sampled_from([kind.name for kind in KINDS]),
        st.lists(st.floats(0.0, 1e9), min_size=3, max_size=3),
        min_size=1,
    ),
    st.floats(0.0, 1e300),
    st.lists(st.text(max_size=20), max_size=3),
)
def test_reports_through_json(feasible, peaks, residual, problems):
    report = some_report(feasible=feasible, peaks=peaks, joint_residual=residual, problems=problems)
    copy = Report.from_dict(through_json(report))
    for field in dataclasses.fields(Report):
        if field.name != "peaks":
            assert getattr(copy, field.name) == getattr(report, field.name)
    assert list(copy.peaks) == list(report.peaks)
    for name in report.peaks:
        np.testing.assert_array_equal(copy.peaks[name], report.peaks[name])


def test_history_has_one_row_an_iteration():
    history = History(segment_times=np.ones((5, 3)), kappa=np.ones((5, 3, 4)))
    assert len(history) == 5
    assert_frozen(history)
    assert_read_only(history.segment_times)
    assert_read_only(history.kappa)
    refuses(r"kappa has shape \(4, 3, 4\); it must be \(5, 3, n\)", History,
            segment_times=np.ones((5, 3)), kappa=np.ones((4, 3, 4)))  # fmt: skip
    refuses(r"history has shape \(3,\); it must be \(n, n\)", History, segment_times=[1, 2, 3])


# ---- Plan -----------------------------------------------------------------------------------


def full_plan(hand_plan, **changes):
    """A plan with everything in it that a plan can have."""
    plan = hand_plan(yaw=[0.0, 0.5, 1.0, -1.0], start_time=0.1)
    kappa = np.random.default_rng(0).uniform(size=(2, 4, 4))
    kappa[:, :, 2] = NAN
    times = np.random.default_rng(1).uniform(0.5, 1.0, size=(2, 4))
    problem = Problem(
        plan.problem.waypoints,
        limits=Limits(speed=1 / 3, tilt=0.7),
        minimize={"jerk": 0.1, "snap": 1.0},
        degree=7,
        continuity=3,
        start={"velocity": [0.1, NAN, 0.3]},
        end={"acceleration": [NAN, 0.2, 0.0]},
        derivatives={1: {"velocity": [1 / 3, NAN, 0.0]}},
        yaw=plan.problem.yaw,
    )
    values = {
        "problem": problem,
        "status": Status.TIME_LIMIT,
        "message": "as good as it gets; \u03ba = 1.2",
        "history": History(segment_times=times, kappa=kappa),
        "iterations": 17,
        "wall_time_s": 0.1 + 0.2,
        "settings": {"pieces": 2, "effort": 1e-5 / 3.0, "variant": "paper"},
        "report": some_report(peaks={"speed": [0.1, 0.2, 0.3, 1 / 3], "tilt": [1.0] * 4}),
        **changes,
    }
    return dataclasses.replace(plan, **values)


def assert_same_plan(a, b):
    assert_same_problem(a.problem, b.problem)
    same = [
        "method",
        "status",
        "pieces",
        "iterations",
        "wall_time_s",
        "settings",
        "message",
        "version",
    ]
    for name in same:
        assert getattr(a, name) == getattr(b, name), name
    np.testing.assert_array_equal(a.trajectory.coefficients, b.trajectory.coefficients)
    np.testing.assert_array_equal(a.segment_times, b.segment_times)
    assert a.trajectory.start_time == b.trajectory.start_time
    assert a.report.to_dict() == b.report.to_dict()
    assert (a.history is None) == (b.history is None)
    if a.history is not None:
        np.testing.assert_array_equal(a.history.segment_times, b.history.segment_times)
        np.testing.assert_array_equal(a.history.kappa, b.history.kappa)


def test_a_plan_knows_its_times(hand_plan):
    plan = hand_plan(pieces=(1, 2, 1))
    assert plan.duration == plan.trajectory.duration
    np.testing.assert_array_equal(plan.segment_times, plan.trajectory.segment_times)
    np.testing.assert_array_equal(plan.waypoint_times, plan.trajectory.breakpoints[[0, 1, 3, 4]])
    assert plan.feasible
    assert_frozen(plan)


def test_plans_through_files(hand_plan, tmp_path):
    for number, plan in enumerate(
        (
            full_plan(hand_plan),
            full_plan(hand_plan, history=None),
            full_plan(
                hand_plan,
                history=History(segment_times=full_plan(hand_plan).history.segment_times),
            ),
            hand_plan(),
        )
    ):
        path = tmp_path / f"{number}.json"
        plan.save(path)
        assert_same_plan(Plan.load(path), plan)


def test_the_plan_file_has_the_keys_of_the_contract(hand_plan, tmp_path):
    plan = full_plan(hand_plan)
    plan.save(tmp_path / "plan.json")
    values = json.loads((tmp_path / "plan.json").read_text())
    contract = (
        "status method duration segment_times degree coefficients limits peaks waypoints pieces "
        "iterations wall_time_s version"
    )
    assert list(values)[: len(contract.split())] == contract.split()
    assert values["status"] == "time limit"
    assert values["duration"] == plan.duration
    assert np.shape(values["coefficients"]) == (4, 8, 3)
    assert values["degree"] == 7
    assert values["limits"] == {"speed": 1 / 3, "tilt": 0.7}
    assert values["pieces"] == [1, 2, 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"status": None}, "key 'status' is missing"),
        ({"coefficients": None}, "key 'coefficients' is missing"),
        ({"version": None}, "key 'version' is missing"),
        ({"status": "great"}, "status 'great' is unknown"),
        ({"pieces": [1, 1, 1]}, "pieces add up to 3 in 3 legs; there are 4 segments and 4"),
        ({"pieces": [2, 2]}, "pieces add up to 4 in 2 legs"),
        ({"pieces": [0, 3, 1]}, "leg 0 has no piece"),
        ({"segment_times": [1, 1, 1, -1]}, "segment 3 lasts -1.0 s"),
        ({"limits": {"speed": -1}}, "limit speed is -1; it must be positive"),
        ({"waypoints": [[0, 0, 0]] * 4}, "waypoint 1 repeats waypoint 0"),
        ({"peaks": 5}, r"a key has a value of the wrong kind"),
        ({"iterations": "many"}, ""),
        ({"pieces": None}, "key 'pieces' is missing"),
        ({"settings": [1]}, "settings must be a JSON object"),
        ({"settings": {"a=1)\nprint(": 1}}, r"there is a setting 'a=1\)\\nprint\('; no method"),
        ({"settings": {"lambda": 1}}, "there is a setting 'lambda'; no method"),
        ({"settings": {"pieces": [1]}}, r"setting pieces is '\[1\]'; it must be a finite number"),
        ({"settings": {"effort": float("inf")}}, ""),
    ],
)
def test_plans_that_are_none_are_refused_with_the_file_and_the_reason(
    change, message, hand_plan, tmp_path
):
    values = hand_plan().to_dict()
    for key, value in change.items():
        if value is None:
            del values[key]
        else:
            values[key] = value
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(values))
    with pytest.raises(InvalidFile, match=f"bad.json: {message}"):
        Plan.load(path)
    with pytest.raises(InvalidProblem):
        Plan.from_dict(values)


@pytest.mark.parametrize("values", [[], 3, "plan", None])
def test_a_plan_must_be_an_object(values):
    refuses("a plan must be a JSON object", Plan.from_dict, values)


def test_status_is_its_own_text():
    assert [str(status) for status in Status] == [
        "solved", "infeasible", "iteration limit", "time limit", "no progress", "numerical",
    ]  # fmt: skip
    assert f"{Status.SOLVED}" == "solved"
    assert Status("no progress") is Status.NO_PROGRESS
