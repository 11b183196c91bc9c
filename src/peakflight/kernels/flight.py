"""A flight from its first moment to its last: rigid body, rotors, controller, what disturbs."""

import math

import numpy as np

from peakflight.kernels.controllers import (
    HELD,
    PLANNED_ATTITUDE,
    PLANNED_POSITION,
    PLANNED_RATE,
    firmware,
    geometric,
    share_out,
)
from peakflight.kernels.jit import kernel, within
from peakflight.kernels.rigid_body import (
    ATTITUDE,
    POSITION,
    RATE,
    STATE,
    VELOCITY,
    product,
    step,
    turned,
    workspace,
)

FLEW, ATTITUDE_LOST, HIT_GROUND, LEFT_PATH, DIVERGED = 0, 1, 2, 3, 4
GEOMETRIC, FIRMWARE = 0, 1
NOISE = 15
"""Random numbers for a run of the controller: position, velocity, attitude, body rate, gust."""
FASTEST = 1e6
"""A state beyond this is no flight any more."""


@kernel
def open_loop(
    start, thrusts, commands, time, parts, rotors, mass, inertia, wrench, drag, wind, gravity
):
    """States (n+1, 13) and thrusts (n+1, 4) under (n, 4) commands, each held for a time.

    Each time is integrated in a number of parts.
    """
    count = commands.shape[0]
    states = np.empty((count + 1, STATE))
    flown = np.empty((count + 1, 4))
    state, now, room = start.copy(), thrusts.copy(), workspace()
    states[0], flown[0] = state, now
    for i in range(count):
        for _ in range(parts):
            step(
                state, now, commands[i], rotors, time / parts, mass, inertia, wrench, drag, wind,
                gravity, room,
            )  # fmt: skip
        states[i + 1], flown[i + 1] = state, now
    return states, flown


@kernel
def closed_loop(
    start, thrusts, planned, time, parts, rotors, mass, inertia, wrench, drag, wind, gravity,
    ranges, kind, gains, model_mass, model_inertia, mixer, spool, force_scale, moments, every,
    late, noise, deviations, gust, memory, bounds,
):  # fmt: skip
    """Fly what is planned.

    Parameters
    ----------
    start, thrusts
        (13,) and (4,) at the first of the planned rows.
    planned
        (n, 20) rows of what is planned, a time apart; the controller runs at each.
    parts
        Steps of integration in that time.
    rotors, mass, inertia, wrench, drag, wind, gravity
        Of the true vehicle; rotors (8,) as `spin` takes them, wrench (4, 4) is force and torques
        of each rotor for a thrust of 1.
    ranges
        (2, 2) least and most thrust of a rotor as it is, and as the controller knows it.
    kind, gains
        `GEOMETRIC` or `FIRMWARE`, and its (11, 3) gains.
    model_mass, model_inertia, mixer, spool
        What the geometric controller knows of the vehicle; spool is the share of the lag that is
        left after the controller has led it, 1 if it does not.
    force_scale, moments, every
        What the firmware's controller knows: see `firmware`; runs between two of its outer loop.
    late
        Runs of the controller by which the measured state is late.
    noise, deviations
        (n, 15) numbers of a normal distribution, or (0, 15) for none; standard deviations of
        position, velocity, attitude and body rate as (4,).
    gust, memory
        Standard deviation of the gusts, m/s; what is left of a gust after one time.
    bounds
        (3,) height of the ground (-inf for none), distance from the path that is a crash, cosine of
        the angle between the thrust axis and its plan that is one.

    Returns
    -------
    States (n, 13), thrusts (n, 4), how many rows there are, how many had a rotor at an end of its
    range, and the cause of a crash.
    """
    count = planned.shape[0]
    states = np.empty((count, STATE))
    flown = np.empty((count, 4))
    room, board = workspace(), np.zeros((6, 4))
    state, now, commands = start.copy(), thrusts.copy(), thrusts.copy()
    measured, air, turbulence = start.copy(), wind.copy(), np.zeros(3)
    held = np.zeros(HELD)
    held[12:16] = planned[0, PLANNED_ATTITUDE:PLANNED_RATE]
    effort = np.zeros(4)
    saturated = 0
    disturbed = noise.shape[0] > 0
    for i in range(count):
        states[i], flown[i] = state, now
        code = _verdict(state, planned[i], bounds, board)
        if code != FLEW:
            return states, flown, i + 1, saturated, code
        measured[:] = states[max(i - late, 0)]
        if disturbed:
            _disturb(measured, noise[i], deviations, board)
            for d in range(3):
                fresh = gust * noise[i, 12 + d]
                if i > 0:
                    fresh = memory * turbulence[d] + math.sqrt(1.0 - memory * memory) * fresh
                turbulence[d] = fresh
                air[d] = wind[d] + fresh
        if kind == GEOMETRIC:
            geometric(measured, planned[i], model_mass, model_inertia, gains, board, effort)
            clipped = share_out(effort, mixer, ranges[1, 0], ranges[1, 1], commands)
            if spool < 1.0:  # ask for more than is wanted, as long as it is not there yet
                for r in range(4):
                    commands[r] = now[r] + (commands[r] - now[r]) / spool
        else:
            row = i - i % every
            firmware(
                measured, planned[row], gains, force_scale, moments, row == i, time, every * time,
                held, board, commands,
            )  # fmt: skip
            clipped = False
        for r in range(4):
            inside = min(max(commands[r], ranges[0, 0]), ranges[0, 1])
            clipped = clipped or inside != commands[r]
            commands[r] = inside
        saturated += clipped
        for _ in range(parts):
            step(
                state, now, commands, rotors, time / parts, mass, inertia, wrench, drag, air,
                gravity, room,
            )  # fmt: skip
    return states, flown, count, saturated, FLEW


@within
def _verdict(state, planned, bounds, board):
    """Whether this is still a flight."""
    square = 0.0
    for d in range(3):
        miss = state[POSITION + d] - planned[PLANNED_POSITION + d]
        square += miss * miss
    for i in range(STATE):
        if not abs(state[i]) < FASTEST:
            return DIVERGED
    if state[POSITION + 2] < bounds[0]:
        return HIT_GROUND
    axis, wanted = board[0], board[1]
    axis[0], axis[1], axis[2] = 0.0, 0.0, 1.0
    turned(planned[PLANNED_ATTITUDE:PLANNED_RATE], axis, wanted)
    turned(state[ATTITUDE:RATE], axis, axis)
    if axis[0] * wanted[0] + axis[1] * wanted[1] + axis[2] * wanted[2] < bounds[2]:
        return ATTITUDE_LOST
    if square > bounds[1] * bounds[1]:
        return LEFT_PATH
    return FLEW


@within
def _disturb(measured, noise, deviations, board):
    """Add noise to a measured state."""
    turn = board[0]
    square = 0.0
    for d in range(3):
        measured[POSITION + d] += deviations[0] * noise[d]
        measured[VELOCITY + d] += deviations[1] * noise[3 + d]
        measured[RATE + d] += deviations[3] * noise[9 + d]
        turn[1 + d] = 0.5 * deviations[2] * noise[6 + d]
        square += turn[1 + d] * turn[1 + d]
    size = math.sqrt(1.0 + square)
    turn[0] = 1.0
    for i in range(4):
        turn[i] /= size
    product(measured[ATTITUDE:RATE], turn, measured[ATTITUDE:RATE])
