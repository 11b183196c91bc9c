"""Scripts that fly set-points in NED: PX4 in offboard mode by MAVSDK, ArduPilot in guided mode.

x of a plan is east and y north, as in ROS (REP 103): north = y, east = x, down = -z, and a heading
clockwise from north = 90 degrees - yaw.
"""

import numpy as np

from peakflight.formats.flight_files.flight_format import (
    SET_POINTS,
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    single,
    start_note,
    through_samples,
)
from peakflight.formats.flight_files.samples import checked_count
from peakflight.formats.flight_files.script import HEIGHT, described, rows_text, script, value_in
from peakflight.formats.flight_files.table import as_float32
from peakflight.heading import heading
from peakflight.result import Plan

RATE = 50.0
"""Set-points a second; PX4 leaves offboard mode below 2."""
TO_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""North, east, down from east, north, up, and back: its own inverse."""


def set_points(plan: Plan) -> np.ndarray:
    """(n, 12) time, NED position, velocity, acceleration, heading and its rate; SI, radians."""
    trajectory = plan.trajectory
    count = checked_count(trajectory.duration, RATE)
    times = np.linspace(trajectory.start_time, trajectory.end_time, count + 1)
    turn = heading(plan)
    return np.column_stack(
        (
            times - trajectory.start_time,
            *(trajectory(times, order) @ TO_NED for order in range(3)),
            np.pi / 2.0 - turn(times),
            -turn(times, 1),
        )
    )


def encode_px4(plan: Plan, name: str = "") -> Encoded:
    """A script for MAVSDK; the name does not appear in it."""
    del name
    return _encoded("px4.py.in", plan)


def encode_ardupilot(plan: Plan, name: str = "") -> Encoded:
    """A script for pymavlink; the name does not appear in it."""
    del name
    return _encoded("ardupilot.py.in", plan)


def decode(data: bytes) -> tuple[Reading, ...]:
    """The motion through set-points in single precision, as MAVLink carries them."""
    rows = np.array(value_in(data, "SET_POINTS"), dtype=float)
    times, rest = rows[:, 0], as_float32(rows[:, 1:])
    position, velocity, acceleration = (rest[:, 3 * k : 3 * k + 3] @ TO_NED for k in range(3))
    yaw = through_samples(times, np.pi / 2.0 - rest[:, 9:10], -rest[:, 10:11])
    return (Reading(through_samples(times, position, velocity, acceleration), yaw),)


def _encoded(template: str, plan: Plan) -> Encoded:
    rows = set_points(plan)
    text = script(
        template,
        described=described(plan, SET_POINTS),
        set_points=rows_text(rows),
        height=f"{max(HEIGHT, float(plan.trajectory.coefficients[0, 0, 2])):.9g}",
    )
    return Encoded(text, start_note([plan], "the vehicle"))


_SHARED = {
    "decode": decode,
    "precision": Precision(position=1e-6, relative=1e-7),
    "tolerance": 1e-2,
    "fixed": SET_POINTS,
    "from_rest": True,
    "from_ground": True,
}
_NUMBERS = "single precision, set-points at 50 Hz"
PX4 = FlightFormat(
    filename="fly_px4.py",
    summary="a script that flies PX4 in offboard mode by MAVSDK",
    consumer="PX4, by MAVSDK 4 or later",
    numbers=_NUMBERS,
    encode=single(encode_px4),
    **_SHARED,  # type: ignore[arg-type]
)
ARDUPILOT = FlightFormat(
    filename="fly_ardupilot.py",
    summary="a script that flies ArduPilot in guided mode by pymavlink",
    consumer="ArduPilot Copter 4.1 or later, by pymavlink",
    numbers=_NUMBERS,
    encode=single(encode_ardupilot),
    **_SHARED,  # type: ignore[arg-type]
)
