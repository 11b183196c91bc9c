"""The plots of a report, as the page hands them to Plotly.

A colour is written as the name of one of the page, such as "@ink": the page puts in what it is in
its light or its dark dress. Nothing that a user wrote goes into a plot: Plotly would read markup.
"""

import math
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np

from peakflight.curves import sampled_curves
from peakflight.labelling import even_step, waypoint_texts
from peakflight.reporting.findings import Findings
from peakflight.reporting.panels import Panel, Panels
from peakflight.result import Plan
from peakflight.yaw import ALL_LABELS

Plot: TypeAlias = dict[str, Any]
"""`data` and `layout` as Plotly takes them, and `height` in pixels."""

DIGITS = 6
"""Significant figures of a number in a plot: finer than a screen."""
DECIMALS = 6
"""Of times in s and places in m."""
PATH_HEIGHT, PANEL_HEIGHT, BARS_HEIGHT = 560, 132, 300
"""Pixels; of panels, of one."""
ABOVE, BELOW = 34, 44
"""Pixels above the first panel and below the last."""
GAP = 0.22
"""Between panels, of the height of one."""
MOST_BORDERS, MOST_NUMBERS = 60, 40
"""With more legs, only every second, fifth, ... has its border drawn, and its number written."""
MOST_LEG_NAMES = 12
"""With more legs, their names in space are shown on demand only."""
EYE = np.array([-0.45, -0.75, 0.48])
"""The direction from which the path in space is first seen, about a unit vector."""
VISIBLE = (0.7, 0.36)
"""Half the width and height of what is seen from a distance of 1, in a plot as wide as two high."""
NEARNESS = 1.2
"""More distance than is just enough."""
ROOM = 0.04
"""Around it, over the same."""
STROKES = {"solid": "—", "dash": "- -", "dot": "···", "dashdot": "-·"}
"""Dashes of lines, in a line of text."""
CHARACTER = 6.6
"""Pixels of a character, on the safe side."""
HEADROOM = 1.18
"""Height of a panel's axis, relative to what it shows."""
FAR = 4.0
"""A bound that is further beyond the curves than this is named, but not drawn to scale."""
PATTERNS = ("", "/", ".", "x", "\\", "+", "-", "|")
"""Of bars, by kind of limit: they can be told apart by pattern or by colour."""


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
            "x": _placed(at[:, 0]),
            "y": _placed(at[:, 1]),
            "marker": {"size": 4, **_coloured(speeds)},
            "customdata": [[*row, z] for row, z in zip(hover, _placed(at[:, 2]), strict=True)],
            "hovertemplate": (
                "%{customdata[0]:.3f} s, leg %{customdata[1]}<br>%{customdata[2]:.2f} m/s"
                "<br>x %{x:.2f}, y %{y:.2f}, z %{customdata[3]:.2f} m<extra></extra>"
            ),
        },
        {
            "type": "scatter",
            "name": "waypoints",
            "mode": "markers+text",
            "x": _placed(points[:, 0]),
            "y": _placed(points[:, 1]),
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
            "x": _placed(at[:1, 0]),
            "y": _placed(at[:1, 1]),
            "marker": {"size": 12, "color": "@limit"},
            "hoverinfo": "skip",
            "visible": False,
        },
    ]
    layout = {
        "xaxis": {**_AXIS, "title": {"text": "x (m)"}},
        "yaxis": {**_AXIS, "title": {"text": "y (m)"}, "scaleanchor": "x"},
        "margin": {"l": 52, "r": 8, "t": 8, "b": BELOW},
        "showlegend": False,
        "hovermode": "closest",
    }
    return {"data": data, "layout": layout, "height": PATH_HEIGHT}


