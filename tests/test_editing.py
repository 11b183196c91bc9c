import math
from dataclasses import replace

import numpy as np
import pytest

import peakflight as pf
from peakflight import editing

LIMITS = pf.Limits(
    speed=3.0, thrust_acceleration=14.0, jerk=50.0, snap=600.0, tilt=0.8, body_rate=6.0
)
WAYPOINTS = np.array([[0, 0, 1], [1, 0.5, 1.3], [2, -0.5, 1.0], [3, 0, 1.2]])
YAWS = {
    "none": None,
    "fixed": 0.7,
    "velocity": "velocity",
    "point": {"point": [1.0, 3.0, 1.0]},
    "waypoints": pf.Heading(policy="waypoints", angles=(0.0, 1.0, 2.0, -2.9)),
}
BETWEEN = 1e-3
"""What a deviation, which is taken at samples, may be more between them, rad."""
KEEPING = {
    "rotate": lambda plan: editing.rotate(plan, 2.0),
    "mirror x": lambda plan: editing.mirror(plan, "x"),
    "mirror y": lambda plan: editing.mirror(plan, "y"),
    "move": lambda plan: editing.move(plan, [3.0, -40.0, 5.0]),
    "reverse": editing.reverse,
}
"""Edits that keep every limit of these plans."""


@pytest.fixture(scope="module", params=YAWS)
def plan(request):
    made = pf.plan(WAYPOINTS, limits=LIMITS, method="peak", yaw=YAWS[request.param])
    assert made.feasible
    return made


@pytest.fixture(scope="module")
def plain():
    return pf.plan(WAYPOINTS, limits=LIMITS, method="peak")


@pytest.fixture(scope="module")
def moving():
    problem = pf.Problem(
        WAYPOINTS,
        limits=LIMITS,
        start={"velocity": [1.0, 0.2, 0.0]},
        end={"velocity": [np.nan, 0.0, 0.0]},
        derivatives={1: {"velocity": [np.nan, np.nan, 0.0]}},
    )
    made = pf.plan(problem, method="peak")
    assert made.feasible
    return made


def same(first, second, tolerance=1e-9):
    """Whether two plans are the same flight, and ask for the same."""
    times = np.linspace(0.0, 1.0, 101)
    for motion in ("trajectory", "yaw_motion"):
        one, two = getattr(first, motion), getattr(second, motion)
        if one is None or two is None:
            assert one is two
            continue
        assert one.duration == pytest.approx(two.duration, rel=1e-12)
        for order in range(3):
            values = [
                m(np.clip(m.start_time + times * m.duration, m.start_time, m.end_time), order)
                for m in (one, two)
            ]
            np.testing.assert_allclose(*values, rtol=0.0, atol=tolerance * 10.0**order)
    np.testing.assert_allclose(first.problem.waypoints, second.problem.waypoints, atol=tolerance)
    for index, state in first.problem.fixed.items():
        np.testing.assert_allclose(state, second.problem.fixed[index], atol=tolerance)
    assert first.pieces == second.pieces


@pytest.mark.parametrize("name", KEEPING)
def test_what_gravity_does_not_see_keeps_every_limit(plan, name):
    edited = KEEPING[name](plan)
    assert edited.feasible
    assert edited.status == "solved"
    for kind, kappa in plan.report.peaks.items():
        after = edited.report.peaks[kind]
        if name == "reverse":
            after = after[::-1]
        if not kind.startswith("yaw"):
            np.testing.assert_allclose(after, kappa, rtol=1e-6)
    again = pf.Plan.from_dict(edited.to_dict())
    assert pf.certify_plan(again).feasible


@pytest.mark.parametrize(
    "there_and_back",
    [
        lambda plan: editing.reverse(editing.reverse(plan)),
        lambda plan: editing.rotate(editing.rotate(plan, 1.0), -1.0),
        lambda plan: editing.mirror(editing.mirror(plan, "y"), "y"),
        lambda plan: editing.move(editing.move(plan, [1, 2, 3]), [-1, -2, -3]),
        lambda plan: editing.scale(editing.scale(plan, 1.5), 1.0 / 1.5),
        lambda plan: editing.to_duration(editing.slow(plan, 0.5), plan.duration),
    ],
)
def test_there_and_back_is_the_same(plan, there_and_back):
    edited = there_and_back(plan)
    flat = edited
    if edited.yaw_motion is not None:  # twice x, or twice backwards along the velocity, is a turn
        turns = np.round((edited.yaw(0.0) - plan.yaw(0.0)) / (2.0 * np.pi))
        motion = edited.yaw_motion
        coefficients = motion.coefficients.copy()
        coefficients[:, 0] -= 2.0 * np.pi * turns
        shifted = pf.Trajectory(coefficients, motion.segment_times, motion.start_time)
        flat = replace(edited, yaw_motion=shifted)
    same(flat, plan)


