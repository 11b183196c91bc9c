"""The kernels of flight against slow twins: rigid body, rotors, both controllers."""

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import peakflight as pf
from peakflight.flight import CONTROLLERS, FirmwareSettings, RotorSpeeds, firmware_settings
from peakflight.flight.rotors import rotors_of
from peakflight.flight.simulate import prepare, run, wrench_of
from peakflight.kernels import controllers, flight, jit, rigid_body

pytestmark = pytest.mark.kernels

RACER = pf.VEHICLES["racing-quad"]
UPGRADE = pf.VEHICLES["crazyflie-2.1-upgrade"]
SPEEDS = RotorSpeeds(rise=(9.0, 2.0), fall=(1.0, 7.0), linear=-0.1, momentum=2e-4)


def turn_of(attitude):
    return Rotation.from_quat(np.roll(attitude, -1, axis=-1))


def start_state(rng):
    attitude = rng.normal(size=4)
    return np.concatenate(
        (rng.normal(size=6), attitude / np.linalg.norm(attitude), 3.0 * rng.normal(size=3))
    )


def fly_open(vehicle, start, thrusts, commands, time, *, speeds=None, parts=1, **other):
    """Open loop by the kernel, with everything as its own variable: one compilation."""
    values = {
        "drag": vehicle.drag,
        "wind": (0.0, 0.0, 0.0),
        "wrench": wrench_of(vehicle, pf.Conditions()),
        "gravity": 9.81,
        "lag": vehicle.motor_lag,
    } | other
    rotors = rotors_of(dataclasses.replace(vehicle, motor_lag=values["lag"]), speeds, 1.0)
    mass, gravity = vehicle.mass, values["gravity"]
    return flight.open_loop(
        jit.fresh(start), jit.fresh(thrusts), jit.fresh(commands), time, parts, rotors, mass,
        jit.fresh(vehicle.inertia), jit.fresh(values["wrench"]), jit.fresh(values["drag"]),
        jit.fresh(values["wind"]), gravity,
    )  # fmt: skip


def twin(vehicle, start, thrusts, commands, time, lag, drag, wind):
    """The same by SciPy, with rotation matrices and rotors among the unknowns."""
    inertia = np.diag(vehicle.inertia)
    x, y = np.array(vehicle.rotor_positions).T
    spins = np.array(vehicle.spins)

    def change(_, state, command):
        rotation = state[6:15].reshape(3, 3)
        rates, rotors = state[15:18], state[18:]
        relative = rotation.T @ (state[3:6] - wind)
        push = np.array([0.0, 0.0, rotors.sum()]) - np.array([drag[0], drag[0], drag[1]]) * relative
        torque = np.array([y @ rotors, -x @ rotors, -vehicle.torque_per_thrust * (spins @ rotors)])
        cross = np.cross(np.eye(3), rates)  # rows e_i x w: minus the matrix of w x
        return np.concatenate(
            (
                state[3:6],
                rotation @ push / vehicle.mass - [0.0, 0.0, 9.81],
                (rotation @ -cross.T).ravel(),
                np.linalg.solve(inertia, torque - np.cross(rates, inertia @ rates)),
                (command - rotors) / lag,
            )
        )

    rotation = turn_of(start[6:10]).as_matrix()
    state = np.concatenate((start[:6], rotation.ravel(), start[10:], thrusts))
    rows = [state]
    for command in commands:
        state = solve_ivp(change, (0.0, time), state, args=(command,), rtol=1e-10, atol=1e-12).y[
            :, -1
        ]
        rows.append(state)
    return np.array(rows)


def test_the_rigid_body_is_that_of_an_integrator_with_rotation_matrices():
    rng = np.random.default_rng(1)
    lag, drag, wind, time = 0.07, (0.3, 0.1), np.array([2.0, -1.0, 0.5]), 0.02
    start, thrusts = start_state(rng), rng.uniform(0.5, 6.0, size=4)
    commands = rng.uniform(0.0, 6.9, size=(20, 4))
    commands[:, 2:] = commands[:, :2]  # turning, but not tumbling out of bounds
    states, flown = fly_open(
        RACER, start, thrusts, commands, time, parts=20, lag=lag, drag=drag, wind=wind
    )
    wanted = twin(RACER, start, thrusts, commands, time, lag, drag, wind)
    # steps of 1 ms at up to 30 rad/s: the rule's error is (0.03)^5 / 120 a step
    np.testing.assert_allclose(states[:, :6], wanted[:, :6], atol=1e-6)
    rotations = turn_of(states[:, 6:10]).as_matrix().reshape(-1, 9)
    np.testing.assert_allclose(rotations, wanted[:, 6:15], atol=1e-6)
    np.testing.assert_allclose(states[:, 10:], wanted[:, 15:18], atol=1e-5)
    np.testing.assert_allclose(flown, wanted[:, 18:], rtol=1e-8)


