"""The plan itself, as JSON and as arrays of NumPy: nothing is rounded."""

import io
import zipfile
from typing import Any

import numpy as np

from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.files import json_text, parse_json
from peakflight.formats.flight_files.flight_format import (
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    single,
)
from peakflight.formats.flight_files.samples import RATE, sample_times
from peakflight.heading import heading
from peakflight.result import Plan
from peakflight.trajectory import Trajectory

DERIVATIVES = ("position", "velocity", "acceleration", "jerk", "snap")
EXACT = Precision(position=1e-12)


def encode_json(plan: Plan, name: str = "") -> Encoded:
    """The plan file; the name does not appear in it."""
    del name
    return Encoded(json_text(plan.to_dict()).encode())


def decode_json(data: bytes) -> tuple[Reading, ...]:
    """The trajectory and the yaw motion of a plan file."""
    try:
        plan = Plan.from_dict(parse_json(data.decode(), "plan"))
    except (InvalidProblem, UnicodeDecodeError) as error:
        raise InvalidFile(f"the file is not a plan ({error})") from None
    return (Reading(plan.trajectory, plan.yaw_motion),)


def encode_npz(plan: Plan, name: str = "") -> Encoded:
    """Polynomials, waypoints and samples at 100 Hz as arrays; the name does not appear in it."""
    del name
    trajectory, yaw = plan.trajectory, heading(plan)
    times = sample_times(plan, RATE)
    arrays: dict[str, Any] = {
        "coefficients": trajectory.coefficients,
        "segment_times": trajectory.segment_times,
        "start_time": np.array(trajectory.start_time),
        "yaw_coefficients": yaw.coefficients,
        "yaw_segment_times": yaw.segment_times,
        "waypoints": plan.problem.waypoints,
        "waypoint_times": plan.waypoint_times,
        "time": times,
        "yaw": yaw(times)[:, 0],
        **{name: trajectory(times, order) for order, name in enumerate(DERIVATIVES)},
    }
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return Encoded(stream.getvalue())


def decode_npz(data: bytes) -> tuple[Reading, ...]:
    """The polynomials of the arrays."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            start = float(arrays["start_time"])
            flight = Trajectory(arrays["coefficients"], arrays["segment_times"], start)
            yaw = Trajectory(arrays["yaw_coefficients"], arrays["yaw_segment_times"], start)
    except (ValueError, KeyError, OSError, EOFError, TypeError, zipfile.BadZipFile) as error:
        raise InvalidFile(f"the file does not have the arrays of a flight ({error})") from None
    return (Reading(flight, yaw),)


JSON = FlightFormat(
    filename="plan.json",
    summary="the plan itself; peakflight check proves it",
    consumer="peakflight, and any program that reads JSON",
    numbers="double precision, exact",
    encode=single(encode_json),
    decode=decode_json,
    precision=EXACT,
    tolerance=1e-9,
)
NPZ = FlightFormat(
    filename="plan.npz",
    summary="polynomials and samples at 100 Hz as arrays",
    consumer="NumPy",
    numbers="double precision, exact",
    encode=single(encode_npz),
    decode=decode_npz,
    precision=EXACT,
    tolerance=1e-9,
)
