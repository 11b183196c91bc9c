"""Flight files through what really reads them: cflib's packers, rosbags, published loaders."""

import csv
import io
import json
import struct
import zipfile
from itertools import pairwise
from pathlib import Path

import jsonschema
import numpy as np
import pytest

import peakflight as pf
from peakflight.formats import FLIGHT_FORMATS, read_course

COURSES = Path(__file__).parent.parent / "examples" / "courses"
POINT = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
TRAJECTORY = {
    "type": "object",
    "required": ["version", "points", "takeoffTime"],
    "properties": {
        "version": {"const": 1},
        "takeoffTime": {"type": "number"},
        "points": {
            "type": "array",
            "minItems": 2,
            "items": {
                "type": "array",
                "prefixItems": [
                    {"type": "number", "minimum": 0},
                    POINT,
                    {"type": "array", "items": POINT, "maxItems": 6},
                ],
                "minItems": 3,
                "maxItems": 3,
            },
        },
    },
}
SHOW = {
    "type": "object",
    "required": ["version", "swarm", "environment"],
    "properties": {
        "version": {"const": 1},
        "environment": {
            "type": "object",
            "properties": {"type": {"enum": ["indoor", "outdoor"]}},
            "required": ["type"],
        },
        "swarm": {
            "type": "object",
            "required": ["drones"],
            "properties": {
                "drones": {
                    "type": "array",
                    "minItems": 1,
                    "items": {
                        "type": "object",
                        "required": ["type", "settings"],
                        "properties": {
                            "settings": {
                                "type": "object",
                                "required": ["trajectory"],
                                "properties": {
                                    "trajectory": TRAJECTORY,
                                    "home": POINT,
                                    "landAt": POINT,
                                },
                            }
                        },
                    },
                }
            },
        },
    },
}
"""What @skybrush/show-format checks and declares of a show, as a schema."""


@pytest.fixture(scope="module")
def plan() -> pf.Plan:
    waypoints = read_course(COURSES / "tight_then_fast.json").waypoints
    yaw = pf.Heading(policy="velocity")
    return pf.plan(waypoints, vehicle="crazyflie-2.1", yaw=yaw, pieces=2)


# ---- cflib ------------------------------------------------------------------------------------


def test_crazyswarm_rows_are_what_cflib_packs(plan: pf.Plan, tmp_path: Path) -> None:
    """The bytes that cflib sends of the CSV's numbers are the floats that we read back."""
    from cflib.crazyflie.mem import Poly4D

    pf.export(plan, to="crazyswarm", path=tmp_path / "c.csv")
    (reading,) = FLIGHT_FORMATS["crazyswarm"].decode((tmp_path / "c.csv").read_bytes())
    with (tmp_path / "c.csv").open(newline="") as stream:
        rows = [[float(field) for field in row] for row in list(csv.reader(stream))[1:]]
    assert len(rows) <= 31
    for k, row in enumerate(rows):
        polynomials = [Poly4D.Poly(row[1 + 8 * axis : 9 + 8 * axis]) for axis in range(4)]
        packed = Poly4D(row[0], *polynomials).pack()
        assert len(packed) == 132
        numbers = np.array(struct.unpack("<33f", packed), dtype=float)
        flown = numbers[:32].reshape(4, 8)
        np.testing.assert_array_equal(flown[:3].T, reading.trajectory.coefficients[k])
        np.testing.assert_array_equal(flown[3], reading.yaw.coefficients[k, :, 0])
        assert numbers[32] == reading.trajectory.segment_times[k]


def test_compressed_bytes_are_what_cflib_packs(plan: pf.Plan, tmp_path: Path) -> None:
    """cflib cuts off; of numbers in the middle of a unit it makes the very bytes that we write."""
    from cflib.crazyflie.mem import CompressedSegment, CompressedStart

    pf.export(plan, to="crazyflie-compressed", path=tmp_path / "c.bin")
    data = (tmp_path / "c.bin").read_bytes()
    (reading,) = FLIGHT_FORMATS["crazyflie-compressed"].decode(data)
    flight = pf.Trajectory(
        np.concatenate((reading.trajectory.coefficients, reading.yaw.coefficients), axis=2),
        reading.trajectory.segment_times,
    )
    unit = np.array([1e-3, 1e-3, 1e-3, np.radians(0.1)])
    whole = np.array([_bezier(flight, k) / unit for k in range(len(flight))])
    np.testing.assert_allclose(whole, whole.round(), atol=1e-4)
    inner = (whole.round() + 0.5 * np.sign(whole.round())) * unit
    packed = CompressedStart(*inner[0, 0]).pack()
    for duration, points in zip(flight.segment_times, inner, strict=True):
        axes = [list(points[1:, axis]) if np.ptp(points[:, axis]) else [] for axis in range(4)]
        packed += CompressedSegment(duration + 5e-4, *axes).pack()
    packed += CompressedSegment(0.0, [], [], [], []).pack()
    assert bytes(packed) == data


