"""What is limited, against time, with the limits."""

import textwrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from peakflight.curves import sampled_curves, shown_kinds
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
from peakflight.labelling import even_step
from peakflight.limits import LimitKind, plain_unit
from peakflight.palette import FAINT, INK, LIMIT, SOFT
from peakflight.result import BINDING, Plan

PANEL = 1.05
"""Height of a panel, in."""
GAP = 0.13
"""Between panels, in."""
LEFT, RIGHT, BOTTOM, TOP = 0.92, 0.85, 0.45, 0.55
"""Margins, in."""
HEADROOM = 1.15
"""Height of a panel's axis, relative to what it shows."""
KEY = "○ limit binds   × limit exceeded"  # noqa: RUF001
FAR = 4.0
"""A limit that is further above the curve than this is named, but not drawn to scale."""
MOST_BORDERS = 60
"""With more legs, only the borders of every second, fifth, ... are drawn."""
MOST_NUMBERS = 40
"""With more legs, only every second, fifth, ... is numbered."""


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
            kappa = plan.report.peaks.get(kind.name, np.zeros(len(trajectory)))
            _mark_peaks(axes, times, values, kappa, least=kind.name.startswith("least"))
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
    unit = plain_unit(kind.unit)
    if kind.unit == "rad":
        unit, limit = "°", None if limit is None else float(np.degrees(limit))
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
    axes: Axes, times: np.ndarray, values: np.ndarray, kappa: np.ndarray, *, least: bool
) -> None:
    rows = np.arange(len(values))
    columns = values.argmin(axis=1) if least else values.argmax(axis=1)
    above = kappa > 1.0
    for chosen, marker, colour in (
        ((kappa >= BINDING) & ~above, "o", "white"),
        (above, "x", LIMIT),
    ):
        at = rows[chosen], columns[chosen]
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
    inner = borders[1:-1]
    inner = inner[:: even_step(len(inner), MOST_BORDERS)]
    lines = [[(time, 0.0), (time, 1.0)] for time in inner]
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
    legs = len(borders) - 1
    points = POINTS * (WIDTH - LEFT - RIGHT) / (borders[-1] - borders[0])
    free = -np.inf
    transform = axes.get_xaxis_transform()
    for leg in range(0, legs, even_step(legs, MOST_NUMBERS)):
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
