"""Which way the nose points: what is asked of the yaw along a flight."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from numbers import Real
from typing import Any, Self, TypeAlias

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.limits import LABELS, LARGEST, SMALLEST, LimitKind

YAW_KINDS = (
    LimitKind("yaw_rate", "rad/s", 1, "yaw rate"),
    LimitKind("yaw_acceleration", "rad/s^2", 2, "yaw acceleration"),
)
"""What is limited of the yaw, by order of derivative."""
BODY_KINDS = (
    LimitKind("body_rate_z", "rad/s", 1, "body rate about z"),
    LimitKind("angular_acceleration_z", "rad/s^2", 2, "angular acceleration about z"),
)
"""What is limited instead where limits are about the body."""
ABOUT = {"yaw": YAW_KINDS, "body": BODY_KINDS}
"""What the limits of a heading can be about, to the kinds that they are then."""
FIELDS = ("rate", "acceleration")
"""The fields of a heading that limit these kinds, by order of derivative."""
ALL_LABELS = LABELS | {kind.name: kind.label for kinds in ABOUT.values() for kind in kinds}
"""Name of any limit to what it is called in tables and on axes."""
ASKED = {"fixed": "angle", "waypoints": "angles", "velocity": None, "point": "point", "free": None}
"""Policy to the field that it needs."""
FARTHEST_ANGLE = 1e4
"""Largest angle, rad: beyond, too few digits of it are left."""
FARTHEST_POINT = 1e7
"""Largest coordinate of a point, m: as of waypoints."""


@dataclass(frozen=True, kw_only=True)
class Heading:
    """Where the nose should point during a flight, and how fast it may turn.

    Raises
    ------
    InvalidProblem
        If the policy is unknown, what it needs is missing, or a value is against its rule.
    """

    policy: str
    """"fixed", "waypoints", "velocity", "point", or "free": the nose is left where it ends up when
    the vehicle does not turn about its thrust."""
    angle: float | None = None
    """Of policy fixed: yaw during the whole flight, rad."""
    angles: tuple[float, ...] | None = None
    """Of policy waypoints: (K+1,) yaw at each waypoint, rad; the nose turns the shorter way."""
    point: tuple[float, float, float] | None = None
    """Of policy point: what to look at, m; its height does not matter."""
    rate: float | None = 3.0
    """Fastest that the nose may turn, rad/s; None does not limit. The default is half a turn in
    about a second."""
    acceleration: float | None = 20.0
    """Fastest that the rate may change, rad/s^2; None does not limit. By default the nose reaches
    the default rate in 0.15 s; yaw is the weakest axis of a quadrotor, which the drag of its rotors
    alone turns."""
    about: str | None = None
    """What rate and acceleration are those of: "yaw", the angle; or "body", the vehicle about its
    own z axis (omega_z), which is what gyro and rotors feel, and differs where the thrust swings
    while it leans. None is "body" for a free nose and where rotor thrust is limited, else "yaw"."""

    def __post_init__(self) -> None:
        if not isinstance(self.policy, str) or self.policy not in ASKED:
            raise InvalidProblem(f"yaw policy is {self.policy!r}; known are {', '.join(ASKED)}")
        for name in filter(None, ASKED.values()):
            given = getattr(self, name) is not None
            if given != (name == ASKED[self.policy]):
                verb = "has no use for" if given else "needs"
                raise InvalidProblem(f"yaw policy {self.policy} {verb} {name}")
        if self.angle is not None:
            object.__setattr__(self, "angle", _finite("yaw", self.angle, FARTHEST_ANGLE))
        if self.angles is not None:
            angles = tuple(
                _finite(f"waypoint {index} has yaw", angle, FARTHEST_ANGLE)
                for index, angle in enumerate(_numbers("yaw", self.angles))
            )
            object.__setattr__(self, "angles", angles)
        if self.point is not None:
            point = tuple(
                _finite("a coordinate of the yaw point", value, FARTHEST_POINT)
                for value in _numbers("the yaw point", self.point)
            )
            if len(point) != 3:
                raise InvalidProblem(f"the yaw point has {len(point)} numbers; it must have 3")
            object.__setattr__(self, "point", point)
        if not (self.about is None or self.about in ABOUT):
            raise InvalidProblem(
                f"yaw limits are about {self.about!r}; it must be {' or '.join(ABOUT)}"
            )
        if self.policy == "free" and self.about == "yaw":
            raise InvalidProblem("a free nose is limited about the body; leave about out")
        for kind, name in zip(self.kinds, FIELDS, strict=True):
            limit = getattr(self, name)
            if limit is not None:
                value = _finite(f"limit {kind.name}", limit, LARGEST)
                if not value >= SMALLEST:
                    raise InvalidProblem(
                        f"limit {kind.name} is {value:g}; it must be positive, from {SMALLEST:g} "
                        f"to {LARGEST:g}"
                    )
                object.__setattr__(self, name, value)

    @property
    def kinds(self) -> tuple[LimitKind, ...]:
        """What rate and acceleration limit, of the two in `ABOUT`."""
        return ABOUT[self.about or ("body" if self.policy == "free" else "yaw")]

    @property
    def is_about_body(self) -> bool:
        """Whether rate and acceleration are those of the vehicle about its own z axis."""
        return self.kinds is BODY_KINDS

    @property
    def limits(self) -> dict[LimitKind, float]:
        """The kinds that are limited, with their limits."""
        values = (getattr(self, name) for name in FIELDS)
        pairs = zip(self.kinds, values, strict=True)
        return {kind: value for kind, value in pairs if value is not None}

    @property
    def follows(self) -> bool:
        """Whether it is a target that is followed as closely as the limits allow."""
        return self.policy in ("velocity", "point")

    def within(self, share: float) -> Self:
        """The same with a part of what its limits allow."""
        values = {name: getattr(self, name) for name in FIELDS}
        return replace(self, **{name: value and share * value for name, value in values.items()})

    def with_angles(self, angles: np.ndarray | None) -> Self:
        """The same with (K+1,) other angles, if it has any."""
        if self.angles is None or angles is None:
            return self
        return replace(self, angles=tuple(angles.tolist()))

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names, from which `from_dict` makes the same heading."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        kept = (*filter(None, ASKED.values()), "about")
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in values.items()
            if not (name in kept and value is None)
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """A heading from what `to_dict` gave; a policy that is left out follows from the rest."""
        values = dict(values)
        unknown = set(values) - {field.name for field in fields(cls)}
        if unknown:
            raise InvalidProblem(
                f"unknown entry {min(map(str, unknown))!r} in yaw; known are "
                f"{', '.join(field.name for field in fields(cls))}"
            )
        if "policy" not in values:
            needing = [policy for policy, name in ASKED.items() if name and name in values]
            if len(needing) != 1:
                raise InvalidProblem(f"yaw names no policy; known are {', '.join(ASKED)}")
            values["policy"] = needing[0]
        return cls(**values)


HeadingLike: TypeAlias = Heading | float | str | Mapping[str, Any]
"""A heading; or in short an angle in rad, "velocity", or fields such as {"point": [x, y, z]}."""


def as_heading(asked: Any) -> Heading | None:
    """The heading that a `HeadingLike` stands for; None for anything else, such as an array.

    Raises
    ------
    InvalidProblem
        If it is one, but against a rule.
    """
    if isinstance(asked, Heading):
        return asked
    if isinstance(asked, str):
        return Heading(policy=asked)
    if isinstance(asked, Mapping):
        return Heading.from_dict(asked)
    if isinstance(asked, Real) and not isinstance(asked, bool):
        return Heading(policy="fixed", angle=float(asked))
    return None


def unwrapped(angles: np.ndarray) -> np.ndarray:
    """(n,) rad, the same directions, each reached from the one before by the shorter way.

    Exactly half a turn goes to the left, counterclockwise seen from above.
    """
    turns = np.pi - np.mod(np.pi - np.diff(angles), 2.0 * np.pi)
    return angles[0] + np.concatenate(([0.0], np.cumsum(turns)))


def _numbers(name: str, values: Any) -> list[Any]:
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise InvalidProblem(f"{name} is {values!r}; it must be a list of numbers")
    return list(values)


def _finite(name: str, value: Any, largest: float) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidProblem(f"{name} is {value!r}; it must be a number") from None
    if not math.isfinite(number):
        raise InvalidProblem(f"{name} = {number}; it must be finite")
    if not abs(number) <= largest:
        raise InvalidProblem(f"{name} is {number:g}; it must be within {largest:g} of zero")
    return number
