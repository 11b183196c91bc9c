"""Courses in JSON: a list of points, a mapping with `waypoints`, or a plan file of ours."""

import re

from peakflight.course import Course
from peakflight.files import PathLike, parse_json
from peakflight.formats.tree import Tree, course_from

_BEGINNING = re.compile(r"""\s*(?:\[|\{\s*["}])""")


def recognises(text: str) -> bool:
    """Whether the text begins as JSON lists and objects do."""
    return _BEGINNING.match(text) is not None


def read(text: str, path: PathLike) -> Course:
    """The course in JSON `text`; the forms are those of `peakflight.formats.tree`.

    Of a plan file the waypoints count, and the yaw of its problem.

    Raises
    ------
    InvalidFile
        If it is not JSON or holds no course; the message names the line, or the key and the rule.
    InvalidProblem
        If the values are against a rule of `Course`.
    """
    root = parse_json(text, path)
    if isinstance(root, dict) and "coefficients" in root:
        problem = root.get("problem")
        yaw = problem.get("yaw") if isinstance(problem, dict) else None
        root = {
            "waypoints": root.get("waypoints"),
            "yaw": yaw.get("angles") if isinstance(yaw, dict) else yaw,
        }
    return course_from(Tree(root, path))
