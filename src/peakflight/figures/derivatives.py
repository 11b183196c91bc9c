"""What is limited, against time, with the limits."""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from peakflight.curves import peaks, sampled_curves, shown_kinds
from peakflight.figures.canvas import (
    POINTS,
    TEXT,
    WIDTH,
    add_axes,
    draw_limit,
    new_figure,
    span,
    text_width,
    write_headline,
    write_limit,
    write_note,
)
from peakflight.labelling import FAR, drawn_borders, numbered_legs
from peakflight.limits import LimitKind
from peakflight.palette import FAINT, INK, LIMIT, SOFT
from peakflight.result import Plan

PANEL = 1.05
"""Height of a panel, in."""
GAP = 0.13
"""Between panels, in."""
LEFT, RIGHT, BOTTOM, TOP = 0.92, 0.85, 0.45, 0.55
"""Margins, in."""
HEADROOM = 1.15
"""Height of a panel's axis, relative to what it shows."""
KEY = "○ limit binds   × limit exceeded"  # noqa: RUF001


def derivatives_figure(plan: Plan) -> Figure:
    """Draw speed, thrust acceleration, jerk, snap and what else is limited against time.

    Legs are numbered from 0 on top. A ring marks the peak of each segment that a limit binds
    (kappa within 0.1 % of 1), a cross one that exceeds it.
    """
    trajectory, limits = plan.trajectory, plan.problem.limits
    times, curves = sampled_curves(trajectory, limits.airframe)
    kinds = shown_kinds(limits, curves)
    figure = new_figure(panels_height(len(kinds)) + TOP)
    write_headline(figure, plan, 0.12)
    write_note(figure, KEY, WIDTH - 0.12)
    panels = add_panels(figure, len(kinds))
    for kind, axes in zip(kinds, panels, strict=True):
        values = curves[kind.name]
        axes.plot(times.ravel(), values.ravel(), color=INK, linewidth=1.0, zorder=3)
        limit = getattr(limits, kind.name)
        scale_panel(axes, kind, limit, times=span(times), highest=float(values.max()))
        if limit is not None:
            _mark_peaks(axes, plan, kind, times, values)
        draw_borders(axes, plan.waypoint_times)
    number_legs(panels[0], plan.waypoint_times)
    return figure


def panels_height(count: int) -> float:
    """Height of a figure of panels under one another, without what stands above them, in."""
    return BOTTOM + count * PANEL + (count - 1) * GAP


def add_panels(figure: Figure, count: int) -> list[Axes]:
    """Put panels under one another, with one axis of time; the first is on top."""
    panels = []
    for row in range(count):
        bottom = BOTTOM + row * (PANEL + GAP)
        axes = add_axes(figure, LEFT, bottom, WIDTH - LEFT - RIGHT, PANEL)
        axes.tick_params(labelbottom=row == 0)
        panels.append(axes)
    panels[0].set_xlabel("time (s)", fontsize=TEXT, color=INK)
    return panels[::-1]


def scale_panel(
    axes: Axes,
    kind: LimitKind,
    limit: float | None,
    *,
    times: tuple[float, float],
    highest: float,
) -> None:
    """Draw the limit of a panel, name it, and scale the axes to what they show.

    Parameters
    ----------
    times
        First and last, s.
    highest
        Of the curves, in the unit of the kind, but tilt in degrees.
    """
    unit, limit = kind.shown_unit, None if limit is None else kind.shown(limit)
    top = max(highest, 1e-12)
    if limit is not None:
        draw_limit(axes, limit)
        far = limit > FAR * top
        top = top if far else max(top, limit)
        space = "" if unit == "°" else " "
        text = f"{limit:.6g}{space}{unit}" + (" ↑" if far else "")
        write_limit(axes, HEADROOM * top if far else limit, text)
    axes.set(xlim=times, ylim=(0.0, HEADROOM * top))
    axes.locator_params(axis="y", nbins=4)
    label = textwrap.fill(kind.label, 14) + f"\n({unit})"
    axes.set_ylabel(label, fontsize=TEXT, color=INK)
    axes.yaxis.set_label_coords(-0.08, 0.5)


def _mark_peaks(
    axes: Axes, plan: Plan, kind: LimitKind, times: np.ndarray, values: np.ndarray
) -> None:
    segments, places, kappa = peaks(plan, kind, values)
    for chosen, marker, colour in ((kappa <= 1.0, "o", "white"), (kappa > 1.0, "x", LIMIT)):
        at = segments[chosen], places[chosen]
        axes.plot(
            times[at],
            values[at],
            linestyle="none",
            marker=marker,
            markersize=3.6,
            markerfacecolor=colour,
            markeredgecolor=LIMIT,
            markeredgewidth=0.9,
            zorder=4,
            clip_on=False,
        )


def draw_borders(axes: Axes, borders: np.ndarray) -> None:
    """Draw a line at each border of a leg, as many as can be told apart; borders in s."""
    lines = [[(time, 0.0), (time, 1.0)] for time in drawn_borders(borders)]
    axes.add_collection(
        LineCollection(
            lines,
            colors=FAINT,
            linewidths=0.6,
            transform=axes.get_xaxis_transform(),
            zorder=1,
        ),
        autolim=False,
    )


def number_legs(axes: Axes, borders: np.ndarray) -> None:
    """Write the number of each leg above its middle, as far as there is room."""
    points = POINTS * (WIDTH - LEFT - RIGHT) / (borders[-1] - borders[0])
    free = -np.inf
    transform = axes.get_xaxis_transform()
    for leg in numbered_legs(len(borders) - 1):
        text = str(leg)
        middle, half = 0.5 * (borders[leg] + borders[leg + 1]), 0.5 * text_width(text) / points
        if middle - half < free:
            continue
        axes.text(
            middle,
            1.03,
            text,
            transform=transform,
            ha="center",
            va="bottom",
            fontsize=TEXT,
            color=SOFT,
        )
        free = middle + half + 2.0 / points
    axes.text(
        -0.012,
        1.03,
        "leg",
        transform=axes.transAxes,
        ha="right",
        va="bottom",
        fontsize=TEXT,
        color=SOFT,
    )
