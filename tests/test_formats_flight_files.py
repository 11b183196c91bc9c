import csv
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import peakflight as pf
from peakflight.errors import InvalidFile, InvalidProblem
from peakflight.formats import read_course, write_crazyflie, write_samples
from peakflight.heading import heading

POSITION_ERROR = 3e-8
"""m, and m/s; what nine significant digits cost (ecosystem notes)."""
WRITERS = {"samples": write_samples, "crazyflie": write_crazyflie}
"""Plain files, with neither refit nor report."""


class CrazyflieFile:
    """A small reader of its own, after the loader of Crazyswarm2: plain Python, no peakflight."""

    def __init__(self, path):
        with path.open(newline="") as stream:
            header, *rows = list(csv.reader(stream))
        self.header = header
        self.pieces = [[float(field) for field in row] for row in rows]
        self.duration = sum(piece[0] for piece in self.pieces)

    def __call__(self, t, derivative=0):
        """(4,) x, y, z, yaw at t seconds after the start."""
        for piece in self.pieces[:-1]:
            if t < piece[0]:
                break
            t -= piece[0]
        else:
            piece = self.pieces[-1]
        value = []
        for axis in range(4):
            polynomial = np.polynomial.Polynomial(piece[1 + 8 * axis : 9 + 8 * axis])
            value.append(polynomial.deriv(derivative)(t) if derivative else polynomial(t))
        return np.array(value)


def read_samples(path):
    with path.open(newline="") as stream:
        header, *rows = list(csv.reader(stream))
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))


def angle_between(a, b):
    return np.abs((np.asarray(a) - b + np.pi) % (2 * np.pi) - np.pi)


# ---- what every writer does -----------------------------------------------------------------


@pytest.mark.parametrize("name", WRITERS)
class TestEveryWriter:
    def test_writes_its_file_and_returns_notes(self, name, hand_plan, tmp_path):
        assert WRITERS[name](hand_plan(), tmp_path / "file.csv") == ()
        assert [path.name for path in tmp_path.iterdir()] == ["file.csv"]

    def test_overwrites(self, name, hand_plan, tmp_path):
        path = tmp_path / "file.csv"
        path.write_text("old")
        WRITERS[name](hand_plan(), path)
        assert "old" not in path.read_text()

    def test_no_folder_is_one_clear_error(self, name, hand_plan, tmp_path):
        with pytest.raises(InvalidFile, match="nowhere"):
            WRITERS[name](hand_plan(), tmp_path / "nowhere" / "file.csv")

    def test_folder_is_one_clear_error(self, name, hand_plan, tmp_path):
        with pytest.raises(InvalidFile, match="is a folder"):
            WRITERS[name](hand_plan(), tmp_path)

    def test_a_thousand_pieces_are_fast(self, name, hand_plan, tmp_path):
        plan = hand_plan(pieces=(2,) * 500, yaw=[0.1] * 501, seconds=(0.1, 0.2))
        start = time.process_time()
        WRITERS[name](plan, tmp_path / "file.csv")
        assert time.process_time() - start < 2.0  # some 0.05 s here

    def test_no_negative_zeros(self, name, hand_plan, tmp_path):
        path = tmp_path / "file.csv"
        back = pf.Trajectory([[[-0.0] * 3, [-1.0] * 3]], [1.0])
        WRITERS[name](replace(hand_plan(pieces=(1,)), trajectory=back), path)
        fields = path.read_text().replace("\n", ",").split(",")
        assert "-0" not in fields
        assert "0" in fields


# ---- samples --------------------------------------------------------------------------------


