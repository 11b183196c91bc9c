"""The part of a vehicle that rotor limits are about."""

import math
from dataclasses import dataclass

from peakflight.errors import InvalidProblem


@dataclass(frozen=True, kw_only=True)
class Airframe:
    """Rigid body and rotor placement of a quadrotor with four equal rotors in a square X."""

    mass: float
    """kg."""
    inertia: float
    """Moment of inertia about the roll and the pitch axis, the larger of the two, kg m^2."""
    lever: float
    """Distance of every rotor from the roll axis and from the pitch axis, m."""

    def __post_init__(self) -> None:
        for name in ("mass", "inertia", "lever"):
            value = getattr(self, name)
            if not (0.0 < value < math.inf):
                raise InvalidProblem(f"airframe {name} is {value!r}; it must be positive")
