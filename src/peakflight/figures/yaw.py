"""Yaw, and its rate and acceleration or those of the body about z, against time and limits."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peakflight.figures.canvas import (
    TEXT,
    WIDTH,
    add_axes,
    draw_limit,
    new_figure,
    span,
    write_headline,
    write_limit,
    write_note,
)
from peakflight.figures.derivatives import (
    BOTTOM,
    GAP,
    HEADROOM,
    LEFT,
    RIGHT,
    TOP,
    draw_borders,
    number_legs,
)
from peakflight.palette import INK, SOFT
from peakflight.result import Plan
from peakflight.twist import turning_about_z

HEIGHTS = (1.7, 1.05, 1.05)
"""Of the panels from the top, in."""
SAMPLES = 4000
"""Points of a curve."""
FOLLOWED = "#7fa8d1"
"""The direction that is followed: lighter than the yaw also in grey."""
NOTES = {
    "fixed": "fixed",
    "waypoints": "○ asked for at waypoints",
    "velocity": "light: the direction of the velocity",
    "point": "light: the direction of the point",
    "free": "free: the vehicle does not turn about its thrust",
}
"""What a policy is, on top of the figure."""


def yaw_figure(plan: Plan) -> Figure:
    """Draw the yaw with what is asked of it, and what is limited: its own rate or the body's.

    Legs are numbered from 0 on top; dashed lines are limits.

    Raises
    ------
    ValueError
        If the plan has no yaw motion.
    """
    if plan.yaw_motion is None or plan.problem.heading is None:
        raise ValueError("the plan has no yaw motion")
    heading = plan.problem.heading
    figure = new_figure(BOTTOM + sum(HEIGHTS) + 2 * GAP + TOP)
    write_headline(figure, plan, 0.12)
    write_note(figure, NOTES[heading.policy], WIDTH - 0.12)
    times = np.linspace(plan.trajectory.start_time, plan.trajectory.end_time, SAMPLES)
    bottom = BOTTOM + sum(HEIGHTS) + 2 * GAP
    panels: list[Axes] = []
    for height in HEIGHTS:
        bottom -= height
        axes = add_axes(figure, LEFT, bottom, WIDTH - LEFT - RIGHT, height)
        axes.set_xlim(*span(times))
        axes.tick_params(labelbottom=len(panels) == len(HEIGHTS) - 1)
        draw_borders(axes, plan.waypoint_times)
        panels.append(axes)
        bottom -= GAP
    panels[-1].set_xlabel("time (s)", fontsize=TEXT, color=INK)
    number_legs(panels[0], plan.waypoint_times)
    _draw_yaw(panels[0], plan, times)
    if heading.is_about_body:
        curves = turning_about_z(plan.trajectory, plan.yaw_motion, times, plan.problem.airframe)
    else:
        curves = plan.yaw(times, derivative=1), plan.yaw(times, derivative=2)
    for kind, axes, values in zip(heading.kinds, panels[1:], curves, strict=True):
        unit = kind.shown_unit
        _name(axes, f"{kind.label.replace(' about z', chr(10) + 'about z')}\n({unit})")
        axes.plot(times, values, color=INK, linewidth=1.0, zorder=3)
        _draw_limit(axes, float(np.abs(values).max()), heading.limits.get(kind), unit)
    return figure


def _draw_yaw(axes: Axes, plan: Plan, times: np.ndarray) -> None:
    """Draw the yaw in degrees, over what it follows or should pass."""
    heading, motion = plan.problem.heading, plan.yaw_motion
    assert heading is not None
    assert motion is not None
    if heading.follows:
        from peakflight.yaw_motion import followed, sample_times

        at = motion.start_time + sample_times(motion.segment_times)
        target, _ = followed(heading, plan.trajectory, at)
        turns = np.round((float(plan.yaw(at[0])) - target[0]) / (2.0 * np.pi))
        target = np.degrees(target + 2.0 * np.pi * turns)
        axes.plot(at, target, color=FOLLOWED, linewidth=2.4, zorder=2)
    axes.plot(times, np.degrees(plan.yaw(times)), color=INK, linewidth=1.0, zorder=3)
    if heading.angles is not None:
        passed = np.clip(plan.waypoint_times, motion.start_time, motion.end_time)
        axes.plot(
            passed,
            np.degrees(plan.yaw(passed)),
            linestyle="none",
            marker="o",
            markersize=3.6,
            markerfacecolor="white",
            markeredgecolor=INK,
            markeredgewidth=0.9,
            zorder=4,
            clip_on=False,
        )
    low, high = axes.get_ylim()
    if high - low < 10.0:
        axes.set_ylim(0.5 * (low + high) - 5.0, 0.5 * (low + high) + 5.0)
    axes.locator_params(axis="y", nbins=5, steps=[1, 1.5, 3, 4.5, 6, 9, 10])
    _name(axes, "yaw (°)")


def _draw_limit(axes: Axes, highest: float, limit: float | None, unit: str) -> None:
    """Draw a limit on both sides of zero, name it, and scale the axis to it and the curve."""
    top = max(highest, limit or 0.0, 1e-6)
    axes.axhline(0.0, color=SOFT, linewidth=0.5, zorder=1)
    axes.set_ylim(-HEADROOM * top, HEADROOM * top)
    axes.locator_params(axis="y", nbins=5)
    if limit is None:
        return
    for value in (-limit, limit):
        draw_limit(axes, value)
    write_limit(axes, limit, f"{limit:.6g} {unit}")


def _name(axes: Axes, text: str) -> None:
    axes.set_ylabel(text, fontsize=TEXT, color=INK)
    axes.yaxis.set_label_coords(-0.08, 0.5)
