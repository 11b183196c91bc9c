"""What comes out of a flight in simulation."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Self
from zipfile import BadZipFile

import numpy as np

from peakflight.errors import InvalidFile, InvalidProblem, quoted
from peakflight.files import PathLike, parse_json, read_json, reason, write_atomically, write_json
from peakflight.flight.conditions import Conditions
from peakflight.flight.numbers import number
from peakflight.problem import as_float_array
from peakflight.vehicle import Vehicle

NUMBERS = ".npz"
"""What a file with arrays of NumPy ends in; others are JSON."""
COLUMNS = {
    "times": 0,
    "position": 3,
    "velocity": 3,
    "attitude": 4,
    "body_rates": 3,
    "rotor_thrusts": 4,
    "planned_position": 3,
    "planned_velocity": 3,
    "planned_attitude": 4,
    "planned_body_rates": 3,
}
"""Array to how many numbers a sample has; 0 for one without an axis of its own."""


@dataclass(frozen=True, kw_only=True)
class Crash:
    """That a flight ended before its plan, and why."""

    cause: str
    """In words."""
    time: float
    """s after the beginning of the plan."""

    def __post_init__(self) -> None:
        if not (isinstance(self.cause, str) and self.cause):
            raise InvalidProblem("crash cause must be text, not empty")
        object.__setattr__(self, "time", number("crash time", self.time, 0.0, 1e10, "s"))


@dataclass(frozen=True, eq=False, kw_only=True)
class Flight:
    """A plan as a vehicle flew it in simulation, in S samples. Arrays are read-only.

    Raises
    ------
    InvalidProblem
        If shapes do not fit or a number is not finite.
    """

    times: np.ndarray
    """(S,) s after the beginning of the plan: every run of the controller, up to the end of the
    hovering at the end of the plan, or to the crash."""
    position: np.ndarray
    """(S, 3) m."""
    velocity: np.ndarray
    """(S, 3) m/s."""
    attitude: np.ndarray
    """(S, 4) unit quaternions w, x, y, z, from the body to the world."""
    body_rates: np.ndarray
    """(S, 3) rad/s, in the body frame."""
    rotor_thrusts: np.ndarray
    """(S, 4) N."""
    planned_position: np.ndarray
    """(S, 3) m."""
    planned_velocity: np.ndarray
    """(S, 3) m/s."""
    planned_attitude: np.ndarray
    """(S, 4)."""
    planned_body_rates: np.ndarray
    """(S, 3) rad/s."""
    duration: float
    """Of the plan, s."""
    saturation_share: float
    """Part of the time that a rotor was asked for its least or most thrust, or for more."""
    crash: Crash | None
    """None if it flew to the end."""
    vehicle: Vehicle
    controller: str
    """Name of what steered."""
    conditions: Conditions

    def __post_init__(self) -> None:
        count = np.shape(self.times)[0] if np.ndim(self.times) else 0
        if count == 0:
            raise InvalidProblem("a flight must have at least one sample")
        for name, width in COLUMNS.items():
            shape = (count, width) if width else (count,)
            array = as_float_array(name, getattr(self, name), shape)
            if not np.isfinite(array).all():
                sample = int(np.argwhere(~np.isfinite(array))[0][0])
                raise InvalidProblem(f"{name} of sample {sample} must be finite")
            object.__setattr__(self, name, array)

    @property
    def flew(self) -> bool:
        """Whether it did not crash."""
        return self.crash is None

    @property
    def errors(self) -> np.ndarray:
        """(S,) m, distance from where the plan is at the time."""
        return np.linalg.norm(self.position - self.planned_position, axis=1)

    @property
    def rms_error(self) -> float:
        """Root mean square of the distance from the plan while it lasts, m."""
        return root_mean_square(self._planned_errors)

    @property
    def top_error(self) -> float:
        """Largest distance from the plan while it lasts, m."""
        return float(self._planned_errors.max())

    @property
    def _planned_errors(self) -> np.ndarray:
        return self.errors[self.times <= self.duration]

    def within(self, error: float) -> bool:
        """Whether it flew with an RMS error of at most so many m."""
        return self.flew and self.rms_error <= error

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers, lists and names, from which `from_dict` makes the same flight."""
        arrays = {name: getattr(self, name).tolist() for name in COLUMNS}
        return {**self._about(), **arrays}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """A flight from what `to_dict` gave.

        Raises
        ------
        InvalidProblem
            If a key is missing or a value is against a rule.
        """
        if not isinstance(values, Mapping):
            raise InvalidProblem("a flight must be a mapping of its values by name")
        for name in (*COLUMNS, *_ABOUT):
            if name not in values:
                raise InvalidProblem(f"{name} is missing")
        crash = values["crash"]
        if crash is not None and not (
            isinstance(crash, Mapping) and sorted(crash) == ["cause", "time"]
        ):
            raise InvalidProblem("crash must be null, or a cause and a time")
        return cls(
            **{name: values[name] for name in COLUMNS},
            duration=number("duration", values["duration"], 1e-9, 1e10, "s"),
            saturation_share=number("saturation_share", values["saturation_share"], 0.0, 1.0),
            crash=None if crash is None else Crash(**crash),
            vehicle=Vehicle.from_dict(values["vehicle"]),
            controller=str(values["controller"]),
            conditions=Conditions.from_dict(values["conditions"]),
        )

    def save(self, path: PathLike) -> None:
        """Write the flight without loss: as arrays of NumPy to a name in .npz, otherwise as JSON.

        Raises
        ------
        InvalidFile
            If the file cannot be written.
        """
        if Path(path).suffix.lower() != NUMBERS:
            write_json(path, self.to_dict())
            return
        stream = BytesIO()
        about = json.dumps(self._about(), allow_nan=False)
        np.savez_compressed(stream, about=about, **{name: getattr(self, name) for name in COLUMNS})
        write_atomically(path, stream.getvalue())

    @classmethod
    def load(cls, path: PathLike) -> Self:
        """Read what `save` wrote.

        Raises
        ------
        InvalidFile
            If it cannot be read or is no flight; the message names file, key and rule.
        """
        values = _read_arrays(path) if Path(path).suffix.lower() == NUMBERS else read_json(path)
        try:
            return cls.from_dict(values)
        except InvalidProblem as error:
            raise InvalidFile(f"{Path(path)}: {error}") from None

    def _about(self) -> dict[str, Any]:
        """What is not an array."""
        crash = self.crash
        return {
            "duration": self.duration,
            "saturation_share": self.saturation_share,
            "crash": None if crash is None else {"cause": crash.cause, "time": crash.time},
            "vehicle": self.vehicle.to_dict(),
            "controller": self.controller,
            "conditions": self.conditions.to_dict(),
            "rms_error": self.rms_error,
            "top_error": self.top_error,
        }


def root_mean_square(errors: np.ndarray) -> float:
    """Of distances from a plan, m."""
    return float(np.sqrt(np.mean(errors**2)))


_ABOUT = ("duration", "saturation_share", "crash", "vehicle", "controller", "conditions")
"""Keys that must be there; the errors follow from the samples."""


def _read_arrays(path: PathLike) -> dict[str, Any]:
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except FileNotFoundError:
        raise InvalidFile(f"{Path(path)}: no such file") from None
    except (BadZipFile, ValueError, EOFError, KeyError, TypeError) as error:
        why = quoted(str(error))
        raise InvalidFile(f"{Path(path)}: is not a file of NumPy arrays ({why})") from None
    except OSError as error:
        raise InvalidFile(f"{Path(path)}: cannot be read ({reason(error)})") from None
    if "about" not in arrays:
        raise InvalidFile(f"{Path(path)}: about is missing")
    about = parse_json(str(arrays.pop("about")), path)
    if not isinstance(about, dict):
        raise InvalidFile(f"{Path(path)}: about must be an object")
    return {**about, **arrays}
