"""What is limited, against time, of several flights under the same limits."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from peakflight.curves import sampled_curves, shown_kinds
from peakflight.figures.canvas import TEXT, new_figure, write_title
from peakflight.figures.derivatives import add_panels, panels_height, scale_panel
from peakflight.figures.flights import LEGEND_TOP, Flight, legend_height, write_legend
from peakflight.limits import Limits
from peakflight.palette import INK

ABOVE = 0.14
"""Between the legend and the first panel, in."""
CUT = 4.0
"""A panel ends at so many times its limit, and says how high the curves go."""


def overlaid_derivatives_figure(flights: Sequence[Flight], limits: Limits, *, title: str) -> Figure:
    """Draw speed, thrust acceleration, jerk, snap and what else is limited of several flights."""
    curves = [sampled_curves(flight.trajectory, limits.airframe) for flight in flights]
    begin = min(flight.trajectory.start_time for flight in flights)
    end = max(flight.trajectory.end_time for flight in flights)
    kinds = shown_kinds(limits, curves[0][1])
    figure = new_figure(panels_height(len(kinds)) + LEGEND_TOP + legend_height(flights) + ABOVE)
    write_title(figure, title, 0.12)
    panels = add_panels(figure, len(kinds))
    for kind, axes in zip(kinds, panels, strict=True):
        for flight, (times, values) in zip(flights, curves, strict=True):
            axes.plot(times.ravel(), values[kind.name].ravel(), zorder=3, **flight.line_style)
        highest = max(float(values[kind.name].max()) for _, values in curves)
        limit = getattr(limits, kind.name)
        cut = CUT * limit if limit else np.inf
        if kind.unit != "rad" and highest > cut:
            text = f"↑ {float(f'{highest:.3g}'):g}\n   {kind.shown_unit}"
            axes.text(
                1.012, 1.0, text, transform=axes.transAxes, va="top", fontsize=TEXT, color=INK
            )
            highest = cut
        scale_panel(axes, kind, limit, times=(begin, end), highest=highest)
    write_legend(figure, panels[0], flights)
    return figure
