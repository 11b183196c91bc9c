"""Positions at an even rate, and their derivatives by differences and moving averages.

As in the paper, each derivative is the difference of neighbours followed by the mean of five. The
mean of five differences telescopes, so that one such step is

    v(t) = (x(t + h) - x(t - h)) / (2 h),    h = 2.5 / rate.

It is exact for polynomials up to degree 2 and moves nothing in time, but it flattens what is
quick: a sine of angular frequency w keeps sin(w h) / (w h) of its height at every step. Noise of
standard deviation s in each position becomes sqrt(binomial(2k, k)) s / (2 h)^k in the k-th
derivative: 0.1 mm at 100 Hz is 134 m/s^4 in each component of snap.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidProblem
from peakflight.problem import as_float_array

RATE = 100.0
"""Hz, of the paper's motion capture."""
POINTS = 5
"""Of the moving average."""
ORDERS = 4
"""Derivatives that are looked at: up to snap."""


class Samples(NamedTuple):
    """Positions at an even rate."""

    times: np.ndarray
    """(n,) s."""
    positions: np.ndarray
    """(n, 3) m; NaN where the record has a gap."""


class Derivative(NamedTuple):
    """A derivative of sampled positions, at times of its own."""

    times: np.ndarray
    """(n - 5k,) s."""
    values: np.ndarray
    """(n - 5k, 3) m/s^k; NaN where positions are missing."""


def sample_positions(
    times: ArrayLike, positions: ArrayLike, rate: float = RATE, *, gap: float | None = None
) -> Samples:
    """Positions at an even rate, as motion capture would give them.

    Between the given samples runs a cubic spline through them, so that samples at the same times
    stay as they are to rounding.

    Parameters
    ----------
    times
        (n,) s, rising; sampling begins at the first.
    positions
        (n, 3) m; rows with NaN are left out.
    rate
        Hz.
    gap
        s; where neighbours are further apart than this, nothing is known of what is between them.
        None fills every gap.

    Raises
    ------
    InvalidProblem
        If times do not rise, shapes do not fit, or the rate is not positive.
    """
    from scipy.interpolate import make_interp_spline

    stamps, places = checked_record(times, positions)
    if not (math.isfinite(rate) and rate > 0.0):
        raise InvalidProblem(f"rate is {rate} Hz; it must be positive and finite")
    known = np.isfinite(places).all(axis=1)
    stamps, places = stamps[known], places[known]
    if len(stamps) == 0:
        raise InvalidProblem("no sample has a position")
    count = math.floor((stamps[-1] - stamps[0]) * rate * (1.0 + 1e-12) + 1e-6) + 1
    grid = stamps[0] + np.arange(count) / rate
    sampled = np.full((count, 3), np.nan)
    longest = math.inf if gap is None else gap
    breaks = np.flatnonzero(np.diff(stamps) > longest) + 1
    slack = 1e-6 / rate
    for part in np.split(np.arange(len(stamps)), breaks):
        begin, end = stamps[part[0]], stamps[part[-1]]
        inside = (grid >= begin - slack) & (grid <= end + slack)
        if len(part) == 1:
            sampled[inside] = places[part]
            continue
        spline = make_interp_spline(stamps[part], places[part], k=_degree(len(part)))
        sampled[inside] = spline(np.clip(grid[inside], begin, end))
    return Samples(grid, sampled)


def differentiate(samples: Samples, rate: float, orders: int = ORDERS) -> list[Derivative]:
    """Derivatives from the first to that of `orders`, by differences and means of five.

    Each step shortens the record by five samples, and its times are those that its values are
    about: the middle of what they are taken from.

    Parameters
    ----------
    samples
        At `rate`.
    rate
        Hz.

    Returns
    -------
    One a derivative, empty where the record is too short.
    """
    times, values = samples
    found = []
    for _ in range(orders):
        count = max(len(values) - POINTS, 0)
        values = (values[POINTS:] - values[:count]) * (rate / POINTS)
        times = times[:count] + 0.5 * POINTS / rate
        found.append(Derivative(times, values))
    return found


def _degree(count: int) -> int:
    """Of the spline through so many points; odd, so that it passes through them by itself."""
    return 3 if count >= 4 else 1


def checked_record(times: ArrayLike, positions: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and positions (n, 3) as arrays, checked; errors as of `sample_positions`."""
    stamps = as_float_array("times", times, (None,))
    places = as_float_array("positions", positions, (len(stamps), 3))
    if not np.isfinite(stamps).all():
        sample = int(np.flatnonzero(~np.isfinite(stamps))[0])
        raise InvalidProblem(f"time of sample {sample} is {stamps[sample]}; it must be finite")
    falls = np.diff(stamps) <= 0.0
    if falls.any():
        sample = int(falls.argmax())
        raise InvalidProblem(
            f"sample {sample + 1} is at {stamps[sample + 1]:.9g} s, after {stamps[sample]:.9g} s; "
            "times must rise"
        )
    return stamps, places
