"""The kinds of limit that a trajectory can be held to, and the values of one vehicle.

`Limits` is an open set: a kind is one entry of `KINDS`, one optional field of `Limits`, one unit
in `kernels/measures.py` (what `peak` sees), one in `kernels/rows.py` (what `joint` sees) and one in
`kernels/bounds.py` (what the certificate proves). Everything else, from the report to the command
line, goes through `KINDS`, and `LEASTS` if it limits from below.

Rotor thrusts follow from the motion and the airframe, for the worst heading. With the thrust T, of
which drag is a part, the angular velocity w and acceleration alpha of its direction, the airframe's
reach c, and chi for its unequal inertia, every rotor of a vehicle of mass m that does not twist
about its thrust gives between (T - m A) / 4 and (T + m A) / 4 with A = c |alpha| + chi |w|^2
(`kernels.rotors`). A yaw that is held or steered twists the vehicle, which takes more:
`twist_certificate` proves that.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from peakflight.airframe import Airframe
from peakflight.errors import InvalidProblem

GRAVITY = 9.81
"""Acceleration of gravity, m/s^2."""


class LimitKind(NamedTuple):
    """What one kind of limit is called, measured in and derived from."""

    name: str
    unit: str
    order: int
    """Highest derivative of position that it depends on."""
    label: str
    """For tables and axes."""

    @property
    def is_least(self) -> bool:
        """Whether it limits from below."""
        return self.name in LEASTS

    @property
    def leasts(self) -> tuple[str, ...]:
        """Names of the limits from below on the same."""
        return tuple(least for least, of in LEASTS.items() if of == self.name)

    @property
    def shown_unit(self) -> str:
        """What people read it in: degrees for angles."""
        return "°" if self.unit == "rad" else plain_unit(self.unit)

    def shown(self, value: Any) -> Any:
        """A value, or an array of them, in that unit."""
        return np.degrees(value) if self.unit == "rad" else value


KINDS = (
    LimitKind("speed", "m/s", 1, "speed"),
    LimitKind("thrust_acceleration", "m/s^2", 2, "thrust acceleration"),
    LimitKind("jerk", "m/s^3", 3, "jerk"),
    LimitKind("snap", "m/s^4", 4, "snap"),
    LimitKind("tilt", "rad", 2, "tilt"),
    LimitKind("least_thrust_acceleration", "m/s^2", 2, "least thrust acceleration"),
    LimitKind("body_rate", "rad/s", 3, "body rate"),
    LimitKind("angular_acceleration", "rad/s^2", 4, "angular acceleration"),
    LimitKind("rotor_thrust", "N", 4, "rotor thrust"),
    LimitKind("least_rotor_thrust", "N", 4, "least rotor thrust"),
)
"""In the order in which kernels number them."""
LABELS = {kind.name: kind.label for kind in KINDS}
"""Name of a limit to what it is called in tables and on axes."""
_INDEX = {kind.name: index for index, kind in enumerate(KINDS)}

LEASTS = {"least_thrust_acceleration": "thrust_acceleration", "least_rotor_thrust": "rotor_thrust"}
"""Name of a limit from below to that from above on the same."""
ROTORS = ("rotor_thrust", "least_rotor_thrust")
"""Limits that are about an airframe."""
BOUNDING = ("speed", "thrust_acceleration", "jerk", "snap", "rotor_thrust")
"""Limits that bound how fast any course can be flown; a straight climb needs no tilt."""
UNBOUNDED = 1e8
"""Ratios from here on stand for no bound at all, as for least thrust in free fall."""
SMALLEST, LARGEST = 1e-6, 1e9
"""Range of values, in SI units: beyond, squares and fourth roots run out of digits."""


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a trajectory may not exceed, anywhere. A field left at None does not limit.

    Raises
    ------
    InvalidProblem
        If a value is not a positive finite number, breaks the rule beside its field, or if none
        is set.
    """

    speed: float | None = None
    """Largest norm of v, m/s (Eq. kapp_i, s = 1)."""
    thrust_acceleration: float | None = None
    """Largest norm of a + g e3, m/s^2, above g (Eq. kappa2, Remark 1)."""
    jerk: float | None = None
    """Largest norm of j, m/s^3 (Eq. kapp_i, s = 3)."""
    snap: float | None = None
    """Largest norm of s, m/s^4 (Eq. kapp_i, s = 4)."""
    tilt: float | None = None
    """Largest angle of a + g e3 from the vertical, rad, below pi/2."""
    least_thrust_acceleration: float | None = None
    """Smallest norm of a + g e3, m/s^2, below g."""
    body_rate: float | None = None
    """Largest angular speed of the direction of a + g e3, rad/s."""
    angular_acceleration: float | None = None
    """Largest angular acceleration of that direction, in a frame that does not twist, rad/s^2."""
    rotor_thrust: float | None = None
    """Largest thrust of a rotor, whatever the heading, N; more than a quarter of the weight."""
    least_rotor_thrust: float | None = None
    """Smallest thrust of a rotor, whatever the heading, N: 0 or more, below a quarter of the
    weight."""
    airframe: Airframe | None = None
    """What turns motion into rotor thrusts; needed for limits on them."""

    def __post_init__(self) -> None:
        for kind in KINDS:
            value = getattr(self, kind.name)
            if value is not None:
                object.__setattr__(self, kind.name, _checked(kind.name, value))
        if self.thrust_acceleration is not None and self.thrust_acceleration <= GRAVITY:
            raise InvalidProblem(
                f"limit thrust_acceleration is {self.thrust_acceleration:g} m/s^2; it must be "
                f"above gravity ({GRAVITY} m/s^2), or the vehicle cannot hover"
            )
        if self.tilt is not None and self.tilt >= math.pi / 2:
            raise InvalidProblem(
                f"limit tilt is {self.tilt:g} rad; it must be below pi/2 (write 50deg for degrees)"
            )
        least = self.least_thrust_acceleration
        if least is not None and least >= GRAVITY:
            raise InvalidProblem(
                f"limit least_thrust_acceleration is {least:g} m/s^2; it must be below gravity "
                f"({GRAVITY} m/s^2), or the vehicle cannot hover"
            )
        self._check_rotors()
        if not self.active:
            raise InvalidProblem("no limit is set; set at least one, such as speed=5.0")

    def _check_rotors(self) -> None:
        if not (self.airframe is None or isinstance(self.airframe, Airframe)):
            raise InvalidProblem(f"airframe is {self.airframe!r}; it must be a peakflight.Airframe")
        for name in ROTORS:
            value = getattr(self, name)
            if value is None:
                continue
            if self.airframe is None:
                raise InvalidProblem(
                    f"limit {name} is set without an airframe; set airframe=Airframe(mass=..., "
                    "inertia=..., lever=...) beside it"
                )
            hover = self.airframe.mass * GRAVITY / 4.0
            if name == "rotor_thrust" and value <= hover:
                raise InvalidProblem(
                    f"limit rotor_thrust is {value:g} N; it must be above a quarter of the weight "
                    f"({hover:g} N), or the vehicle cannot hover"
                )
            if name == "least_rotor_thrust" and value >= hover:
                raise InvalidProblem(
                    f"limit least_rotor_thrust is {value:g} N; it must be below a quarter of the "
                    f"weight ({hover:g} N), or the vehicle cannot hover"
                )

    @cached_property
    def active(self) -> tuple[LimitKind, ...]:
        """The kinds that are set, in the order of `KINDS`."""
        return tuple(kind for kind in KINDS if getattr(self, kind.name) is not None)

    @property
    def on_leaning(self) -> bool:
        """Whether tilt or least thrust is limited: quotients, which kernels else leave out."""
        return self.tilt is not None or self.least_thrust_acceleration is not None

    @property
    def on_turning(self) -> bool:
        """Whether how fast the thrust direction turns is limited: kernels of its own prove that."""
        return self.body_rate is not None or self.angular_acceleration is not None

    @property
    def on_rotors(self) -> bool:
        """Whether rotor thrust is limited, most or least."""
        return any(getattr(self, name) is not None for name in ROTORS)

    @property
    def figures(self) -> np.ndarray | None:
        """(4,) of the airframe where rotor thrust is limited; else kernels leave it out."""
        if self.airframe is None or not self.on_rotors:
            return None
        return self.airframe.figures

    @property
    def can_steer(self) -> bool:
        """Whether the airframe says what turning about its z axis takes."""
        return self.airframe is not None and self.airframe.can_steer

    def as_array(self) -> np.ndarray:
        """What kernels hold kinds to, shape (len(KINDS),); NaN where nothing is limited.

        Values in the order of `KINDS`. Rotor thrusts become accelerations: the most that four
        rotors give, and how far below gravity that which the least of them stands for may fall.
        """
        return self._values.copy()

    @cached_property
    def _values(self) -> np.ndarray:
        held = [getattr(self, kind.name) for kind in KINDS]
        values = np.array([math.nan if value is None else value for value in held])
        if self.airframe is not None:
            most, least = (_INDEX[name] for name in ROTORS)
            values[[most, least]] *= 4.0 / self.airframe.mass
            values[least] = GRAVITY - values[least]
        return values

    def sparing(self, demands: Mapping[str, float]) -> Self:
        """The same, with a part of the rotors' range kept free at either end, for a yaw to take.

        demands: name of a limit on rotors to N; at most half of what hovering leaves is kept free.
        """
        if self.airframe is None:
            return self
        hover = self.airframe.mass * GRAVITY / 4.0
        changed = {}
        for name, demand in demands.items():
            limit = getattr(self, name)
            towards = hover - limit
            value = limit + math.copysign(min(demand, 0.5 * abs(towards)), towards)
            changed[name] = max(value, SMALLEST)
        return replace(self, **changed)

    @property
    def rotor_rooms(self) -> dict[str, float]:
        """Name of each limit on rotors that is set to how far it is from hovering, N."""
        if self.airframe is None:
            return {}
        hover = self.airframe.mass * GRAVITY / 4.0
        values = {name: getattr(self, name) for name in ROTORS}
        return {name: abs(hover - value) for name, value in values.items() if value is not None}

    def ratios(self, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Kappa of the kinds that are set, from `limited_values` of the same airframe."""
        found = {}
        with np.errstate(divide="ignore"):
            for kind in self.active:
                limit, value = getattr(self, kind.name), values[kind.name]
                if kind.name == "least_rotor_thrust" and self.airframe is not None:
                    hover = self.airframe.mass * GRAVITY / 4.0
                    found[kind.name] = np.maximum((hover - value) / (hover - limit), 0.0)
                else:
                    found[kind.name] = limit / value if kind.is_least else value / limit
        return found

    def attained(self, kind: LimitKind, ratio: float) -> float | None:
        """Value that a kappa stands for, in the unit of its kind; None where there is no bound.

        Of the least rotor thrust, what keeps it and is at least that of hovering has kappa 0.
        """
        limit: float = getattr(self, kind.name)
        if ratio >= UNBOUNDED:
            return None
        if kind.name == "least_rotor_thrust" and self.airframe is not None:
            hover = self.airframe.mass * GRAVITY / 4.0
            return hover - ratio * (hover - limit)
        if kind.is_least:
            return limit / ratio if ratio > 0.0 else None
        return limit * ratio

    def to_dict(self) -> dict[str, Any]:
        """The limits that are set, by name, and the airframe if there is one."""
        values: dict[str, Any] = {kind.name: getattr(self, kind.name) for kind in self.active}
        if self.airframe is not None:
            values["airframe"] = self.airframe.to_dict()
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Limits by name, as `to_dict` gives them."""
        known = [kind.name for kind in KINDS]
        for name in values:
            if name not in (*known, "airframe"):
                raise InvalidProblem(f"unknown limit {name!r}; known are {', '.join(known)}")
        given = dict(values)
        if given.get("airframe") is not None:
            given["airframe"] = Airframe.from_dict(given["airframe"])
        return cls(**given)


def limited_values(
    derivatives: Sequence[np.ndarray], airframe: Airframe | None = None
) -> dict[str, np.ndarray]:
    """What each kind of limit is about, at samples of a motion.

    Parameters
    ----------
    derivatives
        (..., 3) velocity, acceleration, ... as many as there are; kinds that need more are left
        out.
    airframe
        For rotor thrusts, which are left out without one.

    Returns
    -------
    Name of kind to (...,), in its unit.
    """
    norms = [np.linalg.norm(derivative, axis=-1) for derivative in derivatives]
    values = dict(zip(("speed", "", "jerk", "snap"), norms, strict=False))
    values.pop("", None)
    if len(derivatives) >= 2:
        thrust = derivatives[1] + np.array([0.0, 0.0, GRAVITY])
        values["thrust_acceleration"] = np.linalg.norm(thrust, axis=-1)
        values["least_thrust_acceleration"] = values["thrust_acceleration"]
        across = np.linalg.norm(thrust[..., :2], axis=-1)
        values["tilt"] = np.arctan2(across, thrust[..., 2])
    if len(derivatives) >= 3:
        values["body_rate"] = _turn(thrust, derivatives[2])
    if len(derivatives) >= 4:
        jerk = derivatives[2]
        values["angular_acceleration"] = _swing(thrust, jerk, derivatives[3])
    if len(derivatives) >= 4 and airframe is not None:
        reach, drag, along_drag, crossed = airframe.figures
        force, change = thrust + drag * derivatives[0], jerk + drag * derivatives[1]
        turning = reach * _swing(force, change, derivatives[3] + drag * jerk)
        turning = turning + crossed * _turn(force, change) ** 2
        size = np.linalg.norm(force, axis=-1)
        pull = (force * derivatives[0]).sum(axis=-1) / np.where(size > 0.0, size, np.inf)
        for name, sign in zip(ROTORS, (1.0, -1.0), strict=True):
            values[name] = airframe.mass / 4.0 * (size + along_drag * pull + sign * turning)
    return values


def keeps(name: str, value: float, limit: float) -> bool:
    """Whether a value of a kind keeps its limit: from below for what is least."""
    return value >= limit if name in LEASTS else value <= limit


def plain_unit(unit: str) -> str:
    """Write a unit as it is printed: m/s² for m/s^2."""
    for power, raised in (("^2", "²"), ("^3", "³"), ("^4", "⁴")):
        unit = unit.replace(power, raised)
    return unit


def _swing(thrust: np.ndarray, jerk: np.ndarray, snap: np.ndarray) -> np.ndarray:
    """|F x (s - 2 (F.j / F.F) j)| / F.F of (..., 3) arrays, as `_turn`."""
    square = (thrust * thrust).sum(axis=-1, keepdims=True)
    along = 2.0 * (thrust * jerk).sum(axis=-1, keepdims=True)
    along = along / np.where(square > 0.0, square, np.inf)
    return _turn(thrust, snap - along * jerk)


def _turn(thrust: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """|F x y| / F.F of (..., 3) arrays; in free fall, where it has no value, infinite."""
    square = (thrust * thrust).sum(axis=-1)
    across = np.linalg.norm(np.cross(thrust, motion), axis=-1)
    values: np.ndarray = np.where(square > 0.0, across, np.inf) / np.where(square > 0, square, 1.0)
    return values


def _checked(name: str, value: Any) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise InvalidProblem(f"limit {name} is {value!r}; it must be a number") from None
    if name == "least_rotor_thrust" and number == 0.0:  # rotors that do not push down
        return 0.0
    if not (math.isfinite(number) and number > 0.0):
        raise InvalidProblem(f"limit {name} is {number:g}; it must be positive and finite")
    if not SMALLEST <= number <= LARGEST:
        raise InvalidProblem(
            f"limit {name} is {number:g}; it must be from {SMALLEST:g} to {LARGEST:g}"
        )
    return number


PAPER_LIMITS = Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
"""What the paper's minimum-jerk trajectories keep; commands take it where no limits are given."""
