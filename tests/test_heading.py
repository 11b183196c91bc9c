import json
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import peakflight as pf
from peakflight.errors import InvalidProblem
from peakflight.formats import write_crazyflie, write_samples
from peakflight.formats.flight_files.coarser import coarsened
from peakflight.yaw import as_heading, unwrapped
from peakflight.yaw_certificate import certify_yaw
from peakflight.yaw_motion import directions, turning

LIMITS = pf.Limits(speed=5.0, thrust_acceleration=15.5, jerk=62.0, snap=800.0)
COURSE = np.array(
    [[0, 0, 1], [0.6, 0.5, 1.2], [0.2, 0.9, 1.0], [0.9, 1.3, 1.1], [3.2, 1.2, 1.4]], dtype=float
)
ROUND = np.array([[0, 0, 1], [4, 0, 1], [4, 4, 1], [0, 4, 1], [0.5, 0, 1]], dtype=float)


def planned(waypoints=COURSE, **options):
    return pf.plan(waypoints, limits=LIMITS, method="proportional", **options)


def wrapped(angle):
    return np.abs(angle - 2 * np.pi * np.round(angle / (2 * np.pi)))


def dense(plan, derivative=0, count=20_001):
    times = np.linspace(plan.trajectory.start_time, plan.trajectory.end_time, count)
    return plan.yaw(times, derivative)


def assert_proven(plan):
    """Limits, ends and continuity by sampling, where the certificate says that they hold."""
    assert plan.feasible, plan.message
    heading = plan.problem.heading
    for kind, limit in heading.limits.items():
        kappa = plan.report.peaks[kind.name]
        assert kappa.shape == plan.segment_times.shape
        sampled = np.abs(dense(plan, kind.order)).max() / limit
        assert sampled <= kappa.max() <= 1.0
        assert kappa.max() <= sampled * 1.01 + 1e-6  # samples miss at most a corner of a part
    assert abs(plan.yaw(plan.trajectory.start_time, 1)) < 1e-9
    assert abs(plan.yaw(plan.trajectory.end_time, 1)) < 1e-9
    motion = plan.yaw_motion
    for order in range(3):
        ends = motion.sample(2, order)[:, :, 0]
        scale = 1.0 + np.abs(ends).max()
        np.testing.assert_allclose(ends[1:, 0], ends[:-1, 1], atol=1e-9 * scale, rtol=0)
    again = pf.Plan.from_dict(json.loads(json.dumps(plan.to_dict())))
    assert pf.certify_plan(again).to_dict() == plan.report.to_dict()


# ---- what is asked --------------------------------------------------------------------------


def test_short_forms():
    assert as_heading(1) == pf.Heading(policy="fixed", angle=1.0)
    assert as_heading(np.float64(0.5)).angle == 0.5
    assert as_heading("velocity").policy == "velocity"
    assert as_heading({"point": [1, 2, 3]}) == pf.Heading(policy="point", point=(1.0, 2.0, 3.0))
    assert as_heading({"angles": [0, 1], "rate": None}).rate is None
    assert as_heading([0.0, 1.0]) is None


@pytest.mark.parametrize(
    "heading",
    [
        pf.Heading(policy="fixed", angle=0.1, rate=None),
        pf.Heading(policy="waypoints", angles=(0.1, 1 / 3, 0.0, 2.0, 3.0), acceleration=1 / 7),
        pf.Heading(policy="velocity", rate=None, acceleration=None),
        pf.Heading(policy="point", point=(1.0, 2.0, 1 / 3)),
    ],
)
def test_headings_through_json(heading):
    assert pf.Heading.from_dict(json.loads(json.dumps(heading.to_dict()))) == heading
    problem = pf.Problem(COURSE, limits=LIMITS, yaw=heading)
    again = pf.Problem.from_dict(json.loads(json.dumps(problem.to_dict())))
    assert again.yaw == heading == again.heading


