"""When in a record of positions a plan began: where the two fit best."""

import math
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.trajectory import Trajectory

COVERED = 0.8
"""Part of the plan, or of the record if that is shorter, that must have positions at a start."""
ABOUT_AS_WELL = 1.5
"""Times the RMS error of the best start, up to which another one is a rival."""
APART = 0.5
"""Of the plan's duration: starts that are nearer to each other are the same."""
PRECISION = 1e-7
"""s, to which a start is found."""


class Alignment(NamedTuple):
    """When a plan began."""

    start: float
    """s, in the time of the record."""
    rival: float | None
    """Another start that fits about as well, s; None if there is none."""


def find_start(
    times: np.ndarray, positions: np.ndarray, trajectory: Trajectory, rate: float
) -> Alignment:
    """Find the start by least squares: at every sample by correlation, then between samples.

    Parameters
    ----------
    times, positions
        (n,) s and (n, 3) m at `rate`; NaN where nothing is known.
    trajectory
        What was flown.
    rate
        Hz.

    Raises
    ------
    InvalidProblem
        If no start leaves enough of the plan within the record.
    """
    planned = planned_positions(
        trajectory, np.arange(math.floor(trajectory.duration * rate) + 1) / rate
    )
    means = _mean_squares(positions, planned)
    best = int(np.argmin(means))
    if not math.isfinite(means[best]):
        raise InvalidProblem(
            f"the record has too many gaps to find in it a plan of {trajectory.duration:g} s; "
            "give the start"
        )
    lags = np.arange(len(means)) - (len(planned) - 1)
    start = _refined(times, positions, trajectory, times[0] + lags[best] / rate, 1.0 / rate)
    apart = np.abs(lags - lags[best]) > APART * trajectory.duration * rate
    others = np.where(apart, means, np.inf)
    rival = int(np.argmin(others))
    near = others[rival] <= ABOUT_AS_WELL**2 * means[best]
    return Alignment(start, float(times[0] + lags[rival] / rate) if near else None)


def planned_positions(
    trajectory: Trajectory, since: np.ndarray, *, hover: bool = True
) -> np.ndarray:
    """(n, 3) m: where a plan is at (n,) s since it began; before and after, at its ends.

    Without `hover` it is nowhere then: NaN.
    """
    within = np.clip(since, 0.0, trajectory.duration)
    positions = trajectory(trajectory.start_time + within)
    if not hover:
        positions[np.abs(since - within) > PRECISION] = np.nan
    return positions


def _mean_squares(positions: np.ndarray, planned: np.ndarray) -> np.ndarray:
    """(n+m-1,) m^2: mean squared distance at each start, from m-1 samples early on.

    Infinite where the two have too few samples in common.
    """
    from scipy.signal import correlate

    known = np.isfinite(positions).all(axis=1)
    centre = planned.mean(axis=0)
    flown = np.where(known[:, None], positions - centre, 0.0)
    planned = planned - centre
    here = known.astype(float)
    counts = np.round(correlate(here, np.ones(len(planned))))
    sums = correlate((flown**2).sum(axis=1), np.ones(len(planned)))
    sums += correlate(here, (planned**2).sum(axis=1))
    for axis in range(flown.shape[1]):
        sums -= 2.0 * correlate(flown[:, axis], planned[:, axis])
    enough = counts >= max(COVERED * min(len(planned), int(known.sum())), 1.0)
    means = np.full(len(sums), np.inf)
    means[enough] = np.maximum(sums[enough], 0.0) / counts[enough]
    return means


def _refined(
    times: np.ndarray,
    positions: np.ndarray,
    trajectory: Trajectory,
    start: float,
    period: float,
) -> float:
    """The best start within a period of one, from the same samples throughout."""
    from scipy.optimize import minimize_scalar

    since = times - start
    used = np.isfinite(positions).all(axis=1) & (since > -period)
    used &= since < trajectory.duration + period
    since, flown = since[used], positions[used]

    def mean_square(delay: float) -> float:
        return float(np.mean((flown - planned_positions(trajectory, since - delay)) ** 2))

    found = minimize_scalar(
        mean_square, bounds=(-period, period), method="bounded", options={"xatol": PRECISION}
    )
    return start + float(found.x)
