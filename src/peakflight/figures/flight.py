"""A flight in simulation: its path beside the plan, its error and its rotors against time."""

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peakflight.figures.canvas import (
    COLOURS,
    TEXT,
    WIDTH,
    add_axes,
    draw_limit,
    name_lines,
    new_figure,
    write_limit,
    write_note,
    write_title,
)
from peakflight.figures.course import FlownPath, draw_views, paper_height
from peakflight.figures.rotors import STYLES
from peakflight.palette import FAINT, INK, LIMIT, SOFT
from peakflight.result import Plan

if TYPE_CHECKING:
    from peakflight.flight import Flight, SpreadResult

PLANNED: dict[str, Any] = {"color": SOFT, "linestyle": (0, (4, 2)), "linewidth": 1.2}
FLOWN: dict[str, Any] = {"color": "#2f7fd6", "linestyle": "-", "linewidth": 1.6}
"""How the planned and the flown path are drawn."""
CRASHED: dict[str, Any] = {
    "color": LIMIT,
    "marker": "X",
    "markersize": 8.0,
    "linestyle": "none",
    "zorder": 6,
}
LINES = 1500
"""About how many straight lines a path is drawn with."""
PANEL, GAP = 1.05, 0.16
LEFT, RIGHT, BOTTOM, TOP = 0.82, 0.85, 0.45, 0.36
"""Height of a panel, room between panels, and margins, in."""
HEADROOM = 1.12
"""Height of an axis over what it shows."""
BINS = 30
"""Of the histogram."""


def flight_path_figure(flight: "Flight", plan: Plan) -> Figure:
    """Draw the path flown and the planned one, from above and from the side."""
    marks = plan.problem.waypoints
    paths = [FlownPath.of(plan.trajectory, PLANNED), _path(flight.position)]
    height = paper_height(paths, marks)
    figure = new_figure(height + 0.85)
    write_title(figure, _headline(flight), 0.12)
    draw_views(figure, paths, marks, height, side_width=WIDTH - 3.5)
    above = figure.axes[0]
    above.plot([], [], label="planned", **PLANNED)
    above.plot([], [], label="flown", **FLOWN)
    if flight.crash is not None:
        above.plot(*flight.position[-1, :2], label="crash", **CRASHED)
    name_lines(figure, above, 0.28, 3)
    return figure


def flight_error_figure(flight: "Flight") -> Figure:
    """Draw the distance from the plan, and the thrust of each rotor with its range, against time.

    A dotted line is where the plan ends and hovering begins.
    """
    figure = new_figure(BOTTOM + 2.0 * PANEL + 1.6 * GAP + TOP)
    write_title(figure, _headline(flight), 0.12)
    write_note(figure, f"RMS {100.0 * flight.rms_error:.2f} cm", WIDTH - 0.12)
    width = WIDTH - LEFT - RIGHT
    rotors = add_axes(figure, LEFT, BOTTOM, width, PANEL)
    errors = add_axes(figure, LEFT, BOTTOM + PANEL + 1.6 * GAP, width, PANEL)
    errors.plot(flight.times, 100.0 * flight.errors, color=INK, linewidth=1.0, zorder=3)
    _label(errors, "error (cm)")
    errors.set_ylim(0.0, HEADROOM * max(100.0 * float(flight.errors.max()), 1e-3))
    least, most = flight.vehicle.rotor_thrust
    for rotor, style in enumerate(STYLES):
        rotors.plot(
            flight.times,
            flight.rotor_thrusts[:, rotor],
            color=COLOURS(rotor / (len(STYLES) - 1)),
            linestyle=style,
            linewidth=1.0,
            zorder=3,
            label=f"rotor {rotor + 1}",
        )
    for value in (least, most):
        draw_limit(rotors, value)
        write_limit(rotors, value, f"{value:.4g} N")
    _label(rotors, "rotor thrust (N)")
    rotors.set_ylim(0.0, HEADROOM * most)
    rotors.set_xlabel("time (s)", fontsize=TEXT, color=INK)
    errors.tick_params(labelbottom=False)
    for axes in (errors, rotors):
        axes.set_xlim(0.0, max(float(flight.times[-1]), 1e-9))
        axes.axvline(flight.duration, color=SOFT, linestyle=":", linewidth=0.8)
    rotors.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=len(STYLES),
        frameon=False,
        fontsize=TEXT,
        labelcolor=INK,
        borderaxespad=0.1,
        borderpad=0.0,
        handlelength=2.6,
    )
    return figure


def spread_figure(spread: "SpreadResult") -> Figure:
    """Draw how often each RMS error came, of the vehicles that did not crash."""
    figure = new_figure(2.3)
    low, high = spread.interval
    write_title(
        figure,
        f"{spread.share:.1%} of {len(spread.flights)} vehicles within {100.0 * spread.error:g} cm "
        f"(95 % confidence: {low:.1%} to {high:.1%})",
        0.12,
    )
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - 0.3, 2.3 - BOTTOM - TOP)
    rms = 100.0 * spread.rms_errors
    if len(rms):
        axes.hist(rms, bins=BINS, color="#2f7fd6", edgecolor="white", linewidth=0.4, zorder=2)
    crashed = len(spread.flights) - len(rms)
    if crashed:
        write_note(figure, f"{crashed} crashed", WIDTH - 0.12)
    axes.axvline(100.0 * spread.error, color=LIMIT, linestyle=(0, (5, 2.5)), linewidth=1.0)
    axes.grid(axis="y", color=FAINT, linewidth=0.6, zorder=0)
    axes.set_axisbelow(True)
    axes.set_xlim(left=0.0)
    axes.set_xlabel("RMS error (cm)", fontsize=TEXT, color=INK)
    _label(axes, "vehicles")
    return figure


def _path(points: np.ndarray) -> FlownPath:
    chosen = points[:: max(1, len(points) // LINES)]
    if len(chosen) < 2:
        chosen = np.repeat(points[:1], 2, axis=0)
    ends = np.stack((chosen[:-1], chosen[1:]), axis=1)
    return FlownPath(ends, np.zeros(len(ends)), FLOWN)


def _headline(flight: "Flight") -> str:
    crash = flight.crash
    end = "flew" if crash is None else f"crashed at {crash.time:.2f} s, {crash.cause}"
    return f"{flight.vehicle.name}, {flight.controller} controller: {end}"


def _label(axes: Axes, text: str) -> None:
    axes.set_ylabel(text, fontsize=TEXT, color=INK)
