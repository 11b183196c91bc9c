"""The flatness map against a rigid body that is integrated apart from it, against differences of
itself, and against a slow twin.
"""

import math

import numpy as np
import pytest
from conftest import make_hand_plan
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import peakflight as pf
from peakflight.flatness import Attitude, flat_states, planned_states, states_along
from peakflight.heading import heading
from peakflight.vehicle import Vehicle

pytestmark = pytest.mark.kernels

G = 9.81
UP = np.array([0.0, 0.0, G])
RACER = pf.VEHICLES["racing-quad"]
PLUS = pf.VEHICLES["hummingbird"]
ODD = Vehicle(
    name="odd",
    mass=0.4,
    inertia=(1.1e-3, 1.7e-3, 2.3e-3),
    rotor_positions=((0.1, -0.07), (-0.1, -0.07), (-0.1, 0.07), (0.1, 0.07)),
    spins=(1, -1, 1, -1),
    rotor_thrust=(0.0, 3.0),
    torque_per_thrust=0.02,
    drag=(0.2, 0.08),
)
"""Nothing about it is symmetric that need not be."""


def motion_of(times):
    """Position to the sixth derivative, (n, 3) each: wide turns, leaning up to 60 degrees."""
    rates, phases = np.array([1.9, 1.4, 2.3]), np.array([0.3, 1.7, 0.0])
    sizes = np.array([2.2, 2.6, 0.7])
    angle = np.multiply.outer(times, rates) + phases
    return [sizes * rates**k * np.sin(angle + k * math.pi / 2.0) for k in range(7)]


def turning_yaw(times):
    return 0.7 * np.sin(1.1 * times), 0.77 * np.cos(1.1 * times), -0.847 * np.sin(1.1 * times)


def still_yaw(times):
    return 0.4 + 0.0 * times, 0.0 * times, 0.0 * times


def states_at(times, vehicle, yaw):
    return flat_states(motion_of(times)[1:5], vehicle, yaw=yaw(times))


def plant(t, state, vehicle, yaw):
    """Eq. Quadrotor_model with rotor drag, straight from the rotor thrusts: no flatness in it."""
    velocity, quaternion, rate = state[3:6], state[6:10], state[10:13]
    thrusts = states_at(np.array([t]), vehicle, yaw).rotor_thrust[0]
    inertia = np.diag(vehicle.inertia)
    torque = np.zeros(3)
    for (x, y), spin, thrust in zip(vehicle.rotor_positions, vehicle.spins, thrusts, strict=True):
        torque += np.cross([x, y, 0.0], [0.0, 0.0, thrust])
        torque[2] -= spin * vehicle.torque_per_thrust * thrust
    rotation = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    drag = np.diag([vehicle.drag[0], vehicle.drag[0], vehicle.drag[1]])
    force = rotation @ (np.array([0.0, 0.0, thrusts.sum()]) - drag @ rotation.T @ velocity)
    w, x, y, z = quaternion
    turn = np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) @ rate / 2.0
    spin_up = np.linalg.solve(inertia, torque - np.cross(rate, inertia @ rate))
    return np.concatenate((velocity, force / vehicle.mass - [0.0, 0.0, G], turn, spin_up))


@pytest.mark.parametrize("yaw", [still_yaw, turning_yaw])
@pytest.mark.parametrize("vehicle", [RACER, PLUS, ODD], ids=lambda one: one.name)
def test_rotor_thrusts_applied_open_loop_fly_the_motion(vehicle, yaw):
    # Nothing holds the attitude: an error in it grows with t^2 and in position with t^4, so that
    # 1e-12 of the integrator may become 1e-10 within 3 s; wrong physics end metres away.
    seconds = 3.0
    first = states_at(np.zeros(1), vehicle, yaw)
    position, velocity = (one[0] for one in motion_of(np.zeros(1))[:2])
    start = np.concatenate((position, velocity, first.attitude[0], first.body_rate[0]))
    times = np.linspace(0.0, seconds, 13)
    flown = solve_ivp(
        plant,
        (0.0, seconds),
        start,
        method="DOP853",
        t_eval=times,
        args=(vehicle, yaw),
        rtol=1e-12,
        atol=1e-12,
    )
    assert flown.success
    wanted = motion_of(times)
    states = states_at(times, vehicle, yaw)
    np.testing.assert_allclose(flown.y[:3].T, wanted[0], atol=1e-9)
    np.testing.assert_allclose(flown.y[3:6].T, wanted[1], atol=1e-9)
    np.testing.assert_allclose(flown.y[6:10].T, states.attitude, atol=1e-9)
    np.testing.assert_allclose(flown.y[10:].T, states.body_rate, atol=1e-9)
    leaning = np.degrees(np.arccos(states.rotation[:, 2, 2]))
    assert leaning.max() > 45.0


