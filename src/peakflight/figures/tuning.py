"""What tuning found: the time of a flight against the error that it is flown with."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from peakflight.figures.canvas import (
    TEXT,
    WIDTH,
    add_axes,
    name_lines,
    new_figure,
    write_note,
    write_title,
)
from peakflight.palette import FAINT, INK, LIMIT

HEIGHT = 3.1
LEFT, RIGHT, BOTTOM, TOP = 0.66, 0.3, 0.46, 0.62
"""Height of the figure, and margins, in."""
FRONT = "#2f7fd6"
ROOM = 0.06
"""Of an axis, beyond what it shows."""


def front_figure(
    front: Sequence[tuple[float, float]],
    error: float,
    chosen: tuple[float, float] | None,
    *,
    title: str,
    note: str = "",
) -> Figure:
    """Draw the shortest flights that were found within each RMS error, and the plan chosen.

    Parameters
    ----------
    front
        RMS error, m, and duration, s, of each.
    error
        RMS error that was asked for, m.
    chosen
        RMS error and duration of the plan, if there is one.
    title, note
        Above it, to the left and to the right.
    """
    figure = new_figure(HEIGHT)
    write_title(figure, title, 0.12)
    write_note(figure, note, WIDTH - 0.12)
    axes = add_axes(figure, LEFT, BOTTOM, WIDTH - LEFT - RIGHT, HEIGHT - BOTTOM - TOP)
    ordered = sorted(front)
    errors = [100.0 * rms for rms, _ in ordered]
    durations = [duration for _, duration in ordered]
    axes.step(errors, durations, where="post", color=FRONT, linewidth=1.4, zorder=3)
    axes.plot(
        errors,
        durations,
        "o",
        color=FRONT,
        markersize=3.5,
        zorder=4,
        label="best of all plans flown, worst of its vehicles",
    )
    line = axes.axvline(100.0 * error, color=LIMIT, linestyle=(0, (5, 2.5)), linewidth=1.0)
    line.set_label("error asked for")
    if chosen is not None:
        axes.plot(
            [100.0 * chosen[0]],
            [chosen[1]],
            "D",
            color=INK,
            markersize=5.5,
            zorder=5,
            label="the plan, looked at closely",
        )
    axes.margins(ROOM)
    axes.grid(color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("RMS error (cm)", fontsize=TEXT, color=INK)
    axes.set_ylabel("flight time (s)", fontsize=TEXT, color=INK)
    name_lines(figure, axes, 0.3, 3)
    return figure
