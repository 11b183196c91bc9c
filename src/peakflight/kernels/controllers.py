"""Controllers: from a measured state and what is planned to the thrust of each rotor.

Both see the same rows of what is planned, at the places that the constants name: position and
velocity; the thrust vector, N; yaw; attitude, body rates and angular accelerations.
"""

import math

from peakflight.kernels.jit import within
from peakflight.kernels.rigid_body import (
    ATTITUDE,
    POSITION,
    RATE,
    VELOCITY,
    normalise,
    product,
    turned,
    turned_back,
)

PLANNED_POSITION, PLANNED_VELOCITY, PLANNED_THRUST, PLANNED_YAW = 0, 3, 6, 9
PLANNED_ATTITUDE, PLANNED_RATE, PLANNED_ACCELERATION, PLANNED = 10, 14, 17, 20

KP, KD, KI, MOST_KI, KR, KW, KM, MOST_KM, KDW, MOST_MOMENT, GAINS = range(11)
"""Rows of gains, each for x, y, z: of position, velocity, integral of position and its bound,
attitude, body rate, integral of attitude and its bound, change of body rate, bound of a moment."""

HELD_INTEGRAL, HELD_TURN, HELD_RATE, HELD_PLANNED, HELD_ATTITUDE, HELD_FORCE, HELD = (
    0, 3, 6, 9, 12, 16, 17,
)  # fmt: skip
"""What the firmware's controller keeps from one time to the next: two integrals, the body rates
last measured and planned, the wanted attitude and force."""

NOTHING = 1e-9
"""A vector this short has no direction, N."""


@within
def geometric(state, planned, mass, inertia, gains, room, wrench):
    """Wrench (4,) <- thrust and torques of a tracker on SE(3): Lee, Leok and McClamroch 2010.

    The wanted attitude is the planned one, tilted the shortest way to where the wanted force
    points, so that feed-forward needs no other frame. Room is (6, 4).
    """
    force, axis, error, wanted, rate, turn = room[0], room[1], room[2], room[3], room[4], room[5]
    square = 0.0
    for d in range(3):
        miss = state[POSITION + d] - planned[PLANNED_POSITION + d]
        drift = state[VELOCITY + d] - planned[PLANNED_VELOCITY + d]
        force[d] = planned[PLANNED_THRUST + d] - mass * (gains[KP, d] * miss + gains[KD, d] * drift)
        square += force[d] * force[d]
    axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
    turned(planned[PLANNED_ATTITUDE:PLANNED_RATE], axis, axis)
    length = math.sqrt(square)
    wanted[:] = planned[PLANNED_ATTITUDE:PLANNED_RATE]
    if length > NOTHING:
        _shortest_turn(axis, force, length, turn)
        product(turn, wanted, wanted)
    for i in range(4):
        error[i] = wanted[i] if i == 0 else -wanted[i]
    product(error, state[ATTITUDE:RATE], error)  # from the wanted to the true attitude
    turned_back(error, planned[PLANNED_RATE:PLANNED_ACCELERATION], rate)
    turned_back(error, planned[PLANNED_ACCELERATION:PLANNED], turn)
    axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
    turned(state[ATTITUDE:RATE], axis, axis)
    wrench[0] = force[0] * axis[0] + force[1] * axis[1] + force[2] * axis[2]
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        p, q = state[RATE + e], state[RATE + f]
        wanted_turn = turn[d] - (p * rate[f] - q * rate[e])
        wanted_turn -= gains[KR, d] * 2.0 * error[0] * error[1 + d]
        wanted_turn -= gains[KW, d] * (state[RATE + d] - rate[d])
        wrench[1 + d] = inertia[d] * wanted_turn + (inertia[f] - inertia[e]) * p * q


@within
def _shortest_turn(axis, force, length, out):
    """Out <- the quaternion of the shortest turn from a unit axis to a force."""
    cosine = (axis[0] * force[0] + axis[1] * force[1] + axis[2] * force[2]) / length
    if cosine < -1.0 + NOTHING:  # straight the other way: there is no shortest turn
        out[0], out[1], out[2], out[3] = 1.0, 0.0, 0.0, 0.0
        return
    out[0] = 1.0 + cosine
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        out[1 + d] = (axis[e] * force[f] - axis[f] * force[e]) / length
    normalise(out)


@within
def share_out(wrench, mixer, least, most, commands):
    """Commands (4,) <- thrusts of rotors within their range; whether the range was in the way.

    Where the range is too narrow, first the torque about z gives way, then the thrust, then
    roll and pitch together (Faessler, Falanga and Scaramuzza 2017, 10.1109/LRA.2016.2640362).
    """
    lowest, highest = math.inf, -math.inf
    for r in range(4):
        commands[r] = mixer[r, 1] * wrench[1] + mixer[r, 2] * wrench[2]
        lowest = min(lowest, commands[r])
        highest = max(highest, commands[r])
    scale = min(1.0, (most - least) / (highest - lowest)) if highest > lowest else 1.0
    base = mixer[0, 0] * wrench[0]
    kept = min(max(base, least - scale * lowest), most - scale * highest)
    share = 1.0
    for r in range(4):
        commands[r] = kept + scale * commands[r]
        about = mixer[r, 3] * wrench[3]
        if about > 0.0:
            share = min(share, (most - commands[r]) / about)
        elif about < 0.0:
            share = min(share, (least - commands[r]) / about)
    share = max(share, 0.0)
    for r in range(4):
        commands[r] = min(max(commands[r] + share * mixer[r, 3] * wrench[3], least), most)
    return scale < 1.0 or kept != base or share < 1.0


