"""The part of a vehicle that rotor limits are about."""

import math
from collections.abc import Mapping
from dataclasses import astuple, dataclass, fields
from typing import Any, Self

import numpy as np

from peakflight.errors import InvalidProblem

SMALLEST, LARGEST = 1e-9, 1e9
"""What figures of an airframe may be, in SI units."""


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
            if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
                raise InvalidProblem(f"airframe {name} is {value!r}; it must be a number")
            if isinstance(value, int) and abs(value) > LARGEST:
                raise InvalidProblem(f"airframe {name} is above {LARGEST:g}")
            object.__setattr__(self, name, float(value))
            if not SMALLEST <= value <= LARGEST:
                raise InvalidProblem(
                    f"airframe {name} is {value!r}; it must be from {SMALLEST:g} to {LARGEST:g}"
                )

    def is_near(self, other: "Airframe") -> bool:
        """Whether two airframes are the same but for rounding."""
        pairs = zip(astuple(self), astuple(other), strict=True)
        return all(math.isclose(one, two, rel_tol=1e-9) for one, two in pairs)

    @property
    def reach(self) -> float:
        """Collective acceleration that turning at 1 rad/s^2 takes from a rotor at worst, m.

        sqrt(2) inertia / (lever mass): see `docs/certificate.md`.
        """
        return math.sqrt(2.0) * self.inertia / (self.lever * self.mass)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Airframe by the names of its fields, as `dataclasses.asdict` gives them."""
        known = [field.name for field in fields(cls)]
        if not isinstance(values, Mapping) or sorted(values) != sorted(known):
            raise InvalidProblem(f"airframe is {values!r}; it must have {', '.join(known)}")
        return cls(**values)