def panels_plot(panels: Panels, plan: Plan) -> Plot:
    """Panels under one another, whose one axis of time is that of the plan."""
    count = len(panels.panels)
    times = _placed(panels.times)
    data: list[Plot] = []
    axes: Plot = {}
    annotations: list[Plot] = []
    shapes = _borders(plan.waypoint_times)
    height = 1.0 / (count + GAP * (count - 1))
    for row, panel in enumerate(panels.panels):
        top = 1.0 - row * (1.0 + GAP) * height
        suffix = "" if row == 0 else str(row + 1)
        low, high, near = _range(panel)
        axes[f"yaxis{suffix}"] = {
            **_AXIS,
            "domain": [max(top - height, 0.0), top],
            "range": [low, high],
            "nticks": 5,
            "anchor": "x",
        }
        data += _curves(panel, panels.times, times, f"y{suffix}")
        annotations += _names(panel, top)
        for bound in panel.bounds:
            if bound.value in near:
                shapes.append(_bound_line(bound.value, f"y{suffix}"))
            if bound.text:
                annotations.append(_bound_text(bound.value, bound.text, near, f"y{suffix}", high))
    annotations += _leg_numbers(plan.waypoint_times)
    layout = {
        "xaxis": {
            **_AXIS,
            "anchor": f"y{count}" if count > 1 else "y",
            "range": [float(panels.times[0]), float(panels.times[-1])],
            "title": {"text": "time (s)"},
            "showspikes": True,
            "spikemode": "across",
            "spikethickness": 1,
            "spikedash": "solid",
            "spikecolor": "@soft",
            "showgrid": False,
            "unifiedhovertitle": {"text": "%{x:.3f} s"},
        },
        **axes,
        "hovermode": "x unified",
        "hoversubplots": "axis",
        "hoverlabel": {"bgcolor": "@card", "bordercolor": "@faint", "font": {"color": "@ink"}},
        "annotations": annotations,
        "shapes": shapes,
        "showlegend": False,
        "margin": {"l": 52, "r": 8, "t": ABOVE, "b": BELOW},
        "dragmode": "zoom",
    }
    return {
        "data": data,
        "layout": layout,
        "height": ABOVE + BELOW + round(PANEL_HEIGHT * (count + GAP * (count - 1))),
    }


def legs_plot(findings: Findings) -> Plot:
    """The time of each leg, and which limit binds it."""
    names = [leg.closest if leg.binds else "" for leg in findings.legs]
    known = list(ALL_LABELS)
    data = []
    for name in dict.fromkeys(names):
        chosen = [leg for leg, other in enumerate(names) if other == name]
        number = known.index(name) if name else 0
        colour = f"@kind-{number % len(PATTERNS)}" if name else "@faint"
        data.append(
            {
                "type": "bar",
                "name": ALL_LABELS[name] if name else "no limit binds",
                "x": chosen,
                "y": _rounded([findings.legs[leg].time for leg in chosen]),
                "customdata": [
                    [ALL_LABELS[findings.legs[leg].closest], findings.legs[leg].ratio]
                    for leg in chosen
                ],
                "hovertemplate": (
                    "leg %{x}: %{y:.4f} s<br>%{customdata[0]} at %{customdata[1]:.4f} of its limit"
                    "<extra></extra>"
                ),
                "marker": {
                    "color": colour,
                    "pattern": {
                        "shape": PATTERNS[number % len(PATTERNS)] if name else "",
                        "fillmode": "overlay",
                        "fgcolor": "@paper",
                        "size": 7,
                        "solidity": 0.25,
                    },
                },
            }
        )
    layout = {
        "xaxis": {**_AXIS, "title": {"text": "leg"}, "showgrid": False, "tickformat": "d"},
        "yaxis": {**_AXIS, "title": {"text": "time (s)"}, "rangemode": "tozero"},
        "barmode": "overlay",
        "bargap": 0.25,
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "margin": {"l": 52, "r": 8, "t": ABOVE, "b": BELOW},
    }
    return {"data": data, "layout": layout, "height": BARS_HEIGHT}


_AXIS: Plot = {
    "gridcolor": "@grid",
    "linecolor": "@faint",
    "zeroline": False,
    "color": "@soft",
    "automargin": False,
}


def _path(plan: Plan) -> tuple[np.ndarray, np.ndarray, list[list[Any]]]:
    """(n, 3) m, (n,) m/s, and time, leg and speed of each point of the path."""
    times, curves = sampled_curves(plan.trajectory)
    count = times.shape[1]
    at = plan.trajectory.sample(count).reshape(-1, 3)
    legs = np.repeat(np.arange(len(plan.pieces)), np.array(plan.pieces) * count)
    speeds = curves["speed"].ravel()
    rows = zip(_placed(times.ravel()), legs.tolist(), _rounded(speeds), strict=True)
    return at, speeds, [list(row) for row in rows]


def _coloured(speeds: np.ndarray) -> Plot:
    return {
        "color": _rounded(speeds),
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


def _axes(points: np.ndarray) -> Plot:
    return {name: _placed(points[:, axis]) for axis, name in enumerate("xyz")}


def _curves(panel: Panel, times: np.ndarray, x: list[float], axis: str) -> list[Plot]:
    unit = "" if panel.unit == "°" else " "
    lines: list[Plot] = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": curve.name,
            "x": x,
            "y": _rounded(curve.values),
            "xaxis": "x",
            "yaxis": axis,
            "line": {"color": f"@{curve.colour}", "width": 1.6, "dash": curve.dash},
            "hovertemplate": f"{curve.name} %{{y:.4~g}}{unit}{panel.unit}<extra></extra>",
        }
        for curve in panel.curves
    ]
    marks = panel.marks
    if marks is None or not len(marks.places):
        return lines
    heights = panel.curves[0].values[marks.places]
    lines.append(
        {
            "type": "scatter",
            "mode": "markers",
            "name": f"{panel.label} binds",
            "x": _placed(times[marks.places]),
            "y": _rounded(heights),
            "xaxis": "x",
            "yaxis": axis,
            "marker": {
                "symbol": ["x" if beyond else "circle" for beyond in marks.exceeded.tolist()],
                "size": 7,
                "color": ["@limit" if beyond else "@paper" for beyond in marks.exceeded.tolist()],
                "line": {"color": "@limit", "width": 1.4},
            },
            "text": marks.texts,
            "hovertemplate": "%{text}<extra></extra>",
            "cliponaxis": False,
        }
    )
    return lines


