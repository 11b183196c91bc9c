"""Plans moved up, whose courses are not above a floor, for vehicles that fly from one."""

import math
from collections.abc import Sequence
from numbers import Real

import numpy as np

from peakflight.editing import move
from peakflight.errors import InvalidProblem, quoted
from peakflight.formats.flight_files.script import HEIGHT
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

AUTO = "auto"
CLEARANCE = HEIGHT
"""m above the ground where `AUTO` puts the lowest point: where scripts hover before and after."""
EPSILON = float(np.finfo(float).eps)
RULE = f"it must be {AUTO} or a number of m from 0 on (peakflight edit --move goes down too)"


def lifted(plans: Sequence[Plan], lift: float | str) -> tuple[tuple[Plan, ...], float]:
    """Plans moved up together and proven again, and by how many m.

    Parameters
    ----------
    lift
        By so many m; or "auto", by as much as puts the lowest point of all 0.5 m above z = 0, and
        not at all where it is higher.

    Raises
    ------
    InvalidProblem
        If it is neither.
    """
    by = _height(plans, lift)
    if by == 0.0:
        return tuple(plans), 0.0
    return tuple(move(plan, (0.0, 0.0, by)) for plan in plans), by


def lowest(flight: Trajectory) -> tuple[float, float]:
    """Least z, m, and when it is reached, s: at an end of a piece or where z stands still."""
    powers = np.arange(flight.degree + 1)
    scaled = flight.coefficients[:, :, 2] * flight.segment_times[:, None] ** powers
    begins = scaled[:, 0]
    reach = begins - np.abs(scaled[:, 1:]).sum(axis=1)  # no point of the piece is lower
    found = [(float(flight(flight.end_time)[2]), flight.end_time)]
    for index in np.flatnonzero(reach <= begins.min()).tolist():
        z = np.polynomial.Polynomial(scaled[index])
        slope = z.deriv()
        slope = slope.trim(EPSILON * np.abs(slope.coef).max())  # roots divide by what leads
        roots = slope.roots() if slope.degree() > 0 else np.empty(0)
        parts = np.concatenate(([0.0, 1.0], np.clip(np.real(roots), 0.0, 1.0)))
        heights = z(parts)
        least = int(heights.argmin())
        time = flight.breakpoints[index] + parts[least] * flight.segment_times[index]
        found.append((float(heights[least]), float(time)))
    return min(found)


def _height(plans: Sequence[Plan], lift: float | str) -> float:
    if isinstance(lift, str):
        if lift != AUTO:
            raise InvalidProblem(f"lift is {quoted(lift)}; {RULE}")
        now = min((lowest(plan.trajectory)[0] for plan in plans), default=CLEARANCE)
        return max(CLEARANCE - now, 0.0)
    if isinstance(lift, bool) or not isinstance(lift, Real):
        raise InvalidProblem(f"lift is {lift!r}; {RULE}")
    by = float(lift)
    if not (math.isfinite(by) and by >= 0.0):
        raise InvalidProblem(f"lift is {by:g} m; {RULE}")
    return by
