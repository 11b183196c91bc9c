import numpy as np
import pytest

import peakflight as pf
from peakflight.formats import write_crazyflie, write_samples
from peakflight.importing import joint_jumps, repaired
from peakflight.readers import TrajectoryFile

LIMITS = pf.Limits(speed=3.0, thrust_acceleration=14.0, jerk=50.0, snap=600.0)
WAYPOINTS = np.array([[0, 0, 1], [1, 0.5, 1.3], [2, -0.5, 1.0], [3, 0, 1.2]])


@pytest.fixture(scope="module")
def plan():
    return pf.plan(WAYPOINTS, limits=LIMITS, method="peak", yaw="velocity")


@pytest.fixture
def pieces(plan, tmp_path):
    write_crazyflie(plan, tmp_path / "c.csv")
    return tmp_path / "c.csv"


def rounded(path, digits):
    """The same file with numbers of so many decimals."""
    header, *rows = path.read_text().strip().split("\n")
    rows = [",".join(f"{float(field):.{digits}f}" for field in row.split(",")) for row in rows]
    other = path.with_name("rounded.csv")
    other.write_text("\n".join([header, *rows]))
    return other


def test_joints_become_waypoints_and_the_proof_holds(plan, pieces, tmp_path):
    found = pf.import_trajectory(pieces, limits=LIMITS, repair=True)
    made = found.plan
    np.testing.assert_allclose(made.problem.waypoints, WAYPOINTS, atol=1e-7)
    assert made.method == "imported"
    assert made.report.worst == pytest.approx(1.0, abs=1e-6)
    assert made.report.joint_residual < 1e-11
    assert made.duration == pytest.approx(plan.duration, rel=1e-8)
    made.save(tmp_path / "plan.json")
    again = pf.certify_plan(pf.Plan.load(tmp_path / "plan.json"))
    assert again.worst == made.report.worst


def test_yaw_is_carried_and_can_be_limited(plan, pieces):
    found = pf.import_trajectory(pieces, limits=LIMITS, yaw_limits={"rate": 4.0}, repair=True)
    assert found.plan.report.peaks["yaw_rate"].max() < 1.0
    assert found.yaw_off < 2e-3
    times = np.linspace(0.0, plan.duration - 1e-6, 200)
    # the file itself is coarser than the plan
    assert np.abs(found.plan.yaw(times) - plan.yaw(times)).max() < 0.05
    strict = pf.import_trajectory(pieces, limits=LIMITS, yaw_limits={"rate": 1.0}, repair=True)
    assert not strict.plan.feasible
    assert any("yaw rate" in line for line in strict.plan.report.problems)
    slower = pf.import_trajectory(
        pieces, limits=LIMITS, yaw_limits={"rate": 1.0}, repair=True, retime=True
    )
    assert slower.plan.feasible
    assert slower.plan.report.peaks["yaw_rate"].max() == pytest.approx(1.0, abs=1e-6)


def test_a_constant_yaw_is_a_fixed_one(tmp_path):
    held = pf.plan(WAYPOINTS, limits=LIMITS, method="peak", yaw=0.5)
    write_crazyflie(held, tmp_path / "c.csv")
    found = pf.import_trajectory(tmp_path / "c.csv", limits=LIMITS, repair=True, retime=True).plan
    assert found.problem.heading.policy == "fixed"
    assert found.problem.heading.angle == 0.5
    assert found.feasible


@pytest.mark.parametrize("digits", [9, 6, 4])
def test_rounded_numbers_jump_and_are_mended(digits, plan, pieces):
    path = rounded(pieces, digits)
    before = pf.import_trajectory(path, limits=LIMITS)
    mended = pf.import_trajectory(path, limits=LIMITS, repair=True)
    if digits < 9:
        assert not before.plan.feasible
        assert any("jumps" in line for line in before.plan.report.problems)
    assert before.is_rounded
    assert not any("jumps" in line for line in mended.plan.report.problems)
    assert joint_jumps(mended.plan.trajectory).max() < 1e-10
    # a correction is about as large as the jumps that it closes
    assert mended.moved[0] <= 2.0 * max(before.jumps[0], 10.0**-digits)
    times = np.linspace(0.0, min(plan.duration, mended.plan.duration) - 1e-3, 200)
    off = mended.plan.trajectory(times) - plan.trajectory(times)
    assert np.abs(off).max() < 50.0 * 10.0**-digits
    retimed = pf.import_trajectory(path, limits=LIMITS, repair=True, retime=True)
    assert retimed.plan.feasible
    assert retimed.plan.duration == pytest.approx(plan.duration, rel=10.0 ** (3 - digits))


