"""What the tuner chooses from: families of plans, and the proportions of their limits.

A point is the logarithm of each limit relative to a reference that follows from the vehicle; a
scale makes all of them faster or slower together, as time does: rates by the scale, accelerations
by its square, jerk and snap by its third and fourth power.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from peakflight.limits import GRAVITY, Limits
from peakflight.vehicle import Vehicle


@dataclass(frozen=True)
class Family:
    """A method, with what else tells its plans from others."""

    method: str
    minimize: str = "jerk"
    options: Mapping[str, Any] = field(default_factory=dict)
    effort: float = 0.0
    """What jerk at its limit costs, over the time that it lasts: a smoother plan for a slower one.
    Of method joint."""

    @property
    def name(self) -> str:
        """For people."""
        parts = [f"{key}={value}" for key, value in self.options.items()]
        parts += [f"effort {self.effort:g} of the time"] if self.effort else []
        return ", ".join([f"{self.method} (min {self.minimize})", *parts])

    def options_within(self, limits: Limits) -> dict[str, Any]:
        """Options of the method under some limits."""
        if not self.effort or limits.jerk is None:
            return dict(self.options)
        return {**self.options, "effort": float(f"{self.effort / limits.jerk**2:.5g}")}


ROUGH = 1e-3
"""Tolerance of `joint`: half the iterations, for 0.2 % of the time."""
SMOOTHER = 0.3
"""Effort of the family that has one: enough to move its plans off the limits of jerk and snap."""
FAMILIES = (
    Family("peak", "jerk"),
    Family("peak", "snap"),
    Family("joint", "jerk", {"pieces": 1, "tolerance": ROUGH}),
    Family("joint", "jerk", {"pieces": 2, "tolerance": ROUGH}),
    Family("joint", "jerk", {"pieces": 1, "tolerance": ROUGH}, SMOOTHER),
)
"""Where the search begins. Limits that `joint` holds all the time are touched by the spline of
`peak` now and then: which of them flies faster depends on the course."""


class Coordinate(NamedTuple):
    """One limit of a point."""

    name: str
    power: int
    """Of the scale."""
    low: float
    high: float
    """Range of the logarithm."""


COORDINATES = (
    Coordinate("speed", 1, -0.7, 0.7),
    Coordinate("thrust_acceleration", 2, -0.7, 0.9),
    Coordinate("tilt", 2, -0.8, 0.8),
    Coordinate("body_rate", 1, -0.8, 0.8),
    Coordinate("jerk", 3, -1.2, 1.2),
    Coordinate("snap", 4, -1.2, 1.5),
)
"""Relative to angular acceleration, which the scale alone moves. Of thrust acceleration it is the
horizontal part at level flight that counts, of tilt the tangent."""
LOW = np.array([one.low for one in COORDINATES])
HIGH = np.array([one.high for one in COORDINATES])

TOP = 1.0
"""Of the top thrust: no limit is above it."""
USUAL = 0.85
"""Of the top thrust, in the reference."""
BEHIND = 3.0
"""rad/s, by which the body rate is late for the motor lag, in the reference."""
RESERVE = 0.15
"""Of the top thrust of each rotor, which turns the vehicle, in the reference."""
LEVEL, SMOOTH = 0.6, 0.4
"""Of the horizontal acceleration of level flight at the usual thrust, and of the snap of that
thrust turned at the angular acceleration, in the reference: what flies fast is limited in snap
first."""
DRAG = 0.2
"""Of the top thrust that drag takes, at the speed of the reference."""
STEEPEST = math.radians(80.0)


def reference(vehicle: Vehicle) -> dict[str, float]:
    """The limits at the origin, as COORDINATES mean them, at scale 1."""
    airframe, (least, most) = vehicle.airframe, vehicle.rotor_thrust
    thrust = max(USUAL * vehicle.top_thrust_acceleration, 1.05 * GRAVITY)
    sideways = math.sqrt(thrust**2 - GRAVITY**2)
    turning = 4.0 * airframe.lever * RESERVE * most / (math.sqrt(2.0) * airframe.inertia)
    if vehicle.motor_lag > 0.0:
        turning = min(turning, BEHIND / vehicle.motor_lag)
    rate = math.sqrt(2.0 * turning * math.atan2(sideways, GRAVITY))
    if vehicle.body_rate is not None:
        rate = min(rate, vehicle.body_rate[0])
    drag = vehicle.drag[0]
    return {
        "speed": DRAG * 4.0 * most / drag if drag > 0.0 else math.inf,
        "thrust_acceleration": LEVEL * sideways,
        "tilt": sideways / GRAVITY,
        "body_rate": rate,
        "angular_acceleration": turning,
        "jerk": rate * thrust,
        "snap": SMOOTH * turning * thrust,
        "least_thrust_acceleration": min(4.0 * (least + RESERVE * most) / vehicle.mass, 9.0),
    }


def limits_at(
    vehicle: Vehicle, point: np.ndarray, scale: float, within: Limits | None = None
) -> Limits:
    """The limits of a point at a scale, none of them looser than those within."""
    base = reference(vehicle)
    values = {
        one.name: base[one.name] * math.exp(shift) * scale**one.power
        for one, shift in zip(COORDINATES, point.tolist(), strict=True)
    }
    values["angular_acceleration"] = base["angular_acceleration"] * scale**2
    thrust = math.hypot(values["thrust_acceleration"], GRAVITY)
    top = TOP * vehicle.top_thrust_acceleration
    values["thrust_acceleration"] = max(min(thrust, top), (1.0 + 1e-3) * GRAVITY)
    values["tilt"] = min(math.atan(values["tilt"]), STEEPEST)
    values["least_thrust_acceleration"] = base["least_thrust_acceleration"]
    if vehicle.body_rate is not None:
        values["body_rate"] = min(values["body_rate"], vehicle.body_rate[0])
    for name, cap in ({} if within is None else within.to_dict()).items():
        if name == "least_thrust_acceleration":
            values[name] = max(values[name], cap)
        else:
            values[name] = min(values.get(name, cap), cap)
    return Limits.from_dict(
        {name: float(f"{value:.5g}") for name, value in values.items() if math.isfinite(value)}
    )