@within
def firmware(state, planned, gains, force_scale, moments, outer, time, pause, held, room, thrusts):
    """Thrusts (4,) <- what the Crazyflie's controller_mellinger.c asks of the rotors, unbounded.

    Parameters
    ----------
    force_scale
        Thrust that comes out for a force that is asked for.
    moments
        (4, 3) thrust of each rotor for a moment of 1 in the units of the firmware, N.
    outer
        Whether it is time for the loop of position.
    time, pause
        Between two runs of this loop and of the loop of position, s.
    held
        (17,) what is kept from one time to the next.
    """
    force, axis, wanted, error = room[0], room[1], room[2], room[3]
    if outer:
        square = 0.0
        for d in range(3):
            miss = planned[PLANNED_POSITION + d] - state[POSITION + d]
            drift = planned[PLANNED_VELOCITY + d] - state[VELOCITY + d]
            integral = held[HELD_INTEGRAL + d] + miss * pause
            integral = min(max(integral, -gains[MOST_KI, d]), gains[MOST_KI, d])
            held[HELD_INTEGRAL + d] = integral
            force[d] = (
                planned[PLANNED_THRUST + d]
                + gains[KP, d] * miss
                + gains[KD, d] * drift
                + gains[KI, d] * integral
            )
            square += force[d] * force[d]
        axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
        turned(state[ATTITUDE:RATE], axis, axis)
        along = force[0] * axis[0] + force[1] * axis[1] + force[2] * axis[2]
        held[HELD_FORCE] = force_scale * along
        length = math.sqrt(square)
        if length > NOTHING:
            attitude = held[HELD_ATTITUDE:HELD_FORCE]
            _with_yaw(force, length, planned[PLANNED_YAW], attitude)
    for i in range(4):
        wanted[i] = held[HELD_ATTITUDE + i] if i == 0 else -held[HELD_ATTITUDE + i]
    product(wanted, state[ATTITUDE:RATE], error)
    for r in range(4):
        thrusts[r] = 0.25 * held[HELD_FORCE]
    for d in range(3):
        off = (
            4.0 * error[0] * error[1 + d]
        )  # (R_d^T R - R^T R_d), which the firmware does not halve
        rate, wanted_rate = state[RATE + d], planned[PLANNED_RATE + d]
        jolt = wanted_rate - held[HELD_PLANNED + d] - (rate - held[HELD_RATE + d])
        integral = held[HELD_TURN + d] - off * time
        integral = min(max(integral, -gains[MOST_KM, d]), gains[MOST_KM, d])
        held[HELD_TURN + d] = integral
        held[HELD_RATE + d] = rate
        held[HELD_PLANNED + d] = wanted_rate
        moment = (
            -gains[KR, d] * off
            + gains[KW, d] * (wanted_rate - rate)
            + gains[KM, d] * integral
            + gains[KDW, d] * jolt / time
        )
        moment = min(max(moment, -gains[MOST_MOMENT, d]), gains[MOST_MOMENT, d])
        if held[HELD_FORCE] > 0.0:
            for r in range(4):
                thrusts[r] += moments[r, d] * moment


@within
def _with_yaw(force, length, yaw, out):
    """Out <- the attitude with z along a force and y across (cos yaw, sin yaw, 0), as Mellinger."""
    zx, zy, zz = force[0] / length, force[1] / length, force[2] / length
    c, s = math.cos(yaw), math.sin(yaw)
    yx, yy, yz = -zz * s, zz * c, zx * s - zy * c
    size = math.sqrt(yx * yx + yy * yy + yz * yz)
    if size < NOTHING:  # the force lies along the heading: keep what was wanted
        return
    yx, yy, yz = yx / size, yy / size, yz / size
    xx, xy, xz = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    _from_axes(xx, xy, xz, yx, yy, yz, zx, zy, zz, out)


@within
def _from_axes(xx, xy, xz, yx, yy, yz, zx, zy, zz, out):
    """Out <- the quaternion of a frame, from its largest part for the sake of digits."""
    trace = xx + yy + zz
    if trace > 0.0:
        out[0], out[1], out[2], out[3] = 1.0 + trace, yz - zy, zx - xz, xy - yx
    elif xx >= yy and xx >= zz:
        out[0], out[1], out[2], out[3] = yz - zy, 1.0 + xx - yy - zz, yx + xy, zx + xz
    elif yy >= zz:
        out[0], out[1], out[2], out[3] = zx - xz, yx + xy, 1.0 + yy - xx - zz, zy + yz
    else:
        out[0], out[1], out[2], out[3] = xy - yx, zx + xz, zy + yz, 1.0 + zz - xx - yy
    normalise(out)
