"""How long each leg takes: on the way to the plan, or in the end."""

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from peakflight.figures.canvas import (
    COLOURS,
    POINTS,
    TEXT,
    WIDTH,
    add_axes,
    new_figure,
    seconds,
    write_headline,
    write_note,
)
from peakflight.labelling import even_step
from peakflight.palette import FAINT, INK, LIMIT
from peakflight.result import BINDING, Plan
from peakflight.yaw import ALL_LABELS

LEFT, RIGHT, BOTTOM = 0.75, 1.1, 0.45
"""Margins, in."""
LINES, TOTAL, BARS = 2.3, 0.85, 2.2
"""Heights of the panels, in."""
LOGARITHMIC = 30.0
"""Times that are spread more than this are drawn on a logarithmic axis."""
ROOM = 0.08
"""Paper left free above and below lines, relative to their range."""
MOST_NAMED = 12
"""With more legs, lines are told apart by colour alone, with a scale."""
MOST_POINTS = 20_000
"""With more iterations times legs, iterations are left out of the picture."""
FEWEST_ROWS = 20
"""Iterations that are drawn in any case."""
MARKS = 8
"""About how many markers a line has."""
MARKERS = "os^vD<>XPph*"
MOST_HATCHED = 60
"""With more bars, hatches would only darken them."""
MOST_WRITTEN = 16
"""With more bars, their heights are not written on them."""
MOST_TICKS = 25
"""With more bars, only every second, fifth, ... is numbered."""
BAR_WIDTH = 0.8
"""Relative to the distance between bars."""
LEGEND_COLUMNS = 5
SHADES = (1.0, 0.45, 0.75, 0.1, 0.3, 0.6, 0.9, 0.2, 0.55, 0.0)
"""Colours of the kinds of limit in the order of `KINDS`: neighbours differ in lightness."""
HATCHES = ("", "////", "....", "xxxx", r"\\\\", "++", "oo", "**", "--", "||")


def segment_times_figure(plan: Plan, *, title: str | None = None) -> Figure:
    """Draw the time of each leg by iteration, the total above; without a history, the final times.

    The bars of final times show the limit that binds each segment (kappa within 0.1 % of 1). Legs
    are numbered from 0; where a leg has several pieces, its line is their sum and its bar their
    pile. The headline is `title`, or says total time, method and proof.
    """
    iterations, times = _leg_history(plan)
    if len(iterations) > 1:
        return _lines(plan, iterations, times, title)
    return _final_times(plan, title)


