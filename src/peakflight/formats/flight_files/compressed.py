"""Compressed trajectories as the memory of a Crazyflie holds them: whole millimetres.

The bytes are those that cflib's CompressedStart and CompressedSegment pack: a start of four 16-bit
numbers, x, y, z in mm and yaw in 0.1 degrees; then for each piece a byte with the kind of each
axis (constant or degree 7 here), the duration in ms as 16 bits without a sign, and the control
points after the first of every axis that is not constant. A piece of no duration ends it.
"""

import math
import struct

import numpy as np

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.formats.flight_files.coarser import coarsened
from peakflight.formats.flight_files.crazyswarm import yaw_note
from peakflight.formats.flight_files.flight_format import (
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    single,
    start_note,
)
from peakflight.formats.flight_files.rounded import (
    DEGREE,
    MILLI,
    Curves,
    control_points,
    cut,
    motion,
    rounded,
)
from peakflight.heading import heading
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

MEMORY = 4096
"""Bytes, all trajectories on board together."""
START, HEAD, AXIS = 8, 3, 14
"""Bytes: the start, what every piece begins with, and an axis of degree 7."""
CONSTANT, SEPTIC = 0, 3
"""Kinds of axis; 1 and 2 are of degree 1 and 3."""
LENGTHS = {0: 0, 1: 1, 2: 3, 3: 7}
"""Control points that a piece has of each kind of axis."""
LARGEST = 32767
"""Of a 16-bit number."""
ANGLE = math.radians(0.1)
UNIT = np.array([MILLI, MILLI, MILLI, ANGLE])
END = b"\0\0\0"
"""Without it the firmware reads on in what was in memory before."""
YAW_NOTE = (
    "it turns the yaw: firmware from before July 2026 reads the yaw of compressed trajectories "
    "wrongly (crazyflie-firmware #1659); update it, or use the format crazyswarm"
)


def encode(plan: Plan, name: str = "") -> Encoded:
    """The memory image of a plan; the name does not appear in it."""
    del name
    curves, notes = curves_of(plan)
    return Encoded(packed(curves), notes)


def curves_of(plan: Plan) -> tuple[Curves, tuple[str, ...]]:
    """The curves of x, y, z and yaw, and notes on what they leave out.

    Raises
    ------
    InvalidProblem
        If a point is farther out than 32.767 m, or they take more than the memory.
    """
    trajectory = cut(plan.trajectory)
    yaw, off = coarsened(heading(plan), trajectory.segment_times, DEGREE)
    points = np.concatenate((control_points(trajectory), control_points(yaw)), axis=2)
    curves = rounded(points, trajectory.segment_times, UNIT)
    whole = curves.points
    if np.abs(whole[:, :, 3]).max() > LARGEST:
        raise InvalidProblem(
            f"the yaw reaches {math.degrees(np.abs(points[:, :, 3]).max()):.0f} deg; the format "
            f"holds {LARGEST * 0.1:.0f} deg"
        )
    if np.abs(whole[:, :, :3]).max() > LARGEST:
        piece, _, axis = np.unravel_index(np.abs(whole[:, :, :3]).argmax(), whole[:, :, :3].shape)
        value = points[piece, :, axis]
        raise InvalidProblem(
            f"segment {piece} reaches {'xyz'[axis]} = {value[np.abs(value).argmax()]:.3f} m with "
            f"a control point; the format holds {LARGEST * MILLI:.3f} m"
        )
    turns = (YAW_NOTE,) if whole[:, :, 3].any() else ()
    return curves, (*yaw_note(off), *turns, *start_note([plan], "the Crazyflie"))


def packed(curves: Curves) -> bytes:
    """The bytes of curves, which fit the memory.

    Raises
    ------
    InvalidProblem
        If they do not.
    """
    parts = [struct.pack("<4h", *curves.points[0, 0])]
    for duration, points in zip(curves.milliseconds.tolist(), curves.points, strict=True):
        kinds = [SEPTIC if np.ptp(points[:, axis]) else CONSTANT for axis in range(4)]
        parts.append(struct.pack("<BH", sum(k << 2 * i for i, k in enumerate(kinds)), duration))
        parts += [struct.pack("<7h", *points[1:, axis]) for axis in np.flatnonzero(kinds)]
    data = b"".join((*parts, END))
    if len(data) > MEMORY:
        raise InvalidProblem(
            f"{len(curves.milliseconds)} pieces take {len(data)} bytes; the memory of a Crazyflie "
            f"has {MEMORY}"
        )
    return data


def decode(data: bytes) -> tuple[Reading, ...]:
    """What a Crazyflie flies of a memory image, as its firmware unpacks it.

    Raises
    ------
    InvalidFile
        If it ends within a piece.
    """
    try:
        curves = _unpacked(data)
    except struct.error:
        raise InvalidFile("the file ends within a piece") from None
    flight = motion(curves, UNIT)
    return (
        Reading(
            Trajectory(flight.coefficients[:, :, :3], flight.segment_times),
            Trajectory(flight.coefficients[:, :, 3:], flight.segment_times),
        ),
    )


def _unpacked(data: bytes) -> Curves:
    start = np.array(struct.unpack_from("<4h", data, 0), dtype=np.int64)
    milliseconds: list[int] = []
    pieces: list[np.ndarray] = []
    at = START
    while True:
        kinds, duration = struct.unpack_from("<BH", data, at)
        at += HEAD
        if duration == 0:
            break
        points = np.tile(start, (DEGREE + 1, 1))
        for axis in range(4):
            kind = kinds >> 2 * axis & 3
            if kind not in (CONSTANT, SEPTIC):
                raise InvalidFile(
                    f"piece {len(pieces)} has an axis of degree {LENGTHS[kind]}; 0 and 7 are read"
                )
            if kind == SEPTIC:
                points[1:, axis] = struct.unpack_from("<7h", data, at)
                at += AXIS
        milliseconds.append(duration)
        pieces.append(points)
        start = points[-1]
    if not pieces:
        raise InvalidFile("the file has no piece")
    return Curves(np.array(milliseconds), np.stack(pieces))


def room(plan: Plan) -> int:
    """Pieces that the memory of a Crazyflie holds: 69 where the yaw turns, else 90."""
    axes = 4 if np.ptp(heading(plan).coefficients[:, 0]) > ANGLE else 3
    return (MEMORY - START - HEAD) // (HEAD + AXIS * axes)


FORMAT = FlightFormat(
    filename="crazyflie-compressed.bin",
    summary="compressed polynomials as a Crazyflie's memory holds them",
    consumer="Crazyflie firmware, by memory write at the trajectory's offset",
    numbers="16 bits: mm, 0.1 deg, ms",
    rules="32.767 m; degree 7; 69 pieces, 90 without turning; pieces are cut at 60 s",
    encode=single(encode),
    decode=decode,
    precision=Precision(position=MILLI, time=MILLI),
    tolerance=1e-2,
    coarse=True,
    most_pieces=room,
)
