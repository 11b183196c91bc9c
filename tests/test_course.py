import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from peakflight.course import FARTHEST, MERGE_DISTANCE, Course, tidy
from peakflight.errors import InvalidProblem
from peakflight.limits import Limits
from peakflight.problem import Problem

CORNER = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]


def test_values_are_float_read_only_copies():
    given_points = np.array([[0, 0, 1], [1, 0, 1]])
    course = Course(given_points, yaw=[0, 1], times=[0, 2], lines=[3, 4])
    assert course.waypoints.dtype == course.yaw.dtype == course.times.dtype == float
    given_points[0, 0] = 9
    assert course.waypoints[0, 0] == 0.0
    for array in (course.waypoints, course.yaw, course.times):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    assert course.lines == (3, 4)
    assert len(course) == 2


def test_waypoints_may_repeat():
    assert len(Course([[0, 0, 1], [0, 0, 1]])) == 2


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"waypoints": [[0, 0, 1]]}, "1 waypoint given; a trajectory needs at least two"),
        ({"waypoints": np.zeros((0, 3))}, "0 waypoints given; a trajectory needs at least two"),
        ({"waypoints": [[0, 0], [1, 1]]}, r"waypoints has shape \(2, 2\); it must be \(n, 3\)"),
        ({"waypoints": [["a", 0, 0], [1, 1, 1]]}, "waypoints must be numbers"),
        ({"waypoints": [[0, 0, 0], [1, np.nan, 1]]}, "waypoint 1 has y = nan; it must be finite"),
        (
            {"waypoints": [[0, 0, 0], [1, 1, -np.inf]], "lines": (2, 7)},
            r"waypoint 1 \(line 7\) has z = -inf; it must be finite",
        ),
        (
            {"waypoints": [[0, 0, 0], [2e7, 1, 1]], "lines": (1, 2)},
            r"waypoint 1 \(line 2\) has x = 2e\+07 m; it must be within 1e\+07 m of zero",
        ),
        ({"yaw": [0, 1]}, r"yaw has shape \(2,\); it must be \(3\)"),
        ({"yaw": [0, 1, np.inf]}, "waypoint 2 has yaw = inf; it must be finite"),
        ({"times": [0, 1]}, r"times has shape \(2,\); it must be \(3\)"),
        ({"times": [0, np.nan, 1]}, "waypoint 1 has t = nan; it must be finite"),
        (
            {"times": [0, 1, 1], "lines": (4, 5, 6)},
            r"waypoint 2 \(line 6\) has t = 1 s after 1 s; times must increase",
        ),
        ({"lines": (1, 2)}, "2 lines are given for 3 waypoints"),
    ],
)
def test_bad_values_are_refused(values, message):
    with pytest.raises(InvalidProblem, match=f"^{message}"):
        Course(**{"waypoints": CORNER, **values})


def test_tidy_leaves_a_tidy_course_alone():
    course = Course(CORNER)
    same, notes = tidy(course)
    assert same is course
    assert notes == ()


def test_tidy_merges_and_says_so():
    course = Course(
        [[0, 0, 0], [1, 0, 0], [1.0003, 0, 0], [1, 0, 0], [2, 0, 0]],
        yaw=[0, 1, 1, 2, 3],
        times=[0, 1, 2, 3, 4],
        name="c",
        lines=(2, 3, 5, 6, 7),
    )
    tidied, notes = tidy(course)
    np.testing.assert_array_equal(tidied.waypoints, course.waypoints[[0, 1, 4]])
    np.testing.assert_array_equal(tidied.yaw, [0, 1, 3])
    np.testing.assert_array_equal(tidied.times, [0, 1, 4])
    assert (tidied.name, tidied.lines) == ("c", (2, 3, 7))
    assert notes == (
        "waypoint 2 (line 5) is 0.3 mm from waypoint 1: merged",
        "waypoint 3 (line 6) repeats waypoint 1: merged, and its yaw of 2 rad dropped",
    )


def test_both_ends_stay_exact():
    points = [[0, 0, 0], [0, 0, 4e-4], [1, 0, 0], [1, 0, 6e-4], [1, 0, 9e-4]]
    tidied, notes = tidy(Course(points))
    np.testing.assert_array_equal(tidied.waypoints, np.array(points)[[0, 4]])
    assert notes == (
        "waypoint 1 is 0.4 mm from waypoint 0: merged",
        "waypoint 2 is 0.9 mm from waypoint 4: merged",
        "waypoint 3 is 0.6 mm from waypoint 2: merged",
    )


