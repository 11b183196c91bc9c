"""The files that vehicles fly, one module a format, one registry.

A format is an `Encoded` of plans and the reading back of it: see `FlightFormat`. A new one is one
file and one line here.
"""

from peakflight.errors import InvalidProblem, quoted
from peakflight.formats.flight_files import (
    agilicious,
    compressed,
    crazyflie_scripts,
    crazyswarm,
    mavlink_scripts,
    plan_files,
    ros2,
    samples,
    skyc,
)
from peakflight.formats.flight_files.crazyswarm import write_crazyflie
from peakflight.formats.flight_files.flight_format import Encoded, FlightFormat, Precision, Reading
from peakflight.formats.flight_files.samples import write_samples

FLIGHT_FORMATS = {
    "samples": samples.FORMAT,
    "crazyswarm": crazyswarm.FORMAT,
    "crazyflie-compressed": compressed.FORMAT,
    "cflib": crazyflie_scripts.CFLIB,
    "cflib-compressed": crazyflie_scripts.CFLIB_COMPRESSED,
    "crazyswarm2": crazyflie_scripts.CRAZYSWARM2,
    "agilicious": agilicious.FORMAT,
    "px4": mavlink_scripts.PX4,
    "ardupilot": mavlink_scripts.ARDUPILOT,
    "skyc": skyc.FORMAT,
    "ros2": ros2.FORMAT,
    "json": plan_files.JSON,
    "npz": plan_files.NPZ,
}
"""By name."""
OTHER_NAMES = {"crazyflie": "crazyswarm"}
"""What formats are called too."""
USUAL = ("samples", "crazyswarm")
"""What is written where nothing is asked for."""

__all__ = [
    "FLIGHT_FORMATS",
    "OTHER_NAMES",
    "USUAL",
    "Encoded",
    "FlightFormat",
    "Precision",
    "Reading",
    "find_format",
    "write_crazyflie",
    "write_samples",
]


def find_format(name: str) -> tuple[str, FlightFormat]:
    """The format that a name means, with its own name.

    Raises
    ------
    InvalidProblem
        If there is none; the message lists the names.
    """
    name = OTHER_NAMES.get(name, name)
    if name not in FLIGHT_FORMATS:
        raise InvalidProblem(
            f"unknown format {quoted(str(name))}; known are {', '.join(FLIGHT_FORMATS)}"
        )
    return name, FLIGHT_FORMATS[name]
