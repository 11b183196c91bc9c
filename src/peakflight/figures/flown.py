"""Several flights of one course as motion capture saw them: paths, derivatives and errors."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from peakflight.figures.canvas import TEXT, WIDTH, add_axes, name_lines, new_figure, write_title
from peakflight.figures.course import FlownPath, draw_views, paper_height
from peakflight.figures.derivatives import (
    BOTTOM,
    HEADROOM,
    LEFT,
    RIGHT,
    add_panels,
    panels_height,
    scale_panel,
)
from peakflight.figures.flights import LEGEND_ROW, LEGEND_TOP, looks
from peakflight.figures.overlaid_derivatives import ABOVE, CUT
from peakflight.figures.paths import SIDE_WIDTH
from peakflight.limits import KINDS
from peakflight.palette import INK, LIMIT
from peakflight.result import Plan

if TYPE_CHECKING:
    from peakflight.flight.motion_capture import FlightAnalysis

CENTIMETRES = 100.0
"""In a metre."""
ERROR_HEIGHT = 1.9
"""Of the panel of errors, in."""
ROOM_FOR_CRASH = 1.5
"""A crash is drawn up to so many times what those show that flew to the end."""
CRASH: dict[str, Any] = {
    "linestyle": "none",
    "marker": "X",
    "markersize": 7.0,
    "markerfacecolor": LIMIT,
    "markeredgecolor": "white",
    "markeredgewidth": 0.6,
    "zorder": 6,
    "clip_on": False,
}


class FlownPlan(NamedTuple):
    """A plan, its flight as motion capture saw it, and when it crashed."""

    plan: Plan
    analysis: "FlightAnalysis"
    crash: float | None = None
    """s after the beginning of the plan; None if it flew to the end."""


def flown_figures(flown: Mapping[str, FlownPlan], *, title: str) -> dict[str, Figure]:
    """Draw flights side by side: paths, what is limited against time, and distances from the plan.

    Parameters
    ----------
    flown
        Flights of the same waypoints and limits by what they are called; one at least.
    title
        Of what, for the headlines.
    """
    lines = [_Line(name, one) for name, one in flown.items()]
    return {"paths": _paths(lines, title), "derivatives": _derivatives(lines, title),
            "errors": _errors(lines, title)}  # fmt: skip


class _Line(NamedTuple):
    """A flight and how it is drawn: in the looks of its method."""

    name: str
    flown: FlownPlan

    @property
    def style(self) -> dict[str, Any]:
        """As matplotlib's lines take it."""
        colour, dashes, width = looks(self.flown.plan.method)
        return {"color": colour, "linestyle": dashes, "linewidth": width}

    @property
    def label(self) -> str:
        """Name, and how it went."""
        if self.flown.crash is not None:
            return f"{self.name}: crash at {self.flown.crash:.2f} s"
        return f"{self.name}: RMS {CENTIMETRES * self.flown.analysis.rms_error:.1f} cm"


def _paths(lines: Sequence[_Line], title: str) -> Figure:
    """Flown paths from above and from the side."""
    paths = []
    for line in lines:
        places = line.flown.analysis.positions
        ends = np.stack((places[:-1], places[1:]), axis=1)
        paths.append(FlownPath(ends, np.zeros(len(ends)), line.style))
    waypoints = lines[0].flown.plan.problem.waypoints
    height = paper_height(paths, waypoints)
    figure = new_figure(height + 0.6 + LEGEND_TOP + LEGEND_ROW)
    write_title(figure, f"{title}: paths", 0.12)
    draw_views(figure, paths, waypoints, height, side_width=SIDE_WIDTH)
    for line in _crashed(lines):
        x, y, _ = line.flown.analysis.positions[-1]
        figure.axes[0].plot(x, y, **CRASH)
    _name(figure, lines)
    return figure


