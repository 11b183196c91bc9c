"""The trajectory files that are read back, one module a form, one registry.

A reader is a module with `recognises(text)` and `read(text, path, tolerance)`. A new form is one
file and one line here.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.files import PathLike, read_text, reason
from peakflight.readers import pieces, plan_json, samples
from peakflight.readers.value import TrajectoryFile
from peakflight.trajectory import Trajectory

TOLERANCE = 1e-4
"""How near a trajectory comes to samples unless said otherwise, m: motion capture resolves this."""
LARGEST_FILE = 100_000_000
"""Bytes: a quarter of an hour at a kilohertz."""


class Reader(NamedTuple):
    """How a form of trajectory file is told apart and read."""

    recognises: Callable[[str], bool]
    """Whether a text is in this form, by how it begins."""
    read: Callable[[str, PathLike, float], TrajectoryFile]
    """The motion in a text; the path is for messages, the tolerance for samples, m."""


READERS = {
    "json": Reader(plan_json.recognises, plan_json.read),
    "pieces": Reader(pieces.recognises, pieces.read),
    "samples": Reader(samples.recognises, samples.read),
}
"""In the order in which they are asked; samples are what is left."""

__all__ = [
    "READERS",
    "TOLERANCE",
    "Reader",
    "TrajectoryFile",
    "read_trajectory",
    "read_trajectory_file",
]


def read_trajectory(path: PathLike, *, tolerance: float = TOLERANCE) -> Trajectory:
    """The motion in a trajectory file, in three axes; `read_trajectory_file` has its yaw too.

    Raises
    ------
    InvalidFile, InvalidProblem
        As `read_trajectory_file`.
    """
    return read_trajectory_file(path, tolerance=tolerance).trajectory


def read_trajectory_file(path: PathLike, *, tolerance: float = TOLERANCE) -> TrajectoryFile:
    """Read a trajectory; what is in the file, not its name, says which form it is in.

    A plan file; polynomial pieces as Crazyswarm has them; or samples, our own or those of
    Agilicious and CPC, to which polynomials are fitted.

    Parameters
    ----------
    tolerance
        How near they come to each sample along each axis, m; to velocity and acceleration, where
        these are in the file, ten and a hundred times that, in m/s and m/s^2.

    Raises
    ------
    InvalidFile
        If it cannot be read or holds no trajectory; the message names the file, the line or key,
        the value and the rule.
    InvalidProblem
        If the tolerance is not positive and finite.
    """
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InvalidProblem(f"tolerance is {tolerance:g} m; it must be positive and finite")
    path = Path(path)
    _refuse_large(path)
    text = read_text(path)
    if "\0" in text:
        raise InvalidFile(f"{path}: is not text (it holds a zero byte)")
    reader = next(reader for reader in READERS.values() if reader.recognises(text))
    try:
        with np.errstate(all="ignore"):  # what is not finite is refused by the value
            return reader.read(text, path, tolerance)
    except InvalidProblem as error:
        raise InvalidFile(f"{path}: {error}") from None


def _refuse_large(path: Path) -> None:
    """Refuse a file that would fill the memory."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        if isinstance(error, FileNotFoundError):
            return  # reading it says so
        raise InvalidFile(f"{path}: cannot be read ({reason(error)})") from None
    if size > LARGEST_FILE and path.is_file():
        raise InvalidFile(
            f"{path}: has {size / 1e6:.0f} MB; a trajectory has {LARGEST_FILE / 1e6:.0f} MB at most"
        )
