"""The files that vehicles fly, one module a format, one registry.

A writer is one function of a plan and a path. A new format is one file and one line here.
"""

from collections.abc import Callable
from typing import NamedTuple

from peakflight.files import PathLike
from peakflight.formats.flight_files.crazyflie import write_crazyflie
from peakflight.formats.flight_files.samples import write_samples
from peakflight.result import Plan


class Writer(NamedTuple):
    """How a format of flight file is written."""

    filename: str
    """What the file is called unless the user says otherwise."""
    write: Callable[[Plan, PathLike], tuple[str, ...]]
    """Writes a plan to a path; returns notes for whoever flies it, one line each."""
    summary: str
    """What the file is, for help texts."""


FLIGHT_WRITERS = {
    "samples": Writer(
        "samples.csv", write_samples, "time, position to snap, yaw and rotor thrusts at 100 Hz"
    ),
    "crazyflie": Writer("crazyflie.csv", write_crazyflie, "polynomials for a Crazyflie"),
}

__all__ = ["FLIGHT_WRITERS", "Writer", "write_crazyflie", "write_samples"]