@pytest.mark.parametrize(
    ("yaw", "words"),
    [
        ("north", "yaw policy is 'north'; known are fixed, waypoints, velocity, point"),
        ("point", "yaw policy point needs point"),
        (float("nan"), "yaw = nan; it must be finite"),
        (1e5, "yaw is 100000; it must be within 10000 of zero"),
        ({"policy": "velocity", "angle": 1}, "yaw policy velocity has no use for angle"),
        ({"point": [1, 2]}, "the yaw point has 2 numbers; it must have 3"),
        ({"point": "abc"}, "the yaw point is 'abc'; it must be a list of numbers"),
        ({"point": [1, 2, np.inf]}, "a coordinate of the yaw point = inf; it must be finite"),
        ({"angle": "x"}, "yaw is 'x'; it must be a number"),
        ({"angles": [0, 1]}, r"yaw has shape \(2,\); it must be \(5\)"),
        ({"angles": [0, 1, np.nan, 1, 1]}, "waypoint 2 has yaw = nan; it must be finite"),
        ({"angle": 1, "rate": -1}, "limit yaw_rate is -1; it must be positive"),
        ({"angle": 1, "acceleration": 0}, "limit yaw_acceleration is 0; it must be positive"),
        ({"angle": 1, "rate": "fast"}, "limit yaw_rate is 'fast'; it must be a number"),
        ({"angle": 1, "speed": 1}, "unknown entry 'speed' in yaw; known are policy"),
        ({"rate": 1}, "yaw names no policy"),
        ([0, 1], r"yaw has shape \(2,\); it must be \(5\)"),
        ([0, 1, np.nan, 1, 1], "waypoint 2 has yaw = nan; it must be finite"),
        (True, "yaw has shape"),
    ],
)
def test_bad_yaw_is_one_clear_error(yaw, words):
    for make in (pf.Problem, planned):
        with pytest.raises(InvalidProblem, match=words) as error:
            make(COURSE, limits=LIMITS, yaw=yaw) if make is pf.Problem else make(yaw=yaw)
        assert "\n" not in str(error.value)


def test_the_shorter_way_and_half_a_turn_to_the_left():
    np.testing.assert_allclose(unwrapped(np.array([3.0, -3.0])), [3.0, 2 * np.pi - 3.0])
    np.testing.assert_allclose(unwrapped(np.array([0.0, np.pi, 0.0])), [0, np.pi, 2 * np.pi])
    np.testing.assert_allclose(unwrapped(np.array([0.0, -np.pi])), [0, np.pi])
    np.testing.assert_allclose(unwrapped(np.array([0.0, -3.0, 3.0])), [0, -3.0, 3.0 - 2 * np.pi])


# ---- policies -------------------------------------------------------------------------------


def test_without_yaw_nothing_changes():
    plan = planned()
    assert plan.yaw_motion is None
    assert "yaw" not in plan.to_dict()
    assert not any("yaw" in name for name in plan.report.peaks)
    np.testing.assert_array_equal(plan.yaw([0.0, 1.0]), [0.0, 0.0])


def test_fixed():
    plan = planned(yaw=-2.5)
    assert_proven(plan)
    assert plan.message == ""
    np.testing.assert_array_equal(dense(plan), -2.5)
    assert plan.duration == planned().duration


def test_array_is_passed_however_fast():
    angles = [0.0, 2.5, -2.5, 1.0, 0.0]
    plan = planned(yaw=angles)
    assert_proven(plan)
    assert plan.duration == planned().duration
    assert not any("yaw" in name for name in plan.report.peaks)
    np.testing.assert_allclose(wrapped(plan.yaw(plan.waypoint_times) - angles), 0.0, atol=1e-12)


def test_waypoints_cross_half_a_turn_unwrapped():
    angles = (3.0, -3.0, 3.0, -3.0, -2.0)
    plan = planned(yaw=pf.Heading(policy="waypoints", angles=angles))
    assert_proven(plan)
    passed = plan.yaw(plan.waypoint_times)
    np.testing.assert_allclose(wrapped(passed - angles), 0.0, atol=1e-12)
    assert passed[1] - passed[0] == pytest.approx(2 * np.pi - 6.0)
    assert np.ptp(dense(plan)) < np.pi