def test_repair_closes_what_it_is_given():
    rng = np.random.default_rng(1)
    flight = pf.minimum_effort_spline(WAYPOINTS, [1.0, 0.7, 1.2])
    noise = rng.uniform(-1e-4, 1e-4, flight.coefficients.shape)
    broken = pf.Trajectory(flight.coefficients + noise, flight.segment_times)
    whole, moved = repaired(broken)
    assert joint_jumps(broken).max() > 1e-5
    assert joint_jumps(whole).max() < 1e-12
    for order in range(3):
        off = np.linalg.norm(whole.sample(50, order) - broken.sample(50, order), axis=2).max()
        assert off <= 1.01 * moved[order]
        np.testing.assert_allclose(
            whole.sample(2, order)[[0, -1], [0, 1]], 0.0 if order else WAYPOINTS[[0, -1]], atol=2e-3
        )
    again, moved = repaired(whole)
    np.testing.assert_allclose(again.coefficients, whole.coefficients, atol=1e-12)


def test_real_jumps_are_not_called_rounding(tmp_path):
    steps = pf.Trajectory([[[0, 0, 1], [1, 0, 0]], [[1.5, 0, 1], [0, 1, 0]]], [1.0, 1.0])
    path = tmp_path / "steps.json"
    path.write_text(str(steps.to_dict()).replace("'", '"'))
    found = pf.import_trajectory(path, limits=LIMITS)
    assert not found.is_rounded
    assert not found.plan.feasible
    np.testing.assert_allclose(found.jumps, [0.5, np.sqrt(2.0), 0.0], atol=1e-12)


def test_retime_is_the_exact_stretch(plan, pieces):
    gentle = pf.Limits(speed=1.5, thrust_acceleration=12.0)
    found = pf.import_trajectory(pieces, limits=gentle, repair=True, retime=True)
    stretched, factor = pf.stretch_to_limits(
        pf.import_trajectory(pieces, limits=gentle, repair=True).plan.trajectory, gentle
    )
    assert found.plan.feasible
    assert found.plan.duration == pytest.approx(stretched.duration, rel=1e-8)
    assert found.file_plan.duration == pytest.approx(plan.duration, rel=1e-8)
    assert found.plan.duration == pytest.approx(factor * plan.duration, rel=1e-7)


@pytest.mark.parametrize("method", ["peak", "joint"])
def test_planned_anew_through_the_joints(method, plan, tmp_path):
    write_samples(plan, tmp_path / "s.csv")
    found = pf.import_trajectory(tmp_path / "s.csv", limits=LIMITS, method=method)
    assert found.plan.feasible
    assert found.plan.method == method
    np.testing.assert_allclose(
        found.plan.problem.waypoints, found.file_plan.problem.waypoints, atol=1e-12
    )
    if method == "joint":
        assert found.plan.duration <= plan.duration * (1.0 + 1e-3)


def test_a_plan_file_keeps_its_own_limits_and_waypoints(plan, tmp_path):
    plan.save(tmp_path / "plan.json")
    found = pf.import_trajectory(tmp_path / "plan.json")
    assert found.plan.problem.to_dict() == plan.problem.to_dict()
    assert found.plan.feasible
    gentle = pf.Limits(speed=1.0)
    slower = pf.import_trajectory(tmp_path / "plan.json", limits=gentle, retime=True).plan
    assert slower.feasible
    assert slower.problem.limits == gentle
    vehicle = pf.import_trajectory(tmp_path / "plan.json", vehicle="racing-quad").plan
    assert vehicle.vehicle.name == "racing-quad"
    mended = pf.import_trajectory(tmp_path / "plan.json", repair=True).plan
    assert mended.report.joint_residual < 1e-8


def test_a_loop_of_one_piece_gets_waypoints(tmp_path):
    # x(t) = t^2 (1 - t)^2 comes back to where it began
    loop = pf.Trajectory([[[0, 0, 1], [0, 0, 0], [4, 0, 0], [-8, 0, 0], [4, 0, 0]]], [1.0])
    path = tmp_path / "loop.json"
    path.write_text(str(loop.to_dict()).replace("'", '"'))
    found = pf.import_trajectory(path, limits=pf.Limits(speed=5.0)).plan
    assert len(found.problem.waypoints) == 3
    np.testing.assert_allclose(found.problem.waypoints[1], [0.25, 0.0, 1.0], atol=1e-12)
    hover = pf.Trajectory([[[0.0, 0.0, 1.0]]], [1.0])
    path.write_text(str(hover.to_dict()).replace("'", '"'))
    with pytest.raises(pf.InvalidProblem, match="stays within 1 mm"):
        pf.import_trajectory(path, limits=LIMITS)


