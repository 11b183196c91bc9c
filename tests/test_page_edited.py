"""What the page edits: every edit a valid problem or a refusal, and undo."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import peakflight as pf
from peakflight.page import Edited, History
from peakflight.page.placing import (
    nearest_leg,
    nearest_point,
    place_after,
    place_in_sight,
)

SQUARE = np.array([[0.0, 0, 1], [2, 0, 1], [2, 2, 1.5], [0, 2, 1]])


def edited(**options: object) -> Edited:
    return Edited.of_course(pf.Course(SQUARE, **options))


def same(one: Edited, other: Edited) -> bool:
    return one.problem.to_dict() == other.problem.to_dict() and one.options == other.options


def test_edits_leave_what_they_came_from_as_it_was() -> None:
    first = edited()
    moved = first.move(1, (3.0, 0.0, 1.0))
    assert np.array_equal(first.waypoints, SQUARE)
    assert np.array_equal(moved.waypoints[1], (3.0, 0.0, 1.0))
    assert np.array_equal(moved.waypoints[[0, 2, 3]], SQUARE[[0, 2, 3]])


@pytest.mark.parametrize("index", range(5))
def test_a_waypoint_is_put_in_where_it_is_asked_for_and_taken_out_again(index: int) -> None:
    more = edited(yaw=[0.0, 0.1, 0.2, 0.3]).insert(index, (9.0, 9.0, 9.0))
    assert np.array_equal(more.waypoints, np.insert(SQUARE, index, 9.0, axis=0))
    assert more.angles is not None
    assert len(more.angles) == 5
    assert same(more.delete(index), edited(yaw=[0.0, 0.1, 0.2, 0.3]))


def test_yaw_and_fixed_motion_go_with_their_waypoint() -> None:
    problem = pf.Problem(
        SQUARE,
        limits=pf.limits.PAPER_LIMITS,
        derivatives={1: {"velocity": [1.0, 0.0, 0.0]}},
        yaw=[0.0, 1.0, 2.0, 3.0],
    )
    later = Edited(problem).reorder(1, 2)
    assert np.array_equal(later.waypoints, SQUARE[[0, 2, 1, 3]])
    assert later.angles is not None
    assert later.angles.tolist() == [0.0, 2.0, 1.0, 3.0]
    assert list(later.problem.derivatives) == [2]
    assert list(Edited(problem).insert(1, (5.0, 5.0, 5.0)).problem.derivatives) == [2]
    assert list(Edited(problem).reorder(1, 0).problem.derivatives) == []  # no longer an inner one


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda one: one.move(1, SQUARE[0]), "repeats"),
        (lambda one: one.move(1, (np.nan, 0.0, 0.0)), "finite"),
        (lambda one: one.move(7, (0.0, 0.0, 0.0)), "no waypoint 7"),
        (lambda one: one.delete(0).delete(0).delete(0), "two waypoints"),
        (lambda one: one.limit({"thrust_acceleration": 9.0}), "above gravity"),
        (lambda one: one.limit({"rotor_thrust": 0.1}), "vehicle"),
        (
            lambda one: one.limit(dict.fromkeys(("speed", "thrust_acceleration", "jerk", "snap"))),
            "no limit",
        ),
    ],
)
def test_what_makes_no_sense_is_refused_with_words(edit: object, words: str) -> None:
    with pytest.raises(pf.InvalidProblem, match=words):
        edit(edited())  # type: ignore[operator]


def test_a_vehicle_brings_its_limits_and_takes_those_on_rotors_with_it() -> None:
    vehicle = pf.find_vehicle("crazyflie-2.1-upgrade")
    flown = edited().fly(vehicle)
    assert flown.problem.limits == vehicle.limits
    slower = flown.limit({"speed": 2.0, "tilt": None})
    assert slower.problem.limits.speed == 2.0
    assert slower.problem.limits.tilt is None
    assert slower.problem.limits.body_rate == vehicle.limits.body_rate
    rotors = flown.fly(vehicle.on_rotors())
    assert rotors.problem.limits.rotor_thrust is not None
    without = rotors.fly(None)
    assert without.vehicle is None
    assert without.problem.limits.airframe is None


def test_another_method_has_its_own_degree() -> None:
    problem = pf.Problem(SQUARE, limits=pf.limits.PAPER_LIMITS, degree=9)
    assert Edited(problem).plan_by(pieces=2).problem.degree == 9
    assert Edited(problem).plan_by(method="peak").problem.degree is None
    assert Edited(problem).plan_by(method="peak").options == {}
    assert edited().plan_by(pieces=2, effort=0.1).options == {"pieces": 2, "effort": 0.1}


def test_a_plan_is_taken_up_as_it_was_asked_for() -> None:
    plan = pf.plan(SQUARE, limits=pf.limits.PAPER_LIMITS, pieces=1)
    taken = Edited.of_plan(plan, "square")
    assert taken.options == {"pieces": 1}
    again = pf.plan(taken.problem, method=taken.method, **taken.options)
    assert again.duration == pytest.approx(plan.duration, rel=1e-9)


def test_settings_of_a_plan_go_with_its_method() -> None:
    plan = pf.plan(SQUARE, limits=pf.limits.PAPER_LIMITS, method="bry", time_penalty=2e4)
    taken = Edited.of_plan(plan, "square")
    assert taken.options == {"time_penalty": 2e4}
    assert taken.plan_by(method="joint").options == {"pieces": "auto"}


@given(st.lists(st.sampled_from(["move", "insert", "delete", "undo", "redo"]), max_size=30))
def test_undo_and_redo_walk_along_what_was_done(steps: list[str]) -> None:
    history = History(edited())
    row, at = [history.present], 0
    for number, step in enumerate(steps):
        now = history.present
        if step == "undo":
            history, at = history.undo(), max(at - 1, 0)
        elif step == "redo":
            history, at = history.redo(), min(at + 1, len(row) - 1)
        else:
            if step == "move":
                made = now.move(0, (float(number), 7.0, 1.0))
            elif step == "insert":
                made = now.insert(1, (float(number), 9.0, 1.0))
            elif len(now.waypoints) > 2:
                made = now.delete(1)
            else:
                continue
            history = history.do(made)
            row, at = [*row[: at + 1], made], at + 1
        assert history.present is row[at]


def test_a_drag_is_one_step() -> None:
    history = History(edited())
    first = history.present
    for x in range(1, 50):
        history = history.do(history.present.move(0, (-float(x), 0.0, 1.0)), "move 0")
    history = history.rest()
    again = history.do(history.present.move(0, (-99.0, 0.0, 1.0)), "move 0")
    assert history.undo().present is first
    assert again.undo().present is history.present


def test_a_line_of_sight_finds_the_leg_that_it_passes() -> None:
    eye = np.array([1.0, -5.0, 6.0])
    for leg in range(3):
        target = SQUARE[leg : leg + 2].mean(axis=0)
        assert nearest_leg(SQUARE, eye, target - eye) == leg
        index, angle = nearest_point(SQUARE, eye, SQUARE[leg] - eye)
        assert index == leg
        assert angle < 1e-6
    behind = nearest_point(SQUARE, eye, eye - SQUARE[0])[1]
    assert behind > np.pi / 2


@given(st.data())
def test_what_an_edit_makes_is_the_same_course_and_what_is_loaded_another(
    data: st.DataObject,
) -> None:
    now = edited()
    if data.draw(st.booleans()):
        now = Edited.of_course(pf.Course(SQUARE[:2]))
    index = data.draw(st.integers(0, len(now.waypoints) - 1))
    for edit in (
        now.move(index, (7.0, 7.0, 7.0)),
        now.insert(index, (7.0, 7.0, 7.0)),
        now.append(),
        now.reorder(index, 0),
        now.limit({"speed": 3.0}),
    ):
        assert not edit.is_other_than(now)
        assert not now.is_other_than(edit)
    assert now.is_other_than(Edited.of_course(pf.Course(SQUARE + 1.0)))
    assert now.is_other_than(Edited.of_course(pf.Course(np.vstack([SQUARE[:1], SQUARE + 9.0]))))


def test_a_click_adds_to_the_leg_that_it_meets_or_at_the_end_on_the_level() -> None:
    now, down = edited(), np.array([0.0, 0.0, -1.0])
    place = place_in_sight(now, None, np.array([5.0, 5.0, 4.0]), down)
    assert place.to == 4
    assert np.array_equal(place.position, (5.0, 5.0, 1.0))  # as high as the last waypoint
    up = place_in_sight(now, None, np.array([4.0, 1.0, 1.1]), np.array([-2.0, 0.0, 0.15]))
    assert up.to == 2
    assert np.array_equal(up.position, (2.0, 1.0, 1.25))
    assert np.array_equal(place_after(now, None, 0).position, (1.0, 0.0, 1.0))
