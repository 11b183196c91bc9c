"""A course seen from the side and above: a parallel projection drawn on plain axes.

Written here instead of using mplot3d for two reasons. It draws what helps to read a flight path: a
floor to scale, the path's shadow on it, a plumb line from every waypoint, nearer parts of the path
over farther ones, and labels that know of each other. And it takes two thirds of the time (measured
on uzh_19wp with labels: 66 ms against 100).
"""

from itertools import count, pairwise, product
from typing import NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from peakflight.figures.canvas import POWERS, TEXT, span, text_width, write
from peakflight.figures.labels import Box
from peakflight.palette import FAINT, SOFT
from peakflight.problem import AXES

AZIMUTH = np.radians(-60.0)
"""Where the viewer stands, from the x axis towards the y axis."""
ELEVATION = np.radians(33.0)
"""How far the viewer looks down."""
LEAST_SIDE = 0.25
"""Shortest side of the box, relative to the longest."""
FAIR_HEIGHT = 0.35
"""A course that is flatter than this, relative to its floor, is drawn with heights stretched."""
MOST_STRETCH = 5
PLANAR = 1e-6
"""A course that is flatter than this is drawn to scale."""
ROOMINESS = 1.1
"""Sides of the box, relative to what they must hold."""
MARGINS = (44.0, 26.0, 34.0, 10.0)
"""Room for tick and axis labels left, right, below and above, pt."""
TICKS = 4
"""About how many intervals an axis is divided into."""
CLEARANCE = 4.5
"""Room between an axis and its numbers, and between these and its name, pt."""
TIMES = "×"  # noqa: RUF001
CORNER = 0.04
"""No number stands nearer to the end of an axis, relative to its length."""

_RIGHT = np.array([-np.sin(AZIMUTH), np.cos(AZIMUTH), 0.0])
_UP = np.array(
    [
        -np.sin(ELEVATION) * np.cos(AZIMUTH),
        -np.sin(ELEVATION) * np.sin(AZIMUTH),
        np.cos(ELEVATION),
    ]
)
_TOWARDS = np.cross(_RIGHT, _UP)


