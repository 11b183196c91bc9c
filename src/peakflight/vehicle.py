"""What flies: a quadrotor's rigid body, rotors and default limits, each figure with its source."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from peakflight.airframe import Airframe
from peakflight.default_limits import default_limits
from peakflight.errors import InvalidProblem, quoted
from peakflight.limits import GRAVITY, Limits

ROTORS = 4
LONGEST_NAME = 80
"""Characters of a name."""
SMALLEST, LARGEST = 1e-9, 1e6
"""Figures that are positive, in SI units: what is beyond is a slip of units."""
OFF_CENTRE = 1e-3
"""How far the centre of the rotors may be from the centre of mass, relative to their distance."""
LEAST_SPAN = 1e-3
"""How narrow the square of the rotors may be, relative to their distance."""


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A quadrotor, and the limits to plan with unless the user says otherwise.

    Body frame: x forward, y left, z up along the thrust, from the centre of mass.

    Raises
    ------
    InvalidProblem
        If a figure is missing, not a number or against the rule beside its field; the message
        names the figure, the value and the rule.
    """

    name: str
    mass: float
    """kg."""
    inertia: tuple[float, float, float]
    """Moments of inertia about x, y and z, kg m^2; the frame is along the principal axes."""
    rotor_positions: tuple[tuple[float, float], ...]
    """(4, 2) x and y of each rotor, m; centred, not all in a line."""
    spins: tuple[int, ...]
    """(4,) how each rotor turns, seen from above: 1 counterclockwise, whose torque turns the
    vehicle clockwise, or -1 clockwise. Two of each."""
    rotor_thrust: tuple[float, float]
    """Least and most of one rotor, N; four times the most is above the weight."""
    torque_per_thrust: float
    """Torque of a rotor about z over its thrust, m."""
    motor_lag: float = 0.0
    """Time constant of thrust following its command, s; 0 if it follows at once."""
    body_rate: tuple[float, float] | None = None
    """Largest body rate across z and about z, rad/s; None if none is known."""
    drag: tuple[float, float] = (0.0, 0.0)
    """Rotor drag over speed, across z and along z, kg/s (Faessler et al. 2018, times the mass)."""
    limits: Limits = None  # type: ignore[assignment]
    """What to plan with; by default `peakflight.default_limits`."""
    sources: Mapping[str, str] = field(default_factory=dict)
    """Name of a field above to where its figure is from, a line each."""
    reasons: Mapping[str, str] = field(default_factory=dict)
    """Name of a limit to why it has its value, a line each."""

    def __post_init__(self) -> None:
        if not (isinstance(self.name, str) and self.name.strip()):
            raise InvalidProblem(f"vehicle name is {self.name!r}; it must be text, not empty")
        if len(self.name) > LONGEST_NAME or not self.name.isprintable():
            raise InvalidProblem(
                f"vehicle name is {quoted(self.name)}; it must be up to {LONGEST_NAME} printable "
                "characters"
            )
        self._set("mass", _positive("mass", self.mass))
        self._set("inertia", _numbers("inertia", self.inertia, (3,)))
        for axis, value in zip("xyz", self.inertia, strict=True):
            _positive(f"inertia about {axis}", value)
        if max(self.inertia) > sum(self.inertia) - max(self.inertia):
            raise InvalidProblem(
                f"vehicle inertia is {_listed(self.inertia)}; no body has one moment of inertia "
                "larger than the other two together"
            )
        self._check_rotors()
        self._set("motor_lag", _zero_or_more("motor_lag", self.motor_lag))
        if self.body_rate is not None:
            self._set("body_rate", _numbers("body_rate", self.body_rate, (2,)))
            for value in self.body_rate:
                _positive("body_rate", value)
        self._set("drag", _numbers("drag", self.drag, (2,)))
        for value in self.drag:
            _zero_or_more("drag", value)
        if self.limits is None:
            limits, reasons = self._default_limits()
            self._set("limits", limits)
            self._set("reasons", {**reasons, **_lines("reasons", self.reasons, reasons)})
        elif not isinstance(self.limits, Limits):
            raise InvalidProblem(
                f"vehicle limits is {self.limits!r}; it must be a peakflight.Limits"
            )
        else:
            self._set("reasons", _lines("reasons", self.reasons, self.limits.to_dict()))
        known = [one.name for one in fields(self) if one.name not in ("name", "sources", "reasons")]
        self._set("sources", _lines("sources", self.sources, dict.fromkeys(known)))

    def _check_rotors(self) -> None:
        self._set("rotor_positions", _numbers("rotor_positions", self.rotor_positions, (ROTORS, 2)))
        self._set("torque_per_thrust", _positive("torque_per_thrust", self.torque_per_thrust))
        spins = _numbers("spins", self.spins, (ROTORS,))
        if sorted(spins) != [-1.0, -1.0, 1.0, 1.0]:
            raise InvalidProblem(
                f"vehicle spins is {_listed(spins)}; two rotors must turn counterclockwise, 1, and "
                "two clockwise, -1"
            )
        self._set("spins", tuple(int(spin) for spin in spins))
        positions = np.array(self.rotor_positions)
        arm = _positive("rotor_positions", float(np.linalg.norm(positions, axis=1).max()))
        centre = positions.mean(axis=0)
        if np.linalg.norm(centre) > OFF_CENTRE * arm:
            raise InvalidProblem(
                f"vehicle rotor_positions have their centre at {_listed(centre)} m; it must be the "
                "centre of mass, [0, 0]"
            )
        if np.linalg.cond(self._wrench / (1.0, arm, arm, self.torque_per_thrust)) > 1 / LEAST_SPAN:
            raise InvalidProblem(
                "vehicle rotor_positions and spins give no hold on roll, pitch and yaw by "
                "themselves; neighbours in a square must turn opposite ways"
            )
        least, most = _numbers("rotor_thrust", self.rotor_thrust, (2,))
        if not 0.0 <= least < most:
            raise InvalidProblem(
                f"vehicle rotor_thrust is {_listed((least, most))} N; it must be the least, from "
                "0, and the most, which is above it"
            )
        self._set("rotor_thrust", (least, _positive("rotor_thrust", most)))
        if ROTORS * most <= self.mass * GRAVITY:
            raise InvalidProblem(
                f"vehicle rotor_thrust is at most {most:g} N, {ROTORS * most:g} N in all; it must "
                f"be above the weight of {self.mass * GRAVITY:.4g} N, or the vehicle cannot hover"
            )

    @property
    def top_thrust_acceleration(self) -> float:
        """Thrust over mass with every rotor at its most, m/s^2."""
        return ROTORS * self.rotor_thrust[1] / self.mass

    @cached_property
    def mixer(self) -> np.ndarray:
        """(4, 4) matrix from (thrust, torques about x, y, z) in N and N m to rotor thrusts, N."""
        mixer = np.linalg.inv(self._wrench.T)
        mixer.setflags(write=False)
        return mixer

    @property
    def _wrench(self) -> np.ndarray:
        """(4, 4) thrust and torques about x, y, z of each rotor, a row a rotor, for a thrust of 1.

        A thrust f at (x, y) has the torque (y f, -x f); that about z is against the spin.
        """
        x, y = np.array(self.rotor_positions).T
        turning = -self.torque_per_thrust * np.array(self.spins)
        return np.column_stack((np.ones(ROTORS), y, -x, turning))

    @property
    def airframe(self) -> Airframe:
        """What rotor limits are about, on the safe side where the rotors are not in a square.

        The lever is that of a square X whose rotors feel a torque across z as much as the one here
        that feels it most does.
        """
        most = float(np.linalg.norm(self.mixer[:, 1:3], axis=1).max())
        return Airframe(
            mass=self.mass,
            inertia=max(self.inertia[:2]),
            lever=math.sqrt(2.0) / (ROTORS * most),
            yaw_inertia=self.inertia[2],
            torque_per_thrust=1.0 / (ROTORS * float(np.abs(self.mixer[:, 3]).max())),
            inertia_difference=abs(self.inertia[0] - self.inertia[1]),
            drag=self.drag,
        )

    def with_limits(self, limits: Limits) -> Self:
        """The vehicle with each limit that is set in `limits` in place of its own."""
        own = self.limits.to_dict()
        merged = {**own, **limits.to_dict()}
        kept = {name: why for name, why in self.reasons.items() if merged[name] == own[name]}
        return replace(self, limits=Limits.from_dict(merged), reasons=kept)

    def on_rotors(self) -> Self:
        """The vehicle limited by its rotors and its body rate, in place of what stands for them.

        There is no margin then: every rotor keeps its range, drag, unequal inertia and the yaw of
        the plan included, and nothing of it is left for control. The body rate is that across the
        thrust axis.
        """
        least, most = self.rotor_thrust
        limits = Limits(
            rotor_thrust=most,
            least_rotor_thrust=least,
            body_rate=None if self.body_rate is None else self.body_rate[0],
            airframe=self.airframe,
        )
        return replace(self, limits=limits, reasons={})

    def has_default_limits(self) -> bool:
        """Whether the limits are those that follow from the other figures."""
        try:
            return self.limits == self._default_limits()[0]
        except InvalidProblem:
            return False

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names, from which `from_dict` makes the same vehicle."""
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        return {
            **{name: _plain(value) for name, value in values.items()},
            "limits": self.limits.to_dict(),
            "sources": dict(self.sources),
            "reasons": dict(self.reasons),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """A vehicle from what `to_dict` gave, or with fewer keys where fields have defaults.

        Raises
        ------
        InvalidProblem
            If a key is missing or unknown, or a value is against a rule.
        """
        if not isinstance(values, Mapping):
            raise InvalidProblem("a vehicle must be a mapping of its figures by name")
        names = [one.name for one in fields(cls)]
        for name in values:
            if name not in names:
                raise InvalidProblem(
                    f"vehicle has an unknown key {quoted(str(name))}; known are {', '.join(names)}"
                )
        for name in names[: names.index("motor_lag")]:
            if values.get(name) is None:
                raise InvalidProblem(f"vehicle {name} is missing")
        given = {name: value for name, value in values.items() if value is not None}
        if "limits" in given:
            if not isinstance(given["limits"], Mapping):
                raise InvalidProblem("vehicle limits must be a mapping, such as {speed: 5}")
            given["limits"] = Limits.from_dict(given["limits"])
        return cls(**given)

    def _default_limits(self) -> tuple[Limits, dict[str, str]]:
        return default_limits(
            self.airframe,
            rotor_thrust=self.rotor_thrust,
            motor_lag=self.motor_lag,
            body_rate=None if self.body_rate is None else self.body_rate[0],
            drag=self.drag[0],
        )

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)


def _positive(name: str, value: Any) -> float:
    number = _number(name, value)
    if not SMALLEST <= number <= LARGEST:
        raise InvalidProblem(
            f"vehicle {name} is {number:g}; it must be positive, from {SMALLEST:g} to {LARGEST:g}"
        )
    return number


def _zero_or_more(name: str, value: Any) -> float:
    number = _number(name, value)
    if not 0.0 <= number <= LARGEST:
        raise InvalidProblem(f"vehicle {name} is {number:g}; it must be from 0 to {LARGEST:g}")
    return number


def _number(name: str, value: Any) -> float:
    if isinstance(value, str | bytes | bool):
        raise InvalidProblem(f"vehicle {name} is {quoted(str(value))}; it must be a number")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidProblem(
            f"vehicle {name} is {quoted(str(value))}; it must be a number"
        ) from None
    if not math.isfinite(number):
        raise InvalidProblem(f"vehicle {name} is {number}; it must be finite")
    return number


def _numbers(name: str, values: ArrayLike, shape: tuple[int, ...]) -> Any:
    """Finite numbers of a shape, as a tuple (of tuples)."""
    rule = f"{' x '.join(map(str, shape))} finite numbers"
    wrong = InvalidProblem(f"vehicle {name} is {quoted(str(values))}; it must be {rule}")
    try:
        given = np.asarray(values)
        array = given.astype(float)
    except (TypeError, ValueError, OverflowError):
        raise wrong from None
    if array.shape != shape or given.dtype.kind in "US" or not np.isfinite(array).all():
        raise wrong
    rows = array.tolist()
    return tuple(tuple(row) if isinstance(row, list) else row for row in rows)


def _lines(name: str, lines: Any, known: Mapping[str, Any]) -> dict[str, str]:
    """A line of text for each of some names."""
    if not isinstance(lines, Mapping):
        raise InvalidProblem(f"vehicle {name} must be a mapping of a name to a line of text")
    for key, line in lines.items():
        if key not in known:
            raise InvalidProblem(
                f"vehicle {name} has an unknown key {quoted(str(key))}; known are "
                f"{', '.join(known)}"
            )
        if not isinstance(line, str):
            raise InvalidProblem(f"vehicle {name} of {key} is {line!r}; it must be a line of text")
    return {key: " ".join(line.split()) for key, line in lines.items()}


def _plain(value: Any) -> Any:
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def _listed(values: Any) -> str:
    return f"[{', '.join(f'{value:g}' for value in values)}]"
