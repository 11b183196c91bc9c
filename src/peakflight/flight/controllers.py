"""What the two controllers are set to, and the numbers that their kernels take."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.flight.numbers import number, vector
from peakflight.kernels import controllers as kernels
from peakflight.limits import GRAVITY
from peakflight.vehicle import ROTORS, Vehicle
from peakflight.vehicles import VEHICLES

PWM = 65535.0
"""Full throttle in the units of the firmware: 16 bits."""
LARGEST = 1e9
"""Gain."""
LEAST_TURNING = 1.0
"""rad/s^2, for a vehicle whose rotors have nothing to spare."""
STOCK = "crazyflie-2.1"
"""The vehicle that the firmware's gains are for."""
STOCK_MASS = 0.029
"""kg, which the firmware takes its own mass for: crazyflow 0.4, cf2x_L250."""
BELIEVED_MASS: Mapping[str, float] = {
    STOCK: STOCK_MASS,
    "crazyflie-2.1-plus": 0.029,
    "crazyflie-2.1-upgrade": 0.0325,
    "crazyflie-brushless": 0.0393,
}
"""kg, by vehicle: crazyflow 0.4, control/mellinger/params.toml, which calls it wrong by default."""


@dataclass(frozen=True, kw_only=True)
class GeometricSettings:
    """Bandwidths of the geometric tracker (Lee, Leok and McClamroch 2010), by the motor lag.

    The attitude may not be faster than its rotors: bandwidth times lag stays below `lag_share`,
    where the third-order loop of attitude and rotor is well damped (it is unstable above twice the
    damping). The position may not be faster than the attitude by the usual separation.
    """

    fastest: float = 30.0
    """Attitude bandwidth of a vehicle whose rotors do not lag, rad/s."""
    lag_share: float = 0.5
    """Attitude bandwidth times what is left of the lag, at most."""
    spool: float = 0.25
    """Share of the motor lag that is left when rotors are asked for more than is wanted until they
    are there, as far as their range goes; 1 asks for just what is wanted."""
    damping: float = 0.9
    """Of both loops, relative to critical."""
    separation: float = 4.0
    """Attitude bandwidth over position bandwidth."""
    reach: float = 0.35
    """Attitude error at which the rotors of a hovering vehicle come to an end of their range, at
    least, rad: faster, a heavy vehicle swings from one end to the other until it tumbles."""
    yaw_share: float = 0.5
    """Bandwidth of the yaw over that of the tilt: rotors turn the vehicle about z with less."""

    def __post_init__(self) -> None:
        for one in fields(self):
            value = number(f"geometric {one.name}", getattr(self, one.name), 1e-3, 1e3)
            object.__setattr__(self, one.name, value)
        if self.spool > 1.0:
            raise InvalidProblem(f"geometric spool is {self.spool:g}; it must be at most 1")

    def gains(self, vehicle: Vehicle) -> np.ndarray:
        """(11, 3) rows of `peakflight.kernels.controllers`."""
        left = self.spool * vehicle.motor_lag
        bandwidth = self.fastest if left == 0.0 else min(self.fastest, self.lag_share / left)
        bandwidth = min(bandwidth, math.sqrt(_turning(vehicle) / self.reach))
        slow = bandwidth / self.separation
        turn = bandwidth * np.array([1.0, 1.0, self.yaw_share])
        gains = np.zeros((kernels.GAINS, 3))
        gains[kernels.KP] = slow**2
        gains[kernels.KD] = 2.0 * self.damping * slow
        gains[kernels.KR] = turn**2
        gains[kernels.KW] = 2.0 * self.damping * turn
        return gains