def test_limits_that_are_too_tight_slow_the_plan_down_just_enough():
    last = planned()
    angles = [0.0, 3.0, 0.0, 3.0, 0.0]
    for limits, order in (({"rate": 1.0, "acceleration": None}, 1),
                          ({"rate": None, "acceleration": 2.0}, 2)):  # fmt: skip
        plan = planned(yaw={"angles": angles, **limits})
        assert_proven(plan)
        factor = plan.duration / last.duration
        assert factor > 1.5
        assert f"slowed down by {100 * (factor - 1):.3g} % for the yaw limits" in plan.message
        np.testing.assert_allclose(wrapped(plan.yaw(plan.waypoint_times) - angles), 0, atol=1e-10)
        np.testing.assert_allclose(plan.trajectory.stretch(1 / factor)(1.0), last.trajectory(1.0))
        assert plan.report.peaks[("yaw_rate", "yaw_acceleration")[order - 1]].max() > 0.999
    # bang-bang between two waypoints: 3 rad in T need 4 * 3 / T^2 of acceleration
    single = planned(COURSE[[0, 4]], yaw={"angles": [0, 3], "rate": None, "acceleration": 0.1})
    assert single.duration == pytest.approx(np.sqrt(4 * 3 / 0.1), rel=2e-3)


def test_motion_that_is_fixed_cannot_be_slowed_down():
    plan = planned(yaw={"angles": [0, 3, 0, 3, 0], "rate": 0.5}, start={"velocity": [1, 0, 0]})
    assert plan.status is pf.Status.INFEASIBLE
    assert (
        "times as long, which the motion that is fixed at waypoints does not allow" in plan.message
    )
    assert plan.report.peaks["yaw_rate"].max() > 1.0


def test_slowing_down_certifies_the_other_limits_again():
    limits = pf.Limits(speed=5.0, thrust_acceleration=15.5, least_thrust_acceleration=8.0)
    yaw = {"angles": [0, 3, 0, 3, 0], "rate": 1.0}
    plan = pf.plan(COURSE, limits=limits, method="proportional", yaw=yaw)
    assert plan.feasible
    assert plan.report.peaks["least_thrust_acceleration"].max() <= 1.0


def test_velocity_without_limits_is_the_direction_of_flight():
    yaw = {"policy": "velocity", "rate": None, "acceleration": None}
    plan = planned(ROUND, yaw=yaw)
    assert_proven(plan)
    times = np.linspace(0.05, 0.95, 201) * plan.duration
    v = plan.trajectory(times, 1)
    assert wrapped(plan.yaw(times) - np.arctan2(v[:, 1], v[:, 0])).max() < 0.05
    assert plan.yaw_deviation < 0.1


def test_velocity_under_limits_starts_where_the_flight_departs_to():
    plan = planned(ROUND, yaw="velocity")
    assert_proven(plan)
    early, late = plan.trajectory([0.02, plan.duration - 0.02], 1)
    assert wrapped(plan.yaw(0.0) - np.arctan2(early[1], early[0])) < 0.05
    assert wrapped(plan.yaw(plan.duration) - np.arctan2(late[1], late[0])) < 0.05
    assert "deg off the direction it follows" in plan.message


def test_velocity_holds_where_nothing_moves_sideways():
    climb = planned([[0, 0, 1], [0, 0, 3]], yaw="velocity")
    assert_proven(climb)
    np.testing.assert_allclose(dense(climb), 0.0, atol=1e-12)
    steps = [[0, 0, 1], [2, 0, 1], [2, 0, 3], [4, 0, 3]]
    rest = {1: {"velocity": [0, 0, 0], "acceleration": [0, 0, 0]},
            2: {"velocity": [0, 0, 0], "acceleration": [0, 0, 0]}}  # fmt: skip
    plan = planned(steps, yaw="velocity", derivatives=rest)
    assert_proven(plan)
    np.testing.assert_allclose(dense(plan), 0.0, atol=1e-6)


def test_velocity_turns_at_a_stop():
    stop = {1: {"velocity": [0, 0, 0], "acceleration": [0, 0, 0]}}
    plan = planned([[0, 0, 1], [3, 0, 1], [3, 3, 1]], yaw="velocity", derivatives=stop)
    assert_proven(plan)
    np.testing.assert_allclose(plan.yaw([0.0, plan.duration]), [0.0, np.pi / 2], atol=0.02)