def _derivatives(lines: Sequence[_Line], title: str) -> Figure:
    """What is limited against time, by differences of the samples."""
    first = lines[0].flown
    kinds = [kind for kind in KINDS if kind.name in first.analysis.curves]
    figure = new_figure(panels_height(len(kinds)) + LEGEND_TOP + LEGEND_ROW + ABOVE)
    rate = first.analysis.rate
    write_title(figure, f"{title}: derivatives of positions at {rate:.4g} Hz", 0.12)
    panels = add_panels(figure, len(kinds))
    end = _end(lines)
    for kind, axes in zip(kinds, panels, strict=True):
        tops = []
        for line in lines:
            curve = line.flown.analysis.curves[kind.name]
            values = kind.shown(curve.flown)
            axes.plot(curve.times, values, zorder=3, **line.style)
            tops.append(float(np.nanmax(values, initial=0.0)))
        limit = getattr(first.plan.problem.limits, kind.name)
        shown = _shown(lines, tops, least=limit or 0.0)
        if limit and kind.unit != "rad":
            shown = min(shown, CUT * limit)
        scale_panel(axes, kind, limit, times=(0.0, end), highest=shown)
        _draw_crashes(axes, lines)
        _tell_higher(axes, max(tops), shown, kind.shown_unit)
    _name(figure, lines)
    return figure


def _errors(lines: Sequence[_Line], title: str) -> Figure:
    """Distances from the plan against time."""
    above = LEGEND_TOP + LEGEND_ROW + ABOVE
    figure = new_figure(BOTTOM + ERROR_HEIGHT + above)
    write_title(figure, f"{title}: distance from the plan", 0.12)
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - RIGHT, ERROR_HEIGHT)
    errors = [CENTIMETRES * line.flown.analysis.errors for line in lines]
    for line, values in zip(lines, errors, strict=True):
        axes.plot(line.flown.analysis.times, values, zorder=3, **line.style)
    tops = [float(values.max()) for values in errors]
    shown = max(_shown(lines, tops), 1e-9)
    axes.set(xlim=(0.0, _end(lines)), ylim=(0.0, HEADROOM * shown))
    _draw_crashes(axes, lines)
    axes.locator_params(axis="y", nbins=6)
    axes.set_xlabel("time (s)", fontsize=TEXT, color=INK)
    axes.set_ylabel("position error\n(cm)", fontsize=TEXT, color=INK)
    axes.yaxis.set_label_coords(-0.08, 0.5)
    _tell_higher(axes, max(tops), shown, "cm")
    _name(figure, lines)
    return figure


def _crashed(lines: Sequence[_Line]) -> Iterator[_Line]:
    return (line for line in lines if line.flown.crash is not None)


def _draw_crashes(axes: Axes, lines: Sequence[_Line]) -> None:
    """Mark when flights ended before their plans, across the panel."""
    for line in _crashed(lines):
        assert line.flown.crash is not None  # chosen by it
        axes.axvline(line.flown.crash, color=line.style["color"], linestyle=":", linewidth=0.9)
        axes.plot(line.flown.crash, 1.0, transform=axes.get_xaxis_transform(), **CRASH)


def _end(lines: Sequence[_Line]) -> float:
    return max(line.flown.analysis.duration for line in lines)


def _shown(lines: Sequence[_Line], tops: Sequence[float], least: float = 0.0) -> float:
    """Up to where a panel goes: a tumble must not press the others flat."""
    flew = [top for line, top in zip(lines, tops, strict=True) if line.flown.crash is None]
    if not flew:
        return max(*tops, least)
    return min(max(*tops, least), ROOM_FOR_CRASH * max(*flew, least))


def _tell_higher(axes: Axes, top: float, shown: float, unit: str) -> None:
    """Say how high a curve goes that leaves its panel."""
    if top > HEADROOM * shown:
        text = f"↑ {float(f'{top:.3g}'):g}\n   {unit}"
        axes.text(1.012, 1.0, text, transform=axes.transAxes, va="top", fontsize=TEXT, color=INK)


def _name(figure: Figure, lines: Sequence[_Line]) -> None:
    """Say which line is which, under the title."""
    handles = [Line2D([], [], label=line.label, **line.style) for line in lines]
    name_lines(figure, figure.axes[0], LEGEND_TOP, len(lines), handles=handles)