def _leg_history(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """(I,) iterations and their (I, legs) s, thinned; those that went astray are left out."""
    legs = len(plan.pieces)
    times = np.empty((0, legs)) if plan.history is None else plan.history.segment_times
    if times.shape[1] == sum(plan.pieces):
        first = np.cumsum((0, *plan.pieces[:-1]))
        times = np.asarray(np.add.reduceat(times, first, axis=1))
    elif times.shape[1] != legs:
        times = np.empty((0, legs))
    sound = np.flatnonzero((np.isfinite(times) & (times > 0.0)).all(axis=1))
    most = max(FEWEST_ROWS, MOST_POINTS // legs)
    if len(sound) > most:
        sound = sound[np.linspace(0, len(sound) - 1, most).round().astype(int)]
    return sound, times[sound]


def _lines(plan: Plan, iterations: np.ndarray, times: np.ndarray, title: str | None) -> Figure:
    figure = new_figure(BOTTOM + LINES + 0.15 + TOTAL + 0.4)
    write_headline(figure, plan, 0.12, title)
    width = WIDTH - LEFT - RIGHT
    axes = add_axes(figure, LEFT, BOTTOM, width, LINES)
    if times.shape[1] <= MOST_NAMED:
        _draw_named(axes, iterations, times)
    else:
        _draw_coloured(figure, axes, iterations, times)
    _scale(axes, LINES, iterations, times)
    axes.set_xlabel("iteration", fontsize=TEXT, color=INK)
    axes.set_ylabel("leg time (s)", fontsize=TEXT, color=INK)
    total = add_axes(figure, LEFT, BOTTOM + LINES + 0.15, width, TOTAL)
    total.tick_params(labelbottom=False)
    total.plot(iterations, times.sum(axis=1), color=INK, linewidth=1.2)
    total.axhline(plan.duration, color=LIMIT, linestyle=(0, (5, 2.5)), linewidth=1.0, zorder=1)
    _scale(total, TOTAL, iterations, np.append(times.sum(axis=1), plan.duration), from_zero=False)
    total.set_ylabel("total (s)", fontsize=TEXT, color=INK)
    total.text(
        1.012,
        plan.duration,
        f"plan {seconds(plan.duration)}",
        transform=total.get_yaxis_transform(),
        va="center",
        fontsize=TEXT,
        color=LIMIT,
    )
    for panel in (axes, total):
        panel.yaxis.set_label_coords(-0.09, 0.5)
    return figure


def _draw_named(axes: Axes, iterations: np.ndarray, times: np.ndarray) -> None:
    legs = times.shape[1]
    every = max(1, len(iterations) // MARKS)
    for leg in range(legs):
        axes.plot(
            iterations,
            times[:, leg],
            color=COLOURS(1.0 - leg / max(legs - 1, 1)),
            linewidth=1.1,
            marker=MARKERS[leg],
            markersize=4.0,
            markevery=((leg * every) // legs, every),
            label=str(leg),
        )
    axes.legend(
        title="leg",
        loc="center left",
        bbox_to_anchor=(1.02, 0.5),
        frameon=False,
        fontsize=TEXT,
        title_fontsize=TEXT,
        labelspacing=0.25,
        borderaxespad=0.0,
    )


def _draw_coloured(figure: Figure, axes: Axes, iterations: np.ndarray, times: np.ndarray) -> None:
    legs = times.shape[1]
    lines = LineCollection(
        [np.column_stack((iterations, column)) for column in times.T],
        array=np.arange(legs),
        norm=Normalize(0, legs - 1),
        cmap=COLOURS.reversed(),
        linewidths=0.9 if legs <= 200 else 0.4,
    )
    axes.add_collection(lines, autolim=False)
    box = add_axes(figure, WIDTH - RIGHT + 0.15, BOTTOM, 0.1, LINES)
    bar = figure.colorbar(lines, cax=box, ticks=MaxNLocator(6, integer=True))
    bar.outline.set_visible(False)
    bar.set_label("leg", fontsize=TEXT, color=INK)


def _scale(
    axes: Axes,
    height: float,
    iterations: np.ndarray,
    times: np.ndarray,
    *,
    from_zero: bool = True,
) -> None:
    """Choose limits and ticks of axes `height` inches high; logarithmic if times are spread far."""
    axes.set_xlim(iterations[0], iterations[-1])
    axes.xaxis.set_major_locator(MaxNLocator(8, integer=True))
    low, high = float(times.min()), float(times.max())
    if high > LOGARITHMIC * low:
        axes.set_yscale("log")
        decade = POINTS * height / math.log10(1.44 * high / low)
        subs = (1.0, 2.0, 5.0) if math.log10(2.0) * decade > 1.5 * TEXT else (1.0,)
        most = int(POINTS * height / (1.5 * TEXT))
        axes.yaxis.set_major_locator(LogLocator(subs=subs, numticks=most))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylim(low / 1.2, high * 1.2)
    else:
        axes.locator_params(axis="y", nbins=5)
        room = ROOM * max(high - low, 0.01 * high)
        axes.set_ylim(0.0 if from_zero else low - room, high + room)


def _final_times(plan: Plan, title: str | None) -> Figure:
    binding = _binding(plan)
    rows = -(-len(binding) // LEGEND_COLUMNS)
    figure = new_figure(BOTTOM + BARS + 0.4 + 0.18 * rows)
    write_headline(figure, plan, 0.12, title)
    write_note(figure, "limit that binds each segment", WIDTH - 0.12)
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - 0.15, BARS)
    legs = len(plan.pieces)
    bars, heights = _bars(plan)
    handles = []
    for name, chosen in binding.items():
        style = _bar_style(name, legs)
        axes.add_collection(PolyCollection(list(bars[chosen]), **style), autolim=False)
        label = ALL_LABELS.get(name, name)
        handles.append(Patch(label=label if name else "no limit binds", **style))
    if legs <= MOST_WRITTEN:
        for leg, height in enumerate(heights):
            text = f"{height:#.3g}".rstrip(".")
            axes.text(leg, height, text, ha="center", va="bottom", fontsize=TEXT, color=INK)
    axes.legend(
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.02),
        ncols=LEGEND_COLUMNS,
        frameon=False,
        fontsize=TEXT,
        borderaxespad=0.0,
        borderpad=0.0,
        labelspacing=0.25,
    )
    axes.set(xlim=(-0.7, legs - 0.3), ylim=(0.0, 1.12 * float(heights.max())))
    axes.set_xticks(range(0, legs, even_step(legs, MOST_TICKS)))
    axes.locator_params(axis="y", nbins=5)
    axes.set_xlabel("leg", fontsize=TEXT, color=INK)
    axes.set_ylabel("leg time (s)", fontsize=TEXT, color=INK)
    axes.yaxis.set_label_coords(-0.065, 0.5)
    return figure


def _bars(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """(K, 4, 2) corners of the bar of each segment, piled up by leg; (legs,) s, height of piles."""
    pieces = np.array(plan.pieces)
    leg = np.repeat(np.arange(len(pieces)), pieces)
    first = np.cumsum(pieces) - pieces
    ends = np.cumsum(plan.segment_times)
    base = (ends - plan.segment_times)[first]
    top = ends - base[leg]
    low = top - plan.segment_times
    half = BAR_WIDTH / 2.0 if len(pieces) <= MOST_HATCHED else 0.5
    x = np.stack((leg - half, leg + half, leg + half, leg - half), axis=1)
    y = np.stack((low, low, top, top), axis=1)
    return np.stack((x, y), axis=2), ends[first + pieces - 1] - base


def _binding(plan: Plan) -> dict[str, np.ndarray]:
    """Name of a limit to (K,): the segments that it binds most; the empty name for the rest."""
    names = list(plan.report.peaks)
    rest = np.ones(len(plan.trajectory), dtype=bool)
    binding = {}
    if names:
        kappa = np.array([plan.report.peaks[name] for name in names])
        rest = ~(kappa.max(axis=0) >= BINDING)
        most = kappa.argmax(axis=0)
        binding = {name: (most == row) & ~rest for row, name in enumerate(names)}
    return {name: chosen for name, chosen in {**binding, "": rest}.items() if chosen.any()}


def _bar_style(name: str, legs: int) -> dict[str, Any]:
    """Colour and hatch of a kind of limit: each can be told by either."""
    edge: dict[str, Any] = {"edgecolor": "none"}
    if legs <= MOST_HATCHED:
        edge = {"edgecolor": "white", "linewidth": 0.6}
    if not name:
        return {"facecolor": FAINT, **edge}
    number = list(ALL_LABELS).index(name) if name in ALL_LABELS else len(ALL_LABELS)
    return {
        "facecolor": COLOURS(SHADES[number % len(SHADES)]),
        "hatch": HATCHES[number % len(HATCHES)] if legs <= MOST_HATCHED else None,
        **edge,
    }
