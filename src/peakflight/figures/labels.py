"""Numbers beside the waypoints: which to write, and where there is room for them."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np

from peakflight.figures.canvas import TEXT, text_width
from peakflight.labelling import waypoint_texts

CLEARANCE = 4.5
"""Room between a place and the edge of its label, pt."""
SPACING = (3.0, 0.5)
"""Room between two labels, across and up, pt."""
_ANGLES = np.radians([45, 135, -45, -135, 0, 180, 90, -90, 20, 160, -20, -160, 70, 110, -70, -110])
_DIRECTIONS = np.stack((np.cos(_ANGLES), np.sin(_ANGLES)), axis=1)
_DISTANCES = (1.0, 2.0, 3.5)
"""Clearances that are tried, in multiples of `CLEARANCE`."""


class Box(NamedTuple):
    """Where a text is, pt."""

    centre: np.ndarray
    """(2,)"""
    half: np.ndarray
    """(2,) half its width and height."""

    @classmethod
    def beside(
        cls, place: np.ndarray, direction: np.ndarray, half: np.ndarray, clearance: float
    ) -> Self:
        """Put a box at a distance from (2,) `place` in the unit `direction` (..., 2)."""
        around = direction / np.abs(direction).max(axis=-1, keepdims=True) * half
        return cls(place + around + direction * clearance, half)

    def is_clear_of(self, other: "Box") -> bool:
        """Whether there is room between this box and another."""
        gap = np.abs(self.centre - other.centre) - self.half - other.half
        return bool((gap >= SPACING).any())


class Label(NamedTuple):
    """A text and its place."""

    text: str
    box: Box
    on_path: bool
    """Whether it could not be kept off the path."""
    place: np.ndarray | None
    """(2,) pt, the end of a line to what it names, where another waypoint is nearer."""


def waypoint_labels(
    waypoints: np.ndarray,
    places: np.ndarray,
    path: np.ndarray,
    size: np.ndarray,
    taken: Sequence[Box] = (),
) -> list[Label]:
    """Place labels for waypoints, none over another and as little as possible over the path.

    A place that is passed several times has one label with all its numbers. A label for which
    there is no room is left out; those of the start and the end come first.

    Parameters
    ----------
    waypoints
        (K+1, 2 or 3) m, by which places are told apart.
    places
        (K+1, 2) pt, where they are on paper.
    path
        (M, 2) pt, points of the path on paper.
    size
        (2,) pt, width and height of the paper.
    taken
        Where something is written already.
    """
    boxes = list(taken)
    labels = []
    for index, text in waypoint_texts(waypoints).items():
        half = 0.5 * np.array([text_width(text), TEXT])
        centres = np.concatenate(
            [
                Box.beside(places[index], _DIRECTIONS, half, distance * CLEARANCE).centre
                for distance in _DISTANCES
            ]
        )
        fits = ((centres - half >= 0.0) & (centres + half <= size)).all(axis=1)
        for box in boxes:
            fits &= (np.abs(centres - box.centre) >= half + box.half + SPACING).any(axis=1)
        fits &= _hits(centres, half + 2.0, places) == 0
        if not fits.any():
            continue
        misleads = _misleads(centres, half, places, index)
        if not misleads[fits].all():
            fits &= ~misleads
        on_path = _hits(centres, half + 1.0, path)
        best = int(np.where(fits, on_path, np.inf).argmin())
        boxes.append(Box(centres[best], half))
        place = places[index] if misleads[best] else None
        labels.append(Label(text, boxes[-1], bool(on_path[best]), place))
    return labels


def _misleads(centres: np.ndarray, half: np.ndarray, places: np.ndarray, index: int) -> np.ndarray:
    """Whether the box around each centre is nearer to another place than to its own."""
    low, high = centres.min(axis=0) - 2.0 * half, centres.max(axis=0) + 2.0 * half
    near = places[((places > low) & (places < high)).all(axis=1)]
    near = near[(np.abs(near - places[index]) > 1e-3).any(axis=1)]
    if not len(near):
        return np.zeros(len(centres), dtype=bool)
    misleads: np.ndarray = _distances(centres, half, near).min(axis=1) < 1.0 + _distances(
        centres, half, places[index : index + 1]
    ).min(axis=1)
    return misleads


def _distances(centres: np.ndarray, half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, m) pt from the edge of the box around each centre to each point."""
    beyond = np.maximum(np.abs(centres[:, None] - points) - half, 0.0)
    distances: np.ndarray = np.hypot(beyond[..., 0], beyond[..., 1])
    return distances


def _hits(centres: np.ndarray, half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Count the points in the box around each centre."""
    low, high = centres.min(axis=0) - half, centres.max(axis=0) + half
    near = points[((points > low) & (points < high)).all(axis=1)]
    inside: np.ndarray = (np.abs(centres[:, None] - near) < half).all(axis=2).sum(axis=1)
    return inside
