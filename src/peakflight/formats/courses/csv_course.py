"""Courses in CSV: `x,y,z[,yaw]` or `t,x,y,z[,yaw]`, with or without a header.

Columns are separated by semicolons, commas, tabs or spaces. Empty lines, and what follows a `#`,
are skipped.

With a header, columns are found by name in any order, upper or lower case, and others are
ignored. A unit may follow in brackets, as in `x [cm]` or `yaw (deg)`; without one it is m, rad
and s. A header may also stand in a comment right above the numbers, as `numpy.savetxt` writes it.

Without one, 3 columns are x, y, z; 4 are x, y, z, yaw; 5 are t, x, y, z, yaw. Four of which the
first rises steadily from 0 may as well be t, x, y, z: such a file is refused, since a guess would
send a vehicle elsewhere.
"""

import math
import re
from typing import NamedTuple

from peakflight.course import Course
from peakflight.errors import InvalidFile, quoted
from peakflight.files import PathLike
from peakflight.numerals import as_number, is_number

SEPARATORS = (";", ",", "\t")
"""The first of them that is in the first line counts; else columns are separated by spaces."""
HEADERLESS = {3: "x,y,z", 4: "x,y,z,yaw", 5: "t,x,y,z,yaw"}
"""Columns by how many there are."""
OTHER_NAMES = {"p_x": "x", "p_y": "y", "p_z": "z", "time": "t"}
"""Of columns, lower case."""
LENGTHS = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
UNITS = {
    "x": LENGTHS,
    "y": LENGTHS,
    "z": LENGTHS,
    "yaw": {"": 1.0, "rad": 1.0, "deg": math.pi / 180.0},
    "t": {"": 1.0, "s": 1.0, "ms": 1e-3},
}
"""What one of a unit is in m, rad or s; the empty unit is what counts when none is named."""

_TITLE = re.compile(r"([^\[\]()]*?)\s*(?:[\[(]([^\[\]()]*)[\])])?")
"""The name of a column, and its unit."""
_SPACED_UNIT = re.compile(r" ?([\[(]) ?([^\[\]() ]*) ?([\])])")
"""A unit with the spaces around it, which belong to no column."""


class _Column(NamedTuple):
    name: str
    """x, y, z, yaw or t."""
    place: int
    """In a row, from 0."""
    unit: float
    """What a number in it is multiplied with."""


class _Row(NamedTuple):
    line: int
    """In the file, from 1."""
    text: str


def recognises(_text: str) -> bool:
    """Whether it may be CSV, which any text may be: what no other format recognises."""
    return True


def read(text: str, path: PathLike) -> Course:
    """The course in CSV `text`.

    Raises
    ------
    InvalidFile
        If a line is wrong; the message names file and line, the text and the rule.
    InvalidProblem
        If the values are against a rule of `Course`.
    """
    if '"' in text:
        text = text.replace('"', "")
    rows, remark = _rows(text)
    if not rows:
        raise InvalidFile(f"{path}: holds no waypoints, only comments")
    separator = next((mark for mark in SEPARATORS if mark in rows[0].text), None)
    titles = _titles(rows[0].text, separator)
    if not any(is_number(title) for title in titles):
        columns, width = _named_columns(titles, rows[0].line, path), len(titles)
        rows = rows[1:]
        if not rows:
            raise InvalidFile(f"{path}: holds no waypoints, only a header")
    elif remark is not None and _is_header(titles_above := _titles(remark.text, separator), titles):
        columns, width = _named_columns(titles_above, remark.line, path), len(titles)
    else:
        columns, width = _counted_columns(len(titles), rows[0].line, path), len(titles)
        _refuse_ambiguous(rows, width, separator, path)
    values = [_numbers(row, columns, width, separator, path) for row in rows]
    by_name = dict(zip((column.name for column in columns), zip(*values, strict=True), strict=True))
    return Course(
        list(zip(by_name["x"], by_name["y"], by_name["z"], strict=True)),  # type: ignore[arg-type]
        yaw=by_name.get("yaw"),  # type: ignore[arg-type]
        times=by_name.get("t"),  # type: ignore[arg-type]
        lines=tuple(row.line for row in rows),
    )


