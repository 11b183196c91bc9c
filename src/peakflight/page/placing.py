"""Where a waypoint goes that is added: on the path, beside it, or at the end."""

from typing import NamedTuple, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from peakflight.page.drawing import Drawing
from peakflight.page.edited import Edited

LOOKS = 65
"""Points of a leg that are looked at."""
ON_PATH = 0.02
"""Angle between a click and the path that counts as on it, rad."""


class Place(NamedTuple):
    """Where a waypoint is added."""

    to: int
    """Its index then."""
    position: np.ndarray
    """(3,) m."""


def place_after(edited: Edited, drawing: Drawing | None, index: int) -> Place:
    """The middle of the leg after a waypoint that is not the last, on the path if there is one."""
    if _answers(drawing, edited):
        middle = drawing.plan.waypoint_times[index : index + 2].mean()
        return Place(index + 1, drawing.plan.trajectory(middle))
    return Place(index + 1, edited.waypoints[index : index + 2].mean(axis=0))


def place_in_sight(
    edited: Edited, drawing: Drawing | None, origin: np.ndarray, direction: np.ndarray
) -> Place:
    """Where a line of sight meets the path, or else the level of the last waypoint.

    A sight that meets neither, above the horizon, means the leg that it passes nearest to.

    Parameters
    ----------
    origin, direction
        (3,) m, and (3,) of any length.
    """
    waypoints = edited.waypoints
    if _answers(drawing, edited):
        index, angle = nearest_point(drawing.path, origin, direction)
        if angle < ON_PATH:
            leg = index // ((len(drawing.path) - 1) // len(drawing.plan.pieces))
            return Place(min(leg, len(waypoints) - 2) + 1, drawing.path[index])
    along = (waypoints[-1, 2] - origin[2]) / direction[2] if direction[2] else -1.0
    if along > 0.0:
        return Place(len(waypoints), origin + along * direction)
    leg = nearest_leg(waypoints, origin, direction)
    return Place(leg + 1, waypoints[leg : leg + 2].mean(axis=0))


def _answers(drawing: Drawing | None, edited: Edited) -> TypeGuard[Drawing]:
    """Whether what is drawn has the legs of the course."""
    return drawing is not None and len(drawing.plan.pieces) == len(edited.waypoints) - 1


def nearest_leg(waypoints: np.ndarray, origin: ArrayLike, direction: ArrayLike) -> int:
    """Which straight leg, of (n, 3) waypoints, a line of sight passes nearest to.

    Parameters
    ----------
    origin, direction
        (3,) m, and (3,) of any length.
    """
    eye, sight = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    sight = sight / np.linalg.norm(sight)
    shares = np.linspace(0.0, 1.0, LOOKS)[:, None]
    points = waypoints[:-1, None] + shares * (waypoints[1:, None] - waypoints[:-1, None])
    return int(np.argmin(_off_sight(points, eye, sight).min(axis=1)))


def nearest_point(points: np.ndarray, origin: ArrayLike, direction: ArrayLike) -> tuple[int, float]:
    """Index of the one of (n, 3) points that is nearest to a line of sight, and its angle, rad."""
    eye, sight = np.asarray(origin, dtype=float), np.asarray(direction, dtype=float)
    off = _off_sight(points, eye, sight / np.linalg.norm(sight))
    index = int(np.argmin(off))
    return index, float(off[index])


def _off_sight(points: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(...,) rad between a line of sight and (..., 3) points."""
    towards = points - origin
    along = towards @ direction
    across = np.linalg.norm(towards - along[..., None] * direction, axis=-1)
    return np.arctan2(across, along)
