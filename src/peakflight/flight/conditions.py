"""What differs in a flight from the vehicle and the still air that a plan knows."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

from peakflight.errors import InvalidProblem, quoted
from peakflight.flight.numbers import number, vector, whole

LEAST_SCALE, MOST_SCALE = 0.1, 10.0
"""Of the vehicle's figures: what is beyond is another vehicle."""
LONGEST_LATENCY = 1.0
"""s."""
FASTEST_WIND = 50.0
"""m/s: a storm is 25."""
LARGEST_NOISE = 100.0
"""m, m/s, rad, rad/s."""
LARGEST_DRAG = 1e3
"""kg/s."""


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """The world as it is, where it differs from what the plan and the controller know.

    Raises
    ------
    InvalidProblem
        If a value is not a number or out of its range; the message names the field.
    """

    mass_scale: float = 1.0
    """Mass over the vehicle's; from 0.1 to 10, like the other scales."""
    thrust_scale: float = 1.0
    """Thrust and torque of the rotors over what they are asked for: an empty battery is below 1."""
    inertia_scale: float = 1.0
    """Moments of inertia over the vehicle's."""
    motor_lag_scale: float = 1.0
    """Time constant of the rotors over the vehicle's."""
    latency: float = 0.0
    """How old the state is that the controller sees, s; to the nearest run of the controller."""
    drag: bool | tuple[float, float] = True
    """Rotor drag: the vehicle's own, none, or another, across and along the thrust, kg/s."""
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Steady wind, m/s. Wind acts through rotor drag alone: without drag it does nothing."""
    gust: float = 0.0
    """Standard deviation of each component of the gusts on top of the wind, m/s."""
    gust_time: float = 0.5
    """Time in which a gust is forgotten (by 1/e), s."""
    position_noise: float = 0.0
    """Standard deviation of each component of the measured position, m, anew at every run of the
    controller; like the other noises."""
    velocity_noise: float = 0.0
    """m/s."""
    attitude_noise: float = 0.0
    """rad."""
    body_rate_noise: float = 0.0
    """rad/s."""
    seed: int = 0
    """Of gusts and noise: the same seed gives the same flight, to the last bit."""

    def __post_init__(self) -> None:
        for name in ("mass_scale", "thrust_scale", "inertia_scale", "motor_lag_scale"):
            self._set(name, number(name, getattr(self, name), LEAST_SCALE, MOST_SCALE))
        self._set("latency", number("latency", self.latency, 0.0, LONGEST_LATENCY, "s"))
        self._set("wind", vector("wind", self.wind, FASTEST_WIND, "m/s"))
        self._set("gust", number("gust", self.gust, 0.0, FASTEST_WIND, "m/s"))
        self._set("gust_time", number("gust_time", self.gust_time, 1e-3, 1e3, "s"))
        for name, unit in NOISES.items():
            self._set(name, number(name, getattr(self, name), 0.0, LARGEST_NOISE, unit))
        self._set("seed", whole("seed", self.seed, 0, 2**63 - 1))
        if not isinstance(self.drag, bool):
            try:
                across, along = self.drag
            except (TypeError, ValueError):
                raise InvalidProblem(
                    f"drag is {quoted(str(self.drag))}; it must be True, False or two numbers, "
                    "across and along the thrust"
                ) from None
            parts = (("drag across", across), ("drag along", along))
            self._set(
                "drag",
                tuple(number(name, one, 0.0, LARGEST_DRAG, "kg/s") for name, one in parts),
            )

    @property
    def disturbed(self) -> bool:
        """Whether anything in it is random."""
        return self.gust > 0.0 or any(getattr(self, name) > 0.0 for name in NOISES)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, from which `from_dict` makes the same conditions."""
        values = asdict(self)
        values["wind"] = list(self.wind)
        values["drag"] = self.drag if isinstance(self.drag, bool) else list(self.drag)
        return values

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Conditions from what `to_dict` gave, or fewer keys.

        Raises
        ------
        InvalidProblem
            If a key is unknown or a value is against its rule.
        """
        known = [one.name for one in fields(cls)]
        if not isinstance(values, Mapping):
            raise InvalidProblem("conditions must be a mapping, such as {mass_scale: 1.1}")
        for name in values:
            if name not in known:
                raise InvalidProblem(
                    f"conditions have an unknown key {quoted(str(name))}; known are "
                    f"{', '.join(known)}"
                )
        return cls(**values)

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)


NOISES = {
    "position_noise": "m",
    "velocity_noise": "m/s",
    "attitude_noise": "rad",
    "body_rate_noise": "rad/s",
}
"""Field to its unit, in the order of the kernels."""
