"""What the rotors and the gyroscope of a vehicle see of a plan, against time, with their ranges."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peakflight.curves import inner_times
from peakflight.errors import InvalidProblem
from peakflight.figures.canvas import (
    COLOURS,
    WIDTH,
    draw_limit,
    name_lines,
    new_figure,
    span,
    write_headline,
    write_limit,
    write_note,
)
from peakflight.figures.derivatives import (
    HEADROOM,
    TOP,
    add_panels,
    draw_borders,
    number_legs,
    panels_height,
    scale_panel,
)
from peakflight.limits import LimitKind
from peakflight.palette import INK
from peakflight.result import Plan

THRUST = LimitKind("rotor_thrust", "N", 4, "rotor thrust")
ACROSS = LimitKind("rate_across", "rad/s", 3, "body rate across z")
ABOUT = LimitKind("rate_about", "rad/s", 3, "body rate about z")
"""Panels, as if each were a kind of limit."""
STYLES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (2, 1.2)), (0, (5, 1.2, 1, 1.2)))
"""Of the rotors, so that they can be told apart in grey."""
LEGEND = 0.12
"""Height of the line that names the rotors, in."""


def rotors_figure(plan: Plan) -> Figure:
    """Draw the thrust of each rotor, and body rates, of a plan that has a vehicle.

    Dashed in red is what the vehicle can do, whether the plan is limited to it or not. Legs are
    numbered from 0 on top. Yaw is that of the flight files.

    Raises
    ------
    InvalidProblem
        If the plan has no vehicle.
    """
    vehicle = plan.vehicle
    if vehicle is None:
        raise InvalidProblem("the plan has no vehicle, so nothing is known of its rotors")
    from peakflight.flatness import planned_states

    times = inner_times(plan.trajectory).ravel()
    states = planned_states(plan, times)
    least, most = map(_rounded, vehicle.rotor_thrust)
    across, about = map(_rounded, vehicle.body_rate) if vehicle.body_rate else (None, None)
    figure = new_figure(panels_height(3) + LEGEND + TOP)
    write_headline(figure, plan, 0.12)
    turning = "yaw 0" if plan.problem.yaw is None else "the yaw of the plan"
    write_note(figure, f"{vehicle.name}, {turning}", WIDTH - 0.12)
    panels = add_panels(figure, 3)
    curves = (
        (THRUST, most, states.rotor_thrust),
        (ACROSS, across, np.linalg.norm(states.body_rate[:, :2], axis=1)),
        (ABOUT, about, np.abs(states.body_rate[:, 2])),
    )
    for axes, (kind, limit, values) in zip(panels, curves, strict=True):
        scale_panel(axes, kind, limit, times=span(times), highest=float(values.max()))
        draw_borders(axes, plan.waypoint_times)
        if kind is not THRUST:
            axes.plot(times, values, color=INK, linewidth=1.0, zorder=3)
    _draw_rotors(panels[0], times, states.rotor_thrust, least)
    name_lines(figure, panels[0], 0.28, len(STYLES))
    number_legs(panels[0], plan.waypoint_times)
    return figure


def _rounded(value: float) -> float:
    """As it is written beside a limit, for which there is little room."""
    return float(f"{value:.4g}")


def _draw_rotors(axes: Axes, times: np.ndarray, thrusts: np.ndarray, least: float) -> None:
    """Draw (n, 4) thrusts and the least that a rotor has."""
    for rotor, style in enumerate(STYLES):
        axes.plot(
            times,
            thrusts[:, rotor],
            color=COLOURS(rotor / (len(STYLES) - 1)),
            linestyle=style,
            linewidth=1.1,
            zorder=3,
            label=f"rotor {rotor + 1}",
        )
    lowest = min(float(thrusts.min()), 0.0)
    axes.set_ylim(bottom=HEADROOM * lowest)
    draw_limit(axes, least)
    write_limit(axes, least, f"{least:g} N")
