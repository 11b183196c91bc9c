"""Where a trajectory could still be faster: time during which no limit is at work.

The fastest motion of all has some limit at work at every instant. Where none is, polynomials are in
the way, and more of them help; the part of the flight that is idle is about what there is to gain.
"""

import numpy as np

from peakflight.limits import Limits, limited_values
from peakflight.trajectory import Trajectory

SAMPLES = 16
"""Points of a piece that are looked at."""
MOST_PARTS = 4
"""Most parts that a piece is cut into at once."""


def idle_times(trajectory: Trajectory, limits: Limits) -> np.ndarray:
    """(K,) s: integral over each piece of how much faster than it is each sample could be flown."""
    derivatives = [trajectory.sample(SAMPLES, order) for order in range(1, 5)]
    ratios = limits.ratios(limited_values(derivatives, limits.airframe))
    stretch = np.zeros(derivatives[0].shape[:2])
    for kind in limits.active:
        ratio = np.minimum(ratios[kind.name], 1.0)
        stretch = np.maximum(stretch, ratio ** (1.0 / kind.order))
    return trajectory.segment_times * np.trapezoid(1.0 - stretch, dx=1.0 / (SAMPLES - 1), axis=1)


def parts_for(idle: np.ndarray, allowance: float, most: int | None) -> np.ndarray:
    """(K,) parts to cut each piece into, so that together they are idle for about `allowance`, s.

    Idle time falls with the square of the number of parts (measured on the public courses); then
    the fewest parts in all are in proportion to the third root of the idle times.
    """
    roots = np.cbrt(np.maximum(idle, 0.0))

    def parts(scale: float) -> np.ndarray:
        return np.clip(np.rint(scale * roots), 1, MOST_PARTS).astype(np.int64)

    high = np.sqrt(roots.sum() / allowance)
    if most is None or parts(high).sum() <= most:
        return parts(high)
    low = 0.0
    for _ in range(60):  # bisection: the sum grows with the scale, in steps
        middle = 0.5 * (low + high)
        low, high = (middle, high) if parts(middle).sum() <= most else (low, middle)
    found = parts(low)  # pieces alike grow all at once: what is left goes to the nearest
    nearest = np.argsort(found - low * roots, kind="stable")
    nearest = nearest[(found < MOST_PARTS)[nearest] & (roots > 0.0)[nearest]]
    found[nearest[: most - found.sum()]] += 1
    return found
