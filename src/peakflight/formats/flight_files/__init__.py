"""The files that vehicles fly, one module a format, one registry.

A format is an `Encoded` of plans and the reading back of it: see `FlightFormat`. A new one is one
file and one line here.
"""

from collections.abc import Callable
from typing import NamedTuple

from peakflight.errors import InvalidProblem, quoted
from peakflight.files import PathLike
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
from peakflight.result import Plan

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


class Writer(NamedTuple):
    """How a format of flight file is written, without refit or report."""

    filename: str
    """What the file is called unless the user says otherwise."""
    write: Callable[[Plan, PathLike], tuple[str, ...]]
    """Writes a plan to a path; returns notes for whoever flies it, one line each."""
    summary: str
    """What the file is, for help texts."""


FLIGHT_WRITERS = {
    "samples": Writer(samples.FORMAT.filename, write_samples, samples.FORMAT.summary),
    "crazyflie": Writer(crazyswarm.FORMAT.filename, write_crazyflie, crazyswarm.FORMAT.summary),
}

__all__ = [
    "FLIGHT_FORMATS",
    "FLIGHT_WRITERS",
    "OTHER_NAMES",
    "USUAL",
    "Encoded",
    "FlightFormat",
    "Precision",
    "Reading",
    "Writer",
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
