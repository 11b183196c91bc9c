"""A quadrotor as a rigid body: Eq. Quadrotor_model with rotor drag, wind and rotors that lag.

A state is 13 numbers: position, velocity, attitude (unit quaternion w, x, y, z from the body to the
world) and body rates, at the places that the constants name.
"""

import math

import numpy as np

from peakflight.kernels.jit import inner, within

POSITION, VELOCITY, ATTITUDE, RATE, STATE = 0, 3, 6, 10, 13
LAG, RISE, FALL, LINEAR, TOP, MOMENTUM, ROTOR = 0, 1, 3, 5, 6, 7, 8
"""What is known of rotors: a lag, s, of the thrust; or rates, 1/s, of rising and falling speeds,
two each, the linear part of the thrust in the speed, the top thrust, N, and the angular momentum
at this thrust, kg m^2/s."""


@inner
def turned(attitude, vector, out):
    """Out <- a vector of the body, seen from the world."""
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    tx = 2.0 * (y * vector[2] - z * vector[1])
    ty = 2.0 * (z * vector[0] - x * vector[2])
    tz = 2.0 * (x * vector[1] - y * vector[0])
    a = vector[0] + w * tx + y * tz - z * ty
    b = vector[1] + w * ty + z * tx - x * tz
    c = vector[2] + w * tz + x * ty - y * tx
    out[0], out[1], out[2] = a, b, c


@inner
def turned_back(attitude, vector, out):
    """Out <- a vector of the world, seen from the body."""
    w, x, y, z = attitude[0], -attitude[1], -attitude[2], -attitude[3]
    tx = 2.0 * (y * vector[2] - z * vector[1])
    ty = 2.0 * (z * vector[0] - x * vector[2])
    tz = 2.0 * (x * vector[1] - y * vector[0])
    a = vector[0] + w * tx + y * tz - z * ty
    b = vector[1] + w * ty + z * tx - x * tz
    c = vector[2] + w * tz + x * ty - y * tx
    out[0], out[1], out[2] = a, b, c


@inner
def product(p, q, out):
    """Out <- quaternion p q: first the turn q, then p."""
    w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]
    out[0], out[1], out[2], out[3] = w, x, y, z


@inner
def normalise(quaternion):
    """Give a quaternion the length 1."""
    square = 0.0
    for i in range(4):
        square += quaternion[i] * quaternion[i]
    scale = 1.0 / math.sqrt(square)
    for i in range(4):
        quaternion[i] *= scale


@within
def _change(
    state, thrusts, momentum, reaction, mass, inertia, wrench, drag, wind, gravity, room, out
):
    """Out <- the derivative of a state; room is (2, 3) of no meaning before or after.

    Momentum is that which the body would have from the rotors if it stopped them, and reaction the
    torque by which it speeds them up, both about z.
    """
    force = 0.0
    torque = room[1]
    torque[:] = 0.0
    for r in range(4):
        force += thrusts[r] * wrench[r, 0]
        for d in range(3):
            torque[d] += thrusts[r] * wrench[r, 1 + d]
    torque[0] += state[RATE + 1] * momentum
    torque[1] -= state[RATE] * momentum
    torque[2] += reaction
    attitude = state[ATTITUDE:RATE]
    push = room[0]
    for d in range(3):
        push[d] = state[VELOCITY + d] - wind[d]
    turned_back(attitude, push, push)
    push[0] *= -drag[0]
    push[1] *= -drag[0]
    push[2] = force - drag[1] * push[2]
    turned(attitude, push, push)
    for d in range(3):
        out[POSITION + d] = state[VELOCITY + d]
        out[VELOCITY + d] = push[d] / mass - gravity * (d == 2)
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    p, q, r = state[RATE], state[RATE + 1], state[RATE + 2]
    out[ATTITUDE] = -0.5 * (x * p + y * q + z * r)
    out[ATTITUDE + 1] = 0.5 * (w * p + y * r - z * q)
    out[ATTITUDE + 2] = 0.5 * (w * q + z * p - x * r)
    out[ATTITUDE + 3] = 0.5 * (w * r + x * q - y * p)
    out[RATE] = (torque[0] - (inertia[2] - inertia[1]) * q * r) / inertia[0]
    out[RATE + 1] = (torque[1] - (inertia[0] - inertia[2]) * r * p) / inertia[1]
    out[RATE + 2] = (torque[2] - (inertia[1] - inertia[0]) * p * q) / inertia[2]