@pytest.mark.parametrize("yaw", [still_yaw, turning_yaw])
@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda one: one.name)
def test_there_and_back_to_acceleration_jerk_and_snap(vehicle, yaw):
    times = np.linspace(0.0, 5.0, 400)
    _, velocity, acceleration, jerk, snap, *_ = motion_of(times)
    states = flat_states([velocity, acceleration, jerk, snap], vehicle, yaw=yaw(times))
    drag, along_drag = np.array(vehicle.drag) / vehicle.mass
    rotation, rate, spin = states.rotation, states.body_rate, states.angular_acceleration
    axis = rotation[..., 2]
    # in the world: w and its derivative, b' = w x b, b'' = w' x b + w x b'
    turning = np.einsum("nij,nj->ni", rotation, rate)
    swing = np.cross(turning, axis)
    bend = np.cross(np.einsum("nij,nj->ni", rotation, spin), axis) + np.cross(turning, swing)

    def dot(a, b):
        return (a * b).sum(axis=1, keepdims=True)

    length = states.thrust_acceleration[:, None] + (drag - along_drag) * dot(axis, velocity)
    force = length * axis
    back = force - drag * velocity - [0.0, 0.0, G]
    np.testing.assert_allclose(back, acceleration, atol=1e-8)
    growth = dot(axis, jerk + drag * back)  # along the axis, attitude says nothing
    again = growth * axis + length * swing - drag * back
    np.testing.assert_allclose(again, jerk, atol=1e-8)
    faster = dot(axis, snap + drag * again) + dot(swing, jerk + drag * back)
    once_more = faster * axis + 2.0 * growth * swing + length * bend - drag * again
    np.testing.assert_allclose(once_more, snap, atol=1e-8)


@pytest.mark.parametrize("yaw", [still_yaw, turning_yaw])
@pytest.mark.parametrize("vehicle", [RACER, ODD], ids=lambda one: one.name)
def test_rates_are_differences_of_attitude_and_angular_accelerations_of_rates(vehicle, yaw):
    times, step = np.linspace(0.0, 5.0, 200), 1e-4
    before, now, after = (states_at(times + shift, vehicle, yaw) for shift in (-step, 0.0, step))
    slope = (after.rotation - before.rotation) / (2.0 * step)
    skew = np.einsum("nji,njk->nik", now.rotation, slope)
    rate = np.stack((skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]), axis=1)
    # central differences: step^2 / 6 of a third derivative of up to 1e3, and rounding over step
    np.testing.assert_allclose(now.body_rate, rate, atol=5e-6)
    spin = (after.body_rate - before.body_rate) / (2.0 * step)
    np.testing.assert_allclose(now.angular_acceleration, spin, atol=1e-4)


def twin(derivatives, vehicle, yaw):
    """One sample by matrices and the tilt's axis and angle; no closed form of the kernel in it."""
    velocity, acceleration = derivatives[:2]
    force = vehicle.mass * (acceleration + UP) + vehicle.drag[0] * velocity
    axis = force / np.linalg.norm(force)
    hinge = np.cross([0.0, 0.0, 1.0], axis)
    sine = np.linalg.norm(hinge)
    turn = hinge / sine * math.atan2(sine, axis[2]) if sine > 0.0 else hinge
    attitude = Rotation.from_rotvec(turn) * Rotation.from_rotvec([0.0, 0.0, yaw])
    carried = vehicle.mass * (acceleration + UP)
    rotation = attitude.as_matrix()
    drag = np.diag([vehicle.drag[0], vehicle.drag[0], vehicle.drag[1]])
    lift = rotation.T @ (carried + rotation @ drag @ rotation.T @ velocity)
    np.testing.assert_allclose(lift[:2], 0.0, atol=1e-12)
    return attitude.as_quat(scalar_first=True), lift[2]


