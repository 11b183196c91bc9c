"""Samples of a flight in CSV: our own, those of Agilicious and CPC, and plain `t,x,y,z[,yaw]`.

With a header, columns are found by name in any order; velocity, acceleration and jerk are used
where they are there and go with the positions, and the yaw is from its own column or from an
attitude. Without one, 4 columns are t, x, y, z and 5 are t, x, y, z, yaw.
"""

import math

import numpy as np

from peakflight.course import FARTHEST
from peakflight.errors import InvalidFile, InvalidProblem, quoted
from peakflight.files import PathLike
from peakflight.readers.fitting import through_angles, through_positions, through_states
from peakflight.readers.table import Table, read_table
from peakflight.readers.value import TrajectoryFile
from peakflight.trajectory import LATEST, LONGEST, SHORTEST

YAW_TOLERANCE = 1e-3
"""How near the yaw comes to samples of it, rad."""
STILL = 1e-9
"""A yaw that stays this near to zero is none, rad."""
AGREES = 0.05
"""Part of its range by which a derivative, integrated, may be off what it is the derivative of."""
LARGEST = 1e12
"""Of any derivative, SI units; beyond, squares run out of digits."""
HEADERLESS = {4: ("t", "x", "y", "z"), 5: ("t", "x", "y", "z", "yaw")}
_NAMES = {
    "t": ("t", "time", "timestamp"),
    "yaw": ("yaw", "heading"),
    **{f"q{part}": (f"q{part}", f"q_{part}") for part in "wxyz"},
    **{axis: (axis, f"p{axis}", f"p_{axis}", f"pos_{axis}") for axis in "xyz"},
    **{f"v{axis}": (f"v{axis}", f"v_{axis}", f"vel_{axis}") for axis in "xyz"},
    **{f"a{axis}": (f"a{axis}", f"a_{axis}", f"a_lin_{axis}", f"acc_{axis}") for axis in "xyz"},
    **{f"j{axis}": (f"j{axis}", f"j_{axis}", f"jerk_{axis}") for axis in "xyz"},
}
COLUMNS = {other: name for name, others in _NAMES.items() for other in others}
"""What a column may be called, lower case, to what it holds."""
DERIVATIVES = ("", "v", "a", "j")
WORDS = ("position", "velocity", "acceleration", "jerk")
_LENGTHS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
_PLAIN = {"": 1.0, "1": 1.0}
_UNITS = {
    "t": {"": 1.0, "s": 1.0, "ms": 1e-3},
    "yaw": {"": 1.0, "rad": 1.0, "deg": math.pi / 180.0},
    **{f"q{part}": _PLAIN for part in "wxyz"},
    **dict.fromkeys("xyz", _LENGTHS),
    **{f"v{axis}": {"": 1.0, "m/s": 1.0} for axis in "xyz"},
    **{f"a{axis}": {"": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "m/s2": 1.0} for axis in "xyz"},
    **{f"j{axis}": {"": 1.0, "m/s^3": 1.0, "m/s³": 1.0, "m/s3": 1.0} for axis in "xyz"},
}
"""What one of a unit is in SI; the empty unit is what counts when none is named."""


def recognises(_text: str) -> bool:
    """Whether it may be a table of samples, which any text may be: what nothing else recognises."""
    return True


def read(text: str, path: PathLike, tolerance: float) -> TrajectoryFile:
    """The motion that samples are of, fitted to the tolerance, m.

    Raises
    ------
    InvalidFile
        If a line or the header is wrong; the message names it, the value and the rule.
    """
    table = read_table(text, path)
    columns = _named(table) if table.titles else _counted(table)
    times = columns["t"]
    _check_times(table, times)
    states = _states(table, columns)
    used, notes = _usable(times, states, tolerance)
    try:
        if used >= 3:
            trajectory = through_states(times, states[:used], tolerance)
        else:
            trajectory = through_positions(times, states[0], tolerance)
        angles = _angles(columns)
        yaw = None if angles is None else through_angles(times, angles, YAW_TOLERANCE)
    except InvalidProblem:
        raise
    except ValueError as error:
        raise InvalidFile(f"{path}: no polynomials fit its samples ({error})") from None
    inside = np.clip(times, trajectory.start_time, trajectory.end_time)
    errors = tuple(
        float(np.linalg.norm(trajectory(inside, order) - states[order], axis=1).max())
        for order in range(max(1, min(used, 3)))
    )
    return TrajectoryFile(
        trajectory=trajectory,
        yaw=yaw,
        form="samples",
        fit_errors=errors,
        samples=len(times),
        notes=notes,
    )