def test_point_is_looked_at_and_passing_over_it_is_defined():
    plan = planned(ROUND, yaw={"point": [2, 2, 0]})
    assert_proven(plan)
    times = np.linspace(0, plan.duration, 201)
    away = np.array([2, 2]) - plan.trajectory(times)[:, :2]
    assert wrapped(plan.yaw(times) - np.arctan2(away[:, 1], away[:, 0])).max() < 0.05
    over = planned([[-2, 0, 1], [2, 0, 1]], yaw={"point": [0, 0, 0]})
    assert_proven(over)
    # the yaw follows the last direction until the point is behind, and then turns left
    assert over.yaw(0.0) == pytest.approx(0.0, abs=0.2)
    assert over.yaw(over.duration) == pytest.approx(np.pi, abs=0.2)
    stay = planned([[0, 0, 1], [0, 0, 3]], yaw={"point": [0, 0, 0]})
    np.testing.assert_allclose(dense(stay), 0.0, atol=1e-12)


def test_directions_hold_and_weigh():
    vectors = np.array([[0, 0], [1, 0], [0, 0], [0, 1], [1e-6, -1e-6], [-1, 0]], dtype=float)
    angles, weights = directions(vectors)
    np.testing.assert_allclose(angles, np.array([0, 0, 0, 1, 1, 2]) * np.pi / 2)
    assert weights.argmin() in (0, 2, 4)
    assert (weights > 0).all()


@settings(deadline=None, derandomize=True, max_examples=25)
@given(
    st.floats(-3.0, 3.0),
    st.sampled_from(["velocity", "point"]),
    st.sampled_from([(3.0, 20.0), (1.0, 5.0), (None, 10.0), (2.0, None)]),
    st.integers(0, 1000),
)
def test_turning_the_course_turns_the_yaw(angle, policy, limits, seed):
    points = np.random.default_rng(seed).uniform(-3, 3, size=(5, 3))
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    made = []
    for matrix in (np.eye(3), turn):
        yaw = {"policy": policy, "rate": limits[0], "acceleration": limits[1]}
        if policy == "point":
            yaw["point"] = matrix @ [0.3, 0.2, 0.1]
        made.append(planned(points @ matrix.T, yaw=yaw))
        assert_proven(made[-1])
    share = np.linspace(0, 1, 101)
    turned = [plan.yaw(share * plan.duration) for plan in made]
    off = turned[1] - turned[0] - angle
    np.testing.assert_allclose(off, 2 * np.pi * np.round(off[0] / (2 * np.pi)), atol=1e-4)


@settings(deadline=None, derandomize=True, max_examples=40)
@given(
    st.lists(st.floats(-10.0, 10.0), min_size=5, max_size=5),
    st.sampled_from([None, 0.5, 3.0]),
    st.sampled_from([None, 1.0, 20.0]),
)
def test_any_yaw_at_waypoints_is_met_within_limits(angles, rate, acceleration):
    plan = planned(yaw={"angles": angles, "rate": rate, "acceleration": acceleration})
    assert_proven(plan)
    np.testing.assert_allclose(wrapped(plan.yaw(plan.waypoint_times) - angles), 0, atol=1e-9)


def test_a_thousand_legs_take_linear_time():
    times = {}
    for legs in (250, 1000):
        rng = np.random.default_rng(0)
        trajectory = pf.Trajectory(rng.normal(size=(legs, 2, 3)), rng.uniform(0.2, 1.0, legs))
        points = rng.normal(size=(legs + 1, 3))
        for yaw in ("velocity", {"angles": rng.uniform(-3, 3, legs + 1)}):
            problem = pf.Problem(points, limits=LIMITS, yaw=yaw)
            began = time.process_time()
            made = turning(problem, trajectory, (1,) * legs)
            times[legs] = times.get(legs, 0.0) + time.process_time() - began
            assert made.yaw is not None
    assert times[1000] < 12.0 * times[250]  # 4 here; what grows with the square takes 16