class View(NamedTuple):
    """A box around the course and how its points fall on paper."""

    low: np.ndarray
    """(3,) m, one corner of the box."""
    high: np.ndarray
    """(3,) m, the opposite corner."""
    stretch: int
    """By how much heights are drawn larger than widths."""
    scale: float
    """pt on paper for a metre across the line of sight."""
    shift: np.ndarray
    """(2,) pt, where the middle of the box falls."""

    @classmethod
    def of(cls, points: np.ndarray, size: np.ndarray) -> Self:
        """Find the view in which (M, 3) m `points` fill a paper of (2,) pt `size`."""
        low, high = points.min(axis=0), points.max(axis=0)
        extent, middle = high - low, 0.5 * (low + high)
        across, height = float(extent[:2].max()), float(extent[2])
        stretch = 1
        if height > PLANAR * across:
            stretch = int(np.clip(FAIR_HEIGHT * across / height, 1, MOST_STRETCH))
        least = LEAST_SIDE * max(across, height) * np.array([1.0, 1.0, 1.0 / stretch])
        half = 0.5 * ROOMINESS * np.maximum(extent, least)
        view = cls(middle - half, middle + half, stretch, 1.0, np.zeros(2))
        corners = view(np.array(list(product(*zip(view.low, view.high, strict=True)))))
        bottom_left, top_right = corners.min(axis=0), corners.max(axis=0)
        room = size - (MARGINS[0] + MARGINS[1], MARGINS[2] + MARGINS[3])
        scale = float((room / (top_right - bottom_left)).min())
        shift = MARGINS[::2] + 0.5 * room - 0.5 * scale * (bottom_left + top_right)
        return view._replace(scale=scale, shift=shift)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(..., 2) pt on paper of (..., 3) m."""
        turned = self._from_middle(points) @ np.stack((_RIGHT, _UP), axis=1)
        placed: np.ndarray = self.scale * turned + self.shift
        return placed

    def nearness(self, points: np.ndarray) -> np.ndarray:
        """(...,) m, how much nearer to the viewer than the middle of the box (..., 3) m are."""
        return self._from_middle(points) @ _TOWARDS

    def on_floor(self, points: np.ndarray) -> np.ndarray:
        """(..., 3) m, the points of the floor right below."""
        below = np.array(points)
        below[..., 2] = self.low[2]
        return below

    def ticks(self, axis: int) -> np.ndarray:
        """Round numbers along an axis, m, none too near to a corner of the box."""
        low, high = float(self.low[axis]), float(self.high[axis])
        values = np.asarray(MaxNLocator(TICKS, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        gap = CORNER * (high - low)
        return values[(values > low + gap) & (values < high - gap)]

    def _from_middle(self, points: np.ndarray) -> np.ndarray:
        away: np.ndarray = (points - 0.5 * (self.low + self.high)) * (1.0, 1.0, self.stretch)
        return away


def draw_box(axes: Axes, view: View) -> list[Box]:
    """Draw the floor with its grid, the two far walls, and numbers along three edges.

    Returns
    -------
    Where the numbers are, pt, so that nothing else is written there.
    """
    (x0, y0, z0), (x1, y1, z1) = view.low, view.high
    outline = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    floor = view(np.array([(*corner, z0) for corner in outline]))
    axes.add_collection(
        PolyCollection([floor], facecolors="#f4f4f4", edgecolors="none", zorder=0), autolim=False
    )
    lines = [[(x, y0, z0), (x, y1, z0)] for x in (x0, x1, *view.ticks(0))]
    lines += [[(x0, y, z0), (x1, y, z0)] for y in (y0, y1, *view.ticks(1))]
    for z in (z1, *view.ticks(2)):
        lines += [[(x0, y0, z), (x0, y1, z)], [(x0, y1, z), (x1, y1, z)]]
    lines += [[(x, y, z0), (x, y, z1)] for x, y in ((x0, y0), (x0, y1), (x1, y1))]
    axes.add_collection(
        LineCollection(list(view(np.array(lines))), colors=FAINT, linewidths=0.5, zorder=0.5),
        autolim=False,
    )
    edges = (
        ((x0, y0, z0), (x1, y0, z0)),
        ((x1, y0, z0), (x1, y1, z0)),
        ((x0, y0, z0), (x0, y0, z1)),
    )
    taken = []
    for axis, (start, end) in enumerate(edges):
        taken += _write_edge(axes, view, axis, np.array(start), np.array(end))
    return taken


def _write_edge(axes: Axes, view: View, axis: int, start: np.ndarray, end: np.ndarray) -> list[Box]:
    """Write numbers and name of one axis along the edge of the box from `start` to `end`."""
    ticks = view.ticks(axis)
    points = np.tile(start, (len(ticks), 1))
    points[:, axis] = ticks
    places, ends = view(points), view(np.stack((start, end)))
    along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
    outwards = np.array([along[1], -along[0]]) if axis < 2 else np.array([-1.0, 0.0])
    marks = np.stack((places, places + outwards * 2.5), axis=1)
    edge = LineCollection([ends, *marks], colors=SOFT, linewidths=0.6, zorder=0.6)
    axes.add_collection(edge, autolim=False)

    texts, offset = _tick_labels(ticks)
    boxes = [
        Box.beside(place, outwards, _half(text), CLEARANCE)
        for place, text in zip(places, texts, strict=True)
    ]
    step = _legible_step(boxes)
    for box, text in zip(boxes[::step], texts[::step], strict=True):
        write(axes, text, box.centre)
    note = f", drawn {view.stretch}{TIMES}" if axis == 2 and view.stretch > 1 else ""
    name = f"{AXES[axis]} (m){note}" + (f"\n{offset}" if offset else "")
    half = _half(name)[::-1] if axis == 2 else _half(name)
    for clearance in count(CLEARANCE):
        box = Box.beside(ends.mean(axis=0), outwards, half, clearance)
        if all(box.is_clear_of(other) for other in boxes):
            break
    write(axes, name, box.centre, rotation=90.0 if axis == 2 else 0.0)
    return [*boxes[::step], box]


def _half(text: str) -> np.ndarray:
    """(2,) pt, half the width and height of a text."""
    lines = text.split("\n")
    return 0.5 * np.array([max(map(text_width, lines)), TEXT * (1.3 * len(lines) - 0.3)])


def _legible_step(boxes: list[Box]) -> int:
    """Every how many-th of a row of numbers can be written without one touching the next."""
    for step in range(1, len(boxes)):
        kept = boxes[::step]
        if all(one.is_clear_of(other) for one, other in pairwise(kept)):
            return step
    return max(len(boxes), 1)


def _tick_labels(ticks: np.ndarray) -> tuple[list[str], str]:
    """Print the numbers at ticks, and what to add to them if they are far from zero."""
    formatter = ScalarFormatter()
    formatter.create_dummy_axis()
    formatter.set_powerlimits(POWERS)
    formatter.axis.set_view_interval(*span(ticks))  # type: ignore[union-attr]
    texts = formatter.format_ticks(list(ticks))
    return texts, formatter.get_offset()