@dataclass(frozen=True, kw_only=True)
class FirmwareSettings:
    """The Crazyflie's `controller_mellinger.c`, in its own units: PWM of 16 bits for moments.

    Defaults are those of crazyflow 0.4 for the stock Crazyflie; the firmware has 0.4 for the
    derivative of z, and, since 2025, 1.5 for its integral.
    """

    mass: float = STOCK_MASS
    """What the controller takes the vehicle's mass for, kg."""
    mass_thrust: float = 132000.0
    """PWM of all rotors for a force of 1 N: `massThrust`."""
    kp: tuple[float, float, float] = (0.4, 0.4, 1.25)
    """N/m."""
    kd: tuple[float, float, float] = (0.2, 0.2, 0.5)
    """N s/m."""
    ki: tuple[float, float, float] = (0.05, 0.05, 0.05)
    """N/(m s)."""
    most_ki: tuple[float, float, float] = (2.0, 2.0, 0.4)
    """Bound of the integral of position, m s: `i_range`."""
    kr: tuple[float, float, float] = (70000.0, 70000.0, 60000.0)
    """Moment for an attitude error, which is not halved."""
    kw: tuple[float, float, float] = (20000.0, 20000.0, 12000.0)
    """Moment for a body rate, s/rad."""
    km: tuple[float, float, float] = (0.0, 0.0, 500.0)
    """Moment for the integral of the attitude error, 1/s: `ki_m`."""
    most_km: tuple[float, float, float] = (1.0, 1.0, 1500.0)
    """Bound of this integral, s: `i_range_m`."""
    kdw: tuple[float, float, float] = (200.0, 200.0, 0.0)
    """Moment for a change of the body rate, s^2/rad: `kd_omega_rp`."""
    most_moment: tuple[float, float, float] = (32000.0, 32000.0, 32000.0)
    """Bound of a moment."""

    def __post_init__(self) -> None:
        for one in fields(self):
            name, value = f"firmware {one.name}", getattr(self, one.name)
            checked = (
                number(name, value, 1e-9, LARGEST)
                if one.name in ("mass", "mass_thrust")
                else vector(name, value, LARGEST)
            )
            object.__setattr__(self, one.name, checked)

    @property
    def gains(self) -> np.ndarray:
        """(11, 3) rows of `peakflight.kernels.controllers`."""
        gains = np.zeros((kernels.GAINS, 3))
        for row, values in (
            (kernels.KP, self.kp),
            (kernels.KD, self.kd),
            (kernels.KI, self.ki),
            (kernels.MOST_KI, self.most_ki),
            (kernels.KR, self.kr),
            (kernels.KW, self.kw),
            (kernels.KM, self.km),
            (kernels.MOST_KM, self.most_km),
            (kernels.KDW, self.kdw),
            (kernels.MOST_MOMENT, self.most_moment),
        ):
            gains[row] = values
        return gains


class Mixing(NamedTuple):
    """How the firmware turns a force and moments into thrusts of rotors."""

    force_scale: float
    """Thrust that comes out for a force that is asked for."""
    moments: np.ndarray
    """(4, 3) thrust of each rotor for a moment of 1, N."""

    @classmethod
    def of(cls, vehicle: Vehicle, mass_thrust: float) -> "Mixing":
        """Take it from a vehicle: a rotor gets half a moment about x and y, and one about z.

        Where rotors are not in a square X, those that reach furthest do, others in proportion.
        """
        most = vehicle.rotor_thrust[1]
        directions = vehicle.mixer[:, 1:] / np.abs(vehicle.mixer[:, 1:]).max(axis=0)
        moments = directions * (0.5, 0.5, 1.0) * most / PWM
        return cls(4.0 * mass_thrust * most / PWM, np.ascontiguousarray(moments))

    def turning(self, vehicle: Vehicle) -> np.ndarray:
        """(3,) angular acceleration for a moment of 1 about each axis, rad/s^2."""
        torques = np.linalg.inv(vehicle.mixer)[1:] @ self.moments
        return np.diag(torques) / vehicle.inertia


def firmware_settings(vehicle: Vehicle) -> FirmwareSettings:
    """What the firmware's controller would be set to for a vehicle.

    The Crazyflies fly with its defaults, as in crazyflow: with the wrong mass, and with a thrust
    that is only near what is asked for. Others get gains of position by their mass, a thrust that
    is what is asked for, and gains of attitude that turn them as fast as the stock Crazyflie.
    """
    if vehicle.name in BELIEVED_MASS:
        return FirmwareSettings(mass=BELIEVED_MASS[vehicle.name])
    stock, default = VEHICLES[STOCK], FirmwareSettings()
    exact = PWM / (4.0 * vehicle.rotor_thrust[1])
    heavier = vehicle.mass / STOCK_MASS
    slower = Mixing.of(stock, exact).turning(stock) / Mixing.of(vehicle, exact).turning(vehicle)
    return FirmwareSettings(
        mass=vehicle.mass,
        mass_thrust=exact,
        kp=_times(default.kp, heavier),
        kd=_times(default.kd, heavier),
        ki=_times(default.ki, heavier),
        kr=_times(default.kr, slower),
        kw=_times(default.kw, slower),
        km=_times(default.km, slower),
        kdw=_times(default.kdw, slower),
    )


def _turning(vehicle: Vehicle) -> float:
    """Angular acceleration across z that rotors of a hovering vehicle can spare, rad/s^2."""
    least, most = vehicle.rotor_thrust
    hovering = vehicle.mass * GRAVITY / ROTORS
    spare = min(most - hovering, hovering - least)
    torques = spare / np.abs(vehicle.mixer[:, 1:3]).max(axis=0)
    return max(float((torques / vehicle.inertia[:2]).min()), LEAST_TURNING)


def _times(
    values: tuple[float, float, float], factor: float | np.ndarray
) -> tuple[float, float, float]:
    x, y, z = (np.array(values) * factor).tolist()
    return x, y, z