def test_without_rotors_a_body_keeps_its_energy_and_angular_momentum():
    rng = np.random.default_rng(2)
    start = start_state(rng)
    states, _ = fly_open(RACER, start, np.zeros(4), np.zeros((500, 4)), 0.002, drag=(0.0, 0.0))
    inertia = np.array(RACER.inertia)
    rates = states[:, 10:]
    energy = (
        0.5 * RACER.mass * (states[:, 3:6] ** 2).sum(axis=1)
        + 0.5 * (inertia * rates**2).sum(axis=1)
        + RACER.mass * 9.81 * states[:, 2]
    )
    momentum = turn_of(states[:, 6:10]).apply(inertia * rates)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), rtol=1e-7)
    fallen = start[2] + start[5] * 1.0 - 0.5 * 9.81
    assert states[-1, 2] == pytest.approx(fallen, abs=1e-9)


def test_a_thrust_follows_a_step_by_the_exponential_of_its_lag():
    lag, time = 0.05, 0.002
    start = np.array([0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    begun, asked = np.array([1.0, 2.0, 3.0, 4.0]), np.array([4.0, 3.0, 2.0, 1.0])
    _, flown = fly_open(RACER, start, begun, np.tile(asked, (100, 1)), time, lag=lag)
    left = np.exp(-np.arange(101) * time / lag)[:, None]
    np.testing.assert_allclose(flown, asked + (begun - asked) * left, rtol=1e-12)


def test_without_a_lag_a_thrust_is_there_at_once():
    start = np.array([0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    _, flown = fly_open(RACER, start, np.ones(4), np.full((3, 4), 2.5), 0.002, lag=0.0)
    np.testing.assert_array_equal(flown[1:], 2.5)


def test_rotor_speeds_are_those_of_an_integrator():
    begun, asked = np.array([1.0, 2.0, 5.0, 6.5]), np.array([6.0, 3.0, 2.0, 0.1])
    start = np.array([0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    _, flown = fly_open(RACER, start, begun, np.tile(asked, (50, 1)), 0.004, speeds=SPEEDS)
    top, c = RACER.rotor_thrust[1], SPEEDS.linear

    def speed(thrust):
        return (-c + np.sqrt(c * c + 4 * (1 - c) * thrust / top)) / (2 * (1 - c))

    for rotor in range(4):
        wanted = speed(asked[rotor])
        a, b = SPEEDS.rise if asked[rotor] > begun[rotor] else SPEEDS.fall
        found = solve_ivp(
            lambda _, n, w=wanted, a=a, b=b: a * (w - n) + b * (w * w - n * n),
            (0.0, 0.2), [speed(begun[rotor])], t_eval=np.arange(51) * 0.004, rtol=1e-10, atol=1e-12,
        ).y[0]  # fmt: skip
        wanted_thrust = top * (c * found + (1 - c) * found**2)
        np.testing.assert_allclose(flown[:, rotor], wanted_thrust, atol=1e-7)


def test_what_rotors_gain_in_momentum_the_body_gives():
    start = np.array([0, 0, 1, 0, 0, 0, 1.0, 0, 0, 0, 0, 0, 0])
    wrench = wrench_of(RACER, pf.Conditions())
    wrench[:, 1:3] = 0.0
    wrench[:, 3] *= 1e-12  # only its sign counts then
    begun, asked = np.full(4, 2.0), np.array([5.0, 1.0, 4.0, 2.0])
    commands = np.tile(asked, (100, 1))
    states, flown = fly_open(RACER, start, begun, commands, 0.002, speeds=SPEEDS, wrench=wrench)
    c, top = SPEEDS.linear, RACER.rotor_thrust[1]
    speeds = (-c + np.sqrt(c * c + 4 * (1 - c) * flown / top)) / (2 * (1 - c))
    # against the torque with which the air turns the body, rotors turn the other way
    rotors = -np.sign(wrench[:, 3]) * SPEEDS.momentum * (speeds - speeds[0])
    assert np.abs(states[-1, 12]) > 1e-3
    np.testing.assert_allclose(RACER.inertia[2] * states[:, 12], -rotors.sum(axis=1), atol=1e-12)


def quintic(*points, seconds=1.5):
    """Rest to rest through points, a piece each."""
    points = np.array(points, dtype=float)
    rows = np.zeros((len(points) - 1, 6, 3))
    rows[:, 0] = points[:-1]
    for power, factor in ((3, 10.0), (4, -15.0), (5, 6.0)):
        rows[:, power] = factor * np.diff(points, axis=0) / seconds**power
    return pf.Trajectory(rows, np.full(len(rows), seconds))


PATH = quintic((0, 0, 1), (1.2, 0.5, 1.4), seconds=1.0)


def closed(vehicle, controller, conditions, path=PATH, **settings):
    task = prepare(
        path, vehicle=vehicle, controller=controller, settings=pf.FlySettings(hold=0.0, **settings)
    )
    return task, run(task, conditions)


def geometric_twin(task, state, planned):
    """Lee, Leok and McClamroch 2010, eqs. 15 to 22, on matrices; the unclipped rotor thrusts."""
    vehicle, gains = task.vehicle, task.gains
    rotation, reference = turn_of(state[6:10]).as_matrix(), turn_of(planned[10:14]).as_matrix()
    force = planned[6:9] - vehicle.mass * (
        gains[controllers.KP] * (state[:3] - planned[:3])
        + gains[controllers.KD] * (state[3:6] - planned[3:6])
    )
    wanted_axis = force / np.linalg.norm(force)
    axis = np.cross(reference[:, 2], wanted_axis)
    angle = np.arctan2(np.linalg.norm(axis), reference[:, 2] @ wanted_axis)
    size = np.linalg.norm(axis)
    tilt = Rotation.from_rotvec(axis / size * angle if size > 0 else np.zeros(3)).as_matrix()
    wanted = tilt @ reference
    error = 0.5 * (wanted.T @ rotation - rotation.T @ wanted)
    off = np.array([error[2, 1], error[0, 2], error[1, 0]])
    rates, inertia = state[10:13], np.array(vehicle.inertia)
    across = rotation.T @ wanted
    slip = rates - across @ planned[14:17]
    forward = across @ planned[17:20] - np.cross(rates, across @ planned[14:17])
    torque = inertia * (
        -gains[controllers.KR] * off - gains[controllers.KW] * slip + forward
    ) + np.cross(rates, inertia * rates)
    return vehicle.mixer @ [force @ rotation[:, 2], *torque]


@pytest.mark.parametrize("late", [0, 7])
def test_the_geometric_tracker_asks_for_what_its_twin_does_of_the_state_that_is_late(late):
    conditions = pf.Conditions(
        mass_scale=1.1, latency=late / 500.0, wind=(3, 1, 0), drag=(0.2, 0.1)
    )
    task, outcome = closed(RACER, "geometric", conditions)
    least, most = RACER.rotor_thrust
    compared = 0
    for i in range(0, len(outcome.states) - 1, 5):
        asked = geometric_twin(task, outcome.states[max(i - late, 0)], task.planned[i])
        if least < asked.min() and asked.max() < most:  # the racer's rotors do not lag
            np.testing.assert_allclose(outcome.rotor_thrusts[i + 1], asked, rtol=1e-9, atol=1e-9)
            compared += 1
    assert compared > 50


def firmware_twin(task, settings, states):
    """controller_mellinger.c as crazyflow splits it, on matrices; (n, 4) thrusts asked for."""
    vehicle = task.vehicle
    top, time, every = vehicle.rotor_thrust[1], 1 / 500.0, 5
    mixing = vehicle.mixer[:, 1:] / np.abs(vehicle.mixer[:, 1:]).max(axis=0)
    sums, turn_sums = np.zeros(3), np.zeros(3)
    last_rates = last_planned = np.zeros(3)
    thrusts = []
    for i, state in enumerate(states):
        planned = task.planned[i - i % every]
        rotation = turn_of(state[6:10]).as_matrix()
        if i % every == 0:
            miss = planned[:3] - state[:3]
            sums = np.clip(sums + miss * time * every, *np.outer((-1, 1), settings.most_ki))
            force = planned[6:9] + np.multiply(settings.kp, miss)
            force = force + np.multiply(settings.kd, planned[3:6] - state[3:6])
            force = force + np.multiply(settings.ki, sums)
            z = force / np.linalg.norm(force)
            y = np.cross(z, [np.cos(planned[9]), np.sin(planned[9]), 0.0])
            y /= np.linalg.norm(y)
            wanted = np.column_stack((np.cross(y, z), y, z))
            thrust = settings.mass_thrust * (force @ rotation[:, 2]) / 65535 * 4 * top
        error = wanted.T @ rotation - rotation.T @ wanted
        off = np.array([error[2, 1], error[0, 2], error[1, 0]])
        rates = state[10:13]
        jolt = ((planned[14:17] - last_planned) - (rates - last_rates)) / time
        last_rates, last_planned = rates, planned[14:17]
        turn_sums = np.clip(turn_sums - off * time, *np.outer((-1, 1), settings.most_km))
        moment = (
            -np.multiply(settings.kr, off)
            + np.multiply(settings.kw, planned[14:17] - rates)
            + np.multiply(settings.km, turn_sums)
            + np.multiply(settings.kdw, jolt)
        )
        moment = np.clip(moment, -32000, 32000) * (thrust > 0.0)
        pwm = thrust / 4 / top * 65535 + mixing @ (moment * [0.5, 0.5, 1.0])
        thrusts.append(pwm / 65535 * top)
    return np.clip(thrusts, *vehicle.rotor_thrust)


@pytest.mark.parametrize("vehicle", [RACER, pf.VEHICLES["hummingbird"]], ids=lambda one: one.name)
def test_the_firmware_asks_for_what_its_twin_does(vehicle):
    vehicle = dataclasses.replace(vehicle, motor_lag=0.0)
    task, outcome = closed(vehicle, "firmware", pf.Conditions(mass_scale=1.05))
    asked = firmware_twin(task, firmware_settings(vehicle), outcome.states)
    assert len(asked) == 501
    np.testing.assert_allclose(outcome.rotor_thrusts[1:], asked[:-1], rtol=1e-7, atol=1e-8)


def test_the_crazyflies_mapping_of_force_to_thrust_is_that_of_crazyflow():
    task, _ = closed(UPGRADE, "firmware", pf.Conditions())
    assert task.force_scale == pytest.approx(132000 / 65535 * 0.72)
    moments = np.abs(task.moments)
    np.testing.assert_allclose(moments[:, :2], 0.5 * 0.18 / 65535)
    np.testing.assert_allclose(moments[:, 2], 0.18 / 65535)
    signs = np.array([[-1, -1, -1], [-1, 1, 1], [1, 1, -1], [1, -1, 1]])
    np.testing.assert_array_equal(np.sign(task.moments), signs)


def test_body_rates_for_the_firmware_are_those_of_its_frame():
    task, _ = closed(UPGRADE, "firmware", pf.Conditions(), control_rate=2000.0)
    force = task.rehearsal.acceleration + np.array([0.0, 0.0, 9.81])
    z = force / np.linalg.norm(force, axis=1, keepdims=True)
    y = np.cross(z, [1.0, 0.0, 0.0])
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    frames = Rotation.from_matrix(np.stack((np.cross(y, z), y, z), axis=2))
    steps = (frames[:-1].inv() * frames[1:]).as_rotvec() * 2000.0
    middle = 0.5 * (task.planned[1:, 14:17] + task.planned[:-1, 14:17])
    # about z the firmware takes the yaw rate, here 0; the frame itself turns a little
    np.testing.assert_allclose(steps[:, :2], middle[:, :2], atol=1e-4)
    assert np.abs(middle[:, :2]).max() > 1.0


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_rotors_stay_within_their_range(controller):
    fast = quintic((0, 0, 2), (2.0, 0, 2.0), (0, 0.5, 2.0), seconds=0.7)
    _, outcome = closed(UPGRADE, controller, pf.Conditions(), path=fast)
    least, most = UPGRADE.rotor_thrust
    assert outcome.saturated > 0
    assert outcome.rotor_thrusts.min() >= least * (1.0 - 1e-12)
    assert outcome.rotor_thrusts.max() <= most * (1.0 + 1e-12)


def test_gains_of_other_vehicles_turn_them_as_fast_as_the_stock_crazyflie():
    def stiffness(vehicle, settings):
        task = prepare(
            PATH, vehicle=vehicle, controller="firmware", settings=pf.FlySettings(firmware=settings)
        )
        torques = wrench_of(vehicle, pf.Conditions())[:, 1:].T @ task.moments
        return np.diag(torques) / vehicle.inertia * settings.kr

    stock = dataclasses.replace(pf.VEHICLES["crazyflie-2.1"], name="exact")
    exact = stiffness(stock, dataclasses.replace(FirmwareSettings(), mass_thrust=65535 / 0.48))
    for name in ("racing-quad", "hummingbird"):
        vehicle = pf.VEHICLES[name]
        np.testing.assert_allclose(stiffness(vehicle, firmware_settings(vehicle)), exact, rtol=1e-9)


def test_quaternions_stay_of_unit_length():
    _, outcome = closed(UPGRADE, "geometric", pf.Conditions(attitude_noise=0.02, gust=1.0, seed=4))
    norms = np.linalg.norm(outcome.states[:, rigid_body.ATTITUDE : rigid_body.RATE], axis=1)
    np.testing.assert_allclose(norms, 1.0, rtol=1e-12)
