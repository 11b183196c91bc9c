"""What is limited, along a trajectory: samples dense enough for the curves of pictures."""

import numpy as np

from peakflight.airframe import Airframe
from peakflight.limits import KINDS, LARGEST, ROTORS, LimitKind, Limits, limited_values
from peakflight.result import BINDING, Plan
from peakflight.trajectory import Trajectory

ALWAYS = ("speed", "thrust_acceleration", "jerk", "snap")
"""Shown whether they are limited or not."""
SAMPLES = 3000
"""About how many points a curve has."""
PIECE_SAMPLES = (9, 200)
"""Fewest and most points to a polynomial piece."""
INSIDE = 1e-6
"""How far from its ends a time is inside a piece, relative to its duration."""


def sampled_curves(
    trajectory: Trajectory, airframe: Airframe | None = None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """(K, n) s, and name of limit to (K, n): what it limits, densely enough for a curve."""
    count = _count(trajectory)
    local = trajectory.segment_times[:, None] * np.linspace(0.0, 1.0, count)
    return trajectory.breakpoints[:-1, None] + local, sampled_values(trajectory, count, airframe)


def inner_times(trajectory: Trajectory) -> np.ndarray:
    """(K, n) s, the times of `sampled_curves`, but of joints those just inside their two pieces.

    A yaw has pieces of its own: at a joint, rounding says which piece of flight and yaw counts, and
    one of the flight may meet one of the yaw that does not belong to it.
    """
    count = _count(trajectory)
    parts = np.clip(np.linspace(0.0, 1.0, count), INSIDE, 1.0 - INSIDE)
    local = trajectory.segment_times[:, None] * parts
    times: np.ndarray = trajectory.breakpoints[:-1, None] + local
    return times


def sampled_values(
    trajectory: Trajectory, count: int, airframe: Airframe | None = None
) -> dict[str, np.ndarray]:
    """Name of limit to (K, count): what it limits, at even points of each piece.

    In the unit of the limit, but tilt in degrees.
    """
    derivatives = [trajectory.sample(count, order) for order in (1, 2, 3, 4)]
    values = limited_values(derivatives, airframe)
    values["tilt"] = np.degrees(values["tilt"])
    for name in ("body_rate", "angular_acceleration", *ROTORS):  # in free fall they are infinite
        if name in values:
            values[name] = np.clip(values[name], -LARGEST, LARGEST)
    return values


def shown_kinds(limits: Limits, curves: dict[str, np.ndarray]) -> list[LimitKind]:
    """Choose the kinds of limit that get a panel."""
    return [
        kind
        for kind in KINDS
        if kind.name in ALWAYS or (kind in limits.active and kind.name in curves)
    ]


def peaks(
    plan: Plan, kind: LimitKind, values: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where segments reach their limit or exceed it, by the report; nowhere if it does not know.

    Parameters
    ----------
    values
        (K, n), the samples of what the kind limits.

    Returns
    -------
    tuple of ndarray
        (m,) segments, (m,) the sample of each that is nearest to its peak, and (m,) kappa there.
    """
    kappa = plan.report.peaks.get(kind.name, np.zeros(len(values)))
    segments = np.flatnonzero(kappa >= BINDING)
    rows = values[segments]
    places = rows.argmin(axis=1) if kind.is_least else rows.argmax(axis=1)
    return segments, places, kappa[segments]


def _count(trajectory: Trajectory) -> int:
    """Points to a piece."""
    return int(np.clip(SAMPLES // len(trajectory), *PIECE_SAMPLES))
