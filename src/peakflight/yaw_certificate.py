"""What is proven about a yaw motion, from its coefficients alone.

Nothing here is shared with what makes the motion. If a yaw has degree 3 at most, the largest rate
of a piece is at an end or at the one vertex, and the largest acceleration at an end; the rounding
error of each value is bounded and added. Limits that are about the body take the flight as well:
`twist_certificate` proves them, for any degree that flights have.
"""

import numpy as np

from peakflight.kernels.bernstein import falling_factorials
from peakflight.limits import LimitKind
from peakflight.result import JOINT_TOLERANCE
from peakflight.trajectory import Trajectory
from peakflight.yaw import Heading

DEGREE = 3
"""Highest of a yaw motion of which limits on its own rate and acceleration can be proven."""
HIGHEST = 11
"""Highest of one under limits about the body."""
ROUNDING = 16.0 * 2.220446049250313e-16
"""Error of a value of degree 3 or a derivative of it, relative to the sum of its terms' sizes."""
JUMP_OF_LIMIT = 1e-4
"""A jump may have this part of the limit on what jumps, however short the pieces."""
SMALLEST_JUMP = 1e-10
"""Largest jump of an angle, rad, but for rounding; and one of a rate or an acceleration, in rad/s
or rad/s^2, that is nothing."""
ANGLE_TOLERANCE = 1e-8
"""Largest miss of an angle that is asked for, rad."""
TIME_TOLERANCE = 1e-9
"""Difference of two times that counts as none, relative to the duration."""
UNBOUNDED = 1e9
"""Kappa where nothing is proven."""
WHAT = ("yaw", "yaw rate", "yaw acceleration")


