"""How long each leg takes in several flights."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from peakflight.figures.canvas import TEXT, WIDTH, add_axes, new_figure, write_title
from peakflight.figures.flights import LEGEND_TOP, Flight, legend_height, write_legend
from peakflight.labelling import even_step
from peakflight.palette import INK

LEFT, RIGHT, BOTTOM, ABOVE = 0.75, 0.15, 0.45, 0.14
"""Margins, in."""
HEIGHT = 2.2
"""Of the panel, in."""
GROUP = 0.76
"""Width of the bars of a leg together, relative to the distance between legs."""
MOST_BARS = 100
"""More are drawn as steps."""
MOST_TICKS = 25
"""With more legs, only every second, fifth, ... is numbered."""


def leg_times_figure(flights: Sequence[Flight], *, title: str) -> Figure:
    """Draw the time of each leg, those of one leg side by side; of many legs, as steps.

    Legs are numbered from 0; the pieces of a leg count together.
    """
    times = np.array([flight.leg_times for flight in flights])
    legs = times.shape[1]
    figure = new_figure(BOTTOM + HEIGHT + ABOVE + LEGEND_TOP + legend_height(flights))
    write_title(figure, title, 0.12)
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - RIGHT, HEIGHT)
    as_bars = times.size <= MOST_BARS
    if as_bars:
        _draw_bars(axes, flights, times)
    else:
        for flight, row in zip(flights, times, strict=True):
            axes.stairs(row, np.arange(legs + 1) - 0.5, baseline=None, **flight.line_style)
    axes.set(xlim=(-0.6, legs - 0.4), ylim=(0.0, 1.08 * float(times.max())))
    axes.set_xticks(range(0, legs, even_step(legs, MOST_TICKS)))
    axes.yaxis.set_major_locator(MaxNLocator(7, steps=[1, 2, 5, 10]))
    axes.set_xlabel("leg", fontsize=TEXT, color=INK)
    axes.set_ylabel("leg time (s)", fontsize=TEXT, color=INK)
    axes.yaxis.set_label_coords(-0.065, 0.5)
    write_legend(figure, axes, flights, as_bars=as_bars)
    return figure


def _draw_bars(axes: Axes, flights: Sequence[Flight], times: np.ndarray) -> None:
    width = GROUP / len(flights)
    for place, (flight, row) in enumerate(zip(flights, times, strict=True)):
        middles = np.arange(len(row)) + (place + 0.5) * width - 0.5 * GROUP
        axes.bar(middles, row, 0.9 * width, color=flight.colour, linewidth=0.0)
