"""The figure of the methods: flight time over the bound against CPU time."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

FIGURE = Path(__file__).parent.parent / "docs" / "images" / "methods_benchmark.png"
MARKERS = "o^sDvPX*<>hp"
COLORS = (
    "#0072b2", "#56b4e9", "#009e73", "#d55e00", "#cc79a7", "#e69f00", "#666666", "#000000",
    "#882255",
)  # fmt: skip
"""Told apart with colour blindness too; the markers differ as well."""


class Point(NamedTuple):
    """One method on one course."""

    who: str
    course: str
    cpu: float
    """ms."""
    over: float
    """Flight time over the bound."""


def draw(points: Sequence[Point], path: Path = FIGURE) -> bool:
    """Write the figure; False where matplotlib is missing or there is nothing to draw."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
        from matplotlib.ticker import FuncFormatter, NullFormatter
    except ModuleNotFoundError:
        return False
    if not points:
        return False
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    axes = figure.add_subplot()
    for index, who in enumerate(dict.fromkeys(point.who for point in points)):
        own = [point for point in points if point.who == who]
        axes.plot(
            [point.cpu for point in own], [point.over for point in own],
            marker=MARKERS[index % len(MARKERS)], color=COLORS[index % len(COLORS)],
            linestyle="none", markersize=7, alpha=0.85, label=who,
        )  # fmt: skip
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    ticks = [1.0, 1.1, 1.25, 1.5, 2.0, 3.0, 4.0]
    axes.set_yticks([tick for tick in ticks if tick <= 1.1 * max(point.over for point in points)])
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("CPU time of one thread, ms")
    axes.set_ylabel("flight time over the bound, after exact stretch")
    axes.set_title(
        "five courses, one point each; the bound is that of any motion under the limits",
        fontsize=10,
    )
    axes.grid(visible=True, alpha=0.3)
    axes.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_png(path)
    return True