def test_replan_keeps_the_policy():
    last = planned(yaw="velocity")
    moved = COURSE + np.array([0.0, 0.0, 0.1])
    again = pf.replan(last, waypoints=moved)
    assert again.problem.yaw == last.problem.yaw
    assert_proven(again)


def test_merged_waypoints_take_their_yaw_along():
    near = np.insert(COURSE, 2, COURSE[1] + 1e-5, axis=0)
    plan = planned(near, yaw={"angles": [0, 1, 1, 2, 3, 4]})
    assert plan.problem.heading.angles == (0, 1, 2, 3, 4)
    assert "merged" in plan.message


# ---- the proof ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plan():
    return planned(yaw={"angles": [0, 1, 2, 3, 4]})


def proven(plan, yaw, **changes):
    heading = replace(plan.problem.heading, **changes)
    return certify_yaw(heading, yaw, plan.trajectory, plan.waypoint_times)


def moved(yaw, piece, power, by):
    coefficients = yaw.coefficients.copy()
    coefficients[piece, power] += by
    return pf.Trajectory(coefficients, yaw.segment_times, yaw.start_time)


def test_peaks_are_exact_on_each_segment(plan):
    peaks, problems = proven(plan, plan.yaw_motion)
    assert problems == []
    borders = plan.trajectory.breakpoints
    for name, order, limit in (("yaw_rate", 1, 3.0), ("yaw_acceleration", 2, 20.0)):
        for k, (a, b) in enumerate(pairwise(borders)):
            sampled = np.abs(plan.yaw(np.linspace(a, b, 20_001), order)).max() / limit
            assert peaks[name][k] == pytest.approx(sampled, rel=1e-6)
            assert peaks[name][k] >= sampled * (1 - 1e-12)


def test_a_vertex_between_samples_is_seen():
    # rate 1 - (t - 0.3)^2, whose peak is inside
    cubic = [[[0.0], [1 - 0.09], [0.3], [-1 / 3]]]
    yaw = pf.Trajectory(cubic, [1.0])
    flight = pf.Trajectory(np.zeros((1, 2, 3)), [1.0])
    heading = pf.Heading(policy="velocity", rate=1.0, acceleration=None)
    peaks, _ = certify_yaw(heading, yaw, flight, np.array([0.0, 1.0]))
    assert 1.0 <= peaks["yaw_rate"][0] <= 1.0 + 1e-12


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda yaw: None, "there is no yaw motion"),
        (lambda yaw: yaw.elevate(4), "the yaw has degree 4; 3 is the most that can be proven"),
        (lambda yaw: yaw.stretch(1.001), "the yaw runs from 0 to"),
        (lambda yaw: yaw.shift(0.1), "the yaw runs from 0.1 to"),
        (lambda yaw: moved(yaw, 3, 0, 1e-5), "yaw jumps by 1e-05 at the end of its piece 2"),
        (lambda yaw: moved(yaw, 3, 1, 1e-4), "yaw rate jumps by"),
        (lambda yaw: moved(yaw, 3, 2, 1e-2), "yaw acceleration jumps by"),
        (lambda yaw: moved(yaw, 0, 1, 1e-3), "yaw rate is 0.001 rad/s at an end of the flight"),
        (lambda yaw: yaw.translate([1e-4]), "the yaw of waypoint"),
    ],
)
def test_what_is_wrong_is_said(plan, change, words):
    _, problems = proven(plan, change(plan.yaw_motion))
    assert any(line.startswith(words) for line in problems), problems


def test_limits_and_fixed_yaw_that_are_not_kept_are_said(plan):
    _, problems = proven(plan, plan.yaw_motion, rate=0.1)
    assert problems[0].startswith("yaw rate reaches")
    fixed = {"policy": "fixed", "angles": None, "angle": 1.0}
    _, problems = proven(plan, plan.yaw_motion, **fixed)
    assert problems == ["the yaw is not 1 rad throughout"]


@pytest.mark.parametrize("asked", ["heading", "array"])
def test_a_yaw_motion_that_was_taken_out_is_missed(plan, asked):
    values = plan.to_dict()
    del values["yaw"]
    if asked == "array":
        values["problem"]["yaw"] = [0.0, 1.0, 2.0, 3.0, 4.0]
    found = pf.Plan.from_dict(values)
    assert found.yaw_motion is None
    assert pf.certify_plan(found).problems == ("there is no yaw motion",)