def test_attitude_and_thrust_agree_with_a_twin():
    rng = np.random.default_rng(3)
    derivatives = rng.normal(scale=8.0, size=(4, 300, 3))
    yaw = rng.uniform(-3.0, 3.0, size=300)
    states = flat_states(derivatives, ODD, yaw=(yaw, 0.0, 0.0))
    for i in range(300):
        attitude, thrust = twin(derivatives[:, i], ODD, yaw[i])
        sign = np.sign(attitude @ states.attitude[i])
        np.testing.assert_allclose(states.attitude[i], sign * attitude, atol=1e-12)
        np.testing.assert_allclose(states.thrust[i], thrust, rtol=1e-12)
    assert states.attitude.shape == (300, 4)
    np.testing.assert_allclose(np.linalg.norm(states.attitude, axis=1), 1.0, rtol=1e-14)
    assert (states.codes == Attitude.REGULAR).all()


def test_rotor_thrusts_make_the_thrust_and_the_torques():
    rng = np.random.default_rng(4)
    states = flat_states(rng.normal(scale=5.0, size=(4, 50, 3)), ODD, yaw=(0.3, 0.2, 0.1))
    np.testing.assert_allclose(states.rotor_thrust.sum(axis=1), states.thrust, rtol=1e-12)
    x, y = np.array(ODD.rotor_positions).T
    np.testing.assert_allclose(states.rotor_thrust @ y, states.torque[:, 0], atol=1e-12)
    np.testing.assert_allclose(states.rotor_thrust @ -x, states.torque[:, 1], atol=1e-12)
    about = -ODD.torque_per_thrust * states.rotor_thrust @ ODD.spins
    np.testing.assert_allclose(about, states.torque[:, 2], atol=1e-12)
    np.testing.assert_allclose(states.thrust_acceleration, states.thrust / ODD.mass, rtol=1e-15)


def test_hovering_shares_the_weight_and_points_where_it_is_told():
    states = flat_states(np.zeros((4, 3)), RACER, yaw=(0.5, 0.0, 0.0))
    np.testing.assert_allclose(states.rotor_thrust, np.full(4, RACER.mass * G / 4.0), rtol=1e-12)
    np.testing.assert_allclose(states.attitude, [math.cos(0.25), 0.0, 0.0, math.sin(0.25)])
    assert states.heading == pytest.approx(0.5)
    np.testing.assert_array_equal(states.torque, 0.0)
    assert states.thrust.shape == states.codes.shape == ()


@pytest.mark.parametrize(
    ("push", "axis"),
    [([5.0, 0.0, 0.0], 1), ([0.0, 5.0, 0.0], 0)],
    ids=["forward", "left"],
)
def test_signs_of_leaning(push, axis):
    states = flat_states([[0.0] * 3, push, [0.0] * 3, [0.0] * 3], RACER)
    turn = Rotation.from_quat(states.attitude, scalar_first=True).as_rotvec()
    assert np.argmax(np.abs(turn)) == axis
    assert np.sign(turn[axis]) == (1.0 if axis == 1 else -1.0)


def test_in_free_fall_the_attitude_stays():
    fall = [0.0, 0.0, -G]
    acceleration = np.array([fall, [3.0, 0.0, 0.0], fall, fall, [0.0, 3.0, 0.0]])
    jerk = np.ones((5, 3))
    states = flat_states([np.ones((5, 3)), acceleration, jerk, jerk], RACER, yaw=(0.2, 0.1, 0.0))
    falling, regular = Attitude.FREE_FALL, Attitude.REGULAR
    np.testing.assert_array_equal(states.codes, [falling, regular, falling, falling, regular])
    upright = [math.cos(0.1), 0.0, 0.0, math.sin(0.1)]
    np.testing.assert_allclose(states.attitude[0], upright, rtol=1e-12)
    np.testing.assert_array_equal(states.attitude[2], states.attitude[1])
    np.testing.assert_array_equal(states.attitude[3], states.attitude[1])
    np.testing.assert_array_equal(states.body_rate[[0, 2, 3]], [[0.0, 0.0, 0.1]] * 3)
    np.testing.assert_allclose(states.thrust[[0, 2, 3]], 0.0, atol=1e-12)
    for name in states.__dataclass_fields__:
        assert np.isfinite(getattr(states, name)).all()