def test_merging_with_the_last_does_not_leave_another_near_it():
    # waypoint 2 is far enough from 1, but the last is near both
    points = [[0, 0, 0], [1, 0, 0], [1.0012, 0, 0], [1.0006, 0, 0]]
    tidied, _ = tidy(Course(points))
    np.testing.assert_array_equal(tidied.waypoints, np.array(points)[[0, 3]])


def test_a_closed_course_keeps_both_of_its_equal_ends():
    tidied, notes = tidy(Course([[0, 0, 0], [0, 0, 0], [1, 0, 0], [0, 0, 0]]))
    np.testing.assert_array_equal(tidied.waypoints, [[0, 0, 0], [1, 0, 0], [0, 0, 0]])
    assert len(notes) == 1


def test_a_dense_path_is_thinned_not_swallowed():
    path = np.zeros((1001, 3))
    path[:, 0] = np.linspace(0.0, 0.3, 1001)  # 0.3 mm apart
    tidied, notes = tidy(Course(path))
    gaps = np.diff(tidied.waypoints[:, 0])
    assert len(tidied) + len(notes) == 1001
    assert gaps.min() >= MERGE_DISTANCE
    assert gaps.max() < 3 * MERGE_DISTANCE


def test_distance_of_the_tolerance_itself_is_kept_and_zero_tolerance_merges_repeats_only():
    assert len(tidy(Course([[0, 0, 0], [0.25, 0, 0], [0.5, 0, 0]]), tolerance=0.25)[0]) == 3
    beside = Course([[0, 0, 0], [0.25, 0, 0], [0.25, 0, 0], [0.5, 0, 0]])
    assert len(tidy(beside, tolerance=0.25)[0]) == 3
    assert len(tidy(Course([[0, 0, 0], [1e-9, 0, 0], [1, 0, 0]]), tolerance=0.0)[0]) == 3
    assert len(tidy(Course([[0, 0, 0], [0, 0, 0], [1, 0, 0]]), tolerance=0.0)[0]) == 2


@pytest.mark.parametrize("points", [[[1, 2, 3]] * 4, [[0, 0, 0], [0, 0, 9e-4]]])
def test_a_course_of_one_place_is_refused(points):
    with pytest.raises(InvalidProblem, match=r"all \d waypoints lie within 1 mm; a trajectory"):
        tidy(Course(points))


def test_strict_refuses_instead():
    course = Course([[0, 0, 0], [1, 0, 0], [1, 0, 2e-4], [2, 0, 0]], lines=(1, 2, 3, 4))
    message = r"waypoint 2 \(line 3\) is 0.2 mm from waypoint 1; waypoints must be at least 1 mm"
    with pytest.raises(InvalidProblem, match=message):
        tidy(course, strict=True)
    assert tidy(Course(CORNER), strict=True)[1] == ()


@pytest.mark.parametrize("tolerance", [-1e-3, np.nan, np.inf])
def test_bad_tolerance_is_refused(tolerance):
    with pytest.raises(InvalidProblem, match=r"tolerance is .* it must be 0 or more"):
        tidy(Course(CORNER), tolerance=tolerance)


def test_coordinates_at_the_edge_do_not_overflow():
    tidied, notes = tidy(Course([[-FARTHEST] * 3, [FARTHEST] * 3, [-FARTHEST] * 3]))
    assert (len(tidied), notes) == (3, ())


def test_long_courses_are_tidied_fast():
    points = np.repeat(np.random.default_rng(0).normal(size=(25_000, 3)), 2, axis=0)
    start = time.process_time()
    tidied, notes = tidy(Course(points))
    assert time.process_time() - start < 2.0  # 0.1 s here; quadratic work would take minutes
    assert len(tidied) == len(notes) == 25_000


@given(
    st.lists(st.tuples(*[st.integers(-3, 3)] * 3), min_size=2, max_size=30),
    st.floats(0.0, 3.0),
)
@settings(deadline=None, derandomize=True)
def test_what_is_left_makes_a_problem(cells, tolerance):
    course = Course(np.array(cells) * 0.5)
    try:
        tidied, notes = tidy(course, tolerance=tolerance)
    except InvalidProblem as error:
        assert np.linalg.norm(course.waypoints[0] - course.waypoints[-1]) <= tolerance
        assert "lie within" in str(error)
        return
    problem = Problem(tidied.waypoints, limits=Limits(speed=1.0))
    assert (problem.leg_lengths >= tolerance).all()
    assert len(tidied) + len(notes) == len(course)
    np.testing.assert_array_equal(tidied.waypoints[[0, -1]], course.waypoints[[0, -1]])
    left = {tuple(point) for point in tidied.waypoints}
    assert left <= {tuple(point) for point in course.waypoints}
