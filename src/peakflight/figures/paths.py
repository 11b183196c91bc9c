"""Several flights of one course in one picture, from above and from the side."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from peakflight.figures.canvas import new_figure, write_title
from peakflight.figures.course import FlownPath, draw_views, paper_height
from peakflight.figures.flights import LEGEND_TOP, Flight, legend_height, write_legend

SIDE_WIDTH = 3.65
"""Width of the view from the side, in: there is no scale of colours beside it."""


def paths_figure(flights: Sequence[Flight], waypoints: np.ndarray, *, title: str) -> Figure:
    """Draw several flights through (K+1, 3) m `waypoints`, later ones over earlier ones."""
    paths = [FlownPath.of(flight.trajectory, flight.line_style) for flight in flights]
    height = paper_height(paths, waypoints)
    figure = new_figure(height + 0.6 + LEGEND_TOP + legend_height(flights))
    write_title(figure, title, 0.12)
    draw_views(figure, paths, waypoints, height, side_width=SIDE_WIDTH)
    write_legend(figure, figure.axes[0], flights)
    return figure
