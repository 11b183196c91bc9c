"""The part of a vehicle that rotor limits are about."""

import math
from collections.abc import Mapping
from dataclasses import asdict, astuple, dataclass, fields
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
    yaw_inertia: float | None = None
    """Moment of inertia about the yaw axis, kg m^2; with the next for a nose that is steered."""
    torque_per_thrust: float | None = None
    """Torque of a rotor about its axis over its thrust, m."""

    def __post_init__(self) -> None:
        if (self.yaw_inertia is None) != (self.torque_per_thrust is None):
            raise InvalidProblem("airframe has one of yaw_inertia and torque_per_thrust; give both")
        for field in fields(self):
            name, value = field.name, getattr(self, field.name)
            if value is None and field.default is None:
                continue
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
        return all(
            one is two or (None not in (one, two) and math.isclose(one, two, rel_tol=1e-9))
            for one, two in pairs
        )

    @property
    def reach(self) -> float:
        """Collective acceleration that turning at 1 rad/s^2 takes from a rotor at worst, m.

        sqrt(2) inertia / (lever mass): see `docs/certificate.md`.
        """
        return math.sqrt(2.0) * self.inertia / (self.lever * self.mass)

    @property
    def can_steer(self) -> bool:
        """Whether it is known what turning about the yaw axis takes."""
        return self.yaw_inertia is not None

    @property
    def steering(self) -> np.ndarray:
        """(3,) c, r and k of `kernels.twisting`: what turning takes, where that about z counts.

        They are the reach in m, the ratio of the moments of inertia, and the collective
        acceleration that an angular acceleration of 1 rad/s^2 about z takes from a rotor, m.
        """
        if self.yaw_inertia is None or self.torque_per_thrust is None:
            raise InvalidProblem("airframe has no yaw_inertia and torque_per_thrust")
        spin = self.yaw_inertia / (self.torque_per_thrust * self.mass)
        return np.array([self.reach, self.yaw_inertia / self.inertia, spin])

    def to_dict(self) -> dict[str, float]:
        """What is known, by name, from which `from_dict` makes the same."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Airframe by the names of its fields; those that have a default may be left out."""
        known = [field.name for field in fields(cls)]
        needed = {field.name for field in fields(cls) if field.default is not None}
        if not isinstance(values, Mapping) or not needed <= set(values) <= set(known):
            raise InvalidProblem(f"airframe is {values!r}; it must have {', '.join(known)}")
        return cls(**values)
