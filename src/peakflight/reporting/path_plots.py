"""The path of a plan, in space and from above."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from peakflight.curves import sampled_curves
from peakflight.labelling import waypoint_texts
from peakflight.reporting.plots import AXIS, BELOW, Plot, placed, rounded
from peakflight.result import Plan

PATH_HEIGHT = 560
"""Pixels."""
EYE = np.array([-0.45, -0.75, 0.48])
"""The direction from which the path in space is first seen, about a unit vector."""
VISIBLE = (0.7, 0.36)
"""Half the width and height of what is seen from a distance of 1, in a plot as wide as two high."""
NEARNESS = 1.2
"""More distance than is just enough."""
ROOM = 0.04
"""Around it, over the same."""
MOST_LEG_NAMES = 12
"""With more legs, their names in space are shown on demand only."""


def path_plot(plan: Plan) -> Plot:
    """The path in space, coloured by speed, with waypoints, names of legs, and a cursor."""
    at, speeds, hover = _path(plan)
    texts = waypoint_texts(plan.problem.waypoints)
    points = plan.problem.waypoints
    names = [texts.get(index, "") for index in range(len(points))]
    middles = 0.5 * (plan.waypoint_times[:-1] + plan.waypoint_times[1:])
    legs = plan.trajectory(middles)
    data = [
        {
            "type": "scatter3d",
            "name": "path",
            "mode": "lines",
            **_axes(at),
            "line": {"width": 7, **_coloured(speeds)},
            "customdata": hover,
            "hovertemplate": (
                "%{customdata[0]:.3f} s, leg %{customdata[1]}<br>%{customdata[2]:.2f} m/s"
                "<br>x %{x:.2f}, y %{y:.2f}, z %{z:.2f} m<extra></extra>"
            ),
            "showlegend": False,
        },
        {
            "type": "scatter3d",
            "name": "waypoints",
            "mode": "markers+text",
            **_axes(points),
            "text": names,
            "textposition": "top center",
            "textfont": {"size": 13, "color": "@ink"},
            "marker": {
                "size": 5,
                "color": "@paper",
                "line": {"color": "@ink", "width": 2},
            },
            "customdata": [[index, float(t)] for index, t in enumerate(plan.waypoint_times)],
            "hovertemplate": (
                "waypoint %{customdata[0]}, passed at %{customdata[1]:.3f} s"
                "<br>x %{x:.3f}, y %{y:.3f}, z %{z:.3f} m<extra></extra>"
            ),
        },
        {
            "type": "scatter3d",
            "name": "legs",
            "mode": "text",
            **_axes(legs),
            "text": [f"leg {leg}" for leg in range(len(legs))],
            "textfont": {"size": 11, "color": "@soft"},
            "hoverinfo": "skip",
            "visible": True if len(legs) <= MOST_LEG_NAMES else "legendonly",
        },
        {
            "type": "scatter3d",
            "name": "cursor",
            "mode": "markers",
            **_axes(at[:1]),
            "marker": {"size": 7, "color": "@limit"},
            "hoverinfo": "skip",
            "showlegend": False,
            "visible": False,
        },
    ]
    spans = _spans(np.concatenate((at, points)))
    axis = {"gridcolor": "@faint", "zeroline": False, "showbackground": False, "color": "@soft"}
    layout = {
        "scene": {
            "aspectmode": "manual",
            "aspectratio": {name: ratio for name, (_, ratio) in spans.items()},
            "camera": {
                "eye": _eye([ratio for _, ratio in spans.values()]),
                "center": {"x": 0.0, "y": 0.0, "z": -0.08},  # room for the names of the axes
            },
            **{
                f"{name}axis": {"title": {"text": f"{name} (m)"}, "range": ends, **axis}
                for name, (ends, _) in spans.items()
            },
        },
        "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        "legend": {"x": 0, "y": 1, "orientation": "h", "bgcolor": "rgba(0,0,0,0)"},
    }
    return {"data": data, "layout": layout, "height": PATH_HEIGHT}


def above_plot(plan: Plan) -> Plot:
    """The path from above; in place of the path in space where that cannot be drawn."""
    at, speeds, hover = _path(plan)
    points = plan.problem.waypoints
    texts = waypoint_texts(points[:, :2])
    data = [
        {
            "type": "scatter",
            "name": "path",
            "mode": "markers",
            "x": placed(at[:, 0]),
            "y": placed(at[:, 1]),
            "marker": {"size": 4, **_coloured(speeds)},
            "customdata": [[*row, z] for row, z in zip(hover, placed(at[:, 2]), strict=True)],
            "hovertemplate": (
                "%{customdata[0]:.3f} s, leg %{customdata[1]}<br>%{customdata[2]:.2f} m/s"
                "<br>x %{x:.2f}, y %{y:.2f}, z %{customdata[3]:.2f} m<extra></extra>"
            ),
        },
        {
            "type": "scatter",
            "name": "waypoints",
            "mode": "markers+text",
            "x": placed(points[:, 0]),
            "y": placed(points[:, 1]),
            "text": [texts.get(index, "") for index in range(len(points))],
            "textposition": "top center",
            "textfont": {"color": "@ink"},
            "marker": {"size": 9, "color": "@paper", "line": {"color": "@ink", "width": 2}},
            "customdata": [
                [index, float(t), float(point[2])]
                for index, (t, point) in enumerate(zip(plan.waypoint_times, points, strict=True))
            ],
            "hovertemplate": (
                "waypoint %{customdata[0]}, passed at %{customdata[1]:.3f} s"
                "<br>x %{x:.3f}, y %{y:.3f}, z %{customdata[2]:.3f} m<extra></extra>"
            ),
        },
        {
            "type": "scatter",
            "name": "cursor",
            "mode": "markers",
            "x": placed(at[:1, 0]),
            "y": placed(at[:1, 1]),
            "marker": {"size": 12, "color": "@limit"},
            "hoverinfo": "skip",
            "visible": False,
        },
    ]
    layout = {
        "xaxis": {**AXIS, "title": {"text": "x (m)"}},
        "yaxis": {**AXIS, "title": {"text": "y (m)"}, "scaleanchor": "x"},
        "margin": {"l": 52, "r": 8, "t": 8, "b": BELOW},
        "showlegend": False,
        "hovermode": "closest",
    }
    return {"data": data, "layout": layout, "height": PATH_HEIGHT}


def _path(plan: Plan) -> tuple[np.ndarray, np.ndarray, list[list[Any]]]:
    """(n, 3) m, (n,) m/s, and time, leg and speed of each point of the path."""
    times, curves = sampled_curves(plan.trajectory)
    count = times.shape[1]
    at = plan.trajectory.sample(count).reshape(-1, 3)
    legs = np.repeat(np.arange(len(plan.pieces)), np.array(plan.pieces) * count)
    speeds = curves["speed"].ravel()
    rows = zip(placed(times.ravel()), legs.tolist(), rounded(speeds), strict=True)
    return at, speeds, [list(row) for row in rows]


def _coloured(speeds: np.ndarray) -> Plot:
    return {
        "color": rounded(speeds),
        "colorscale": "@speeds",
        "cmin": 0.0,
        "cmax": float(speeds.max()),
        "colorbar": {
            "title": {"text": "speed (m/s)", "side": "right"},
            "thickness": 12,
            "len": 0.6,
            "outlinewidth": 0,
            "tickfont": {"color": "@soft"},
        },
    }


def _axes(points: np.ndarray) -> Plot:
    return {name: placed(points[:, axis]) for axis, name in enumerate("xyz")}


def _spans(points: np.ndarray) -> dict[str, tuple[list[float], float]]:
    """Ends of each axis, m, and its length over that of the longest: all axes have one scale."""
    low, high = points.min(axis=0), points.max(axis=0)
    room = ROOM * max(float((high - low).max()), 1e-9)
    low, high = low - room, high + room
    ratios = (high - low) / (high - low).max()
    return {
        name: ([float(low[axis]), float(high[axis])], float(ratios[axis]))
        for axis, name in enumerate("xyz")
    }


def _eye(ratios: Sequence[float]) -> dict[str, float]:
    """From where all of a box with sides of these lengths is seen."""
    across, up = 0.5 * math.hypot(ratios[0], ratios[1]), 0.5 * ratios[2]
    rising = float(EYE[2] / np.linalg.norm(EYE))
    seen = across, across * rising + up * math.sqrt(1.0 - rising**2)
    distance = NEARNESS * max(half / most for half, most in zip(seen, VISIBLE, strict=True))
    return {name: float(value) for name, value in zip("xyz", distance * EYE, strict=True)}
