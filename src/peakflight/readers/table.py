"""Tables of numbers in CSV, as people have them: with or without a header, however separated."""

import math
import re
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidFile, quoted
from peakflight.files import PathLike
from peakflight.numerals import as_number, is_number

SEPARATORS = (";", ",", "\t")
"""The first of them that is in the first line counts; else columns are separated by spaces."""
_TITLE = re.compile(r"([^\[\]()]*?)\s*(?:[\[(]([^\[\]()]*)[\])])?")
"""The name of a column, and its unit."""
_SPACED_UNIT = re.compile(r"\s+([\[(][^\[\]()]*[\])])")


class Table(NamedTuple):
    """Rows of numbers."""

    titles: tuple[tuple[str, str], ...]
    """Name and unit of each column, lower case; empty without a header."""
    values: np.ndarray
    """(n, columns)."""
    lines: tuple[int, ...]
    """(n,) line of each row in its file, from 1."""
    path: PathLike

    def error(self, row: int, message: str) -> InvalidFile:
        """What is wrong in a row."""
        return InvalidFile(f"{self.path}: line {self.lines[row]}: {message}")


def read_table(text: str, path: PathLike) -> Table:
    """The numbers of a CSV file, all finite.

    Empty lines, and what follows a `#`, are skipped; a header in a comment right above the numbers
    counts as one.

    Raises
    ------
    InvalidFile
        If rows differ in length, or a field is not a finite number.
    """
    rows, remark = [], ""
    for number, line in enumerate(text.replace('"', "").split("\n"), start=1):
        content, mark, comment = line.partition("#")
        if content.strip():
            rows.append((number, content.strip()))
        elif mark and not rows:
            remark = comment.strip()
    if not rows:
        raise InvalidFile(f"{path}: holds no numbers, only comments")
    first = rows[0][1]
    separator = next((mark for mark in SEPARATORS if mark in first), None)
    titles: tuple[tuple[str, str], ...] = ()
    if not any(map(is_number, fields := _fields(first, separator))):
        titles = _titles(first, separator)
        rows = rows[1:]
    elif remark and len(above := _titles(remark, separator)) == len(fields):
        titles = above
    if not rows:
        raise InvalidFile(f"{path}: holds no numbers, only a header")
    width = len(titles) or len(fields)
    values = np.empty((len(rows), width))
    for index, (line_number, content) in enumerate(rows):
        fields = _fields(content, separator)
        if len(fields) != width:
            raise InvalidFile(
                f"{path}: line {line_number} has {len(fields)} columns; the first line has {width}"
            )
        for column, field in enumerate(fields):
            values[index, column] = _number(field, titles, column, line_number, path)
    return Table(titles, values, tuple(number for number, _ in rows), path)


def opening(text: str) -> tuple[str, str]:
    """The first line with numbers or names, and all comments above it in one."""
    comments: list[str] = []
    for line in text.split("\n"):
        content, _, comment = line.partition("#")
        if content.strip():
            return content.strip(), " ".join(comments)
        comments.append(comment.strip())
    return "", " ".join(comments)


def _titles(text: str, separator: str | None) -> tuple[tuple[str, str], ...]:
    found = []
    for field in _fields(_SPACED_UNIT.sub(r"\1", text), separator):
        match = _TITLE.fullmatch(field.lower())
        found.append((field.lower(), "") if match is None else (match[1], (match[2] or "").strip()))
    return tuple(found)


def _fields(text: str, separator: str | None) -> list[str]:
    """The columns of a row, without spaces around them and empty ones at its end."""
    fields = [field.strip() for field in text.split(separator)]
    while len(fields) > 1 and not fields[-1]:
        fields.pop()
    return fields


def _number(
    field: str, titles: tuple[tuple[str, str], ...], column: int, line: int, path: PathLike
) -> float:
    try:
        number = as_number(field)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        name = titles[column][0] if titles else f"column {column + 1}"
        raise InvalidFile(
            f"{path}: line {line}: {name} is {quoted(field)}; it must be a finite number"
        )
    return number
