"""What a quadrotor does while it follows a motion: attitude, rates and rotor thrusts at samples.

With v, a, j, s of a motion, gravity g, mass m and rotor drag d across and e along the thrust axis,
all of Eq. Quadrotor_model follows from

    F = a + g e3 + (d/m) v,   b = F/|F|,   thrust = m |F| + (e - d) b.v

where b is the thrust axis: Faessler et al. 2018 (10.1109/LRA.2017.2776353), with one coefficient
across the axis, which leaves b independent of the yaw. The attitude tilts e3 to b by the shortest
way, then turns by the yaw about b. Its rates follow by differentiating; see `docs/flatness.md`.
"""

import math

import numpy as np

from peakflight.kernels.jit import inner, kernel

REGULAR, FREE_FALL, INVERTED = 0, 1, 2
WEIGHTLESS = 1e-6
"""|F| below this share of gravity has no direction to speak of."""
UPSIDE_DOWN = 1e-9
"""1 + b_z below this: about every way to tilt there is as short."""


@kernel
def flat_states(motion, yaw, mass, inertia, drag, mixer, gravity):
    """States of n samples.

    Parameters
    ----------
    motion
        (n, 4, 3) velocity, acceleration, jerk, snap.
    yaw
        (n, 3) yaw, its rate and acceleration.
    inertia, drag, mixer
        (3,), (2,) across and along the axis, (4, 4) from thrust and torques to rotor thrusts.

    Returns
    -------
    Quaternions (n, 4), body rates, angular accelerations and torques (n, 3, 3), thrusts (n,),
    rotor thrusts (n, 4), and codes (n,).
    """
    count = motion.shape[0]
    quaternions = np.empty((count, 4))
    turning = np.empty((count, 3, 3))
    thrusts = np.empty(count)
    rotors = np.empty((count, 4))
    codes = np.zeros(count, np.int64)
    axis = np.array([0.0, 0.0, 1.0])
    swing = np.zeros((2, 3))
    wrench = np.empty(4)
    for i in range(count):
        length = _thrust_axis(motion[i], drag[0] / mass, gravity, axis, swing)
        if length < WEIGHTLESS * gravity:
            codes[i] = FREE_FALL
        elif 1.0 + axis[2] < UPSIDE_DOWN:
            codes[i] = INVERTED
        along = axis[0] * motion[i, 0, 0] + axis[1] * motion[i, 0, 1] + axis[2] * motion[i, 0, 2]
        thrusts[i] = mass * length + (drag[1] - drag[0]) * along
        _attitude(axis, yaw[i, 0], quaternions[i])
        _rates(axis, swing, yaw[i], turning[i])
        _torques(inertia, turning[i])
        wrench[0] = thrusts[i]
        for d in range(3):
            wrench[1 + d] = turning[i, 2, d]
        for r in range(4):
            total = 0.0
            for c in range(4):
                total += mixer[r, c] * wrench[c]
            rotors[i, r] = total
    return quaternions, turning, thrusts, rotors, codes


@inner
def _thrust_axis(motion, pull, gravity, axis, swing):
    """Axis b, swing: b' and b'' <- a sample; returns |F|. In free fall b stays as it is."""
    square = 0.0
    for d in range(3):
        force = motion[1, d] + pull * motion[0, d] + gravity * (d == 2)
        square += force * force
    length = math.sqrt(square)
    if length < WEIGHTLESS * gravity:
        swing[:] = 0.0
        return length
    growth = 0.0
    for d in range(3):
        axis[d] = (motion[1, d] + pull * motion[0, d] + gravity * (d == 2)) / length
        growth += axis[d] * (motion[2, d] + pull * motion[1, d])
    bend = 0.0
    for d in range(3):
        change = motion[2, d] + pull * motion[1, d]
        swing[0, d] = (change - growth * axis[d]) / length
        bend += swing[0, d] * change + axis[d] * (motion[3, d] + pull * motion[2, d])
    for d in range(3):
        bent = motion[3, d] + pull * motion[2, d]
        swing[1, d] = (bent - bend * axis[d] - 2.0 * growth * swing[0, d]) / length
    return length


@inner
def _attitude(axis, yaw, out):
    """Out <- quaternion w, x, y, z: the shortest tilt from e3 to the axis, after a turn by yaw."""
    rise = 1.0 + axis[2]
    if rise < UPSIDE_DOWN:  # half a turn about x
        w, x, y = 0.0, 1.0, 0.0
    else:
        scale = 1.0 / math.sqrt(2.0 * rise)
        w, x, y = rise * scale, -axis[1] * scale, axis[0] * scale
    c = math.cos(0.5 * yaw)
    s = math.sin(0.5 * yaw)
    out[0] = w * c
    out[1] = x * c + y * s
    out[2] = y * c - x * s
    out[3] = w * s


@inner
def _rates(axis, swing, yaw, out):
    """Out[0], out[1] <- body rates and angular accelerations.

    In the frame that is tilted but not yet turned, b' = (w_y, -w_x, 0), and w_z is what the
    shortest tilt turns by as the axis goes around.
    """
    rise = 1.0 + axis[2]
    c = 0.0 if rise < UPSIDE_DOWN else 1.0 / rise
    bx, by = axis[0], axis[1]
    vx, vy, vz = swing[0, 0], swing[0, 1], swing[0, 2]
    ax, ay, az = swing[1, 0], swing[1, 1], swing[1, 2]
    side = 1.0 if c > 0.0 else -1.0  # upside down, half a turn about x has y reversed
    wx = -side * (vy - c * by * vz)
    wy = vx - c * bx * vz
    wz = c * (by * vx - bx * vy)
    px = -side * (ay - c * (vy * vz + by * az) + c * c * by * vz * vz)
    py = ax - c * (vx * vz + bx * az) + c * c * bx * vz * vz
    pz = c * (by * ax - bx * ay) - c * vz * wz
    cosine = math.cos(yaw[0])
    sine = math.sin(yaw[0])
    out[0, 0] = cosine * wx + sine * wy
    out[0, 1] = cosine * wy - sine * wx
    out[0, 2] = wz + yaw[1]
    out[1, 0] = cosine * px + sine * py + yaw[1] * out[0, 1]
    out[1, 1] = cosine * py - sine * px - yaw[1] * out[0, 0]
    out[1, 2] = pz + yaw[2]


@inner
def _torques(inertia, out):
    """Out[2] <- J w' + w x J w from out[0] and out[1]."""
    for d in range(3):
        e = (d + 1) % 3
        f = (d + 2) % 3
        twist = (inertia[f] - inertia[e]) * out[0, e] * out[0, f]
        out[2, d] = inertia[d] * out[1, d] + twist