def _rows(text: str) -> tuple[list[_Row], _Row | None]:
    """Lines that hold something, without comments; and the comment right above the first."""
    rows, remark = [], None
    for number, line in enumerate(text.split("\n"), start=1):
        content, mark, comment = line.partition("#")
        content = content.strip()
        if content:
            rows.append(_Row(number, content))
        elif mark and not rows:
            remark = _Row(number, comment.strip())
    return rows, remark


def _titles(text: str, separator: str | None) -> list[str]:
    """Fields of a header, or of what may be one; a unit stays with its name."""
    if separator is None:
        text = _SPACED_UNIT.sub(r"\1\2\3", " ".join(text.split()))
    return [" ".join(field.split()) for field in _fields(text, separator)]


def _fields(text: str, separator: str | None) -> list[str]:
    """The columns of a row, without empty ones at its end."""
    fields = text.split(separator)
    while len(fields) > 1 and not fields[-1].strip():
        fields.pop()
    return fields


def _is_header(titles: list[str], fields: list[str]) -> bool:
    """Whether a comment names each of the columns below, and nothing else."""
    return len(titles) == len(fields) and all(_split_title(title)[0] in UNITS for title in titles)


def _split_title(title: str) -> tuple[str, str]:
    """Name and unit of a column, lower case."""
    match = _TITLE.fullmatch(title.lower())
    if match is None:
        return title, ""
    return OTHER_NAMES.get(match[1], match[1]), (match[2] or "").strip()


def _named_columns(titles: list[str], line: int, path: PathLike) -> list[_Column]:
    """The columns that a header names."""
    columns: dict[str, _Column] = {}
    for index, title in enumerate(titles):
        name, unit = _split_title(title)
        if name not in UNITS:
            continue
        if name in columns:
            raise InvalidFile(f"{path}: line {line}: the header names column {name} twice")
        if unit not in UNITS[name]:
            known = ", ".join(filter(None, UNITS[name]))
            raise InvalidFile(
                f"{path}: line {line}: column {name} has the unit {quoted(unit)}; known are {known}"
            )
        columns[name] = _Column(name, index, UNITS[name][unit])
    missing = [name for name in "xyz" if name not in columns]
    if missing:
        raise InvalidFile(
            f"{path}: line {line}: the header {quoted(','.join(titles))} names no column "
            f"{missing[0]}; x, y and z are needed"
        )
    return list(columns.values())


def _counted_columns(count: int, line: int, path: PathLike) -> list[_Column]:
    """The columns of a file without a header."""
    if count not in HEADERLESS:
        raise InvalidFile(
            f"{path}: line {line} has {_columns(count)}; without a header there must be 3 (x,y,z), "
            "4 (x,y,z,yaw) or 5 (t,x,y,z,yaw)"
        )
    return [_Column(name, index, 1.0) for index, name in enumerate(HEADERLESS[count].split(","))]


def _refuse_ambiguous(rows: list[_Row], width: int, separator: str | None, path: PathLike) -> None:
    """Refuse four columns without a header that may be x, y, z, yaw or t, x, y, z."""
    if width != 4 or len(rows) < 2:
        return
    previous = -math.inf
    for row in rows:
        first = _fields(row.text, separator)[0]
        if not is_number(first) or (value := as_number(first)) <= previous:
            return
        if previous == -math.inf and value != 0.0:
            return
        previous = value
    raise InvalidFile(
        f"{path}: line {rows[0].line}: 4 columns, the first rising from 0, may be x,y,z,yaw or "
        "t,x,y,z; say which in a header line"
    )


def _numbers(
    row: _Row, columns: list[_Column], width: int, separator: str | None, path: PathLike
) -> list[float]:
    """The numbers of a row in m, rad and s, column by column."""
    fields = _fields(row.text, separator)
    if len(fields) != width:
        raise InvalidFile(
            f"{path}: line {row.line} has {_columns(len(fields))}, and the first line {width}"
        )
    try:
        return [as_number(fields[column.place]) * column.unit for column in columns]
    except ValueError:
        pass
    wrong = next(column for column in columns if not is_number(fields[column.place]))
    field = fields[wrong.place].strip()
    hint = " with a decimal point" if is_number(field.replace(",", ".")) else ""
    raise InvalidFile(
        f"{path}: line {row.line}: {wrong.name} is {quoted(field)}; it must be a number{hint}"
    )


def _columns(count: int) -> str:
    return "1 column" if count == 1 else f"{count} columns"
