"""What the tuner found."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from peakflight.limits import Limits
from peakflight.result import Plan
from peakflight.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Point:
    """One end of the bargain between time and error: nothing that was tried is better in both."""

    duration: float
    """s."""
    rms_error: float
    """m, of the worst of its flights."""
    family: str
    """Method and options."""
    limits: Limits

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and names."""
        return {
            "duration": self.duration,
            "rms_error": self.rms_error,
            "family": self.family,
            "limits": self.limits.to_dict(),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class TuneResult:
    """The fastest plan that a vehicle tracks within an error, and what it takes to be slower."""

    plan: Plan | None
    """None if nothing that was tried is tracked."""
    vehicle: Vehicle
    error: float
    """RMS error that was asked for, m."""
    rms_error: float | None
    """Of the plan, flown as the figures say, m."""
    worst_error: float | None
    """Of the plan, of the worst of the vehicles that it has stood, m."""
    stood_doubts: bool
    """Whether it has stood the vehicles that differ a little, by which plans are told from lucky
    ones in the end; if not, none had when the time was up."""
    options: dict[str, Any]
    """Of `peakflight.plan`, beside the limits: with them it makes the same plan again."""
    front: Sequence[Point]
    """From the fastest on."""
    plans: int
    """How many were tried."""
    robust: int
    """Vehicles that differ, which the plan has stood."""
    seconds: float
    """Time that it took."""
    complete: bool
    """Whether the search came to its own end, not that of the budget."""
    seed: int

    @property
    def limits(self) -> Limits | None:
        """What the plan was made with."""
        return None if self.plan is None else self.plan.problem.limits

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names, without the plan itself."""
        return {
            "duration": None if self.plan is None else self.plan.duration,
            "method": None if self.plan is None else self.plan.method,
            "limits": None if self.limits is None else self.limits.to_dict(),
            "options": dict(self.options),
            "vehicle": self.vehicle.name,
            "error": self.error,
            "rms_error": self.rms_error,
            "worst_error": self.worst_error,
            "stood_doubts": self.stood_doubts,
            "plans": self.plans,
            "robust": self.robust,
            "seconds": self.seconds,
            "complete": self.complete,
            "seed": self.seed,
            "front": [point.to_dict() for point in self.front],
        }