@pytest.mark.parametrize("name", [*KEEPING, "slow"])
def test_moving_ends_and_fixed_motion_go_along(moving, name):
    edited = editing.slow(moving, 0.5) if name == "slow" else KEEPING[name](moving)
    assert edited.feasible
    assert edited.report.state_error < 1e-9
    start, end = (np.asarray(edited.problem.fixed[index]) for index in (0, 3))
    for state, time in ((start, 0.0), (end, edited.duration)):
        velocity = edited.trajectory(time, 1)
        known = np.isfinite(state[0])
        np.testing.assert_allclose(velocity[known], state[0][known], atol=1e-9)


def test_a_nose_that_points_ahead_still_does():
    ahead = pf.plan(WAYPOINTS, limits=LIMITS, method="peak", yaw="velocity")
    for name, change in KEEPING.items():
        edited = change(ahead)
        times = np.linspace(0.0, edited.duration, 200)[20:-20]
        velocity = edited.trajectory(times, 1)
        off = edited.yaw(times) - np.arctan2(velocity[:, 1], velocity[:, 0])
        off = np.abs(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)))
        assert off.max() <= ahead.yaw_deviation + BETWEEN, name


def test_a_nose_towards_a_point_still_is():
    target = np.array([1.0, 6.0, 1.0])
    looking = pf.plan(
        WAYPOINTS, limits=LIMITS, method="peak", yaw=pf.Heading(policy="point", point=tuple(target))
    )
    edited = editing.rotate(editing.move(editing.mirror(looking, "x"), [1, 2, 0]), 0.5)
    new = np.array(edited.problem.heading.point)
    times = np.linspace(0.0, edited.duration, 100)
    towards = new - edited.trajectory(times)
    off = edited.yaw(times) - np.arctan2(towards[:, 1], towards[:, 0])
    off = np.abs(off - 2.0 * np.pi * np.round(off / (2.0 * np.pi)))
    assert off.max() <= looking.yaw_deviation + BETWEEN


def test_pace(plain):
    slower = editing.slow(plain, 0.8)
    assert slower.duration == pytest.approx(plain.duration / 0.8)
    np.testing.assert_allclose(
        slower.report.peaks["speed"], 0.8 * plain.report.peaks["speed"], rtol=1e-8
    )
    np.testing.assert_allclose(
        slower.report.peaks["jerk"], 0.8**3 * plain.report.peaks["jerk"], rtol=1e-8
    )
    assert editing.to_duration(plain, 10.0).duration == pytest.approx(10.0)
    np.testing.assert_allclose(
        slower.trajectory(0.5 * slower.duration), plain.trajectory(0.5 * plain.duration), atol=1e-12
    )


def test_too_fast_is_said_and_mended(plan):
    fast = editing.to_duration(plan, 0.7 * plan.duration)
    assert not fast.feasible
    assert fast.status == "infeasible"
    assert any("times its limit" in line for line in fast.report.problems)
    mended = editing.keep_limits(fast)
    assert mended.feasible
    assert mended.status == "solved"
    assert "times its limit" not in mended.message
    assert mended.report.worst > 1.0 - 1e-6
    # the same path at the fastest pace, whichever way one comes
    assert mended.duration == pytest.approx(editing.retime(plan).duration, rel=1e-6)


def test_retime_goes_back_to_the_limits_and_nothing_faster_keeps_them(plan):
    fastest = editing.retime(editing.slow(plan, 0.3))
    assert fastest.feasible
    assert not editing.to_duration(fastest, fastest.duration * (1.0 - 1e-5)).feasible
    assert editing.retime(fastest).duration == pytest.approx(fastest.duration, rel=1e-8)


def test_retime_under_other_limits(plain):
    gentle = pf.Limits(speed=1.0, thrust_acceleration=12.0)
    made = editing.retime(plain, limits=gentle)
    assert made.feasible
    assert made.problem.limits == gentle
    assert made.report.worst == pytest.approx(1.0, abs=1e-6)


