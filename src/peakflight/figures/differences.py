"""A figure of each method on each course, as dots in a line for each course."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator

from peakflight.figures.canvas import (
    POINTS,
    TEXT,
    WIDTH,
    add_axes,
    name_lines,
    new_figure,
    shortened,
    text_width,
    write_title,
)
from peakflight.figures.flights import looks
from peakflight.labelling import even_step
from peakflight.palette import FAINT, INK, SOFT

ROW = 0.23
"""Height of a course, in; less if there are many."""
MOST = 8.0
"""Height of all courses together, in."""
LEGEND, BOTTOM, RIGHT = 0.6, 0.45, 0.2
"""Margins, in."""
LONGEST_NAME = 28
"""Characters of a course's name that are shown: its end, if it is longer."""
MARKERS = "sDv^oP*X"


def differences_figure(
    courses: Sequence[str], values: Mapping[str, Sequence[float | None]], *, title: str, axis: str
) -> Figure:
    """Draw what methods differ by on every course.

    Parameters
    ----------
    courses
        Names, from the top down.
    values
        Name of a method to its figure for each course, percent; None leaves the place empty.
    axis
        What the figures are.
    """
    names = [shortened(name, LONGEST_NAME) for name in courses]
    left = 0.25 + max(map(text_width, names)) / POINTS
    height = min(ROW * max(len(names), 3), MOST)
    figure = new_figure(LEGEND + height + BOTTOM)
    write_title(figure, title, 0.12)
    axes = add_axes(figure, left, BOTTOM, WIDTH - left - RIGHT, height)
    rows = range(len(names))
    size = 5.5 if height / len(names) > 0.5 * ROW else 3.0
    handles = []
    for place, (name, figures) in enumerate(values.items()):
        style: dict[str, Any] = {
            "linestyle": "none",
            "marker": MARKERS[place % len(MARKERS)],
            "markersize": size,
            "markerfacecolor": looks(name)[0],
            "markeredgecolor": "white",
            "markeredgewidth": 0.5,
        }
        known = [
            (value, row) for value, row in zip(figures, rows, strict=True) if value is not None
        ]
        axes.plot(*np.reshape(known, (-1, 2)).T, zorder=3, clip_on=False, **style)
        handles.append(Line2D([], [], label=name, **{**style, "markersize": 5.5}))
    axes.grid(axis="y", color=FAINT, linewidth=0.6)
    axes.axvline(0.0, color=SOFT, linewidth=0.8, zorder=1)
    axes.set_axisbelow(True)
    axes.spines["left"].set_visible(False)
    axes.set_ylim(len(names) - 0.5, -0.5)
    most = max(int(POINTS * height / (1.25 * TEXT)), 1)
    shown = rows[:: even_step(len(names), most)]
    axes.set_yticks(shown, [names[row] for row in shown], parse_math=False)
    axes.tick_params(axis="y", length=0.0)
    axes.margins(x=0.03)
    axes.xaxis.set_major_locator(MaxNLocator(8, steps=[1, 2, 5, 10]))
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:+g} %" if value else "0")
    )
    axes.set_xlabel(axis, fontsize=TEXT, color=INK)
    name_lines(figure, axes, 0.3, len(handles), handles=handles, handletextpad=0.2)
    return figure
