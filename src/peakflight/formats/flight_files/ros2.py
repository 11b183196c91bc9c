"""Bags of ROS 2: a MultiDOFJointTrajectory for each drone in one MCAP file, written without ROS.

Positions, velocities and accelerations are in the frame `world`, z up; orientation is the yaw
alone, and angular velocity and acceleration about z are its rate and acceleration.
"""

import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from peakflight.errors import InvalidFile, InvalidProblem, MissingExtra
from peakflight.formats.flight_files.flight_format import (
    SET_POINTS,
    Encoded,
    FlightFormat,
    Precision,
    Reading,
    start_note,
    through_samples,
)
from peakflight.formats.flight_files.samples import sample_times
from peakflight.heading import heading
from peakflight.result import Plan

RATE = 100.0
"""Points a second."""
FRAME, JOINT = "world", "base_link"
TYPE = "trajectory_msgs/msg/MultiDOFJointTrajectory"
NANO = 10**9
VERSION = 8
"""Of the bag: what ROS 2 Iron and later write, and Humble reads."""


def encode(plans: Sequence[Plan], names: Sequence[str]) -> Encoded:
    """The bag of several plans, one topic each, named after them.

    Raises
    ------
    MissingExtra
        If rosbags is not installed.
    InvalidProblem
        If two drones have the same name.
    """
    from_library = _library()
    topics = [f"/{_topic(name)}/trajectory" for name in names]
    if len(set(topics)) != len(topics):
        raise InvalidProblem(f"two drones have the same topic: {', '.join(sorted(topics))}")
    store = from_library["get_typestore"](from_library["Stores"].ROS2_JAZZY)
    first = min(plan.trajectory.start_time for plan in plans)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / "bag"
        writer = from_library["Writer"](
            bag, version=VERSION, storage_plugin=from_library["StoragePlugin"].MCAP
        )
        with writer:
            for plan, topic in zip(plans, topics, strict=True):
                connection = writer.add_connection(topic, TYPE, typestore=store)
                message = _message(plan, first, store.types)
                writer.write(connection, 0, store.serialize_cdr(message, TYPE))
        data = next(bag.glob("*.mcap")).read_bytes()
    return Encoded(data, start_note(plans, "the vehicle"))


def decode(data: bytes) -> tuple[Reading, ...]:
    """The motion through the points of each message.

    Raises
    ------
    InvalidFile
        If it is not such a bag.
    """
    from_library = _library()
    store = from_library["get_typestore"](from_library["Stores"].ROS2_JAZZY)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag.mcap"
        path.write_bytes(data)
        try:
            with from_library["Reader"](path) as reader:
                messages = [
                    store.deserialize_cdr(raw, connection.msgtype)
                    for connection, _, raw in reader.messages()
                    if connection.msgtype == TYPE
                ]
        except from_library["ReaderError"] as error:
            raise InvalidFile(f"the file is not a bag ({error})") from None
    return tuple(_reading(message) for message in messages)


def _library() -> dict[str, Any]:
    if find_spec("rosbags") is None:
        raise MissingExtra(
            "the format ros2 needs rosbags, which is not installed; install it with: "
            "pip install 'peakflight[ros2]'"
        )
    from rosbags.rosbag2 import Reader, ReaderError, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    return {
        "Reader": Reader,
        "ReaderError": ReaderError,
        "StoragePlugin": StoragePlugin,
        "Stores": Stores,
        "Writer": Writer,
        "get_typestore": get_typestore,
    }


def _topic(name: str) -> str:
    """What ROS allows in the name of a topic: letters, digits and underlines."""
    topic = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return topic if topic[:1].isalpha() else f"drone_{topic}"


def _message(plan: Plan, first: float, types: Any) -> Any:
    """The message of a plan, times from when the first of several starts."""
    times = sample_times(plan, RATE)
    position, velocity, acceleration = (plan.trajectory(times, order) for order in range(3))
    yaw, rate, turn = (heading(plan)(times, order)[:, 0] for order in range(3))
    vector = types["geometry_msgs/msg/Vector3"]
    twist = types["geometry_msgs/msg/Twist"]
    points = [
        types["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"](
            transforms=[
                types["geometry_msgs/msg/Transform"](
                    translation=vector(*position[k].tolist()),
                    rotation=types["geometry_msgs/msg/Quaternion"](
                        0.0, 0.0, float(np.sin(yaw[k] / 2)), float(np.cos(yaw[k] / 2))
                    ),
                )
            ],
            velocities=[twist(vector(*velocity[k].tolist()), vector(0.0, 0.0, float(rate[k])))],
            accelerations=[
                twist(vector(*acceleration[k].tolist()), vector(0.0, 0.0, float(turn[k])))
            ],
            time_from_start=_duration(types, round((times[k] - first) * NANO)),
        )
        for k in range(len(times))
    ]
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](0, 0), frame_id=FRAME
    )
    return types[TYPE](header=header, joint_names=[JOINT], points=points)


def _duration(types: Any, nanoseconds: int) -> Any:
    seconds, rest = divmod(nanoseconds, NANO)
    return types["builtin_interfaces/msg/Duration"](seconds, rest)


def _reading(message: Any) -> Reading:
    times = np.array(
        [p.time_from_start.sec + p.time_from_start.nanosec / NANO for p in message.points]
    )

    def vectors(get: Any) -> np.ndarray:
        return np.array([[v.x, v.y, v.z] for v in map(get, message.points)])

    turns = [p.transforms[0].rotation for p in message.points]
    yaw = np.unwrap([2.0 * np.arctan2(q.z, q.w) for q in turns])[:, None]
    return Reading(
        through_samples(
            times,
            vectors(lambda p: p.transforms[0].translation),
            vectors(lambda p: p.velocities[0].linear),
            vectors(lambda p: p.accelerations[0].linear),
        ),
        through_samples(
            times,
            yaw,
            vectors(lambda p: p.velocities[0].angular)[:, 2:],
            vectors(lambda p: p.accelerations[0].angular)[:, 2:],
        ),
    )


FORMAT = FlightFormat(
    filename="flight.mcap",
    summary="a bag of ROS 2 with trajectory messages at 100 Hz",
    consumer="ROS 2: ros2 bag play, and nodes that take MultiDOFJointTrajectory",
    numbers="double precision; times in ns",
    rules="needs rosbags; orientation is the yaw alone",
    encode=encode,
    decode=decode,
    precision=Precision(position=1e-6, time=1e-9),
    tolerance=1e-2,
    fixed=SET_POINTS,
    several=True,
)