def _named(table: Table) -> dict[str, np.ndarray]:
    """Columns by what they hold, in SI, by the header."""
    columns: dict[str, np.ndarray] = {}
    for place, (title, unit) in enumerate(table.titles):
        name = COLUMNS.get(title)
        if name is None:
            continue
        if name in columns:
            raise InvalidFile(f"{table.path}: the header names column {name} twice")
        if unit not in _UNITS[name]:
            known = ", ".join(filter(None, _UNITS[name]))
            raise InvalidFile(
                f"{table.path}: column {title} has the unit {quoted(unit)}; known are {known}"
            )
        columns[name] = table.values[:, place] * _UNITS[name][unit]
    missing = [name for name in ("t", "x", "y", "z") if name not in columns]
    if missing:
        raise InvalidFile(
            f"{table.path}: the header names no column {missing[0]}; a trajectory has t, x, y and "
            "z, or duration, x^0, x^1, ..."
        )
    return columns


def _counted(table: Table) -> dict[str, np.ndarray]:
    width = table.values.shape[1]
    if width not in HEADERLESS:
        raise InvalidFile(
            f"{table.path}: has {width} columns and no header; samples have 4 (t,x,y,z) or 5 "
            "(t,x,y,z,yaw), polynomial pieces 33, or 25 without yaw"
        )
    return dict(zip(HEADERLESS[width], table.values.T, strict=True))


def _check_times(table: Table, times: np.ndarray) -> None:
    if len(times) < 2:
        raise InvalidFile(f"{table.path}: has one sample; a trajectory needs at least two")
    if not (np.abs(times[[0, -1]]) <= LATEST).all():
        raise table.error(0, f"times go from {times[0]:g} s; they must be within {LATEST:g} s")
    late = ~(np.diff(times) >= SHORTEST)
    if late.any():
        row = int(late.argmax()) + 1
        raise table.error(
            row, f"t is {times[row]:.9g} s after {times[row - 1]:.9g} s; times must increase"
        )
    if not times[-1] - times[0] <= LONGEST:
        raise table.error(0, f"samples last more than {LONGEST:g} s")


def _states(table: Table, columns: dict[str, np.ndarray]) -> np.ndarray:
    """(m, n, 3) position and as many derivatives as the file has without a gap."""
    states = []
    for prefix, largest in zip(DERIVATIVES, (FARTHEST, *[LARGEST] * 3), strict=True):
        names = [prefix + axis for axis in "xyz"]
        if not all(name in columns for name in names):
            break
        values = np.column_stack([columns[name] for name in names])
        far = ~(np.abs(values) <= largest)
        if far.any():
            row, axis = (int(place) for place in np.argwhere(far)[0])
            raise table.error(
                row,
                f"{names[axis]} is {values[row, axis]:g}; it must be within {largest:g} of zero",
            )
        states.append(values)
    return np.stack(states)


def _usable(times: np.ndarray, states: np.ndarray, tolerance: float) -> tuple[int, tuple[str, ...]]:
    """How many of position and derivatives go with each other; and notes on those that do not.

    Each is integrated by the trapezoid rule, corrected by the next where there is one.
    """
    steps = np.diff(times)[:, None]
    for order in range(len(states) - 1):
        value, rate = states[order], states[order + 1]
        grown = 0.5 * (rate[1:] + rate[:-1]) * steps
        if order + 2 < len(states):
            grown -= np.diff(states[order + 2], axis=0) * steps**2 / 12.0
        drift = np.abs(value[0] + np.cumsum(grown, axis=0) - value[1:]).max()
        extent = np.abs(value - value[0]).max()
        if not drift <= AGREES * extent + tolerance / AGREES**order:
            note = f"its {WORDS[order + 1]} does not go with its {WORDS[order]}, and is not used"
            return order + 1, (note,)
    return len(states), ()


def _angles(columns: dict[str, np.ndarray]) -> np.ndarray | None:
    """(n,) rad, unwrapped; None if there is none, or it is zero throughout."""
    if "yaw" in columns:
        angles = columns["yaw"]
    elif "qw" in columns and "qz" in columns:
        # the turn before the shortest tilt from upright
        angles = 2.0 * np.arctan2(columns["qz"], columns["qw"])
    else:
        return None
    if not (np.abs(angles) <= FARTHEST).all():
        raise InvalidProblem(f"a yaw is not within {FARTHEST:g} rad of zero")
    angles = np.unwrap(angles)
    return None if np.abs(angles).max() <= STILL else angles
