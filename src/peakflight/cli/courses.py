"""Courses as commands take them: read, tidied, and named."""

from pathlib import Path

from peakflight.course import Course, tidy
from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.formats import read_course

UNUSED_TIMES = "the times in the course are not used: the planner finds its own"


def read_tidied(path: Path, *, strict: bool) -> tuple[Course, tuple[str, ...]]:
    """A course from a file, without waypoints that are nearly alike; and notes on them.

    Raises
    ------
    InvalidFile
        If it cannot be read, is no course or, with `strict`, has such waypoints.
    """
    course = read_course(path)
    try:
        return tidy(course, strict=strict)
    except InvalidProblem as error:
        raise InvalidFile(f"{path}: {error}") from None