def test_upside_down_is_flagged_and_finite():
    acceleration = [0.0, 0.0, -3.0 * G]
    states = flat_states([np.ones(3), acceleration, np.ones(3), np.ones(3)], RACER)
    assert states.codes == Attitude.INVERTED
    np.testing.assert_allclose(states.rotation, np.diag([1.0, -1.0, -1.0]), atol=1e-15)
    swing = states.rotation @ np.cross(states.body_rate, [0.0, 0.0, 1.0])
    np.testing.assert_allclose(swing, np.array([-1.0, -1.0, 0.0]) / (-2.0 * G), rtol=1e-12)
    assert np.isfinite(states.rotor_thrust).all()


@pytest.mark.parametrize("direction", [0.0, 0.9, math.pi / 2.0])
def test_leaning_by_a_right_angle_any_way_is_regular(direction):
    # where a convention by the projected heading has its pole
    across = 2.0 * G * np.array([math.cos(direction), math.sin(direction), 0.0])
    states = flat_states([np.ones(3), across - [0, 0, G], np.ones(3), np.ones(3)], RACER)
    assert states.codes == Attitude.REGULAR
    assert np.abs(states.body_rate).max() < 1.0


def test_shapes_are_kept_and_results_are_read_only():
    rng = np.random.default_rng(5)
    derivatives = rng.normal(size=(4, 2, 3, 3))
    states = flat_states(derivatives, RACER)
    assert states.attitude.shape == (2, 3, 4)
    assert states.rotation.shape == (2, 3, 3, 3)
    assert states.rotor_thrust.shape == (2, 3, 4)
    assert states.heading.shape == states.codes.shape == (2, 3)
    with pytest.raises(ValueError, match="read-only"):
        states.thrust[0, 0] = 1.0
    assert flat_states(np.empty((4, 0, 3)), RACER).thrust.shape == (0,)


@pytest.mark.parametrize(
    ("derivatives", "yaw", "message"),
    [
        (np.zeros((3, 5, 3)), (0, 0, 0), "3 derivatives are given; there must be four"),
        (np.zeros((4, 5, 2)), (0, 0, 0), r"derivatives have shape \(5, 2\); it must be \(\.\.\."),
        ([np.zeros(3)] * 3 + [np.zeros((2, 3))], (0, 0, 0), "arrays of one shape"),
        (np.full((4, 2, 3), math.nan), (0, 0, 0), r"velocity of sample \[0\] has x = nan; it must"),
        (np.zeros((4, 5, 3)), (0, 0), "yaw has 2 parts; it must have three"),
        (np.zeros((4, 5, 3)), (np.zeros(4), 0, 0), r"yaw must be numbers, or arrays of shape \(5"),
        (np.zeros((4, 5, 3)), (0, math.inf, 0), "yaw, its rate and its acceleration must be finit"),
    ],
)
def test_what_is_wrong_is_named(derivatives, yaw, message):
    with pytest.raises(pf.InvalidProblem, match=message):
        flat_states(derivatives, RACER, yaw=yaw)


def test_along_a_trajectory_yaw_may_be_numbers_or_a_function():
    trajectory = make_hand_plan().trajectory
    times = np.linspace(0.0, trajectory.duration, 50)
    given = states_along(trajectory, times, ODD, yaw=turning_yaw(times))
    called = states_along(trajectory, times, ODD, yaw=turning_yaw)
    np.testing.assert_array_equal(given.rotor_thrust, called.rotor_thrust)
    direct = flat_states([trajectory(times, order) for order in (1, 2, 3, 4)], ODD)
    plain = states_along(trajectory, times, ODD)
    np.testing.assert_array_equal(plain.attitude, direct.attitude)


def test_a_plan_turns_as_its_flight_files_do():
    from dataclasses import replace

    plan = make_hand_plan(yaw=[0.0, 1.0, -0.5, 2.0])
    with pytest.raises(pf.InvalidProblem, match="the plan has no vehicle; plan with vehicle="):
        planned_states(plan, 0.0)
    plan = replace(plan, problem=replace(plan.problem, vehicle="racing-quad"))
    times = np.linspace(0.0, plan.duration, 50)
    turn = heading(plan)
    yaw = [turn(times, order)[:, 0] for order in (0, 1, 2)]
    wanted = states_along(plan.trajectory, times, RACER, yaw=yaw)
    np.testing.assert_array_equal(planned_states(plan, times).attitude, wanted.attitude)
