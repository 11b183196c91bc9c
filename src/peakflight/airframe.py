"""The part of a vehicle that rotor limits are about."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from peakflight.errors import InvalidProblem

SMALLEST, LARGEST = 1e-9, 1e9
"""What figures of an airframe may be, in SI units."""
NUMBERS = ("mass", "inertia", "lever", "yaw_inertia", "torque_per_thrust")
"""The fields that are a positive number each; the last two may be unknown."""

SPIN = 5
"""Which of `Airframe.steering` an acceleration about z multiplies."""


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
    inertia_difference: float = 0.0
    """By how much inertia is less about the other one of the roll and pitch axes, kg m^2."""
    drag: tuple[float, float] = (0.0, 0.0)
    """Force against the velocity, over it, across and along the thrust, kg/s."""

    def __post_init__(self) -> None:
        if (self.yaw_inertia is None) != (self.torque_per_thrust is None):
            raise InvalidProblem("airframe has one of yaw_inertia and torque_per_thrust; give both")
        for name in NUMBERS:
            value = getattr(self, name)
            if value is None and name in NUMBERS[3:]:
                continue
            object.__setattr__(self, name, _number(name, value))
            if not SMALLEST <= value <= LARGEST:
                raise InvalidProblem(
                    f"airframe {name} is {value!r}; it must be from {SMALLEST:g} to {LARGEST:g}"
                )

        object.__setattr__(self, "drag", _drag(self.drag))
        uneven = _number("inertia_difference", self.inertia_difference)
        object.__setattr__(self, "inertia_difference", uneven)
        if not 0.0 <= self.inertia_difference < self.inertia:
            raise InvalidProblem(
                f"airframe inertia_difference is {self.inertia_difference!r}; it must be from 0 to "
                f"below the inertia, {self.inertia:g}"
            )
        if self.inertia_difference > 0.0 and self.torque_per_thrust is None:
            raise InvalidProblem(
                f"airframe inertia_difference is {self.inertia_difference!r}; torque_per_thrust "
                "and yaw_inertia must be given with it, to know what it takes of the rotors"
            )

    def is_near(self, other: "Airframe") -> bool:
        """Whether two airframes are the same but for rounding."""
        pairs = [(getattr(self, name), getattr(other, name)) for name in NUMBERS]
        pairs += zip(self.drag, other.drag, strict=True)
        uneven = abs(self.inertia_difference - other.inertia_difference)
        if not uneven <= 1e-9 * self.inertia:
            return False
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
    def figures(self) -> np.ndarray:
        """(4,) c, delta, epsilon and chi of `kernels.rotors`.

        Reach, m; drag over mass, 1/s; and the collective acceleration that unequal inertia takes
        from a rotor at worst where the thrust direction swings at 1 rad/s, m.
        """
        across, along = self.drag
        crossed = 0.0
        if self.torque_per_thrust is not None:
            crossed = 0.5 * self.inertia_difference / (self.torque_per_thrust * self.mass)
        drag = (across / self.mass, (along - across) / self.mass)
        return np.array([self.reach, *drag, crossed])

    @property
    def can_steer(self) -> bool:
        """Whether it is known what turning about the yaw axis takes."""
        return self.yaw_inertia is not None

    @property
    def steering(self) -> np.ndarray:
        """(7,) what `kernels.twisting` takes, where turning about z counts.

        After the `figures`, the ratio of the moments of inertia; the collective acceleration that
        an angular acceleration of 1 rad/s^2 about z takes from a rotor, m; and what unequal inertia
        across z takes of a product of the rates about z and across it, m.
        """
        if self.yaw_inertia is None or self.torque_per_thrust is None:
            raise InvalidProblem("airframe has no yaw_inertia and torque_per_thrust")
        spin = self.yaw_inertia / (self.torque_per_thrust * self.mass)
        ratio, uneven = self.yaw_inertia / self.inertia, self.inertia_difference
        twisting = (1.0 + ratio) * uneven / self.inertia * self.reach
        return np.array([*self.figures, ratio, spin, twisting])

    def to_dict(self) -> dict[str, Any]:
        """What is known, by name, from which `from_dict` makes the same."""
        values = {name: getattr(self, name) for name in NUMBERS}
        known: dict[str, Any] = {name: value for name, value in values.items() if value is not None}
        if self.inertia_difference:
            known["inertia_difference"] = self.inertia_difference
        return {**known, "drag": list(self.drag)} if any(self.drag) else known

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Airframe by the names of its fields; those that have a default may be left out."""
        if not isinstance(values, Mapping) or not set(NUMBERS[:3]) <= set(values) <= {
            *NUMBERS, "inertia_difference", "drag",
        }:  # fmt: skip
            raise InvalidProblem(
                f"airframe is {values!r}; it must have {', '.join(NUMBERS[:3])}, and may have "
                f"{', '.join(NUMBERS[3:])}, inertia_difference and drag"
            )
        return cls(**values)


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.floating):
        raise InvalidProblem(f"airframe {name} is {value!r}; it must be a number")
    if isinstance(value, int) and abs(value) > LARGEST:
        raise InvalidProblem(f"airframe {name} is above {LARGEST:g}")
    return float(value)


def _drag(values: Any) -> tuple[float, float]:
    try:
        across, along = (float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        raise InvalidProblem(f"airframe drag is {values!r}; it must be two numbers") from None
    for value in (across, along):
        if not 0.0 <= value <= LARGEST:
            raise InvalidProblem(
                f"airframe drag is {values!r}; both must be from 0 to {LARGEST:g} kg/s"
            )
    return across, along
