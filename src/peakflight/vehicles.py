"""The vehicles that come with peakflight, and finding one by its name or file."""

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeAlias

from peakflight.errors import InvalidProblem, quoted
from peakflight.files import PathLike
from peakflight.vehicle import Vehicle

VehicleLike: TypeAlias = Vehicle | PathLike
"""A vehicle, the name of one of `VEHICLES`, or the path of a YAML or JSON file with one."""
SUFFIXES = (".yaml", ".yml", ".json")
"""What names of vehicle files end in; other text is a path only if it names a folder."""

GYRO = math.radians(2000.0)
"""Range of the gyroscope of every Crazyflie, rad/s."""
CRAZYFLOW = "crazyflow 0.4, {}"


def _square(lever: float) -> tuple[tuple[float, float], ...]:
    """Rotors in an X as a Crazyflie numbers them: front right, then clockwise from above."""
    return ((lever, -lever), (-lever, -lever), (-lever, lever), (lever, lever))


def _crazyflie(name: str, parameters: str, *, inertia_source: str = "", **figures: Any) -> Vehicle:
    """A Crazyflie with parameters of crazyflow.

    Its model gives the rates of a rotor's speed n as a (n' - n) + b (n'^2 - n^2), and thrust and
    torque as polynomials in n. The lag here is 1 / (a + 2 b n) as it speeds up from hovering; the
    torque is that at top thrust.
    """
    found = CRAZYFLOW.format(parameters)
    sources = {
        "mass": f"{found}, with battery and markers",
        "inertia": f"{found}{inertia_source}",
        "rotor_positions": found,
        "spins": f"{found}: mixing matrix",
        "rotor_thrust": found,
        "torque_per_thrust": f"{found}: torque over thrust at the top",
        "motor_lag": f"{found}: rotors speeding up from hovering, linearised",
        "body_rate": "range of the gyroscope, 2000 deg/s (Bosch BMI088)",
        "drag": f"{found}: drag matrix, a force in its dynamics",
    }
    return Vehicle(
        name=name,
        spins=(1, -1, 1, -1),
        body_rate=(GYRO, GYRO),
        sources=sources | figures.pop("sources", {}),
        **figures,
    )


_STOCK = _crazyflie(
    "crazyflie-2.1",
    "cf2x_L250",
    mass=0.0328,
    inertia=(16.8e-6, 16.8e-6, 29.8e-6),
    rotor_positions=_square(0.03253),
    rotor_thrust=(0.012818, 0.12),
    torque_per_thrust=0.00735,
    motor_lag=0.136,
    drag=(0.01472, 0.01278),
    sources={
        "torque_per_thrust": f"{CRAZYFLOW.format('cf2x_L250')}: torque over thrust, which falls "
        "to 0.0068 at the top"
    },
)
_PLUS = _crazyflie(
    "crazyflie-2.1-plus",
    "cf2x_P250",
    inertia_source=" with the stock propellers",
    mass=0.0318,
    inertia=(16.8e-6, 16.8e-6, 29.8e-6),
    rotor_positions=_square(0.03253),
    rotor_thrust=(0.012818, 0.12),
    torque_per_thrust=0.00699,
    motor_lag=0.112,
    drag=(0.01351, 0.01677),
)
_UPGRADE = _crazyflie(
    "crazyflie-2.1-upgrade",
    "cf2x_T350",
    mass=0.0379,
    inertia=(15.7e-6, 17.1e-6, 30.0e-6),
    rotor_positions=_square(0.03253),
    rotor_thrust=(0.019226, 0.18),
    torque_per_thrust=0.00508,
    motor_lag=0.0879,
    drag=(0.01557, 0.02192),
)
_BRUSHLESS = _crazyflie(
    "crazyflie-brushless",
    "cf21B_500",
    mass=0.0434,
    inertia=(25e-6, 28e-6, 49e-6),
    rotor_positions=_square(0.035355),
    rotor_thrust=(0.021363, 0.20),
    torque_per_thrust=0.00597,
    motor_lag=0.0571,
    drag=(0.02149, 0.02360),
)

