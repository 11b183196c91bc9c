"""A course in nested lists and mappings, as JSON and YAML hold it.

A course is a list of points, or a mapping with the points under these keys, in this order:

==========  =====================================================================
first       `start`, `initial`, `start_position`, `initial_position`, `initState`
between     `waypoints` or `gates`; or `orders`, a list of the keys of the points
last        `end`, `goal`, `end_position`, `goal_position`, `endState`
==========  =====================================================================

Each part may be missing. A point is `[x, y, z]`, `[x, y, z, yaw]`, or a mapping with `x`, `y`,
`z`, or with such a list as `position` or `pos`; a mapping may have `yaw` too. Metres, radians,
z up. Beside the points there may be a `name`, and `yaw` and `times`: one number for each point.

These are the forms of rpg_time_optimal, pmm_uav_planner and TOGT-Planner, and our own. A course
begins and ends at rest: other motion at a point is refused, and so is a closed `ring`. Other keys
are ignored.
"""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

from peakflight.course import Course
from peakflight.errors import LONGEST_QUOTE, InvalidFile
from peakflight.files import PathLike

FIRST = ("start", "initial", "start_position", "initial_position", "initState")
BETWEEN = ("waypoints", "gates", "orders")
LAST = ("end", "goal", "end_position", "goal_position", "endState")
POSITION = ("position", "pos")
MOTION = ("velocity", "vel", "acceleration", "acc", "jerk", "jer")
"""Derivatives that a point of the known forms can fix."""
COMPONENTS = ("x", "y", "z", "yaw")
HUGE = 1024
"""Bits of a whole number that no float can hold, nor a message show."""

Place: TypeAlias = tuple[str | int, ...]
"""Keys and indices that lead from the root to a value."""


class Items(list[Any]):
    """A list that knows the line of each item in its file."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[int] = []


class Entries(dict[str, Any]):
    """A mapping that knows the line of each value in its file."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: dict[str, int] = {}


class Tree(NamedTuple):
    """Lists and mappings from a file; where they are `Items` and `Entries`, lines are known."""

    root: Any
    path: PathLike

    def line(self, place: Place) -> int | None:
        """Line of the value at `place`, from 1; None if it is not known."""
        line, value = None, self.root
        for step in place:
            lines = getattr(value, "lines", None)
            line = line if lines is None else lines[step]
            value = value[step]
        return line

    def error(self, place: Place, message: str) -> InvalidFile:
        """What is wrong at `place`, with the file, the line if known and the place itself."""
        line = self.line(place)
        name = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
        words = [str(self.path)]
        if line is not None:
            words.append(f"line {line}")
        return InvalidFile(": ".join([*words, f"{name.removeprefix('.')} {message}".lstrip()]))


def course_from(tree: Tree) -> Course:
    """The course that a tree holds.

    Raises
    ------
    InvalidFile
        If it holds none; the message names file, line or key, the value and the rule.
    InvalidProblem
        If the values are against a rule of `Course`.
    """
    root = tree.root
    if not isinstance(root, list | dict):
        raise tree.error((), f"holds {_shown(root)}; a course is a list or a mapping of points")
    places = list(_places(tree))
    if not places:
        raise tree.error((), "holds no waypoints; name them under the key waypoints")
    points = [_point(tree, place) for place in places]
    named = root if isinstance(root, dict) else {}
    name = named.get("name")
    if not isinstance(name, str | None):
        raise tree.error(("name",), f"is {_shown(name)}; it must be text")
    lines = tuple(line for place in places if (line := tree.line(place)) is not None)
    return Course(
        [point[:3] for point in points],  # type: ignore[arg-type]
        yaw=_yaw(tree, places, points),  # type: ignore[arg-type]
        times=_numbers(tree, ("times",), len(points)),  # type: ignore[arg-type]
        name=name or "",
        lines=lines or None,
    )


def _places(tree: Tree) -> Iterator[Place]:
    """Where the points are, in order of flight."""
    root = tree.root
    if isinstance(root, list):
        yield from ((index,) for index in range(len(root)))
        return
    if root.get("ring"):
        raise tree.error(
            ("ring",), "is true; closed laps are not planned, so end at the first gate"
        )
    if (first := _only(tree, (), FIRST)) is not None:
        yield (first,)
    between = _only(tree, (), BETWEEN)
    if between is not None:
        values = root[between]
        if not isinstance(values, list):
            raise tree.error((between,), f"is {_shown(values)}; it must be a list")
        for index, value in enumerate(values):
            if between != "orders":
                yield (between, index)
            elif isinstance(value, str) and value in root:
                yield (value,)
            else:
                raise tree.error(
                    (between, index), f"is {_shown(value)}; it must be a key of the file"
                )
    if (last := _only(tree, (), LAST)) is not None:
        yield (last,)


