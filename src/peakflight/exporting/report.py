"""What is known about a flight file: how near it is to its plan, and what it is proven to keep."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from peakflight.result import Plan
from peakflight.trajectory import Trajectory

FEWEST, MOST, IN_ALL = 2, 64, 100_000
"""Points of every piece at which two motions are compared: least and most, and about how many in
all."""
ORDERS = 3
"""Position, velocity and acceleration are compared."""


class Differences(NamedTuple):
    """Largest differences of a kind between two motions, or at joints."""

    position: float
    """m."""
    velocity: float
    """m/s."""
    acceleration: float
    """m/s^2."""


@dataclass(frozen=True, kw_only=True)
class ExportedFlight:
    """One drone of a flight file, as its consumer reads it."""

    name: str
    duration: float
    """s."""
    plan_duration: float
    """s, of the plan that was given."""
    pieces: int
    """Polynomials that were written; of set-points, those of the flight that they are of."""
    plan_pieces: int
    refitted: bool
    """Whether the flight was planned again with other pieces than the plan has."""
    difference: Differences
    """To the plan that was given, at the same part of the flight."""
    rounding: Differences
    """To the flight that was written, which differs from the plan where it was refitted."""
    jumps: Differences
    """Largest at joints: measured, not proven to be none."""
    yaw_difference: float
    """To the plan's yaw, rad; 0 if the file has none."""
    peaks: dict[str, float]
    """Name of limit to the largest certified peak over limit, as read back."""
    plan_peaks: dict[str, float]
    """The same of the plan that was given."""
    held: tuple[str, ...]
    """Names of the limits that the file is held to."""
    problems: tuple[str, ...] = ()
    """Limits that are exceeded by more than the tolerance, in words."""
    trajectory: Trajectory = field(repr=False, compare=False)
    """What the consumer flies."""

    @property
    def cost(self) -> float:
        """By how much longer the file flies than the plan, percent."""
        return 100.0 * (self.duration / self.plan_duration - 1.0)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names; without the trajectory."""
        values = {
            key: value._asdict() if isinstance(value, Differences) else value
            for key, value in vars(self).items()
            if key != "trajectory"
        }
        return {**values, "cost": self.cost}


@dataclass(frozen=True, kw_only=True)
class ExportReport:
    """What was written, and what is proven about the numbers in it as a consumer reads them."""

    format: str
    path: Path
    size: int
    """Bytes."""
    tolerance: float
    """Part of a limit by which the file may exceed it, for rounding."""
    flights: tuple[ExportedFlight, ...]
    """One for each plan."""
    lift: float = 0.0
    """m, by which the plans were moved up first."""
    notes: tuple[str, ...] = ()
    """For whoever flies it, one line each."""

    @property
    def feasible(self) -> bool:
        """Whether every limit that the file is held to is proven to hold, to the tolerance."""
        return not any(flight.problems for flight in self.flights)

    @property
    def problems(self) -> tuple[str, ...]:
        """What is exceeded, one line each."""
        several = len(self.flights) > 1
        return tuple(
            f"{flight.name}: {problem}" if several else problem
            for flight in self.flights
            for problem in flight.problems
        )

    @property
    def difference(self) -> Differences:
        """Largest differences to the plans."""
        return Differences(*np.max([flight.difference for flight in self.flights], axis=0).tolist())

    @property
    def cost(self) -> float:
        """By how much longer the file flies than the plan, percent; the largest of several."""
        return max(flight.cost for flight in self.flights)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names."""
        values = asdict(_Header(self.format, str(self.path), self.size, self.tolerance))
        return {
            **values,
            "feasible": self.feasible,
            "problems": list(self.problems),
            "lift": self.lift,
            "flights": [flight.to_dict() for flight in self.flights],
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class _Header:
    format: str
    path: str
    size: int
    tolerance: float


def differences(first: Trajectory, second: Trajectory) -> Differences:
    """Largest distances between two motions at the same part of their durations.

    Sampled at up to 64 points of every piece of either.
    """
    parts = np.union1d(_parts(first), _parts(second))
    found = []
    for order in range(ORDERS):
        values = [
            motion(motion.start_time + parts * (motion.end_time - motion.start_time), order)
            for motion in (first, second)
        ]
        found.append(float(np.linalg.norm(values[0] - values[1], axis=1).max()))
    return Differences(*found)


def jumps(trajectory: Trajectory) -> Differences:
    """Largest jumps of position, velocity and acceleration at the joints."""
    pieces = np.arange(len(trajectory))
    found = []
    for order in range(ORDERS):
        ends = trajectory.at(pieces[:-1], trajectory.segment_times[:-1], order)
        begins = trajectory.at(pieces[1:], np.zeros(len(pieces) - 1), order)
        found.append(float(np.linalg.norm(ends - begins, axis=1).max(initial=0.0)))
    return Differences(*found)


def yaw_difference(plan: Plan, yaw: Trajectory | None) -> float:
    """Largest difference of a yaw from the plan's at the same part of the flight, rad."""
    if yaw is None:
        return 0.0
    from peakflight.heading import heading

    asked = heading(plan)
    parts = np.union1d(_parts(asked), _parts(yaw))
    values = [
        motion(motion.start_time + parts * (motion.end_time - motion.start_time))[:, 0]
        for motion in (asked, yaw)
    ]
    return float(np.abs(values[0] - values[1]).max())


def _parts(motion: Trajectory) -> np.ndarray:
    """Where a motion is sampled, as parts of its duration: inside pieces, off the joints."""
    count = min(max(IN_ALL // len(motion), FEWEST), MOST)
    u = (np.arange(count) + 0.5) / count
    times = motion.breakpoints[:-1, None] + motion.segment_times[:, None] * u
    parts: np.ndarray = (times.ravel() - motion.start_time) / (motion.end_time - motion.start_time)
    return np.concatenate((parts, [0.0, 1.0]))