def test_delay_hovers_first(plan):
    late = editing.delay(plan, 1.5)
    assert late.feasible
    assert late.duration == pytest.approx(plan.duration + 1.5)
    for t in (0.0, 0.7, 1.5):
        np.testing.assert_allclose(late.trajectory(t), WAYPOINTS[0], atol=1e-12)
        np.testing.assert_allclose(late.trajectory(min(t, 1.49), 1), 0.0, atol=1e-12)
    times = np.linspace(0.0, plan.duration, 50)
    np.testing.assert_allclose(late.trajectory(times + 1.5), plan.trajectory(times), atol=1e-9)
    assert late.pieces == (plan.pieces[0] + 1, *plan.pieces[1:])
    assert pf.Plan.from_dict(editing.delay(late, 1.0).to_dict()).duration == pytest.approx(
        plan.duration + 2.5
    )


def test_scale(plan):
    larger = editing.scale(plan, 2.0)
    np.testing.assert_allclose(larger.problem.waypoints, 2.0 * WAYPOINTS)
    np.testing.assert_allclose(
        larger.report.peaks["speed"], 2.0 * plan.report.peaks["speed"], rtol=1e-8
    )
    assert not larger.feasible
    kept = editing.keep_limits(editing.scale(plan, [1.0, 2.0, 1.0]))
    assert kept.feasible
    np.testing.assert_allclose(kept.problem.waypoints, WAYPOINTS * [1.0, 2.0, 1.0])


def test_a_vehicle_and_its_rotors_stay(plain):
    # without drag, which does not look alike backwards
    vehicle = replace(pf.find_vehicle("crazyflie-2.1"), drag=(0.0, 0.0)).on_rotors()
    problem = replace(plain.problem, vehicle=vehicle, limits=None)
    made = editing.steered(plain, problem, plain.trajectory.stretch(1.2), plain.pieces, "")
    assert made.feasible, made.message
    for change in KEEPING.values():
        edited = change(made)
        assert edited.feasible == made.feasible
        assert edited.vehicle.name == "crazyflie-2.1"
        np.testing.assert_allclose(
            sorted(edited.report.peaks["rotor_thrust"]),
            sorted(made.report.peaks["rotor_thrust"]),
            rtol=1e-5,
        )


@pytest.mark.parametrize("change", ["under_limits", "retime", "join", "import"])
def test_a_nose_about_which_nothing_is_said_follows_the_limits(plain, change, tmp_path):
    rotors = pf.find_vehicle("crazyflie-2.1").on_rotors().limits
    away = editing.move(plain, [5.0, 0.0, 0.0])

    def changed(plan, limits):
        if change == "under_limits":
            return editing.under_limits(plan, limits)
        if change == "retime":
            return editing.retime(plan, limits=limits)
        if change == "join":
            return pf.join(plan, away, limits=limits)
        plan.save(tmp_path / "plan.json")
        return pf.import_trajectory(tmp_path / "plan.json", limits=limits, retime=True).plan

    free = changed(editing.slow(plain, 0.5), rotors)
    assert free.problem.heading.policy == "free"
    assert free.yaw_motion is not None
    assert not any("yaw motion" in line for line in free.report.problems)
    assert "rotor_thrust" in free.report.peaks
    back = changed(free, LIMITS)
    assert not any("yaw motion" in line for line in back.report.problems)
    assert back.problem.heading is None
    assert back.yaw_motion is None
    if change != "join":  # the transition under other limits is too fast for these
        assert back.feasible, back.message


def test_joint_plans_with_pieces_are_edited_too():
    made = pf.plan(WAYPOINTS, limits=LIMITS, method="joint", pieces=2, yaw="velocity")
    for change in (*KEEPING.values(), lambda plan: editing.delay(plan, 0.5)):
        assert change(made).feasible


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda plan: editing.slow(plan, 0.0), "the pace is 0 %"),
        (lambda plan: editing.slow(plan, 1.2), "the pace is 120 %"),
        (lambda plan: editing.slow(plan, math.nan), "the pace is nan %"),
        (lambda plan: editing.slow(plan, 1e-320), "change by a factor of inf"),
        (lambda plan: editing.slow(plan, 1e-12), "every piece must last from"),
        (lambda plan: editing.to_duration(plan, 5e-324), "change by a factor of 0"),
        (lambda plan: editing.to_duration(plan, -1.0), "the duration is -1 s"),
        (lambda plan: editing.delay(plan, 0.0), "the delay is 0 s"),
        (lambda plan: editing.rotate(plan, math.inf), "the angle is inf"),
        (lambda plan: editing.mirror(plan, "z"), "mirror axis is 'z'"),
        (lambda plan: editing.move(plan, [1.0, 2.0]), "the offset has shape"),
        (lambda plan: editing.move(plan, [1.0, 2.0, math.nan]), "they must be finite"),
        (lambda plan: editing.scale(plan, -1.0), "they must be positive"),
        (lambda plan: editing.scale(plan, [1.0, 2.0]), "the factors has shape"),
    ],
)
def test_bad_input_is_refused(plain, change, message):
    with pytest.raises(pf.InvalidProblem, match=message):
        change(plain)


