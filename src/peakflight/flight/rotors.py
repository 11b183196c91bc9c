"""How the rotors of a vehicle follow their commands."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.flight.numbers import number
from peakflight.kernels import rigid_body as kernels
from peakflight.vehicle import Vehicle

FASTEST = 1e4
"""Rate, 1/s."""


@dataclass(frozen=True, kw_only=True)
class RotorSpeeds:
    """Rotors whose speeds were identified: n' = a (n_c - n) + b (n_c^2 - n^2).

    Speeds are relative to that of the top thrust.

    Raises
    ------
    InvalidProblem
        If a rate is negative or none is positive, or a number is out of its range.
    """

    rise: tuple[float, float]
    """a and b while a rotor speeds up, 1/s."""
    fall: tuple[float, float]
    """a and b while it slows down, 1/s."""
    linear: float
    """c of thrust over top thrust, c n + (1 - c) n^2."""
    momentum: float = 0.0
    """Angular momentum of a rotor at its top thrust, kg m^2/s; it turns the vehicle as the rotor
    speeds up."""

    def __post_init__(self) -> None:
        for name in ("rise", "fall"):
            try:
                a, b = getattr(self, name)
            except (TypeError, ValueError):
                raise InvalidProblem(f"rotor {name} must be two rates, 1/s") from None
            rates = tuple(number(f"rotor {name}", one, 0.0, FASTEST, "1/s") for one in (a, b))
            if not any(rates):
                raise InvalidProblem(f"rotor {name} is {rates}; one rate must be positive")
            object.__setattr__(self, name, rates)
        object.__setattr__(self, "linear", number("rotor linear", self.linear, -0.5, 0.9))
        object.__setattr__(self, "momentum", number("rotor momentum", self.momentum, 0.0, 1e3))


def _identified(
    top: float,
    thrust: tuple[float, float],
    rates: tuple[float, float, float, float],
    inertia: float,
) -> RotorSpeeds:
    """From crazyflow: thrust is k_1 n + k_2 n^2 for n in rpm; rates of rising and of falling."""
    k1, k2 = thrust
    fastest = (-k1 + (k1 * k1 + 4.0 * k2 * top) ** 0.5) / (2.0 * k2)
    up, up_square, down, down_square = rates
    return RotorSpeeds(
        rise=(up, up_square * fastest),
        fall=(down, down_square * fastest),
        linear=k1 * fastest / top,
        momentum=inertia * fastest * 2.0 * math.pi / 60.0,
    )


ROTOR_SPEEDS: Mapping[str, RotorSpeeds] = {
    "crazyflie-2.1": _identified(
        0.12,
        (-5.382196214637237e-7, 2.4582929831265485e-10),
        (7.3556237, 0.0, 0.0, 2.4443863e-4),
        34.52e-9,
    ),
    "crazyflie-2.1-plus": _identified(
        0.12,
        (-3.6200226530383495e-7, 1.6060924304100328e-10),
        (5.1725967, 8.1477423e-5, 0.0, 2.0952535e-4),
        26.97e-9,
    ),
    "crazyflie-2.1-upgrade": _identified(
        0.18,
        (-7.167227176573658e-7, 2.9401303690194613e-10),
        (11.374753, 0.0, 0.0, 3.7867689e-4),
        38.93e-9,
    ),
    "crazyflie-brushless": _identified(
        0.20,
        (-3.133427287299859e-7, 4.407354891648379e-10),
        (13.996002, 1.1093208e-4, 5.9331685, 3.1951312e-4),
        38.93e-9,
    ),
}
"""By vehicle: crazyflow 0.4, dynamics/first_principles/params.toml."""


def rotors_of(vehicle: Vehicle, speeds: RotorSpeeds | None, slower: float) -> np.ndarray:
    """(8,) as `peakflight.kernels.rigid_body` takes them, `slower` by a factor.

    Without speeds, the thrust follows with the vehicle's lag.
    """
    rotors = np.zeros(kernels.ROTOR)
    rotors[kernels.TOP] = vehicle.rotor_thrust[1]
    rotors[kernels.LAG] = vehicle.motor_lag * slower
    if speeds is not None:
        rotors[kernels.RISE : kernels.FALL] = np.divide(speeds.rise, slower)
        rotors[kernels.FALL : kernels.LINEAR] = np.divide(speeds.fall, slower)
        rotors[kernels.LINEAR] = speeds.linear
        rotors[kernels.MOMENTUM] = speeds.momentum
    return rotors
