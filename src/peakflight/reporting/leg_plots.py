"""The legs of a plan, as bars."""

from peakflight.reporting.findings import Findings
from peakflight.reporting.plots import ABOVE, AXIS, BELOW, Plot, rounded
from peakflight.yaw import ALL_LABELS

BARS_HEIGHT = 300
"""Pixels."""
PATTERNS = ("", "/", ".", "x", "\\", "+", "-", "|")
"""Of bars, by kind of limit: they can be told apart by pattern or by colour."""


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
                "y": rounded([findings.legs[leg].time for leg in chosen]),
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
        "xaxis": {**AXIS, "title": {"text": "leg"}, "showgrid": False, "tickformat": "d"},
        "yaxis": {**AXIS, "title": {"text": "time (s)"}, "rangemode": "tozero"},
        "barmode": "overlay",
        "bargap": 0.25,
        "showlegend": True,
        "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
        "margin": {"l": 52, "r": 8, "t": ABOVE, "b": BELOW},
    }
    return {"data": data, "layout": layout, "height": BARS_HEIGHT}
