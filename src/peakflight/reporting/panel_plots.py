"""Panels under one another, against time."""

from collections.abc import Sequence

import numpy as np

from peakflight.labelling import FAR, drawn_borders, numbered_legs
from peakflight.reporting.panels import Panel, Panels
from peakflight.reporting.plots import ABOVE, AXIS, BELOW, Plot, placed, rounded
from peakflight.result import Plan

PANEL_HEIGHT = 132
"""Pixels of one panel."""
STROKES = {"solid": "—", "dash": "- -", "dot": "···", "dashdot": "-·"}
"""Dashes of lines, in a line of text."""
CHARACTER = 6.6
"""Pixels of a character, on the safe side."""
GAP = 0.22
"""Between panels, of the height of one."""
HEADROOM = 1.18
"""Height of a panel's axis, relative to what it shows."""


def panels_plot(panels: Panels, plan: Plan) -> Plot:
    """Panels under one another, whose one axis of time is that of the plan."""
    count = len(panels.panels)
    times = placed(panels.times)
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
            **AXIS,
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
            **AXIS,
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


def _curves(panel: Panel, times: np.ndarray, x: list[float], axis: str) -> list[Plot]:
    unit = "" if panel.unit == "°" else " "
    lines: list[Plot] = [
        {
            "type": "scatter",
            "mode": "lines",
            "name": curve.name,
            "x": x,
            "y": rounded(curve.values),
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
            "x": placed(times[marks.places]),
            "y": rounded(heights),
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
        for time in drawn_borders(passed)
    ]


def _leg_numbers(passed: np.ndarray) -> list[Plot]:
    """The numbers of the legs, on top."""
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
        for leg in numbered_legs(len(passed) - 1)
    ]
