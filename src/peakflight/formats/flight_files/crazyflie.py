"""Trajectory files of the Crazyflie: one polynomial piece a row, as Crazyswarm2 loads them.

A row holds a duration, s, then eight ascending coefficients in piece-local time for each of x, y,
z, m, and yaw, rad.
"""

import math

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.files import PathLike, write_atomically
from peakflight.formats.flight_files.coarser import coarsened
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


def write_crazyflie(plan: Plan, path: PathLike) -> tuple[str, ...]:
    """Write the pieces of a plan, padded to degree 7; a single piece becomes two, exactly.

    Yaw is that of `heading`. A yaw motion has finer pieces than the flight: on each of the flight's
    the polynomial of degree 7 nearest to it, with the same yaw, rate and acceleration at both ends;
    a note says how far off that is. Numbers have 9 significant digits, which costs some 3e-8 m, and
    1e-7 m on pieces of 4 s.

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
    row = ",".join(["%.9g"] * rows.shape[1])
    lines = [HEADER, *(row % tuple(values) for values in (rows + 0.0).tolist())]
    write_atomically(path, "\n".join(lines) + "\n")
    return _notes(plan, pieces, off)


def _notes(plan: Plan, pieces: int, off: float) -> tuple[str, ...]:
    notes = []
    if off > SAME_YAW:
        notes.append(
            f"its yaw is up to {math.degrees(off):.2g} deg off the plan's, which has finer pieces, "
            "and not proven to keep the yaw limits"
        )
    if pieces > MEMORY_PIECES:
        notes.append(
            f"{pieces} pieces: the memory of a Crazyflie holds {MEMORY_PIECES}, and its firmware "
            "does not check"
        )
    if plan.trajectory.start_time != 0.0:
        notes.append(
            f"the plan starts at {plan.trajectory.start_time:g} s; the file has no such time, and "
            "its flight starts when the Crazyflie is told to"
        )
    return tuple(notes)
