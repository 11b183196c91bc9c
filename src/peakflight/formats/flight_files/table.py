"""Reading back the tables of numbers that flight files are."""

import numpy as np

from peakflight.errors import InvalidFile


def read_table(data: bytes, columns: int | None = None) -> tuple[list[str], np.ndarray]:
    """The names in the first line of a CSV and the (n, columns) numbers below it.

    Raises
    ------
    InvalidFile
        If a line does not have as many numbers as there are names; the message names it.
    """
    try:
        header, *lines = data.decode().splitlines()
    except (UnicodeDecodeError, ValueError):
        raise InvalidFile("the file is not a table of text") from None
    names = header.split(",")
    if columns is not None and len(names) != columns:
        raise InvalidFile(f"line 1 has {len(names)} columns; there must be {columns}")
    if not lines:
        raise InvalidFile("the file has no row of numbers")
    rows = _quickly(lines, len(names))
    if rows is None:
        rows = _line_by_line(lines, names)
    if not np.isfinite(rows).all():
        place = int(np.argwhere(~np.isfinite(rows))[0, 0]) + 2
        raise InvalidFile(f"line {place} has a number that is not finite")
    return names, rows


def _quickly(lines: list[str], columns: int) -> np.ndarray | None:
    """The numbers of a table without a fault; None if it has one."""
    try:
        rows = np.loadtxt(lines, delimiter=",", comments=None, ndmin=2)
    except ValueError:
        return None
    return rows if rows.shape == (len(lines), columns) else None


def _line_by_line(lines: list[str], names: list[str]) -> np.ndarray:
    """The same, slower, naming the first line that is wrong."""
    rows = np.empty((len(lines), len(names)))
    for index, line in enumerate(lines):
        fields = line.split(",")
        if len(fields) != len(names):
            raise InvalidFile(
                f"line {index + 2} has {len(fields)} fields; there must be {len(names)}"
            )
        try:
            rows[index] = [float(field) for field in fields]
        except ValueError:
            raise InvalidFile(f"line {index + 2} has a field that is not a number") from None
    return rows


def as_float32(values: np.ndarray) -> np.ndarray:
    """Numbers as a consumer in single precision has them."""
    return values.astype(np.float32).astype(float)
