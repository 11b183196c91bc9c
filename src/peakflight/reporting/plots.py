"""What the plots of a report share, as the page hands them to Plotly.

A colour is written as the name of one of the page, such as "@ink": the page puts in what it is in
its light or its dark dress. Nothing that a user wrote goes into a plot: Plotly would read markup.
"""

from typing import Any, TypeAlias

import numpy as np

Plot: TypeAlias = dict[str, Any]
"""`data` and `layout` as Plotly takes them, and `height` in pixels."""

DIGITS = 6
"""Significant figures of a number in a plot: finer than a screen."""
DECIMALS = 6
"""Of times in s and places in m."""
ABOVE, BELOW = 34, 44
"""Pixels above the first axes of a plot and below the last."""
AXIS: Plot = {
    "gridcolor": "@grid",
    "linecolor": "@faint",
    "zeroline": False,
    "color": "@soft",
    "automargin": False,
}
"""Of two dimensions."""


def placed(values: np.ndarray) -> list[float]:
    """Times in s and places in m, which may be far from zero."""
    numbers: list[float] = (np.round(values, DECIMALS) + 0.0).tolist()
    return numbers


def rounded(values: Any) -> list[float]:
    """Numbers to `DIGITS` significant figures."""
    return [float(f"{value:.{DIGITS}g}") for value in np.asarray(values, dtype=float).tolist()]
