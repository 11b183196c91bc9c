"""A simulated flight as CSV, one row a sample."""

from typing import TYPE_CHECKING

import numpy as np

from peakflight.files import PathLike, write_atomically
from peakflight.problem import AXES

if TYPE_CHECKING:
    from peakflight.flight import Flight

GROUPS = (
    ("times", ("t [s]",)),
    ("position", tuple(f"{axis} [m]" for axis in AXES)),
    ("velocity", tuple(f"v{axis} [m/s]" for axis in AXES)),
    ("attitude", tuple(f"q{part} [1]" for part in "wxyz")),
    ("body_rates", tuple(f"w{axis} [rad/s]" for axis in AXES)),
    ("rotor_thrusts", tuple(f"f{rotor} [N]" for rotor in (1, 2, 3, 4))),
    ("planned_position", tuple(f"planned_{axis} [m]" for axis in AXES)),
    ("planned_velocity", tuple(f"planned_v{axis} [m/s]" for axis in AXES)),
    ("errors", ("error [m]",)),
)
"""Field of a flight to its columns."""


def write_flight_samples(flight: "Flight", path: PathLike) -> None:
    """Write time, state, rotor thrusts, what was planned and the error, with 9 digits.

    Raises
    ------
    InvalidFile
        If the file cannot be written.
    """
    table = np.column_stack([getattr(flight, name) for name, _ in GROUPS]) + 0.0  # no negative zero
    names = [column for _, columns in GROUPS for column in columns]
    row = "%.9g" + ",%.9g" * (table.shape[1] - 1)
    lines = [",".join(names), *(row % tuple(values) for values in table.tolist())]
    write_atomically(path, "\n".join(lines) + "\n")