def _bezier(flight: pf.Trajectory, piece: int) -> np.ndarray:
    """(8, D) control points by de Casteljau's blossom, another way than the package's."""
    h = float(flight.segment_times[piece])
    values = np.array([flight.at(piece, h * u, 0) for u in np.linspace(0.0, 1.0, 8)])
    rows = np.array([_bernstein(u) for u in np.linspace(0.0, 1.0, 8)])
    points: np.ndarray = np.linalg.solve(rows, values)
    return points


def _bernstein(u: float) -> list[float]:
    from math import comb

    return [comb(7, j) * u**j * (1 - u) ** (7 - j) for j in range(8)]


# ---- the loader of Crazyswarm2 ------------------------------------------------------------------


class PublishedTrajectory:
    """By the rules of crazyflie_py's uav_trajectory.py, in words of our own.

    A line of names is skipped, 33 columns are read, a piece is flown until its end is passed, and a
    row alone breaks it, since it then sees numbers in place of rows.
    """

    def __init__(self, path: Path) -> None:
        data = np.loadtxt(path, delimiter=",", skiprows=1, usecols=range(33))
        self.pieces = [(row[0], row[1:].reshape(4, 8)) for row in data]
        self.duration = np.sum(data[:, 0])

    def __call__(self, t: float, order: int = 0) -> np.ndarray:
        assert 0 <= t <= self.duration
        for duration, coefficients in self.pieces:
            if t <= duration:
                polynomials = [np.polynomial.Polynomial(row).deriv(order) for row in coefficients]
                return np.array([polynomial(t) for polynomial in polynomials])
            t -= duration
        raise AssertionError


@pytest.mark.parametrize("waypoints", [2, 5])
def test_crazyswarm2_loads_what_was_planned(waypoints: int, tmp_path: Path) -> None:
    points = read_course(COURSES / "tight_then_fast.json").waypoints[:waypoints]
    made = pf.plan(points, vehicle="crazyflie-2.1", pieces=1)
    pf.export(made, to="crazyswarm", path=tmp_path / "c.csv")
    flown = PublishedTrajectory(tmp_path / "c.csv")
    assert len(flown.pieces) >= 2
    for t in np.linspace(0.0, 0.9999, 50):
        for order in range(3):
            there = made.trajectory(t * made.duration, order)
            assert np.abs(flown(t * flown.duration, order)[:3] - there).max() < 1e-5


# ---- ROS 2 --------------------------------------------------------------------------------------


