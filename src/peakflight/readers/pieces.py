"""Polynomials in CSV, one piece a row, as Crazyswarm has them: `duration,x^0,...,x^7,y^0,...`.

A duration, s, then ascending coefficients in piece-local time for x, y, z, m, and perhaps yaw, rad.
With a header, columns are found by name in any order, and there may be any number of powers.
Without one there are 33 columns, or 25 without a yaw.
"""

import re

import numpy as np

from peakflight.errors import InvalidFile
from peakflight.files import PathLike
from peakflight.readers.table import SEPARATORS, Table, opening, read_table
from peakflight.readers.value import TrajectoryFile
from peakflight.trajectory import LONGEST, SHORTEST, Trajectory

POWERS = 8
"""Coefficients of each axis in a file without a header."""
WIDTHS = (1 + 3 * POWERS, 1 + 4 * POWERS)
AXES = ("x", "y", "z", "yaw")
DURATIONS = ("duration", "t", "time", "dt")
"""What the first column is called."""
MOST_POWERS = 12
"""Degree 11 is the highest that is planned, and certified."""
_TITLE = re.compile(r"(?:p_?)?(x|y|z|yaw)\s*\^\s*(\d{1,3})")


def recognises(text: str) -> bool:
    """Whether the first line names powers, or has as many columns as pieces without a header."""
    line, remarks = opening(text)
    if "^" in line or "^" in remarks:
        return _TITLE.search(f"{remarks} {line}".lower()) is not None
    separator = next((mark for mark in SEPARATORS if mark in line), None)
    fields = [field for field in line.split(separator) if field.strip()]
    return len(fields) in WIDTHS and fields[0].strip()[:1] in "0123456789.+-"


def read(text: str, path: PathLike, tolerance: float) -> TrajectoryFile:
    """The motion in a file of pieces; the tolerance is for samples.

    Raises
    ------
    InvalidFile
        If a line or the header is wrong; the message names it, the value and the rule.
    """
    del tolerance
    table = read_table(text, path)
    places = _named(table) if table.titles else _counted(table)
    durations = table.values[:, places.pop(("duration", 0))]
    bad = ~((durations >= SHORTEST) & (durations <= LONGEST))
    if bad.any():
        row = int(bad.argmax())
        raise table.error(
            row, f"duration is {durations[row]:g}; it must be from {SHORTEST:g} to {LONGEST:g} s"
        )
    powers = 1 + max(power for _, power in places)
    coefficients = np.zeros((len(durations), powers, len(AXES)))
    for (axis, power), column in places.items():
        coefficients[:, power, AXES.index(axis)] = table.values[:, column]
    turning = coefficients[:, :, 3:]
    return TrajectoryFile(
        trajectory=Trajectory(coefficients[:, :, :3], durations),
        yaw=Trajectory(turning, durations) if turning.any() else None,
        form="polynomial pieces, as Crazyswarm has them",
    )


def _named(table: Table) -> dict[tuple[str, int], int]:
    """Column of the duration and of each axis and power, by the header."""
    places: dict[tuple[str, int], int] = {}
    for column, (name, _) in enumerate(table.titles):
        match = _TITLE.fullmatch(name)
        if match is None and name not in DURATIONS:
            continue
        key = ("duration", 0) if match is None else (match[1], int(match[2]))
        if key in places:
            raise InvalidFile(f"{table.path}: the header names column {name} twice")
        if key[1] >= MOST_POWERS:
            raise InvalidFile(
                f"{table.path}: the header names {name}; degree {MOST_POWERS - 1} is the highest"
            )
        places[key] = column
    for key in (("duration", 0), ("x", 0), ("y", 0), ("z", 0)):
        if key not in places:
            name = key[0] if key[0] == "duration" else f"{key[0]}^0"
            raise InvalidFile(f"{table.path}: the header names no column {name}")
    return places


def _counted(table: Table) -> dict[tuple[str, int], int]:
    """As `_named`, by the number of columns."""
    width = table.values.shape[1]
    if width not in WIDTHS:
        raise InvalidFile(
            f"{table.path}: has {width} columns and no header; pieces have {WIDTHS[1]}, or "
            f"{WIDTHS[0]} without yaw"
        )
    axes = AXES[: (width - 1) // POWERS]
    places = {
        (axis, power): 1 + POWERS * index + power
        for index, axis in enumerate(axes)
        for power in range(POWERS)
    }
    return {("duration", 0): 0, **places}
