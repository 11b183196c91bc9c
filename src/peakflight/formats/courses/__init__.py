"""The files that courses come in, one module a format, one registry.

A reader is a module with `recognises(text)` and `read(text, path)`. A new format is one file and
one line here.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from peakflight.course import Course
from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.files import PathLike, read_text
from peakflight.formats.courses import csv_course, json_course, yaml_course

LARGEST_FILE = 100_000_000
"""Bytes: over a million waypoints; what is larger is not a course."""


class Reader(NamedTuple):
    """How a format of course is told apart and read."""

    recognises: Callable[[str], bool]
    """Whether a text is in this format, by how it begins."""
    read: Callable[[str, PathLike], Course]
    """The course in a text; the path is for messages."""


COURSE_READERS = {
    "json": Reader(json_course.recognises, json_course.read),
    "yaml": Reader(yaml_course.recognises, yaml_course.read),
    "csv": Reader(csv_course.recognises, csv_course.read),
}
"""In the order in which they are asked; CSV recognises what is left."""

__all__ = ["COURSE_READERS", "LARGEST_FILE", "Reader", "read_course"]


def read_course(path: PathLike) -> Course:
    """Read a course; what is in the file, not its name, says which format it is in.

    A course that has no name in the file is called as the file is.

    Raises
    ------
    InvalidFile
        If it cannot be read or is not a course; the message names the file, the line or key, the
        value and the rule.
    MissingExtra
        If it is YAML and PyYAML is not installed.
    """
    path = Path(path)
    _refuse_large(path)
    text = read_text(path)
    if "\0" in text:
        raise InvalidFile(f"{path}: is not text (it holds a zero byte)")
    reader = next(reader for reader in COURSE_READERS.values() if reader.recognises(text))
    try:
        course = reader.read(text, path)
    except InvalidProblem as error:
        raise InvalidFile(f"{path}: {error}") from None
    return course if course.name else replace(course, name=path.stem)


def _refuse_large(path: Path) -> None:
    """Refuse a file too large to be a course before its text fills the memory."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError):
        return  # reading it says what is wrong
    if size > LARGEST_FILE and path.is_file():
        raise InvalidFile(
            f"{path}: has {size / 1e6:.0f} MB; a course has {LARGEST_FILE / 1e6:.0f} MB at most"
        )