def test_nothing_hovers_before_a_moving_start(moving):
    with pytest.raises(pf.InvalidProblem, match="does not begin at rest"):
        editing.delay(moving, 1.0)


class TestJoin:
    @pytest.mark.parametrize("yaw", YAWS)
    def test_a_transition_keeps_limits_and_jumps_nowhere(self, plain, yaw):
        first = pf.plan(WAYPOINTS, limits=LIMITS, method="peak", yaw=YAWS[yaw])
        second = editing.move(editing.rotate(plain, 1.0), [6.0, 1.0, 0.0])
        whole = pf.join(first, second)
        assert whole.feasible, whole.message
        np.testing.assert_array_equal(whole.problem.waypoints[:4], first.problem.waypoints)
        np.testing.assert_array_equal(whole.problem.waypoints[4:], second.problem.waypoints)
        for order in range(3):
            values = whole.trajectory.sample(2, order)
            np.testing.assert_allclose(values[1:, 0], values[:-1, 1], atol=1e-8)
        rest = pf.plan(np.stack((WAYPOINTS[-1], second.problem.waypoints[0])), limits=LIMITS)
        if yaw == "none":
            expected = first.duration + rest.duration + second.duration
            assert whole.duration == pytest.approx(expected, rel=1e-6)
        assert pf.certify_plan(pf.Plan.from_dict(whole.to_dict())).feasible

    def test_one_that_begins_where_the_other_ends_needs_no_transition(self, plan):
        whole = pf.join(plan, editing.reverse(plan))
        assert whole.feasible
        assert len(whole.problem.waypoints) == 7
        assert whole.duration == pytest.approx(2.0 * plan.duration, rel=1e-6)
        np.testing.assert_allclose(whole.trajectory(whole.duration), WAYPOINTS[0], atol=1e-9)

    @pytest.mark.parametrize("method", ["peak", "joint"])
    def test_moving_ends_are_joined_without_a_stop(self, method):
        first = pf.plan(WAYPOINTS, limits=LIMITS, method=method, end={"velocity": [1.0, 0, 0]})
        second = pf.plan(
            WAYPOINTS + np.array([5.0, 1.0, 0.0]),
            limits=LIMITS,
            method=method,
            start={"velocity": [1.0, 0.5, 0]},
        )
        whole = pf.join(first, second)
        assert whole.feasible, whole.message
        times = np.linspace(first.duration, whole.duration - second.duration, 50)
        assert np.linalg.norm(whole.trajectory(times, 1), axis=1).min() > 0.1

    def test_several_one_after_the_other(self, plan):
        whole = plan
        for index in range(3):
            whole = pf.join(whole, editing.move(plan, [0.0, 2.0 * (index + 1), 0.0]))
        assert whole.feasible, whole.message
        assert len(whole.problem.waypoints) == 16

    def test_different_limits_are_refused_unless_some_are_given(self, plain):
        other = editing.move(
            editing.under_limits(plain, replace(LIMITS, speed=4.0)), [5.0, 0.0, 0.0]
        )
        with pytest.raises(pf.InvalidProblem, match="different limits of speed"):
            pf.join(plain, other)
        assert pf.join(plain, other, limits=LIMITS).feasible

    def test_another_motion_at_the_same_point_is_refused(self):
        first = pf.plan(WAYPOINTS, limits=LIMITS, method="peak", end={"velocity": [1.0, 0, 0]})
        second = pf.plan(WAYPOINTS + WAYPOINTS[-1] - WAYPOINTS[0], limits=LIMITS, method="peak")
        with pytest.raises(pf.InvalidProblem, match="not in the same motion"):
            pf.join(first, second)
