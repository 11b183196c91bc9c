"""Samples of a flight at a fixed rate, as CSV: time, position to snap, yaw, and what rotors do."""

import math

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.files import PathLike, write_atomically
from peakflight.formats.flight_files.flight_format import (
    SET_POINTS,
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    as_text,
    single,
    through_samples,
)
from peakflight.formats.flight_files.table import read_table
from peakflight.heading import heading
from peakflight.problem import AXES
from peakflight.result import Plan
from peakflight.vehicle import Vehicle

RATE = 100.0
"""Samples a second: what motion capture gives and position controllers take."""
MOST_ROWS = 5_000_000
"""A file of a gigabyte; more is a slip in the rate."""
PREFIXES = ("", "v", "a", "j", "s")
"""Of the columns of position, velocity, acceleration, jerk and snap."""
YAW_COLUMNS = ("yaw [rad]", "yaw_rate [rad/s]", "yaw_acceleration [rad/s^2]")
STATES = (
    *(f"q{part} [1]" for part in "wxyz"),
    *(f"w{axis} [rad/s]" for axis in AXES),
    *(f"f{rotor} [N]" for rotor in (1, 2, 3, 4)),
)
"""Columns of a vehicle: its attitude, body rates and rotor thrusts."""
UNITS = ("m", "m/s", "m/s^2", "m/s^3", "m/s^4")
NEAR_END = 1e-3
"""A sample this part of a period before the end is the end: both would print the same time."""


def write_samples(plan: Plan, path: PathLike, rate: float = RATE) -> tuple[str, ...]:
    """Write time, position, velocity, acceleration, jerk, snap and yaw, one row a sample.

    Samples begin at the start time and follow each other by 1/rate; the last one is at the end,
    wherever that falls. Yaw, its rate and its acceleration are there if the plan has a yaw motion;
    attitude, body rates and rotor thrusts if it has a vehicle (`peakflight.planned_states`). Times
    have 15 significant digits, so that they stay apart whatever the start time, other numbers 9.

    Parameters
    ----------
    rate
        Hz.

    Returns
    -------
    Notes for whoever flies the file: where rotors are asked for more than the vehicle's have.

    Raises
    ------
    InvalidProblem
        If the rate is not positive and finite, or makes more than 5 million rows.
    InvalidFile
        If the file cannot be written.
    """
    data, notes = encode(plan, rate=rate)
    write_atomically(path, data)
    return notes


def encode(plan: Plan, name: str = "", rate: float = RATE) -> Encoded:
    """The file of a plan; the name does not appear in it."""
    del name
    times = sample_times(plan, rate)
    trajectory = plan.trajectory
    columns = [times, *(trajectory(times, derivative=order).T for order in range(len(UNITS)))]
    names = ["t [s]"]
    for prefix, unit in zip(PREFIXES, UNITS, strict=True):
        names += [f"{prefix}{axis} [{unit}]" for axis in AXES]
    if plan.problem.yaw is not None:
        orders = range(1 if plan.yaw_motion is None else len(YAW_COLUMNS))
        columns += [heading(plan)(times, derivative=order).T for order in orders]
        names += YAW_COLUMNS[: len(orders)]
    if plan.vehicle is not None:
        from peakflight.flatness import planned_states

        states = planned_states(plan, times)
        notes = beyond(states.rotor_thrust, plan.vehicle)
        columns += [states.attitude.T, states.body_rate.T, states.rotor_thrust.T]
        names += STATES
    else:
        notes = ()
    table = np.vstack(columns).T + 0.0  # no negative zeros
    row = "%.15g" + ",%.9g" * (table.shape[1] - 1)
    lines = [",".join(names), *(row % tuple(values) for values in table.tolist())]
    return Encoded(as_text(lines), notes)


def decode(data: bytes) -> tuple[Reading, ...]:
    """The motion through the samples, and the yaw if there is one."""
    names, rows = read_table(data)
    times = rows[:, 0]
    position, velocity, acceleration = (rows[:, 1 + 3 * k : 4 + 3 * k] for k in range(3))
    yaw = None
    if YAW_COLUMNS[1] in names:
        angle, rate, turn = (rows[:, [names.index(column)]] for column in YAW_COLUMNS)
        yaw = through_samples(times, angle, rate, turn)
    return (Reading(through_samples(times, position, velocity, acceleration), yaw),)


def beyond(thrusts: np.ndarray, vehicle: Vehicle) -> tuple[str, ...]:
    """A note if any of (n, 4) thrusts is out of the range of the rotors."""
    least, most = vehicle.rotor_thrust
    lowest, highest = float(thrusts.min()), float(thrusts.max())
    if least <= lowest and highest <= most:
        return ()
    return (
        f"flown exactly, at this yaw, it takes {lowest:.3g} to {highest:.3g} N of a rotor; "
        f"{vehicle.name} has {least:.3g} to {most:.3g} N",
    )


def sample_times(plan: Plan, rate: float) -> np.ndarray:
    """(n,) s, from the start to the end."""
    trajectory = plan.trajectory
    count = checked_count(trajectory.duration, rate)
    return np.append(trajectory.start_time + np.arange(count) / rate, trajectory.end_time)


def checked_count(duration: float, rate: float) -> int:
    """Periods of a rate, Hz, in a duration, s; the last may be shorter.

    Raises
    ------
    InvalidProblem
        If the rate is not positive and finite, or makes more than 5 million rows.
    """
    if not (math.isfinite(rate) and rate > 0.0):
        raise InvalidProblem(f"rate is {rate:g} Hz; it must be positive and finite")
    periods = duration * rate
    if periods >= MOST_ROWS:
        raise InvalidProblem(
            f"rate is {rate:g} Hz, which makes {periods:.3g} rows of {duration:g} s; "
            f"{MOST_ROWS} are the most"
        )
    return max(1, math.ceil(periods - NEAR_END))


FORMAT = FlightFormat(
    filename="samples.csv",
    summary="time, position to snap, yaw and rotor thrusts at 100 Hz",
    consumer="spreadsheets, simulators, own controllers",
    numbers="9 digits",
    rules="5 million rows",
    encode=single(encode),
    decode=decode,
    precision=Precision(position=1e-6, relative=1e-8),
    tolerance=1e-2,
    fixed=SET_POINTS,
)