def test_a_yaw_motion_that_nobody_asked_for_is_not_proven(plan):
    values = plan.to_dict()
    values["problem"]["yaw"] = None
    report = pf.certify_plan(pf.Plan.from_dict(values))
    assert not report.feasible
    assert report.problems[0].startswith("there is a yaw motion, but nothing is asked")


def test_small_jumps_do_not_add_up(plan):
    count = 1000
    steps = 1e-8 * np.arange(count)
    yaw = pf.Trajectory(steps[:, None, None], np.full(count, plan.duration / count))
    _, problems = proven(plan, yaw)
    assert any(line.startswith("yaw jumps by 1e-08") for line in problems)


def test_yaw_of_more_axes_is_refused(plan):
    values = plan.to_dict()
    values["yaw"]["coefficients"] = [[[0.0, 0.0]]]
    values["yaw"]["segment_times"] = [plan.duration]
    with pytest.raises(InvalidProblem, match="yaw has 2 axes; it must have 1"):
        pf.Plan.from_dict(values)


# ---- files ----------------------------------------------------------------------------------


def test_samples_have_yaw_rate_and_acceleration(plan, tmp_path):
    write_samples(plan, tmp_path / "s.csv")
    rows = np.genfromtxt(tmp_path / "s.csv", delimiter=",", skip_header=1)
    header = (tmp_path / "s.csv").read_text().split("\n", 1)[0]
    assert header.endswith(",yaw [rad],yaw_rate [rad/s],yaw_acceleration [rad/s^2]")
    for order in range(3):
        values = plan.yaw(np.clip(rows[:, 0], 0, plan.trajectory.end_time), order)
        np.testing.assert_allclose(rows[:, 16 + order], values, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("yaw", [1.5, "velocity", {"angles": [0, 2, -2, 0, 3]}])
def test_crazyflie_file_has_the_yaw_and_says_how_far_off(yaw, tmp_path):
    plan = planned(yaw=yaw)
    notes = write_crazyflie(plan, tmp_path / "c.csv")
    rows = np.genfromtxt(tmp_path / "c.csv", delimiter=",", skip_header=1)
    flown = pf.Trajectory(rows[:, 25:, None], rows[:, 0])
    times = np.linspace(0, min(plan.duration, flown.duration), 5001)
    off = np.abs(flown(times)[:, 0] - plan.yaw(times)).max()
    if yaw == 1.5:
        assert notes == ()
        assert off == 0.0
    else:
        claimed = float(notes[0].removeprefix("its yaw is up to ").split()[0])
        assert np.degrees(off) == pytest.approx(claimed, rel=0.1)
    borders = plan.trajectory.breakpoints
    for order in range(3):
        np.testing.assert_allclose(
            flown(np.minimum(borders, flown.duration), order)[:, 0],
            plan.yaw(borders, order),
            atol=1e-5,  # nine digits, times the powers of a piece of 2 s
        )


def test_coarsening_is_exact_where_it_can_be():
    rng = np.random.default_rng(3)
    whole = pf.Trajectory(rng.normal(size=(1, 8, 1)), [1.3], 2.0)
    same, off = coarsened(whole, whole.segment_times, 7)
    assert off == 0.0
    np.testing.assert_array_equal(same.coefficients, whole.coefficients)
    fine = whole.subdivide(5)
    back, off = coarsened(fine, whole.segment_times, 7)
    assert off < 1e-11
    np.testing.assert_allclose(back.coefficients, whole.coefficients, rtol=1e-6, atol=1e-6)


def test_figure_is_drawn_for_plans_with_a_yaw(tmp_path):
    figures = pytest.importorskip("peakflight.figures")
    for yaw in (0.0, "velocity", {"angles": [0, 1, 2, 3, 4], "rate": None}):
        drawn = figures.save_figures(planned(yaw=yaw), tmp_path)
        assert [path.stem for path in drawn][-1] == "yaw"
    with pytest.raises(ValueError, match="the plan has no yaw motion"):
        figures.yaw_figure(planned())