def certify_yaw(
    heading: Heading, yaw: Trajectory | None, flight: Trajectory, waypoint_times: np.ndarray
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Prove that a yaw motion keeps the limits of a heading and does what can be proven of it.

    That it begins and ends with the flight; that neither yaw nor rate jumps; that it holds a fixed
    yaw and passes that of each waypoint. Of limits on its own rate and acceleration: that they are
    kept, that the acceleration does not jump, and that the rate is zero at both ends. How near it
    comes to a direction that is followed is not proven.

    Parameters
    ----------
    waypoint_times
        (legs+1,) s.

    Returns
    -------
    Name of limit to (K,) certified peak over limit on each segment of the flight; and what is
    wrong, one line each.
    """
    slack = TIME_TOLERANCE * flight.duration
    misfit = unfit(heading, yaw, flight)
    own = {} if heading.is_about_body else heading.limits
    if yaw is None or misfit:
        unknown = np.full(len(flight), UNBOUNDED)
        return {kind.name: unknown for kind in heading.limits}, [misfit]
    coefficients = yaw.elevate(max(DEGREE, yaw.degree)).coefficients[:, :, 0]
    peaks, problems = {}, []
    for kind, limit in own.items():
        largest = _largest(coefficients, yaw.segment_times, kind.order)
        kappa = _by_segment(largest, yaw.breakpoints, flight.breakpoints, slack) / limit
        peaks[kind.name] = kappa * (1.0 + ROUNDING)
        problems += exceeded(kind, limit, peaks[kind.name])
    problems += _jumps(coefficients, yaw.segment_times, heading)
    problems += _missed(heading, yaw, waypoint_times)
    return peaks, problems


def exceeded(kind: LimitKind, limit: float, kappa: np.ndarray) -> list[str]:
    """A line that says by how much and where a limit is not kept; none if it is."""
    if kappa.max() <= 1.0:
        return []
    segment = int(kappa.argmax())
    return [
        f"{kind.label} reaches {kappa[segment]:.6g} times its limit of {limit:g} {kind.unit} in "
        f"segment {segment}"
    ]


def unfit(heading: Heading, yaw: Trajectory | None, flight: Trajectory) -> str:
    """Why nothing can be proven about a yaw motion; empty if something can."""
    if yaw is None:
        return "there is no yaw motion"
    most = HIGHEST if heading.is_about_body else DEGREE
    if yaw.degree > most:
        return f"the yaw has degree {yaw.degree}; {most} is the most that can be proven"
    slack = TIME_TOLERANCE * flight.duration
    ends = np.array([yaw.start_time - flight.start_time, yaw.end_time - flight.end_time])
    if not np.abs(ends).max() <= slack:
        return (
            f"the yaw runs from {yaw.start_time:.9g} to {yaw.end_time:.9g} s, the flight from "
            f"{flight.start_time:.9g} to {flight.end_time:.9g} s"
        )
    return ""


def _largest(coefficients: np.ndarray, times: np.ndarray, order: int) -> np.ndarray:
    """(M,) upper bounds of |derivative| of (M, 4) cubics; order 1 or 2."""
    _, c1, c2, c3 = coefficients.T
    if order == 2:
        size = np.abs(2.0 * c2) + np.abs(6.0 * c3 * times)
        return np.maximum(np.abs(2.0 * c2), np.abs(2.0 * c2 + 6.0 * c3 * times)) + ROUNDING * size
    size = np.abs(c1) + np.abs(2.0 * c2 * times) + np.abs(3.0 * c3 * times**2)
    value = np.maximum(np.abs(c1), np.abs(c1 + (2.0 * c2 + 3.0 * c3 * times) * times))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        place = -c2 / (3.0 * c3)
        vertex = np.abs(c1 + c2 * place)
    # a vertex beyond the piece by rounding alone only raises the bound
    inside = (place >= -1e-9 * times) & (place <= (1.0 + 1e-9) * times)
    return np.where(inside, np.maximum(value, vertex), value) + ROUNDING * size


def _by_segment(
    values: np.ndarray, knots: np.ndarray, borders: np.ndarray, slack: float
) -> np.ndarray:
    """(K,) largest of (M,) values over the pieces between knots that touch each segment."""
    first = np.searchsorted(knots[1:-1], borders[:-1] + slack, side="right")
    last = np.searchsorted(knots[1:-1], borders[1:] - slack, side="left")
    pairs = np.stack((first, np.maximum(last, first) + 1), axis=1).ravel()
    largest: np.ndarray = np.maximum.reduceat(np.append(values, 0.0), pairs)[::2]
    return largest


def _jumps(coefficients: np.ndarray, times: np.ndarray, heading: Heading) -> list[str]:
    """Where yaw, rate or acceleration jumps, or the rate is not zero at an end."""
    count = coefficients.shape[1]
    powers = times[:, None] ** np.arange(count)
    factors = falling_factorials(count - 1)
    sizes = (np.abs(coefficients) * powers).sum(axis=1)
    caps = {kind.order: JUMP_OF_LIMIT * limit for kind, limit in heading.limits.items()}
    caps[0] = SMALLEST_JUMP + ROUNDING * float(sizes.max())  # small ones add up over many pieces
    lines = []
    # where the snap of a flight jumps, so does what keeps the body from turning about z
    smooth = WHAT[:2] if heading.is_about_body else WHAT
    for order, what in enumerate(smooth):
        begins = factors[order, order] * coefficients[:, order]
        ends = (factors[order, order:] * coefficients[:, order:] * powers[:, : count - order]).sum(
            axis=1
        )
        allowed = np.minimum(JOINT_TOLERANCE * sizes / times**order, caps.get(order, np.inf))
        allowed = np.maximum(allowed, SMALLEST_JUMP)
        jumps = np.abs(begins[1:] - ends[:-1])
        wrong = ~(jumps <= np.maximum(allowed[1:], allowed[:-1]))
        if wrong.any():
            joint = int(wrong.argmax())
            lines.append(f"{what} jumps by {jumps[joint]:.3g} at the end of its piece {joint}")
        at_ends = np.abs([begins[0], ends[-1]])
        if order == 1 and len(smooth) > 2 and not (at_ends <= allowed[[0, -1]]).all():
            lines.append(
                f"{what} is {at_ends.max():.3g} rad/s at an end of the flight; it must be 0"
            )
    return lines


def _missed(heading: Heading, yaw: Trajectory, waypoint_times: np.ndarray) -> list[str]:
    """Which angle that is asked for the yaw does not have."""
    if heading.angle is not None:
        constant = yaw.coefficients[:, 0] == heading.angle
        if constant.all() and not yaw.coefficients[:, 1:].any():
            return []
        return [f"the yaw is not {heading.angle:g} rad throughout"]
    if heading.angles is None:
        return []
    times = np.clip(waypoint_times, yaw.start_time, yaw.end_time)
    off = yaw(times)[:, 0] - np.array(heading.angles)
    miss = np.abs(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)))
    if (miss <= ANGLE_TOLERANCE).all():
        return []
    index = int(np.argmax(miss))
    return [f"the yaw of waypoint {index} is missed by {miss[index]:.3g} rad"]