def _only(tree: Tree, place: Place, keys: Sequence[str]) -> str | None:
    """The one of `keys` that the mapping at `place` has."""
    mapping = _at(tree, place)
    found = [key for key in keys if mapping.get(key) is not None]
    if len(found) > 1:
        raise tree.error(
            (*place, found[1]), f"stands beside {found[0]}; only one of them can count"
        )
    return found[0] if found else None


def _point(tree: Tree, place: Place) -> list[float]:
    """The three or four numbers of a point."""
    value = _at(tree, place)
    if not isinstance(value, dict):
        return _position(tree, place)
    for key in MOTION:
        motion = value.get(key)
        if motion is not None and motion not in (0.0, [0.0, 0.0, 0.0]):
            raise tree.error(
                (*place, key), f"is {_shown(motion)}; it must be zero, as a course has no motion"
            )
    inner = _only(tree, place, POSITION)
    point = _position(tree, place if inner is None else (*place, inner))
    if value.get("yaw") is not None:
        if len(point) == 4:
            raise tree.error((*place, "yaw"), "is given twice; the position has a fourth number")
        point.append(_number(tree, place, "yaw", value["yaw"]))
    return point


def _position(tree: Tree, place: Place) -> list[float]:
    """The three or four numbers of a list, or the three of a mapping."""
    value = _at(tree, place)
    if isinstance(value, dict):
        missing = [name for name in "xyz" if name not in value]
        if missing:
            raise tree.error(place, f"has no {missing[0]}; it must have x, y and z, or position")
        return [_number(tree, place, name, value[name]) for name in "xyz"]
    if not isinstance(value, list):
        raise tree.error(place, f"is {_shown(value)}; it must be a point such as [x, y, z]")
    if len(value) not in (3, 4):
        raise tree.error(place, f"has {len(value)} numbers; it must have x, y, z or x, y, z, yaw")
    return [
        _number(tree, place, name, number) for name, number in zip(COMPONENTS, value, strict=False)
    ]


def _yaw(tree: Tree, places: list[Place], points: list[list[float]]) -> list[float] | None:
    """One yaw for each point, from a list beside them or from the points themselves."""
    having = [len(point) == 4 for point in points]
    yaw = _numbers(tree, ("yaw",), len(points))
    if any(having):
        if yaw is not None:
            raise tree.error(("yaw",), "is given twice; the points have it too")
        if not all(having):
            raise tree.error(
                places[having.index(False)], "has no yaw; give every point one, or none"
            )
        yaw = [point[3] for point in points]
    return yaw


def _numbers(tree: Tree, place: Place, count: int) -> list[float] | None:
    """The list of `count` numbers at a key of the root; None if there is none."""
    values = tree.root.get(*place) if isinstance(tree.root, dict) else None
    if values is None:
        return None
    if not isinstance(values, list):
        raise tree.error(place, f"is {_shown(values)}; it must be a list of {count} numbers")
    if len(values) != count:
        raise tree.error(place, f"has {len(values)} numbers; there are {count} waypoints")
    return [_number(tree, place, f"[{index}]", value) for index, value in enumerate(values)]


def _number(tree: Tree, place: Place, name: str, value: Any) -> float:
    if type(value) not in (int, float):
        raise tree.error(place, f"has {name} = {_shown(value)}; it must be a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise tree.error(place, f"has {name} = {_shown(value)}; it must be finite")
    return number


def _at(tree: Tree, place: Place) -> Any:
    value = tree.root
    for step in place:
        value = value[step]
    return value


def _shown(value: Any) -> str:
    """A value in one short line; of most lists and of mappings no more than their kind."""
    if isinstance(value, list):
        if len(value) > len(COMPONENTS) or any(isinstance(item, list | dict) for item in value):
            return "a list"
        return f"[{', '.join(_shown(item) for item in value)}]"
    if isinstance(value, dict):
        return "a mapping"
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if isinstance(value, int) and value.bit_length() > HUGE:
        return "a number of hundreds of digits"
    text = repr(value)
    return text if len(text) <= LONGEST_QUOTE else f"{text[:LONGEST_QUOTE]}..."