_CPC = "Foehn et al. 2021, uzh-rpg/rpg_time_optimal quads/quad.yaml"
_ARM = 0.15 / math.sqrt(2.0)
_RACER = Vehicle(
    name="racing-quad",
    mass=0.85,
    inertia=(1.0e-3, 1.0e-3, 1.7e-3),
    rotor_positions=((_ARM, _ARM), (_ARM, -_ARM), (-_ARM, -_ARM), (-_ARM, _ARM)),
    spins=(-1, 1, -1, 1),
    rotor_thrust=(0.0, 3.3 * 0.85 * 9.81 / 4.0),
    torque_per_thrust=0.05,
    motor_lag=0.0,
    body_rate=(15.0, 0.3),
    sources={
        "mass": _CPC,
        "inertia": _CPC,
        "rotor_positions": f"{_CPC}: 0.15 m from the centre, on the diagonals",
        "spins": "uzh-rpg/rpg_time_optimal src/quad.py: signs of its mixer",
        "rotor_thrust": f"{_CPC}: thrust-to-weight ratio 3.3, least 0",
        "torque_per_thrust": _CPC,
        "motor_lag": "Foehn et al. model no lag",
        "body_rate": _CPC,
        "drag": "Foehn et al. plan without drag",
    },
)

_ROTORS = "RotorS, urdf/hummingbird.xacro"
_HUMMINGBIRD = Vehicle(
    name="hummingbird",
    mass=0.716,
    inertia=(7.52e-3, 7.52e-3, 13.04e-3),
    rotor_positions=((0.17, 0.0), (0.0, 0.17), (-0.17, 0.0), (0.0, -0.17)),
    spins=(-1, 1, -1, 1),
    rotor_thrust=(0.0, 6.003),
    torque_per_thrust=0.016,
    motor_lag=0.0125,
    drag=(0.146, 0.0),
    sources={
        "mass": f"{_ROTORS}: body 0.68 kg and four rotors of 0.009 kg",
        "inertia": f"{_ROTORS}: body 0.007, 0.007, 0.012 kg m^2 (after Wang et al.), and the "
        "rotors at 0.17 m",
        "rotor_positions": f"{_ROTORS}: a plus, 0.17 m from the centre",
        "spins": _ROTORS,
        "rotor_thrust": f"{_ROTORS}: 8.54858e-6 N s^2 at up to 838 rad/s",
        "torque_per_thrust": _ROTORS,
        "motor_lag": f"{_ROTORS}: rotors speeding up; 0.025 s slowing down",
        "body_rate": "none found in a public source",
        "drag": f"{_ROTORS}: 8.06428e-5 kg for each rotor at 453 rad/s, hovering",
    },
)

VEHICLES: Mapping[str, Vehicle] = {
    one.name: one for one in (_STOCK, _PLUS, _UPGRADE, _BRUSHLESS, _RACER, _HUMMINGBIRD)
}
"""By name."""


def find_vehicle(vehicle: VehicleLike) -> Vehicle:
    """The vehicle that is meant.

    Parameters
    ----------
    vehicle
        A `Vehicle`; the name of one of `VEHICLES`; or the path of a YAML or JSON file, which ends
        in .yaml, .yml or .json or names a folder.

    Raises
    ------
    InvalidProblem
        If it is neither; the message lists the names.
    InvalidFile
        If the file cannot be read or holds no vehicle; the message names file, key, value, rule.
    """
    if isinstance(vehicle, Vehicle):
        return vehicle
    if isinstance(vehicle, str) and vehicle in VEHICLES:
        return VEHICLES[vehicle]
    if isinstance(vehicle, str | os.PathLike):
        path = Path(vehicle)
        if path.suffix.lower() in SUFFIXES or len(path.parts) > 1:
            from peakflight.formats.vehicle_file import read_vehicle

            return read_vehicle(path)
    raise InvalidProblem(
        f"unknown vehicle {quoted(str(vehicle))}; known are {', '.join(VEHICLES)}, or a YAML file"
    )