def _range(panel: Panel) -> tuple[float, float, list[float]]:
    """Ends of the axis, and the bounds that are within it."""
    low = min(float(curve.values.min()) for curve in panel.curves)
    high = max(float(curve.values.max()) for curve in panel.curves)
    size = max(abs(low), abs(high), 1e-12)
    near = [bound.value for bound in panel.bounds if abs(bound.value) <= FAR * size]
    low, high = min([low, *near]), max([high, *near])
    if panel.unit == "°" and panel.label == "yaw":
        middle, half = 0.5 * (low + high), max(0.5 * HEADROOM * (high - low), 5.0)
        return middle - half, middle + half, near
    return (HEADROOM * low if low < 0.0 else 0.0), (HEADROOM * high if high > 0.0 else 1.0), near


def _names(panel: Panel, top: float) -> list[Plot]:
    """What a panel shows, and after it which of several lines is which."""
    texts = [(f"<b>{panel.label}</b> ({panel.unit})", "@ink", len(panel.label + panel.unit) + 5)]
    if len(panel.curves) > 1:
        texts += [
            (f"{STROKES[curve.dash]} {curve.name}", f"@{curve.colour}", len(curve.name) + 4)
            for curve in panel.curves
        ]
    names: list[Plot] = []
    begins = 0
    for text, colour, length in texts:
        names.append(
            {
                "text": text,
                "xref": "paper",
                "yref": "paper",
                "x": 0.0,
                "y": top,
                "xshift": begins,
                "xanchor": "left",
                "yanchor": "bottom",
                "showarrow": False,
                "font": {"color": colour, "size": 12 if begins == 0 else 11},
            }
        )
        begins += round(CHARACTER * length)
    return names


def _bound_line(value: float, axis: str) -> Plot:
    return {
        "type": "line",
        "xref": "paper",
        "yref": axis,
        "x0": 0.0,
        "x1": 1.0,
        "y0": value,
        "y1": value,
        "line": {"color": "@limit", "width": 1.2, "dash": "dash"},
        "layer": "below",
    }


def _bound_text(value: float, text: str, near: Sequence[float], axis: str, high: float) -> Plot:
    return {
        "text": text if value in near else f"{text} ↑",
        "xref": "paper",
        "yref": axis,
        "x": 1.0,
        "y": value if value in near else high,
        "xanchor": "right",
        "yanchor": "bottom" if value in near else "top",
        "showarrow": False,
        "font": {"color": "@limit", "size": 11},
    }


def _borders(passed: np.ndarray) -> list[Plot]:
    inner = passed[1:-1]
    return [
        {
            "type": "line",
            "xref": "x",
            "yref": "paper",
            "x0": float(time),
            "x1": float(time),
            "y0": 0.0,
            "y1": 1.0,
            "line": {"color": "@faint", "width": 1},
            "layer": "below",
        }
        for time in inner[:: even_step(len(inner), MOST_BORDERS)]
    ]


def _leg_numbers(passed: np.ndarray) -> list[Plot]:
    """The numbers of the legs, on top."""
    legs = len(passed) - 1
    return [
        {
            "text": f"leg {leg}" if leg == 0 else str(leg),
            "xref": "x",
            "yref": "paper",
            "x": float(0.5 * (passed[leg] + passed[leg + 1])),
            "y": 1.0,
            "yshift": 15,
            "yanchor": "bottom",
            "showarrow": False,
            "font": {"color": "@soft", "size": 11},
        }
        for leg in range(0, legs, even_step(legs, MOST_NUMBERS))
    ]


def _placed(values: np.ndarray) -> list[float]:
    """Times in s and places in m, which may be far from zero."""
    placed: list[float] = (np.round(values, DECIMALS) + 0.0).tolist()
    return placed


def _rounded(values: Any) -> list[float]:
    return [float(f"{value:.{DIGITS}g}") for value in np.asarray(values, dtype=float).tolist()]