def test_waiting_pieces_are_not_waypoints(plan, tmp_path):
    from peakflight.editing import delay

    plain = pf.plan(WAYPOINTS, limits=LIMITS, method="peak")
    write_crazyflie(delay(plain, 1.0), tmp_path / "c.csv")
    found = pf.import_trajectory(tmp_path / "c.csv", limits=LIMITS, repair=True, retime=True).plan
    assert found.feasible
    assert len(found.problem.waypoints) == 4
    assert found.pieces == (2, 1, 1)
    del plan


def test_moving_ends_are_kept(tmp_path):
    line = pf.Trajectory([[[0, 0, 1], [1, 0, 0]]], [2.0])
    path = tmp_path / "line.json"
    path.write_text(str(line.to_dict()).replace("'", '"'))
    found = pf.import_trajectory(path, limits=pf.Limits(speed=2.0), repair=True, retime=True).plan
    assert found.feasible
    assert found.duration == pytest.approx(1.0, rel=1e-8)
    np.testing.assert_allclose(found.problem.start[0], [2.0, 0.0, 0.0], atol=1e-7)


def test_limits_are_needed(pieces):
    with pytest.raises(pf.InvalidProblem, match="limits is missing"):
        pf.import_trajectory(pieces)


def test_yaw_limits_need_a_yaw(plan, tmp_path):
    still = pf.plan(WAYPOINTS, limits=LIMITS, method="peak")
    write_crazyflie(still, tmp_path / "c.csv")
    still.save(tmp_path / "plan.json")
    for name in ("c.csv", "plan.json"):
        with pytest.raises(pf.InvalidProblem, match="the file has no yaw"):
            pf.import_trajectory(tmp_path / name, limits=LIMITS, yaw_limits={"rate": 1.0})
    del plan


def test_yaw_off_is_that_between_the_knots(tmp_path):
    slow = pf.minimum_effort_spline(WAYPOINTS, np.full(3, 10.0 / 3.0))
    flight = pf.Trajectory(slow.coefficients, slow.segment_times)
    # one polynomial over all pieces, of a degree that is too high, turning at both ends
    powers = np.zeros((1, 5, 1))
    powers[0, :, 0] = [0.0, 3.0, 0.0, 0.0, 1e-4]
    yaw = pf.Trajectory(powers, [flight.duration]).cut(flight.breakpoints[1:-1])
    file = TrajectoryFile(trajectory=flight, yaw=yaw, form="made here")
    found = pf.import_trajectory(file, limits=LIMITS)
    times = np.linspace(0.0, flight.duration, 100_001)
    off = np.abs(found.plan.yaw_motion(times) - yaw(times)).max()
    assert found.yaw_off == pytest.approx(off, rel=0.05)
    assert off <= 1e-3


def test_a_yaw_that_jumps_is_said_to_be_off(tmp_path):
    flight = pf.minimum_effort_spline(WAYPOINTS, np.full(3, 3.0))
    angles = np.zeros((3, 5, 1))
    angles[1, 0] = 1.0
    angles[0, 4] = 1e-4
    file = TrajectoryFile(
        trajectory=flight, yaw=pf.Trajectory(angles, flight.segment_times), form="made here"
    )
    found = pf.import_trajectory(file, limits=LIMITS)
    assert 0.5 < found.yaw_off < 1.5
    assert len(found.plan.yaw_motion) <= 3 * 64


def test_a_motion_under_limits_on_rotors_leaves_its_nose_free():
    flight = pf.minimum_effort_spline(WAYPOINTS, np.full(3, 3.0))
    file = TrajectoryFile(trajectory=flight, form="made here")
    rotors = pf.find_vehicle("crazyflie-2.1").on_rotors().limits
    made = pf.import_trajectory(file, limits=rotors).plan
    assert made.problem.heading.policy == "free"
    assert made.feasible, made.message


def test_either_the_path_or_another_plan(plan, tmp_path):
    write_samples(plan, tmp_path / "s.csv")
    with pytest.raises(pf.InvalidProblem, match=r"retime flies the path .* ask for one of them"):
        pf.import_trajectory(tmp_path / "s.csv", limits=LIMITS, retime=True, method="joint")
