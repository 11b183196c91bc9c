"""A course: the waypoints of a file, before limits make a problem of them; and tidying it."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.problem import AXES, as_float_array

MERGE_DISTANCE = 1e-3
"""Waypoints closer than this are merged, m: shorter legs end feasible, but far from optimal."""
FARTHEST = 1e7
"""Largest coordinate, m: no map grid goes further, and doubles still resolve 2 nm there."""


@dataclass(frozen=True, eq=False)
class Course:
    """Waypoints to pass in order, and what its file says beside them.

    Unlike in a `Problem`, waypoints may be near each other or alike: `tidy` merges them.

    Raises
    ------
    InvalidProblem
        If a value is not finite, of the wrong shape or against the rule beside its field; the
        message names index, line, value and rule.
    """

    waypoints: np.ndarray
    """(n, 3) m, z up; two at least, each coordinate within 1e7 m of zero."""
    yaw: np.ndarray | None = field(default=None, kw_only=True)
    """(n,) rad, heading at each waypoint."""
    times: np.ndarray | None = field(default=None, kw_only=True)
    """(n,) s, when each waypoint is passed; increasing."""
    name: str = field(default="", kw_only=True)
    lines: tuple[int, ...] | None = field(default=None, kw_only=True)
    """(n,) line of each waypoint in its file, from 1; for messages."""

    def __post_init__(self) -> None:
        waypoints = as_float_array("waypoints", self.waypoints, (None, 3))
        count = len(waypoints)
        object.__setattr__(self, "waypoints", waypoints)
        if count < 2:
            raise InvalidProblem(
                f"{count} waypoint{'' if count == 1 else 's'} given; "
                "a trajectory needs at least two"
            )
        if self.lines is not None:
            object.__setattr__(self, "lines", tuple(int(line) for line in self.lines))
            if len(self.lines) != count:
                raise InvalidProblem(f"{len(self.lines)} lines are given for {count} waypoints")
        self._require_finite(AXES, waypoints)
        far = np.abs(waypoints) > FARTHEST
        if far.any():
            row, column = np.argwhere(far)[0]
            raise InvalidProblem(
                f"{self.label(row)} has {AXES[column]} = {waypoints[row, column]:g} m; "
                f"it must be within {FARTHEST:g} m of zero"
            )
        for name, attribute in (("yaw", "yaw"), ("t", "times")):
            if getattr(self, attribute) is not None:
                values = as_float_array(attribute, getattr(self, attribute), (count,))
                object.__setattr__(self, attribute, values)
                self._require_finite((name,), values[:, None])
        if self.times is not None and (late := self.times[1:] <= self.times[:-1]).any():
            row = int(late.argmax()) + 1
            raise InvalidProblem(
                f"{self.label(row)} has t = {self.times[row]:g} s after {self.times[row - 1]:g} s; "
                "times must increase"
            )

    def __len__(self) -> int:
        """Number of waypoints, n."""
        return len(self.waypoints)

    def label(self, index: int) -> str:
        """What messages call a waypoint: its index, and its line if that is known."""
        line = "" if self.lines is None else f" (line {self.lines[index]})"
        return f"waypoint {index}{line}"

    def _require_finite(self, names: str | tuple[str, ...], values: np.ndarray) -> None:
        """Refuse NaN and infinity in `values`, (n, len(names))."""
        finite = np.isfinite(values)
        if not finite.all():
            row, column = np.argwhere(~finite)[0]
            raise InvalidProblem(
                f"{self.label(row)} has {names[column]} = {values[row, column]}; it must be finite"
            )


def tidy(
    course: Course, *, tolerance: float = MERGE_DISTANCE, strict: bool = False
) -> tuple[Course, tuple[str, ...]]:
    """Merge waypoints that are as good as the same, and say which.

    Of waypoints in a row that lie closer than `tolerance` to the first of them, the first is
    kept; at the end of the course the last. So both ends stay exactly where they are.

    Parameters
    ----------
    tolerance
        m; 0 merges exact repeats only.
    strict
        Refuse such waypoints instead of merging them.

    Returns
    -------
    The course without them (the same object if there are none), and a note for each merge.

    Raises
    ------
    InvalidProblem
        If fewer than two waypoints remain, the tolerance is negative or not finite, or, with
        `strict`, if there is anything to merge.
    """
    if not (math.isfinite(tolerance) and tolerance >= 0.0):
        raise InvalidProblem(f"tolerance is {tolerance:g} m; it must be 0 or more, and finite")
    steps = course.waypoints[1:] - course.waypoints[:-1]
    gaps = np.sqrt((steps * steps).sum(axis=1))
    if not ((gaps < tolerance) | (gaps == 0.0)).any():
        return course, ()
    kept, merged = _merge(course.waypoints.tolist(), tolerance)
    notes = []
    for index, other, distance in merged:
        apart = f"is {1e3 * distance:.3g} mm from" if distance > 0.0 else "repeats"
        fact = f"{course.label(index)} {apart} waypoint {other}"
        if strict:
            raise InvalidProblem(
                f"{fact}; waypoints must be at least {1e3 * tolerance:g} mm apart, and not alike"
            )
        lost = ""
        if course.yaw is not None and course.yaw[index] != course.yaw[other]:
            lost = f", and its yaw of {course.yaw[index]:g} rad dropped"
        notes.append(f"{fact}: merged{lost}")
    if len(kept) < 2:
        raise InvalidProblem(
            f"all {len(course)} waypoints lie within {1e3 * tolerance:g} mm; "
            "a trajectory needs two that are further apart"
        )
    rest = replace(
        course,
        waypoints=course.waypoints[kept],
        yaw=None if course.yaw is None else course.yaw[kept],
        times=None if course.times is None else course.times[kept],
        lines=None if course.lines is None else tuple(course.lines[index] for index in kept),
    )
    return rest, tuple(notes)


def _merge(
    points: list[list[float]], tolerance: float
) -> tuple[list[int], list[tuple[int, int, float]]]:
    """Indices to keep; and (index, index that it is merged with, distance) in order."""
    last = len(points) - 1
    kept, merged = [0], []
    for index in range(1, last):
        distance = math.dist(points[index], points[kept[-1]])
        if distance < tolerance or distance == 0.0:
            merged.append((index, kept[-1], distance))
        else:
            kept.append(index)
    while kept:
        distance = math.dist(points[kept[-1]], points[last])
        if distance >= tolerance and distance > 0.0:
            break
        merged.append((kept.pop(), last, distance))
    return [*kept, last], sorted(merged)