@inner
def spin(thrusts, commands, rotors, time, out):
    """Out (4,) <- thrusts after a time under constant commands.

    With a lag, thrusts follow exactly, by its exponential. With rates, speeds n follow, relative to
    that of the top thrust: n' = a (n_c - n) + b (n_c^2 - n^2), with two rates for rising and two
    for falling, by the classical Runge-Kutta rule; thrust over its top is c n + (1 - c) n^2.
    """
    if rotors[RISE] + rotors[RISE + 1] <= 0.0:
        left = math.exp(-time / rotors[LAG]) if rotors[LAG] > 0.0 else 0.0
        for r in range(4):
            out[r] = commands[r] + (thrusts[r] - commands[r]) * left
        return
    top, c = rotors[TOP], rotors[LINEAR]
    for r in range(4):
        begun = _speed(thrusts[r] / top, c)
        wanted = _speed(commands[r] / top, c)
        a, b = rotors[RISE], rotors[RISE + 1]
        if wanted < begun:
            a, b = rotors[FALL], rotors[FALL + 1]
        one = (wanted - begun) * (a + b * (wanted + begun))
        now = begun + 0.5 * time * one
        two = (wanted - now) * (a + b * (wanted + now))
        now = begun + 0.5 * time * two
        three = (wanted - now) * (a + b * (wanted + now))
        now = begun + time * three
        four = (wanted - now) * (a + b * (wanted + now))
        now = begun + time / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        out[r] = top * (c * now + (1.0 - c) * now * now)


@inner
def _speed(share, linear):
    """Speed over the top one for a thrust over the top one."""
    if linear == 0.0:
        return math.sqrt(max(share, 0.0))
    square = 1.0 - linear
    root = math.sqrt(max(linear * linear + 4.0 * square * share, 0.0))
    return (root - linear) / (2.0 * square)


@inner
def step(state, thrusts, commands, rotors, time, mass, inertia, wrench, drag, wind, gravity, room):
    """Move state (13,) and thrusts (4,) on by a time, under constant commands and wind.

    Rotors follow their commands as `spin` says; the body moves by the classical Runge-Kutta rule of
    fourth order. Room is (9, 13) of no meaning before or after.
    """
    half = room[5, :4]
    after = room[6, :4]
    spin(thrusts, commands, rotors, 0.5 * time, half)
    spin(half, commands, rotors, 0.5 * time, after)
    if rotors[LAG] <= 0.0 and rotors[RISE] + rotors[RISE + 1] <= 0.0:
        thrusts[:] = commands
    momentum, reaction = 0.0, 0.0
    if rotors[MOMENTUM] > 0.0:
        for r in range(4):
            turning = rotors[MOMENTUM] if wrench[r, 3] > 0.0 else -rotors[MOMENTUM]
            begun = _speed(thrusts[r] / rotors[TOP], rotors[LINEAR])
            ended = _speed(after[r] / rotors[TOP], rotors[LINEAR])
            momentum += 0.5 * turning * (begun + ended)
            reaction += turning * (ended - begun) / time
    change, total, trial = room[0], room[1], room[2]
    vectors = room[7:9, :3]
    total[:] = 0.0
    trial[:] = state
    for stage in range(4):
        active = thrusts if stage == 0 else (after if stage == 3 else half)
        _change(
            trial, active, momentum, reaction, mass, inertia, wrench, drag, wind, gravity, vectors,
            change,
        )  # fmt: skip
        weight = 1.0 if stage in (0, 3) else 2.0
        ahead = time if stage == 2 else 0.5 * time
        for i in range(STATE):
            total[i] += weight * change[i]
            trial[i] = state[i] + ahead * change[i]
    for i in range(STATE):
        state[i] += time / 6.0 * total[i]
    normalise(state[ATTITUDE:RATE])
    thrusts[:] = after


@inner
def workspace():
    """Room for `step`."""
    return np.zeros((9, STATE))