def test_samples_have_named_columns_with_units(hand_plan, tmp_path):
    write_samples(hand_plan(), tmp_path / "s.csv")
    columns = list(read_samples(tmp_path / "s.csv"))
    assert columns[:4] == ["t [s]", "x [m]", "y [m]", "z [m]"]
    assert columns[4:7] == ["vx [m/s]", "vy [m/s]", "vz [m/s]"]
    assert columns[7] == "ax [m/s^2]"
    assert columns[10] == "jx [m/s^3]"
    assert columns[13:] == ["sx [m/s^4]", "sy [m/s^4]", "sz [m/s^4]"]
    write_samples(hand_plan(yaw=[0, 1, 2, 3]), tmp_path / "s.csv")
    assert list(read_samples(tmp_path / "s.csv"))[16:] == ["yaw [rad]"]


@pytest.mark.kernels
def test_samples_of_a_vehicle_have_its_attitude_rates_and_rotor_thrusts(hand_plan, tmp_path):
    plan = hand_plan(yaw=[0.0, 1.0, 2.0, 1.0])
    write_samples(plan, tmp_path / "without.csv")
    plan = replace(plan, problem=replace(plan.problem, vehicle="racing-quad"))
    assert write_samples(plan, tmp_path / "with.csv") == ()
    without, samples = (read_samples(tmp_path / f"{name}.csv") for name in ("without", "with"))
    new = ["qw [1]", "qx [1]", "qy [1]", "qz [1]", "wx [rad/s]", "wy [rad/s]", "wz [rad/s]"]
    new += [f"f{rotor} [N]" for rotor in (1, 2, 3, 4)]
    assert list(samples) == [*without, *new]
    for name, values in without.items():
        np.testing.assert_array_equal(samples[name], values)
    states = pf.planned_states(plan, np.minimum(samples["t [s]"], plan.trajectory.end_time))
    wanted = np.hstack((states.attitude, states.body_rate, states.rotor_thrust))
    np.testing.assert_allclose([samples[name] for name in new], wanted.T, rtol=1e-7, atol=1e-7)
    course = read_course(tmp_path / "with.csv")
    np.testing.assert_array_equal(course.waypoints[:, 0], samples["x [m]"])


@pytest.mark.kernels
def test_samples_say_where_rotors_are_asked_for_too_much(hand_plan, tmp_path):
    plan = hand_plan(yaw=[0.0, 3.0, -3.0, 0.0])
    plan = replace(plan, problem=replace(plan.problem, vehicle="crazyflie-2.1"))
    plan = replace(plan, trajectory=plan.trajectory.stretch(0.3))
    (note,) = write_samples(plan, tmp_path / "samples.csv")
    assert note.startswith("flown exactly, at this yaw, it takes -")
    assert note.endswith("N of a rotor; crazyflie-2.1 has 0.0128 to 0.12 N")


