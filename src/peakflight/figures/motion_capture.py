"""A flight as motion capture saw it, beside its plan: path, derivatives and error."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from peakflight.figures.canvas import TEXT, name_lines, new_figure, write_title
from peakflight.figures.course import FlownPath, draw_views, paper_height
from peakflight.figures.derivatives import (
    HEADROOM,
    TOP,
    add_panels,
    draw_borders,
    number_legs,
    panels_height,
    scale_panel,
)
from peakflight.figures.flights import LEGEND_ROW, LEGEND_TOP
from peakflight.figures.paths import SIDE_WIDTH
from peakflight.limits import KINDS
from peakflight.palette import INK
from peakflight.result import Plan

if TYPE_CHECKING:
    from peakflight.flight.motion_capture import FlightAnalysis

PLANNED: dict[str, Any] = {"color": "#e08a00", "linestyle": (0, (5, 1.5)), "linewidth": 1.2}
"""Drawn over what was flown, so that where they are one both are seen."""
FLOWN: dict[str, Any] = {"color": "#0a4a3a", "linestyle": "-", "linewidth": 0.9}
CENTIMETRES = 100.0
"""In a metre."""


def motion_capture_figures(
    analysis: "FlightAnalysis", plan: Plan, *, title: str
) -> dict[str, Figure]:
    """Draw the path, what is limited, and the distance from the plan.

    Parameters
    ----------
    title
        Of what, for the headlines.
    """
    return {
        "path": _path(analysis, plan, title),
        "derivatives": _derivatives(analysis, plan, title),
        "error": _error(analysis, plan, title),
    }


def _path(analysis: "FlightAnalysis", plan: Plan, title: str) -> Figure:
    """Both paths from above and from the side."""
    middles = [0.5 * (begin + end) for begin, end in analysis.gaps]
    parts = np.split(analysis.positions, np.searchsorted(analysis.times, middles))
    lines = [np.stack((part[:-1], part[1:]), axis=1) for part in parts if len(part) > 1]
    paths = [FlownPath(ends, np.zeros(len(ends)), FLOWN) for ends in lines]
    paths.append(FlownPath.of(plan.trajectory, PLANNED))
    waypoints = plan.problem.waypoints
    height = paper_height(paths, waypoints)
    figure = new_figure(height + 0.6 + LEGEND_TOP + LEGEND_ROW)
    write_title(figure, f"{title}: path", 0.12)
    draw_views(figure, paths, waypoints, height, side_width=SIDE_WIDTH)
    _name(figure, "planned", "flown")
    return figure


def _derivatives(analysis: "FlightAnalysis", plan: Plan, title: str) -> Figure:
    """What is limited against time, flown and planned through the same filter."""
    kinds = [kind for kind in KINDS if kind.name in analysis.curves]
    figure = new_figure(panels_height(len(kinds)) + TOP + LEGEND_ROW)
    write_title(figure, f"{title}: what is limited, at {analysis.rate:.4g} Hz", 0.12)
    panels = add_panels(figure, len(kinds))
    for kind, axes in zip(kinds, panels, strict=True):
        curve = analysis.curves[kind.name]
        both = (kind.shown(curve.flown), FLOWN), (kind.shown(curve.planned), PLANNED)
        for values, style in both:
            axes.plot(curve.times, values, zorder=3, **style)
        known = np.concatenate([values[np.isfinite(values)] for values, _ in both])
        scale_panel(
            axes,
            kind,
            getattr(plan.problem.limits, kind.name),
            times=(0.0, analysis.duration),
            highest=float(known.max(initial=0.0)),
        )
        draw_borders(axes, _borders(plan))
    number_legs(panels[0], _borders(plan))
    _name(figure, "planned, through the same filter", "flown")
    return figure


def _error(analysis: "FlightAnalysis", plan: Plan, title: str) -> Figure:
    """The distance from the plan against time."""
    figure = new_figure(panels_height(1) + TOP)
    write_title(
        figure,
        f"{title}: {CENTIMETRES * analysis.rms_error:.1f} cm off the plan (RMS), "
        f"{CENTIMETRES * analysis.top_error:.1f} cm at most",
        0.12,
    )
    (axes,) = add_panels(figure, 1)
    errors = CENTIMETRES * analysis.errors
    times, errors = _with_gaps(analysis, errors)
    axes.plot(times, errors, zorder=3, **FLOWN)
    top = max(float(np.nanmax(errors)), 1e-9)
    axes.set(xlim=(0.0, analysis.duration), ylim=(0.0, HEADROOM * top))
    axes.locator_params(axis="y", nbins=4)
    axes.set_ylabel("error\n(cm)", fontsize=TEXT, color=INK)
    axes.yaxis.set_label_coords(-0.08, 0.5)
    draw_borders(axes, _borders(plan))
    number_legs(axes, _borders(plan))
    return figure


def _borders(plan: Plan) -> np.ndarray:
    """(legs+1,) s since the plan began, of the waypoints."""
    return plan.waypoint_times - plan.trajectory.start_time


def _with_gaps(analysis: "FlightAnalysis", values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and values with a NaN in each gap, at which a line is broken."""
    middles = [0.5 * (begin + end) for begin, end in analysis.gaps]
    places = np.searchsorted(analysis.times, middles)
    return np.insert(analysis.times, places, middles), np.insert(values, places, np.nan)


def _name(figure: Figure, *names: str) -> None:
    styles = (PLANNED, FLOWN)
    handles = [
        Line2D([], [], label=name, **style) for name, style in zip(names, styles, strict=True)
    ]
    name_lines(figure, figure.axes[0], LEGEND_TOP, len(names), handles=handles)