def test_rosbags_reads_the_messages(plan: pf.Plan, tmp_path: Path) -> None:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    path = tmp_path / "flight.mcap"
    pf.export([plan, plan], to="ros2", path=path, names=["cf 1", "7"])
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(path) as reader:
        found = {c.topic: store.deserialize_cdr(raw, c.msgtype) for c, _, raw in reader.messages()}
    assert set(found) == {"/cf_1/trajectory", "/drone_7/trajectory"}
    message = found["/cf_1/trajectory"]
    assert (message.header.frame_id, message.joint_names) == ("world", ["base_link"])
    for point in message.points[:: len(message.points) // 9]:
        t = point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec
        place = point.transforms[0].translation
        speed, push = point.velocities[0], point.accelerations[0].linear
        there = [plan.trajectory(min(t, plan.duration), order) for order in range(3)]
        np.testing.assert_allclose([place.x, place.y, place.z], there[0], atol=1e-8)
        np.testing.assert_allclose([speed.linear.x, speed.linear.z], there[1][[0, 2]], atol=1e-7)
        np.testing.assert_allclose([push.x, push.y, push.z], there[2], atol=1e-5)
        turn = point.transforms[0].rotation
        yaw = plan.yaw(min(t, plan.duration))
        assert np.hypot(turn.w, turn.z) == pytest.approx(1.0)
        assert turn.z == pytest.approx(np.sin(yaw / 2), abs=1e-8)
        assert speed.angular.z == pytest.approx(
            plan.yaw(min(t, plan.duration), derivative=1), abs=1e-6
        )


# ---- Skybrush -----------------------------------------------------------------------------------


def test_a_show_is_a_zip_with_what_skybrush_declares(plan: pf.Plan, tmp_path: Path) -> None:
    pf.export([plan, plan], to="skyc", path=tmp_path / "show.skyc", names=["one", "two"])
    with zipfile.ZipFile(tmp_path / "show.skyc") as archive:
        assert archive.namelist() == ["show.json"]
        assert archive.testzip() is None
        show = json.loads(archive.read("show.json"))
    jsonschema.validate(show, SHOW, cls=jsonschema.Draft202012Validator)
    drones = show["swarm"]["drones"]
    assert [drone["settings"]["name"] for drone in drones] == ["one", "two"]
    points = drones[0]["settings"]["trajectory"]["points"]
    assert points[0][2] == []
    assert {len(point[2]) for point in points[1:]} <= {0, 6}
    assert all(after[0] > before[0] for before, after in pairwise(points))


def test_a_show_through_the_servers_encoder(plan: pf.Plan, tmp_path: Path) -> None:
    """By the rules of skybrush-server's SegmentEncoder: cut off to mm, ms by floor."""
    report = pf.export(plan, to="skyc", path=tmp_path / "show.skyc")
    with zipfile.ZipFile(io.BytesIO((tmp_path / "show.skyc").read_bytes())) as archive:
        points = json.loads(archive.read("show.json"))["swarm"]["drones"][0]["settings"]
    keypoints = points["trajectory"]["points"]
    flown = report.flights[0].trajectory
    time = 0
    for k, ((before, start, _), (after, end, via)) in enumerate(pairwise(keypoints)):
        duration = int(np.floor(round(after - before, 3) * 1000))
        series = np.array([[int(x * 1000) for x in point] for point in (start, *via, end)])
        assert np.abs(series).max() < 2**15
        for u in (0.0, 0.3, 1.0):
            value = np.array(_bernstein(u)) @ series / 1000.0
            np.testing.assert_allclose(flown.at(k, u * duration / 1000.0, 0), value, atol=1e-9)
        time += duration
    assert time == pytest.approx(flown.duration * 1000)


# ---- Agilicious, arrays, the plan ---------------------------------------------------------------


def test_agilicious_has_the_published_columns(plan: pf.Plan, tmp_path: Path) -> None:
    pf.export(plan, to="agilicious", path=tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(newline="") as stream:
        header, *rows = list(csv.reader(stream))
    assert ",".join(header) == (
        "t,p_x,p_y,p_z,q_w,q_x,q_y,q_z,v_x,v_y,v_z,w_x,w_y,w_z,a_lin_x,a_lin_y,a_lin_z,"
        "a_rot_x,a_rot_y,a_rot_z,u_1,u_2,u_3,u_4,jerk_x,jerk_y,jerk_z,snap_x,snap_y,snap_z"
    )
    columns = dict(zip(header, np.array(rows, dtype=float).T, strict=True))
    assert columns["t"][0] == 0.0
    assert columns["t"][-1] == pytest.approx(plan.duration, rel=1e-8)
    thrust = sum(columns[f"u_{rotor}"] for rotor in (1, 2, 3, 4)) / plan.vehicle.mass
    w, x, y, z = (columns[f"q_{part}"] for part in "wxyz")
    np.testing.assert_allclose(w * w + x * x + y * y + z * z, 1.0, atol=1e-8)
    push = np.array([columns[f"a_lin_{axis}"] for axis in "xyz"]) + np.array(
        [[0], [0], [pf.GRAVITY]]
    )
    up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    drag = np.abs(thrust * up - push).max()
    assert drag < 3.0  # the rotors' drag is all that is between them
    speed = np.array([columns[f"v_{axis}"] for axis in "xyz"])
    body = np.einsum("it,it->t", up, speed)
    lost = (
        thrust - np.einsum("it,it->t", up, push) - plan.vehicle.drag[1] / plan.vehicle.mass * body
    )
    np.testing.assert_allclose(lost, 0.0, atol=1e-4)


def test_arrays_are_named(plan: pf.Plan, tmp_path: Path) -> None:
    pf.export(plan, to="npz", path=tmp_path / "p.npz")
    with np.load(tmp_path / "p.npz") as arrays:
        assert arrays["position"].shape == (len(arrays["time"]), 3)
        np.testing.assert_array_equal(arrays["coefficients"], plan.trajectory.coefficients)
        np.testing.assert_allclose(arrays["snap"], plan.trajectory(arrays["time"], 4))
    pf.export(plan, to="json", path=tmp_path / "p.json")
    assert pf.certify_plan(pf.Plan.load(tmp_path / "p.json")).feasible
