"""What is proven of a flight and its yaw together: turning about z, and rotor thrusts with it.

Nothing here is shared with what makes the yaw: bounds are taken of the coefficients of both that
are written to the file (`kernels.twisting`).
"""

import numpy as np

from peakflight.kernels import twisting
from peakflight.kernels.bernstein import bernstein_tables, falling_factorials
from peakflight.kernels.jit import fresh
from peakflight.limits import GRAVITY, KINDS, ROTORS
from peakflight.problem import Problem
from peakflight.trajectory import Trajectory
from peakflight.yaw import BODY_KINDS, Heading
from peakflight.yaw_certificate import UNBOUNDED, exceeded, unfit

TOLERANCE = 1e-6
"""Largest distance of a bound from what is reached, relative to the limit or to that value."""
SAME_TIME = 1e-12
"""Difference of two times that counts as none, relative to the duration."""
SHIFTED = 64.0 * 2.220446049250313e-16
"""Error of a derivative of a polynomial that is written around another time, relative to the sum of
the sizes that its terms had around the first one: each is a sum of at most twelve products."""


def certify_twist(
    problem: Problem, heading: Heading, yaw: Trajectory | None, flight: Trajectory
) -> tuple[dict[str, np.ndarray], list[str]]:
    """Prove the limits of a heading that are about the body, and those on rotors with the yaw.

    Parameters
    ----------
    problem, heading
        Of its limits those on rotors count, and its airframe; and what is asked of the nose.
    yaw
        One axis, rad, during the flight; nothing is proven without one that fits.

    Returns
    -------
    Name of limit to (K,) certified peak over limit on each segment of the flight; and which are not
    kept, one line each.
    """
    held = {kind.name: limit for kind, limit in heading.limits.items() if heading.is_about_body}
    kinds = {kind.name: kind for kind in (*BODY_KINDS, *KINDS)}
    names = [kind.name for kind in BODY_KINDS] + list(ROTORS)
    allowed = np.array([held.get(name, np.nan) for name in names])
    limits = problem.limits
    allowed[2:] = limits.as_array()[[KINDS.index(kinds[name]) for name in ROTORS]]
    is_fit = yaw is not None and not unfit(heading, yaw, flight)
    upper = np.full((len(flight), twisting.COUNT), np.inf)
    if yaw is not None and is_fit:
        upper = _bounds(allowed, _figures(problem), yaw, flight)
    peaks, problems = {}, []
    for name, kappa in zip(names, upper.T, strict=True):
        limit = held.get(name, getattr(limits, name, None))
        if limit is not None:
            peaks[name] = np.minimum(np.nan_to_num(kappa, nan=np.inf), UNBOUNDED)
            problems += exceeded(kinds[name], limit, peaks[name]) if is_fit else []
    return peaks, problems


def _figures(problem: Problem) -> np.ndarray:
    """(7,) what kernels take of the airframe."""
    if problem.airframe is None:
        return np.zeros(7)
    if problem.airframe.can_steer:
        return problem.airframe.steering
    return np.concatenate((problem.airframe.figures, np.zeros(3)))


def _bounds(
    allowed: np.ndarray, figures: np.ndarray, yaw: Trajectory, flight: Trajectory
) -> np.ndarray:
    """(K, twisting.COUNT) certified kappa."""
    slack = SAME_TIME * flight.duration
    borders = flight.breakpoints[1:-1]
    nearest = np.searchsorted(0.5 * (yaw.breakpoints[1:] + yaw.breakpoints[:-1]), borders)
    is_new = np.abs(yaw.breakpoints[nearest] - borders) > slack
    parts, lost = _cut(yaw, borders[is_new])
    ends = 0.5 * (parts.breakpoints[1:] + parts.breakpoints[:-1])
    firsts = np.concatenate(([0], np.searchsorted(ends, borders), [len(parts)]))
    coefficients = np.zeros((len(parts), parts.degree + 1, 3))
    coefficients[:, :, 0] = parts.coefficients[:, :, 0]
    degree = max(flight.degree, parts.degree)
    factorials = falling_factorials(degree)
    upper = np.empty((len(flight), twisting.COUNT))
    twisting.largest(
        fresh(flight.coefficients),
        fresh(flight.segment_times),
        coefficients,
        fresh(parts.segment_times),
        lost,
        firsts.astype(np.int64),
        figures,
        allowed,
        GRAVITY,
        (bernstein_tables(degree)[0], factorials),
        TOLERANCE,
        upper,
    )
    return upper


def _cut(yaw: Trajectory, times: np.ndarray) -> tuple[Trajectory, np.ndarray]:
    """The yaw with joints at (n,) s more, and (M, 2) largest errors of rate and acceleration by it.

    Writing a polynomial around another time rounds in proportion to what its terms come to at the
    end of the piece, taken positive, however much of that cancels.
    """
    parts = yaw.cut(times)
    lost = np.zeros((len(parts), 2))
    if len(times) > 0:
        parent = np.searchsorted(yaw.breakpoints[1:-1], parts.breakpoints[:-1], side="right")
        sizes = np.abs(yaw.coefficients[parent, :, 0])
        powers = np.arange(yaw.degree + 1.0)
        factorials = falling_factorials(yaw.degree)
        for order in (1, 2):
            terms = yaw.segment_times[parent, None] ** np.maximum(powers - order, 0.0)
            row = factorials[order, : yaw.degree + 1]
            lost[:, order - 1] = SHIFTED * (row * sizes * terms).sum(axis=1)
    return parts, lost
