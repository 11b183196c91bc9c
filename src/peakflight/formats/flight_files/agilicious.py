"""Reference trajectories of Agilicious and CPC: the full state and the thrust of every rotor.

The columns are those that the planners of Foehn et al. write and Agilicious reads: time, position,
attitude w x y z from body to world, velocity in the world, body rates, acceleration, angular
acceleration in the body, the rotors' thrusts, jerk and snap.
"""

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.formats.flight_files.flight_format import (
    SET_POINTS,
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    as_text,
    single,
    start_note,
    through_samples,
)
from peakflight.formats.flight_files.samples import beyond, sample_times
from peakflight.formats.flight_files.table import read_table
from peakflight.result import Plan

RATE = 100.0
"""Rows a second."""
COLUMNS = (
    "t",
    *(f"p_{axis}" for axis in "xyz"),
    *(f"q_{part}" for part in "wxyz"),
    *(f"{name}_{axis}" for name in ("v", "w", "a_lin", "a_rot") for axis in "xyz"),
    *(f"u_{rotor}" for rotor in (1, 2, 3, 4)),
    *(f"{name}_{axis}" for name in ("jerk", "snap") for axis in "xyz"),
)


def encode(plan: Plan, name: str = "") -> Encoded:
    """The file of a plan; the name does not appear in it.

    Raises
    ------
    InvalidProblem
        If the plan has no vehicle.
    """
    del name
    if plan.vehicle is None:
        raise InvalidProblem("the plan has no vehicle, whose rotor thrusts the file holds")
    from peakflight.flatness import planned_states

    trajectory = plan.trajectory
    times = sample_times(plan, RATE)
    states = planned_states(plan, times)
    table = np.column_stack(
        (
            times - trajectory.start_time,
            trajectory(times),
            states.attitude,
            trajectory(times, 1),
            states.body_rate,
            trajectory(times, 2),
            states.angular_acceleration,
            states.rotor_thrust,
            trajectory(times, 3),
            trajectory(times, 4),
        )
    )
    row = ",".join(["%.9g"] * len(COLUMNS))
    lines = [",".join(COLUMNS), *(row % tuple(values) for values in (table + 0.0).tolist())]
    notes = (*beyond(states.rotor_thrust, plan.vehicle), *start_note([plan], "the vehicle"))
    return Encoded(as_text(lines), notes)


def decode(data: bytes) -> tuple[Reading, ...]:
    """The motion through position, velocity and acceleration."""
    _, rows = read_table(data, len(COLUMNS))
    columns = {name: index for index, name in enumerate(COLUMNS)}

    def vector(name: str) -> np.ndarray:
        first = columns[f"{name}_x"]
        return rows[:, first : first + 3]

    return (Reading(through_samples(rows[:, 0], vector("p"), vector("v"), vector("a_lin"))),)


FORMAT = FlightFormat(
    filename="agilicious.csv",
    summary="full state and rotor thrusts at 100 Hz",
    consumer="Agilicious, and what reads the files of CPC",
    numbers="9 digits",
    rules="needs a vehicle",
    encode=single(encode),
    decode=decode,
    precision=Precision(position=1e-6, relative=1e-8),
    tolerance=1e-2,
    fixed=SET_POINTS,
    needs_vehicle=True,
)
