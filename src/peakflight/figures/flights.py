"""Several flights in one picture: what they are called, and how each is told from the others."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from peakflight.figures.canvas import COLOURS, POINTS, TEXT, WIDTH, name_lines, seconds, text_width
from peakflight.methods import METHODS
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

SOLID = "-"
LOOKS: tuple[tuple[str, Any, float], ...] = (
    ("#a3a3a3", SOLID, 1.6),
    ("#e08a00", (0, (6, 1.5)), 1.4),
    ("#a0489c", (0, (1.2, 1.2)), 1.4),
    ("#2f7fd6", SOLID, 1.4),
    ("#0a4a3a", SOLID, 1.0),
)
"""Colour, dashes and width, pt, of methods in the order of `METHODS`."""
MANY = 40
"""With more legs than this, lines are thin, and dashes would only fray them."""
LEGEND_TOP = 0.3
"""From the top of the figure to its legend, in."""
LEGEND_ROW = 0.165
"""Height of a row of the legend, in."""
HANDLE = 30.0
"""Width of a line in the legend and of the room around it, pt."""


class Flight(NamedTuple):
    """A trajectory, its name and its looks."""

    name: str
    trajectory: Trajectory
    pieces: tuple[int, ...]
    """(legs,) polynomial pieces in each leg."""
    colour: Any
    dashes: Any = SOLID
    width: float = 1.4
    """pt."""

    @classmethod
    def of(
        cls, name: str, trajectory: Trajectory, method: str, pieces: Sequence[int] | None = None
    ) -> Self:
        """Give a trajectory the looks of its method; without `pieces`, each leg has one."""
        counts = (1,) * len(trajectory) if pieces is None else tuple(pieces)
        return cls(name, trajectory, counts, *looks(method))

    @property
    def label(self) -> str:
        """Name and total time."""
        return f"{self.name}, {seconds(self.trajectory.duration)}"

    @property
    def leg_times(self) -> np.ndarray:
        """(legs,) s."""
        firsts = np.cumsum((0, *self.pieces[:-1]))
        return np.asarray(np.add.reduceat(self.trajectory.segment_times, firsts))

    @property
    def line_style(self) -> dict[str, Any]:
        """As matplotlib's lines take it."""
        if len(self.pieces) > MANY:
            return {"color": self.colour, "linestyle": SOLID, "linewidth": 0.5 * self.width}
        return {"color": self.colour, "linestyle": self.dashes, "linewidth": self.width}


def looks(method: str) -> tuple[str, Any, float]:
    """Colour, dashes and width of a method, the same in every figure."""
    place = list(METHODS).index(method) if method in METHODS else len(METHODS)
    return LOOKS[place % len(LOOKS)]


def side_by_side(plans: Mapping[str, Plan]) -> list[Flight]:
    """Give plans by name the looks of their methods."""
    return [
        Flight.of(name, plan.trajectory, plan.method, plan.pieces) for name, plan in plans.items()
    ]


def in_sequence(trajectories: Mapping[str, Trajectory]) -> list[Flight]:
    """Shade trajectories from light, the first, to dark, the last."""
    last = max(len(trajectories) - 1, 1)
    return [
        Flight(name, trajectory, (1,) * len(trajectory), COLOURS(place / last), SOLID, 1.2)
        for place, (name, trajectory) in enumerate(trajectories.items())
    ]


def legend_height(flights: Sequence[Flight]) -> float:
    """Height of the legend, in."""
    return LEGEND_ROW * -(-len(flights) // _columns(flights))


def write_legend(
    figure: Figure, axes: Axes, flights: Sequence[Flight], *, as_bars: bool = False
) -> None:
    """Name the flights with their total times, under the title."""
    handles: list[Artist] = []
    for flight in flights:
        if as_bars:
            handles.append(Patch(color=flight.colour, linewidth=0.0, label=flight.label))
        else:
            handles.append(Line2D([], [], label=flight.label, **flight.line_style))
    short = {"handlelength": 1.2} if as_bars else {}
    name_lines(
        figure, axes, LEGEND_TOP, _columns(flights), handles=handles, labelspacing=0.25, **short
    )


def _columns(flights: Sequence[Flight]) -> int:
    widest = max(text_width(flight.label) for flight in flights) + HANDLE
    return int(np.clip(POINTS * (WIDTH - 0.3) // (widest + 0.6 * TEXT), 1, len(flights)))
