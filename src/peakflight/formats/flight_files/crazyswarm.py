"""Trajectory files of the Crazyflie: one polynomial piece a row, as Crazyswarm2 loads them.

A row holds a duration, s, then eight ascending coefficients in piece-local time for each of x, y,
z, m, and yaw, rad.
"""

import math

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.files import PathLike, write_atomically
from peakflight.formats.flight_files.coarser import coarsened
from peakflight.formats.flight_files.flight_format import (
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    as_text,
    single,
    start_note,
)
from peakflight.formats.flight_files.table import as_float32, read_table
from peakflight.heading import heading
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

DEGREE = 7
"""Of every polynomial in the file."""
MEMORY_PIECES = 31
"""What 4096 bytes hold of pieces with 33 numbers of 4 bytes, all trajectories on board together."""
SAME_YAW = 1e-6
"""Difference of yaw, rad, below which the file has the plan's."""
LEAST_PIECES = 2
"""The loader of Crazyswarm2 fails on a file of one row."""
HEADER = ",".join(
    ["duration"] + [f"{axis}^{power}" for axis in ("x", "y", "z", "yaw") for power in range(8)]
)
NUMBERS = 33
"""In a row."""


def write_crazyflie(plan: Plan, path: PathLike) -> tuple[str, ...]:
    """Write the pieces of a plan, padded to degree 7; a single piece becomes two, exactly.

    Yaw is that of `heading`. A yaw motion has finer pieces than the flight: on each of the flight's
    the polynomial of degree 7 nearest to it, with the same yaw, rate and acceleration at both ends;
    a note says how far off that is. Numbers have 9 significant digits, which costs some 3e-8 m, and
    1e-7 m on pieces of 4 s. `peakflight.export` makes pieces fewer where there is not room for all.

    Returns
    -------
    Notes for whoever flies the file, in words.

    Raises
    ------
    InvalidProblem
        If the polynomials have a degree above 7.
    InvalidFile
        If the file cannot be written.
    """
    data, notes = encode(plan)
    write_atomically(path, data)
    return notes


def encode(plan: Plan, name: str = "") -> Encoded:
    """The file of a plan; the name does not appear in it."""
    del name
    rows, notes = pieces_of(plan)
    row = ",".join(["%.9g"] * NUMBERS)
    lines = [HEADER, *(row % tuple(values) for values in rows.tolist())]
    return Encoded(as_text(lines), notes)


def decode(data: bytes) -> tuple[Reading, ...]:
    """What a Crazyflie flies of a file: every number becomes single precision on board."""
    _, rows = read_table(data, NUMBERS)
    return (reading_of(rows),)


def pieces_of(plan: Plan) -> tuple[np.ndarray, tuple[str, ...]]:
    """(K, 33) duration and coefficients of x, y, z and yaw, and notes on what they leave out."""
    trajectory = plan.trajectory
    if trajectory.degree > DEGREE:
        raise InvalidProblem(
            f"the trajectory has degree {trajectory.degree}; a Crazyflie flies degree {DEGREE} "
            f"at most: plan with degree={DEGREE}"
        )
    yaw, off = coarsened(heading(plan), trajectory.segment_times, DEGREE)
    coefficients = np.concatenate(
        (trajectory.elevate(DEGREE).coefficients, yaw.coefficients), axis=2
    )
    flight = Trajectory(coefficients, trajectory.segment_times, trajectory.start_time)
    if len(flight) < LEAST_PIECES:
        flight = Trajectory.concatenate(flight.split((flight.start_time + flight.end_time) / 2.0))
    pieces = len(flight)
    rows = np.column_stack(
        (flight.segment_times, flight.coefficients.transpose(0, 2, 1).reshape(pieces, -1))
    )
    return rows + 0.0, _notes(plan, pieces, off)  # no negative zeros


def reading_of(rows: np.ndarray) -> Reading:
    """The flight of (K, 33) numbers in single precision."""
    rows = as_float32(rows)
    coefficients = rows[:, 1:].reshape(len(rows), 4, DEGREE + 1).transpose(0, 2, 1)
    return Reading(
        Trajectory(coefficients[:, :, :3], rows[:, 0]),
        Trajectory(coefficients[:, :, 3:], rows[:, 0]),
    )


def room(plan: Plan) -> int:
    """Pieces that the memory of a Crazyflie holds."""
    del plan
    return MEMORY_PIECES


def yaw_note(off: float) -> tuple[str, ...]:
    """A note where yaw is off the plan's."""
    if off <= SAME_YAW:
        return ()
    return (
        f"its yaw is up to {math.degrees(off):.2g} deg off the plan's, which has finer pieces, "
        "and not proven to keep the yaw limits",
    )


def _notes(plan: Plan, pieces: int, off: float) -> tuple[str, ...]:
    full: tuple[str, ...] = ()
    if pieces > MEMORY_PIECES:
        full = (
            f"{pieces} pieces: the memory of a Crazyflie holds {MEMORY_PIECES}, and its firmware "
            "does not check",
        )
    return (*yaw_note(off), *full, *start_note([plan], "the Crazyflie"))


FORMAT = FlightFormat(
    filename="crazyflie.csv",
    summary="polynomials for a Crazyflie",
    consumer="Crazyswarm2, and other loaders of Crazyflie trajectories",
    numbers="9 digits, single precision on board",
    rules="degree 7; 31 pieces, all trajectories on board together",
    encode=single(encode),
    decode=decode,
    # half a unit in the last place of single precision
    precision=Precision(position=1e-6, time=1e-6, terms=6e-8),
    tolerance=1e-4,
    most_pieces=room,
)
