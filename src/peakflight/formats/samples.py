"""Samples of a flight at a fixed rate, as CSV: time, position to snap, and yaw."""

import math

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.files import PathLike, write_atomically
from peakflight.heading import heading
from peakflight.problem import AXES
from peakflight.result import Plan

RATE = 100.0
"""Samples a second: what motion capture gives and position controllers take."""
MOST_ROWS = 5_000_000
"""A file of a gigabyte; more is a slip in the rate."""
PREFIXES = ("", "v", "a", "j", "s")
"""Of the columns of position, velocity, acceleration, jerk and snap."""
UNITS = ("m", "m/s", "m/s^2", "m/s^3", "m/s^4")
NEAR_END = 1e-3
"""A sample this part of a period before the end is the end: both would print the same time."""


def write_samples(plan: Plan, path: PathLike, rate: float = RATE) -> tuple[str, ...]:
    """Write time, position, velocity, acceleration, jerk, snap and yaw, one row a sample.

    Samples begin at the start time and follow each other by 1/rate; the last one is at the end,
    wherever that falls. Yaw is there if the problem has it. Times have 15 significant digits,
    so that they stay apart whatever the start time, other numbers 9.

    Parameters
    ----------
    rate
        Hz.

    Returns
    -------
    Notes for whoever flies the file: none.

    Raises
    ------
    InvalidProblem
        If the rate is not positive and finite, or makes more than 5 million rows.
    InvalidFile
        If the file cannot be written.
    """
    times = _times(plan, rate)
    trajectory = plan.trajectory
    columns = [times, *(trajectory(times, derivative=order).T for order in range(len(UNITS)))]
    names = ["t [s]"]
    for prefix, unit in zip(PREFIXES, UNITS, strict=True):
        names += [f"{prefix}{axis} [{unit}]" for axis in AXES]
    if plan.problem.yaw is not None:
        columns.append(heading(plan)(times).T)
        names.append("yaw [rad]")
    table = np.vstack(columns).T + 0.0  # no negative zeros
    row = "%.15g" + ",%.9g" * (table.shape[1] - 1)
    lines = [",".join(names), *(row % tuple(values) for values in table.tolist())]
    write_atomically(path, "\n".join(lines) + "\n")
    return ()


def _times(plan: Plan, rate: float) -> np.ndarray:
    """(n,) s, from the start to the end."""
    if not (math.isfinite(rate) and rate > 0.0):
        raise InvalidProblem(f"rate is {rate:g} Hz; it must be positive and finite")
    trajectory = plan.trajectory
    periods = trajectory.duration * rate
    if periods >= MOST_ROWS:
        raise InvalidProblem(
            f"rate is {rate:g} Hz, which makes {periods:.3g} rows of {trajectory.duration:g} s; "
            f"{MOST_ROWS} are the most"
        )
    count = max(1, math.ceil(periods - NEAR_END))
    return np.append(trajectory.start_time + np.arange(count) / rate, trajectory.end_time)
