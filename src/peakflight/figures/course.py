"""The course from above and from the side, the path coloured by speed."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from peakflight.figures.canvas import (
    COLOURS,
    POINTS,
    TEXT,
    add_axes,
    new_figure,
    write,
    write_headline,
)
from peakflight.figures.labels import Label, waypoint_labels
from peakflight.figures.view import View, draw_box
from peakflight.labelling import even_step
from peakflight.palette import INK, SOFT
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

LINES = 1200
"""About how many straight lines the path is drawn with."""
PIECE_LINES = (5, 200)
"""Fewest and most lines to a polynomial piece."""
PAPER_WIDTH, SIDE_WIDTH = 2.6, 2.95
"""Widths of the views from above and from the side, in."""
PAPER_HEIGHT = (2.1, 2.9)
"""Least and largest height of the view from above, in; between, the course decides by its shape."""
BORDER = 0.12
"""Paper left free around the course for labels, relative to the paper."""
BAR_POWERS = (-2, 4)
"""Speeds are written without a power of ten between 0.01 and 10,000 m/s."""
FLAT = 0.05
"""A course that is seen as a point or short from above: least extent, relative to its height."""
MANY = 40
"""With more waypoints than this, their marks are smaller, and not every one has a plumb line."""
MOST_MARKS = 200
"""With more waypoints than this, only every second, fifth, ... is marked."""


class FlownPath(NamedTuple):
    """A trajectory as M short straight lines."""

    ends: np.ndarray
    """(M, 2, 3) m, both ends of each line."""
    speed: np.ndarray
    """(M,) m/s, mean of the speeds at both ends."""
    style: dict[str, Any] | None = None
    """How to draw it, as matplotlib's lines take it; None colours it by speed."""

    @classmethod
    def of(cls, trajectory: Trajectory, style: dict[str, Any] | None = None) -> Self:
        """Sample a trajectory evenly in each piece."""
        count = int(np.clip(LINES // len(trajectory), *PIECE_LINES)) + 1
        points = trajectory.sample(count)
        speed = np.linalg.norm(trajectory.sample(count, 1), axis=-1)
        ends = np.stack((points[:, :-1], points[:, 1:]), axis=2).reshape(-1, 2, 3)
        return cls(ends, (0.5 * (speed[:, :-1] + speed[:, 1:])).ravel(), style)

    def lines(self, ends: np.ndarray, order: np.ndarray | slice = slice(None)) -> LineCollection:
        """Draw (M, 2, 2) `ends`, where the lines fall on paper, later ones over earlier ones."""
        if self.style is not None:  # as one line, or dashes would begin anew at every end
            whole = np.concatenate((ends[:, 0], ends[-1:, 1]))
            return LineCollection([whole], zorder=2, capstyle="round", **self.style)
        return LineCollection(
            list(ends[order]),
            array=self.speed[order],
            norm=Normalize(0.0, max(float(self.speed.max()), 1e-12)),
            cmap=COLOURS,
            linewidths=2.0,
            capstyle="round",
            zorder=2,
        )


def course_figure(plan: Plan) -> Figure:
    """Draw the course from above and from the side, coloured by speed.

    Waypoints are numbered from 0, the start; a place that is passed several times lists its
    numbers. With many waypoints, round numbers only.
    """
    paths, waypoints = [FlownPath.of(plan.trajectory)], plan.problem.waypoints
    height = paper_height(paths, waypoints)
    figure = new_figure(height + 0.85)
    write_headline(figure, plan, 0.12)
    lines = draw_views(figure, paths, waypoints, height)
    bar = figure.colorbar(lines, cax=add_axes(figure, 6.43, 0.55, 0.1, height - 0.15))
    bar.ax.ticklabel_format(axis="y", scilimits=BAR_POWERS)
    bar.outline.set_visible(False)
    bar.set_label("speed (m/s)", fontsize=TEXT, color=INK)
    return figure


def paper_height(paths: Sequence[FlownPath], waypoints: np.ndarray) -> float:
    """Choose the height of the view from above, in."""
    extent = np.ptp(_points(paths, waypoints), axis=0)
    shape = float(extent[1] / max(extent[0], 1e-12 * extent.max()))
    return float(np.clip(PAPER_WIDTH * shape, *PAPER_HEIGHT))


def draw_views(
    figure: Figure,
    paths: Sequence[FlownPath],
    waypoints: np.ndarray,
    height: float,
    *,
    side_width: float = SIDE_WIDTH,
) -> LineCollection:
    """Draw paths from above, `height` inches high, and from the side; hand back the last."""
    above = add_axes(figure, 0.75, 0.45, PAPER_WIDTH, height)
    _draw_from_above(above, paths, waypoints, POINTS * np.array([PAPER_WIDTH, height]))
    side = add_axes(figure, 3.4, 0.1, side_width, height + 0.4)
    return _draw_from_side(side, paths, waypoints, POINTS * np.array([side_width, height + 0.4]))


def _points(paths: Sequence[FlownPath], waypoints: np.ndarray) -> np.ndarray:
    """(n, 3) m, all that is to be seen."""
    return np.concatenate((*(path.ends.reshape(-1, 3) for path in paths), waypoints))


def _draw_from_above(
    axes: Axes, paths: Sequence[FlownPath], waypoints: np.ndarray, paper: np.ndarray
) -> None:
    """Draw x and y to one scale on a `paper` of (2,) pt."""
    points, places = _points(paths, waypoints), waypoints[:, :2]
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    size = np.maximum(high - low, FLAT * np.ptp(points[:, 2]))
    point = float((size / (paper * (1.0 - 2.0 * BORDER))).max())  # metres to a point on paper
    origin = 0.5 * (low + high) - 0.5 * point * paper
    corner = origin + point * paper
    axes.set(xlim=(origin[0], corner[0]), ylim=(origin[1], corner[1]), aspect="equal")
    axes.locator_params(axis="x", nbins=4)
    axes.locator_params(axis="y", nbins=6)
    axes.set_xlabel("x (m)", fontsize=TEXT, color=INK)
    axes.set_ylabel("y (m)", fontsize=TEXT, color=INK)
    for path in paths:
        axes.add_collection(path.lines(path.ends[:, :, :2]), autolim=False)
    _draw_waypoints(axes, places)
    starts = np.concatenate([path.ends[:, 0, :2] for path in paths])
    labels = waypoint_labels(places, (places - origin) / point, (starts - origin) / point, paper)
    _write_labels(axes, labels, origin, point)


def _draw_from_side(
    axes: Axes, paths: Sequence[FlownPath], waypoints: np.ndarray, paper: np.ndarray
) -> LineCollection:
    """Draw the parallel projection; the units of these axes are points on paper."""
    view = View.of(_points(paths, waypoints), paper)
    axes.set(xlim=(0.0, paper[0]), ylim=(0.0, paper[1]), aspect="equal")
    axes.set_axis_off()
    taken = draw_box(axes, view)
    for path in paths:
        shadow = view(view.on_floor(np.concatenate((path.ends[:, 0], path.ends[-1:, 1]))))
        axes.plot(*shadow.T, color="#bdbdbd", linewidth=1.0, zorder=1, solid_joinstyle="round")
    hung = waypoints[:: even_step(len(waypoints), MANY)]
    plumb = view(np.stack((hung, view.on_floor(hung)), axis=1))
    axes.add_collection(
        LineCollection(list(plumb), colors=SOFT, linewidths=0.5, zorder=1.5), autolim=False
    )
    places = view(waypoints)
    for path in paths:
        order = np.argsort(view.nearness(path.ends.mean(axis=1)))
        lines = path.lines(view(path.ends), order)
        axes.add_collection(lines, autolim=False)
    _draw_waypoints(axes, places)
    starts = np.concatenate([view(path.ends[:, 0]) for path in paths])
    labels = waypoint_labels(waypoints, places, starts, paper, taken)
    _write_labels(axes, labels, np.zeros(2), 1.0)
    return lines


def _write_labels(axes: Axes, labels: list[Label], origin: np.ndarray, point: float) -> None:
    """Write labels in the units of the axes: from (2,) `origin`, `point` to a pt on paper."""
    leaders = []
    for text, box, on_path, place in labels:
        write(axes, text, origin + point * box.centre, on_white=on_path)
        if place is not None:
            edge = np.clip(place, box.centre - box.half, box.centre + box.half)
            leaders.append(origin + point * np.array([place, edge]))
    lines = LineCollection(leaders, colors=INK, linewidths=0.4, zorder=2.5)
    axes.add_collection(lines, autolim=False)


def _draw_waypoints(axes: Axes, places: np.ndarray) -> None:
    """Draw rings; a triangle where the flight starts, a square where it ends."""
    small = 2.0 if len(places) > MANY else 4.0
    step = even_step(len(places), MOST_MARKS)
    for chosen, marker, size, fill in (
        (places[step:-1:step], "o", small, "white"),
        (places[-1:], "s", 6.0, "white"),
        (places[:1], "^", 6.5, INK),
    ):
        axes.plot(
            chosen[:, 0],
            chosen[:, 1],
            linestyle="none",
            marker=marker,
            markersize=size,
            markerfacecolor=fill,
            markeredgecolor=INK,
            markeredgewidth=0.7,
            clip_on=False,
            zorder=4 if marker != "o" else 3,
        )
