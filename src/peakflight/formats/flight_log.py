"""Records of a flight as CSV: time and position, one row a sample, as motion capture writes them.

Columns are separated by semicolons, commas, tabs or spaces; empty lines, and what follows a `#`,
are skipped. With a header, columns are found by name, upper or lower case, and others are ignored;
a unit may follow in brackets, as in `x [mm]` or `t (ms)`. Without one there must be 4 columns:
t, x, y, z in s and m. A position that is empty or `nan` is a sample that the cameras have missed.
"""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidFile, quoted
from peakflight.files import PathLike, read_text
from peakflight.numerals import is_finite_number

SEPARATORS = (";", ",", "\t")
"""The first of them that is in the first line counts; else columns are separated by spaces."""
COLUMNS = "txyz"
NAMES = {
    "t": ("t", "time", "timestamp", "times"),
    "x": ("x", "px", "p_x", "pos_x", "position_x", "tx", "stateestimate.x"),
    "y": ("y", "py", "p_y", "pos_y", "position_y", "ty", "stateestimate.y"),
    "z": ("z", "pz", "p_z", "pos_z", "position_z", "tz", "stateestimate.z"),
}
"""What a column may be called, lower case."""
LENGTHS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
TIMES = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
UNITS = {"t": TIMES, "x": LENGTHS, "y": LENGTHS, "z": LENGTHS}
"""What one of a unit is in s or m; the empty unit is what counts when none is named."""
MISSED = ("", "nan", "-nan", "null", "none", "n/a")
"""How a position may be written that is not known, lower case."""
SLOWEST = 1.0
"""s: samples that are further apart than this, typically, are in another unit of time."""
MOST_NAMED = 5
"""Lines that a note names."""

_TITLE = re.compile(r"\s*\"?([^\[\]()\"]*?)\"?\s*(?:[\[(]\s*([^\[\]()]*?)\s*[\])])?\s*\"?\s*")
"""The name of a column, and its unit."""


class FlightLog(NamedTuple):
    """A record of a flight."""

    times: np.ndarray
    """(n,) s, rising."""
    positions: np.ndarray
    """(n, 3) m; NaN where the cameras have missed the vehicle."""
    notes: tuple[str, ...]
    """What a reader should know, a line each."""


def read_flight_log(path: PathLike) -> FlightLog:
    """Read a record of a flight.

    Raises
    ------
    InvalidFile
        If it cannot be read or is no such record; the message names file and line, the text and
        the rule.
    """
    path = Path(path)
    rows = _rows(read_text(path))
    if not rows:
        raise InvalidFile(f"{path}: holds no samples, only comments")
    line, text = rows[0]
    separator = next((mark for mark in SEPARATORS if mark in text), None)
    fields = text.split(separator)
    if any(is_finite_number(field) for field in fields):
        if len(fields) != len(COLUMNS):
            raise InvalidFile(
                f"{path}: line {line} has {_columns(len(fields))}; without a header there must "
                "be 4 (t,x,y,z)"
            )
        places, scales = list(range(4)), [1.0] * 4
    else:
        places, scales = _header(_joined(text, separator), line, path)
        fields = _joined(text, separator)
        rows = rows[1:]
    if len(rows) < 2:
        raise InvalidFile(
            f"{path}: holds {len(rows)} sample{'s' * (len(rows) != 1)}; a flight needs at least two"
        )
    table, missed = _table(rows, separator, len(fields), places, path)
    table *= scales
    _check_times(table[:, 0], [number for number, _ in rows], path)
    notes: tuple[str, ...] = ()
    if missed:
        if len(missed) == len(rows):
            raise InvalidFile(f"{path}: no sample has a position")
        named = ", ".join(map(str, missed[:MOST_NAMED]))
        more = ", ..." if len(missed) > MOST_NAMED else ""
        plural = "s" * (len(missed) != 1)
        notes = (f"{len(missed)} sample{plural} without a position (line{plural} {named}{more})",)
    return FlightLog(table[:, 0], table[:, 1:], notes)


def _rows(text: str) -> list[tuple[int, str]]:
    """Lines that hold something, without comments, with their numbers from 1."""
    lines = (line.partition("#")[0].strip() for line in text.split("\n"))
    return [(number, line) for number, line in enumerate(lines, start=1) if line]


def _joined(text: str, separator: str | None) -> list[str]:
    """Titles of a header; between spaces, a unit stays with its name."""
    if separator is None:
        text = re.sub(r"\s+([\[(])", r"\1", text)
    return text.split(separator)


def _header(titles: list[str], line: int, path: Path) -> tuple[list[int], list[float]]:
    """Where t, x, y and z are, and what one of their units is in s or m."""
    places, scales = [], []
    split = [_split_title(title) for title in titles]
    for column in COLUMNS:
        found = [place for place, (name, _) in enumerate(split) if name in NAMES[column]]
        if not found:
            raise InvalidFile(
                f"{path}: line {line}: the header {quoted(','.join(titles))} names no column "
                f"{column}; t, x, y and z are needed"
            )
        if len(found) > 1:
            raise InvalidFile(f"{path}: line {line}: the header names column {column} twice")
        unit = split[found[0]][1]
        if unit not in UNITS[column]:
            known = ", ".join(filter(None, UNITS[column]))
            raise InvalidFile(
                f"{path}: line {line}: column {column} has the unit {quoted(unit)}; known are "
                f"{known}"
            )
        places.append(found[0])
        scales.append(UNITS[column][unit])
    return places, scales


def _split_title(title: str) -> tuple[str, str]:
    match = _TITLE.fullmatch(title.lower())
    return (title, "") if match is None else (match[1], match[2] or "")


def _table(
    rows: list[tuple[int, str]], separator: str | None, width: int, places: list[int], path: Path
) -> tuple[np.ndarray, list[int]]:
    """(n, 4) numbers as they are written, and the lines without a position."""
    table = np.empty((len(rows), len(COLUMNS)))
    missed: list[int] = []
    for row, (line, text) in enumerate(rows):
        fields = text.split(separator)
        if len(fields) != width:
            raise InvalidFile(
                f"{path}: line {line} has {_columns(len(fields))}, and the first line {width}"
            )
        for column, place in enumerate(places):
            field = fields[place].strip().strip('"')
            if column and field.lower() in MISSED:
                table[row, column] = math.nan
                if not missed or missed[-1] != line:
                    missed.append(line)
                continue
            if not is_finite_number(field):
                hint = " with a decimal point" if is_finite_number(field.replace(",", ".")) else ""
                raise InvalidFile(
                    f"{path}: line {line}: {COLUMNS[column]} is {quoted(field)}; it must be a "
                    f"finite number{hint}"
                )
            table[row, column] = float(field)
    return table, missed


def _columns(count: int) -> str:
    return "1 column" if count == 1 else f"{count} columns"


def _check_times(times: np.ndarray, lines: list[int], path: Path) -> None:
    """Refuse times that do not rise, or are in a unit that the header does not name."""
    steps = np.diff(times)
    if (steps <= 0.0).any():
        row = int((steps <= 0.0).argmax()) + 1
        raise InvalidFile(
            f"{path}: line {lines[row]}: t is {times[row]:.9g} s, after {times[row - 1]:.9g} s; "
            "times must rise"
        )
    typical = float(np.median(steps))
    if typical > SLOWEST:
        raise InvalidFile(
            f"{path}: samples are {typical:g} s apart; if the times are in ms, say so in the "
            "header: t [ms],x,y,z"
        )
