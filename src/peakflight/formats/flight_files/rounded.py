"""Flights in whole millimetres and milliseconds: Bézier curves that share their ends.

What Crazyflies hold as compressed trajectories and Skybrush sends to its drones. Joints in time are
rounded, not durations, so that rounding does not add up.
"""

from collections.abc import Callable
from math import comb
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.trajectory import Trajectory

DEGREE = 7
"""Of every curve that is not constant."""
MILLI = 1e-3
LONGEST = 60_000
"""ms of one curve, which has two bytes for them: longer pieces are cut, exactly."""
TO_POINTS = np.array(
    [[comb(i, j) / comb(DEGREE, j) if j <= i else 0.0 for j in range(DEGREE + 1)]
     for i in range(DEGREE + 1)]
)  # fmt: skip
"""(8, 8) control points of a curve from its coefficients on [0, 1]."""
TO_COEFFICIENTS = np.linalg.inv(TO_POINTS)


class Curves(NamedTuple):
    """Bézier curves in whole units; the last point of one is the first of the next."""

    milliseconds: np.ndarray
    """(K,) whole numbers from 1."""
    points: np.ndarray
    """(K, 8, D) whole numbers."""


def cut(trajectory: Trajectory) -> Trajectory:
    """The same motion, pieces that are too long for a curve cut."""
    parts = np.ceil(trajectory.segment_times * 1e3 / LONGEST).astype(int)
    return trajectory.subdivide(parts) if parts.max() > 1 else trajectory


def control_points(trajectory: Trajectory) -> np.ndarray:
    """(K, 8, D) Bézier points of a trajectory of degree up to 7, in its unit."""
    if trajectory.degree > DEGREE:
        raise InvalidProblem(
            f"the trajectory has degree {trajectory.degree}; the format holds degree {DEGREE} at "
            f"most: plan with degree={DEGREE}"
        )
    powers = trajectory.segment_times[:, None, None] ** np.arange(DEGREE + 1)[:, None]
    points: np.ndarray = TO_POINTS @ (trajectory.elevate(DEGREE).coefficients * powers)
    return points


def rounded(
    points: np.ndarray,
    segment_times: np.ndarray,
    unit: np.ndarray,
    *,
    fits: Callable[[int], bool] = lambda _: True,
) -> Curves:
    """Curves at the nearest whole numbers.

    Parameters
    ----------
    points
        (K, 8, D).
    segment_times
        (K,) s.
    unit
        (D,) what a whole number stands for.
    fits
        Whether the consumer keeps a duration of so many milliseconds.

    Raises
    ------
    InvalidProblem
        If a piece is shorter than a millisecond.
    """
    whole = np.round(points / unit)
    whole[1:, 0] = whole[:-1, -1]
    joints = np.cumsum(segment_times) * 1e3
    milliseconds = np.zeros(len(segment_times), dtype=np.int64)
    passed = 0
    for index, joint in enumerate(joints):
        duration = round(float(joint)) - passed
        while duration >= 1 and not fits(duration):
            duration += 1
        if duration < 1:
            raise InvalidProblem(
                f"segment {index} lasts {segment_times[index] * 1e3:.3g} ms; the format holds "
                "whole milliseconds from 1"
            )
        milliseconds[index] = duration
        passed += duration
    return Curves(milliseconds, whole.astype(np.int64))


def motion(curves: Curves, unit: np.ndarray) -> Trajectory:
    """The polynomials that a consumer makes of curves."""
    times = curves.milliseconds * MILLI
    powers = times[:, None, None] ** np.arange(DEGREE + 1)[:, None]
    return Trajectory(TO_COEFFICIENTS @ (curves.points * unit) / powers, times)