def test_samples_are_the_trajectory(hand_plan, tmp_path):
    plan = hand_plan(yaw=[0.1, 3.0, -3.0, 0.0], start_time=2.5)
    write_samples(plan, tmp_path / "s.csv", rate=50.0)
    columns = read_samples(tmp_path / "s.csv")
    t = columns.pop("t [s]")
    yaw = columns.pop("yaw [rad]")
    for index, values in enumerate(columns.values()):
        exact = plan.trajectory(np.clip(t, 2.5, plan.trajectory.end_time), index // 3)[:, index % 3]
        np.testing.assert_allclose(values, exact, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(yaw, heading(plan)(t)[:, 0], rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize("rate", [100.0, 33.3, 7.0, 0.1])
@pytest.mark.parametrize("start_time", [0.0, 12.5, 1.7e9])
def test_samples_go_from_start_to_the_exact_end_at_the_rate(rate, start_time, hand_plan, tmp_path):
    plan = hand_plan(start_time=start_time)
    write_samples(plan, tmp_path / "s.csv", rate=rate)
    t = read_samples(tmp_path / "s.csv")["t [s]"]
    resolution = 1e-14 * max(1.0, start_time)
    assert t[0] == start_time
    assert t[-1] == pytest.approx(plan.trajectory.end_time, abs=resolution, rel=0)
    steps = np.diff(t)
    np.testing.assert_allclose(steps[:-1], 1.0 / rate, rtol=0, atol=2 * resolution)
    assert 0.0 < steps[-1] <= 1.0 / rate + 2 * resolution


@pytest.mark.parametrize("duration", [0.29, 0.3, 0.7, 1.1, 4.35])
def test_end_on_the_grid_is_written_once(duration, hand_plan, tmp_path):
    plan = hand_plan(pieces=(1,), seconds=(duration, duration))
    write_samples(plan, tmp_path / "s.csv")
    assert len(read_samples(tmp_path / "s.csv")["t [s]"]) == round(100 * duration) + 1


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_bad_rate_is_refused(rate, hand_plan, tmp_path):
    with pytest.raises(InvalidProblem, match=r"rate is .* Hz; it must be positive and finite"):
        write_samples(hand_plan(), tmp_path / "s.csv", rate=rate)
    assert not list(tmp_path.iterdir())


def test_rate_that_would_fill_the_disk_is_refused(hand_plan, tmp_path):
    with pytest.raises(InvalidProblem, match=r"rate is 1e\+12 Hz, which makes .* rows"):
        write_samples(hand_plan(), tmp_path / "s.csv", rate=1e12)


def test_five_seconds_of_samples_take_milliseconds(hand_plan, tmp_path):
    plan = hand_plan(pieces=(1,) * 10, seconds=(0.5, 0.5))
    best = min(timed(write_samples, plan, tmp_path / "s.csv") for _ in range(10))
    assert best < 0.05  # 3 ms here; a loop over samples and axes takes more than this


def timed(function, *arguments):
    start = time.perf_counter()
    function(*arguments)
    return time.perf_counter() - start


def test_samples_read_back_as_a_timed_course(hand_plan, tmp_path):
    plan = hand_plan(yaw=[0, 1, 2, 3])
    write_samples(plan, tmp_path / "s.csv")
    course = read_course(tmp_path / "s.csv")
    np.testing.assert_allclose(course.waypoints[-1], plan.problem.waypoints[-1], atol=1e-8)
    assert course.times[-1] == pytest.approx(plan.duration, rel=1e-14)
    assert course.yaw[-1] == pytest.approx(3.0)


# ---- Crazyflie ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degree", "seconds", "tolerance"),
    [
        (7, (0.6, 1.0), POSITION_ERROR),
        (7, (1.0, 2.0), POSITION_ERROR),
        (5, (0.6, 1.5), POSITION_ERROR),
        (3, (1.0, 2.0), POSITION_ERROR),
        (7, (3.0, 4.5), 1e-7),  # larger powers of longer times
    ],
)
def test_crazyflie_file_flies_the_trajectory(degree, seconds, tolerance, hand_plan, tmp_path):
    plan = hand_plan(pieces=(1, 2) * 4, degree=degree, seconds=seconds, start_time=1.0)
    write_crazyflie(plan, tmp_path / "c.csv")
    flown = CrazyflieFile(tmp_path / "c.csv")
    assert flown.duration == pytest.approx(plan.duration, rel=1e-8)
    assert len(flown.pieces) == len(plan.trajectory)
    for t in np.linspace(0.0, plan.duration, 101):
        for derivative in (0, 1):
            error = flown(t, derivative)[:3] - plan.trajectory(1.0 + t, derivative)
            assert np.linalg.norm(error) < tolerance


def test_crazyflie_header_and_row_length(hand_plan, tmp_path):
    write_crazyflie(hand_plan(degree=5), tmp_path / "c.csv")
    flown = CrazyflieFile(tmp_path / "c.csv")
    assert flown.header[:2] == ["duration", "x^0"]
    assert flown.header[8:10] == ["x^7", "y^0"]
    assert flown.header[-8:] == [f"yaw^{power}" for power in range(8)]
    assert {len(piece) for piece in flown.pieces} == {33}
    assert all(piece[7:9] == [0.0, 0.0] for piece in flown.pieces)


def test_single_piece_is_split_in_two(hand_plan, tmp_path):
    plan = hand_plan(pieces=(1,), yaw=[0.2, 1.7])
    assert write_crazyflie(plan, tmp_path / "c.csv") == ()
    flown = CrazyflieFile(tmp_path / "c.csv")
    assert len(flown.pieces) == 2
    for t in np.linspace(0.0, plan.duration, 51):
        assert np.linalg.norm(flown(t)[:3] - plan.trajectory(t)) < POSITION_ERROR
        assert flown(t)[3] == pytest.approx(float(heading(plan)(t)[0]), abs=POSITION_ERROR)


def test_degree_above_seven_is_refused(hand_plan, tmp_path):
    with pytest.raises(InvalidProblem, match="has degree 9; a Crazyflie flies degree 7 at most"):
        write_crazyflie(hand_plan(degree=9), tmp_path / "c.csv")
    assert not list(tmp_path.iterdir())


def test_notes_for_the_pilot(hand_plan, tmp_path):
    assert write_crazyflie(hand_plan(pieces=(1,) * 31), tmp_path / "c.csv") == ()
    (note,) = write_crazyflie(hand_plan(pieces=(2,) * 16), tmp_path / "c.csv")
    assert note.startswith("32 pieces: the memory of a Crazyflie holds 31")
    assert len(CrazyflieFile(tmp_path / "c.csv").pieces) == 32
    (note,) = write_crazyflie(hand_plan(start_time=12.5), tmp_path / "c.csv")
    assert note.startswith("the plan starts at 12.5 s")


# ---- yaw ------------------------------------------------------------------------------------


def test_yaw_is_zero_without_one(hand_plan, tmp_path):
    write_crazyflie(hand_plan(), tmp_path / "c.csv")
    assert all(piece[25:] == [0.0] * 8 for piece in CrazyflieFile(tmp_path / "c.csv").pieces)


@pytest.mark.parametrize("pieces", [(1, 1, 1), (2, 1, 3)])
def test_yaw_passes_every_waypoint_at_rest_and_takes_the_shorter_way(pieces, hand_plan, tmp_path):
    yaw = [3.0, -3.0, 0.1, 6.9]
    plan = hand_plan(pieces=pieces, yaw=yaw, start_time=4.0)
    write_crazyflie(plan, tmp_path / "c.csv")
    flown = CrazyflieFile(tmp_path / "c.csv")
    joints = plan.waypoint_times - 4.0
    for joint, wanted in zip(joints, yaw, strict=True):
        assert angle_between(flown(joint)[3], wanted) < 1e-7
        assert abs(flown(joint, 1)[3]) < 1e-6
    turns = [flown(after)[3] - flown(before)[3] for before, after in pairwise(joints)]
    assert np.abs(turns).max() <= np.pi
    assert turns[0] == pytest.approx(2 * np.pi - 6.0, abs=1e-6)


def test_yaw_is_one_smoothstep_a_leg_whatever_the_pieces(hand_plan):
    plan = hand_plan(pieces=(3, 1, 2), yaw=[0.0, 2.0, 1.0, 1.0], start_time=-1.0)
    turning = heading(plan)
    begins = plan.waypoint_times
    for leg, (a, b) in enumerate([(0.0, 2.0), (2.0, 1.0), (1.0, 1.0)]):
        s = np.linspace(0.0, 1.0, 40)
        t = begins[leg] + s * (begins[leg + 1] - begins[leg])
        np.testing.assert_allclose(turning(t)[:, 0], a + (b - a) * s * s * (3 - 2 * s), atol=1e-12)
    jumps = turning.sample(2)[1:, 0] - turning.sample(2)[:-1, 1]
    np.testing.assert_allclose(jumps, 0.0, atol=1e-12)


def test_heading_without_yaw_is_zero_over_the_same_pieces(hand_plan):
    plan = hand_plan()
    turning = heading(plan)
    assert isinstance(turning, pf.Trajectory)
    np.testing.assert_array_equal(turning.breakpoints, plan.trajectory.breakpoints)
    assert not turning.coefficients.any()
