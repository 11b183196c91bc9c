"""What all figures share: size, type, ink, and axes placed in inches.

Figures are made without pyplot and without touching matplotlib's settings, so that drawing has no
effect outside the figure. Margins are fixed: a layout engine would draw everything twice.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure

from peakflight.palette import INK, LIMIT, SOFT
from peakflight.result import Plan

WIDTH = 7.16
"""Width of a figure across two columns, in."""
DPI = 130
POINTS = 72.0
"""Points in an inch."""
TEXT = 8.0
"""Size of all lettering but the headline, pt."""
HEADLINE = 9.5
"""Size of the headline, pt."""
LONGEST_TITLE = 80
"""Characters of a headline."""
CHARACTER = 0.6
"""Width of a character, relative to the size of the type; on the safe side for digits."""
POWERS = (-4, 5)
"""Numbers at axes are written without a power of ten between 1e-4 and 1e5."""


def _without_its_palest_end() -> Colormap:
    """Viridis up to 90 %: what follows is too pale for thin lines on white paper."""
    colours = colormaps["viridis"](np.linspace(0.9, 0.0, 256))
    return LinearSegmentedColormap.from_list("peakflight", list(map(tuple, colours)))


COLOURS = _without_its_palest_end()
"""From dark to light, evenly in lightness: it reads the same in grey."""


def new_figure(height: float) -> Figure:
    """Make an empty figure, two columns wide and `height` inches high, ready to be saved."""
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def add_axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Put axes at a place given in inches."""
    across, up = figure.get_size_inches()
    axes = figure.add_axes((left / across, bottom / up, width / across, height / up))
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(labelsize=TEXT, color=SOFT, labelcolor=INK, length=3.0, width=0.6)
    axes.ticklabel_format(scilimits=POWERS)
    for axis in (axes.xaxis, axes.yaxis):
        axis.get_offset_text().set(fontsize=TEXT, color=INK)
    return axes


def write_headline(figure: Figure, plan: Plan, left: float, title: str | None = None) -> None:
    """Write total time, method and proof of a plan, or a title, from `left` inches on."""
    proof = "certified" if plan.feasible else f"not certified ({plan.status})"
    otherwise = f"{seconds(plan.duration)} by method {plan.method}, {proof}"
    write_title(figure, otherwise if title is None else title, left)


def write_title(figure: Figure, text: str, left: float) -> None:
    """Write what a figure shows on top of it, from `left` inches on; its end, if it is too long."""
    across, up = figure.get_size_inches()
    figure.suptitle(
        shortened(text, LONGEST_TITLE),
        x=left / across,
        y=1.0 - 0.07 / up,
        ha="left",
        va="top",
        fontsize=HEADLINE,
        color=INK,
        parse_math=False,  # it may hold a name that a user chose
    )


def write_note(figure: Figure, text: str, right: float) -> None:
    """Write a remark on the line of the headline, up to `right` inches from the left."""
    across, up = figure.get_size_inches()
    x, y = right / across, 1.0 - 0.085 / up
    figure.text(x, y, text, ha="right", va="top", fontsize=TEXT, color=SOFT)


def write(
    axes: Axes, text: str, at: np.ndarray, *, rotation: float = 0.0, on_white: bool = False
) -> None:
    """Write a text of size `TEXT` centred at (2,) `at`, in the units of the axes."""
    paper = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.6}
    axes.text(
        float(at[0]),
        float(at[1]),
        text,
        ha="center",
        va="center" if rotation else "center_baseline",
        rotation=rotation,
        fontsize=TEXT,
        color=INK,
        zorder=5,
        bbox=paper if on_white else None,
    )


def draw_limit(axes: Axes, value: float) -> None:
    """Draw a limit across the axes."""
    axes.axhline(value, color=LIMIT, linestyle=(0, (5, 2.5)), linewidth=1.0, zorder=2)


def write_limit(axes: Axes, height: float, text: str) -> None:
    """Write what a limit is, right of the axes at a height in their units."""
    axes.text(
        1.012,
        height,
        text,
        transform=axes.get_yaxis_transform(),
        ha="left",
        va="center",
        fontsize=TEXT,
        color=LIMIT,
    )


def name_lines(figure: Figure, axes: Axes, top: float, columns: int, **more: Any) -> None:
    """Say which line is which, `top` inches below the upper edge; more: of `Axes.legend`."""
    across, up = figure.get_size_inches()
    style = {"handlelength": 2.6, "columnspacing": 1.4, **more}
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(0.1 / across, 1.0 - top / up),
        bbox_transform=figure.transFigure,
        ncols=columns,
        frameon=False,
        fontsize=TEXT,
        labelcolor=INK,
        borderaxespad=0.0,
        borderpad=0.0,
        **style,
    )


def seconds(duration: float) -> str:
    """Print a time to four figures, with its unit."""
    decimals = max(0, 3 - math.floor(math.log10(duration))) if duration > 0.0 else 0
    return f"{duration:.{min(decimals, 6)}f} s"


def shortened(text: str, most: int) -> str:
    """Leave out the beginning of a text of more than `most` characters."""
    return text if len(text) <= most else "…" + text[1 - most :]


def text_width(text: str) -> float:
    """Estimate how wide a text of size `TEXT` is, pt."""
    return CHARACTER * TEXT * len(text)


def span(values: Sequence[float] | np.ndarray) -> tuple[float, float]:
    """Find the least and the largest value."""
    return float(np.min(values)), float(np.max(values))
