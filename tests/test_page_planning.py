"""The page without a browser: planning, files, who may look, and what is called certified."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import peakflight as pf
from peakflight.page import files
from peakflight.page.asking import Planner, Shown
from peakflight.page.drawing import Drawing
from peakflight.page.edited import Edited
from peakflight.page.header import Summary, badge, course_line, header, legs_table, message
from peakflight.page.solver import Request, answer
from peakflight.page.states import states
from peakflight.page.thread import PageThread

COURSES = Path(__file__).parent.parent / "examples" / "courses"
STEPS = np.random.default_rng(5).normal(size=(200, 3)) * (1.5, 1.5, 0.2)
LONG = np.cumsum(STEPS, axis=0) + np.array([0.0, 0.0, 5.0])


def edited(count: int = 6) -> Edited:
    return Edited.of_course(pf.Course(LONG[:count]))


def until(ready: Callable[[], object], seconds: float = 300.0) -> None:
    """Wait; the first plan of a machine compiles."""
    end = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < end, "not in time"
        time.sleep(0.005)


@pytest.fixture
def shown() -> list[Shown]:
    return []


@pytest.fixture
def planner(shown: list[Shown]) -> Iterator[Planner]:
    planner = Planner(shown.append)
    yield planner
    planner.close()


def test_what_rests_is_planned_as_plan_does(planner: Planner, shown: list[Shown]) -> None:
    course = edited()
    planner.ask(course)
    until(lambda: shown and shown[-1].whole)
    plan = shown[-1].plan
    assert plan is not None
    assert plan.duration == pytest.approx(pf.plan(course.problem).duration, rel=1e-9)
    guess = pf.plan(course.problem, method="proportional").duration
    assert shown[-1].guess == pytest.approx(guess, rel=1e-9)


def test_the_newest_wins_and_drafts_follow_a_drag(planner: Planner, shown: list[Shown]) -> None:
    course = edited(11)
    planner.ask(course)
    until(lambda: planner.idle)
    shown.clear()
    asked = []
    for step in range(200):
        asked.append(course.move(5, course.waypoints[5] + (0.005 * step, 0.0, 0.0)))
        planner.ask(asked[-1], rests=False)
        time.sleep(0.002)
    planner.rest()
    until(lambda: planner.idle)
    order = [asked.index(one.edited) for one in shown]
    assert order == sorted(order)
    assert len(shown) < len(asked)  # no queue: what was overtaken is never planned
    assert shown[-1].edited is asked[-1]
    assert shown[-1].whole
    assert not any(one.whole for one in shown[:-1])
    for one in shown:
        assert one.plan is not None
        assert np.array_equal(one.plan.problem.waypoints, one.edited.waypoints)
        assert pf.certify_plan(one.plan).feasible


def test_a_long_solve_can_be_stopped_and_the_next_goes_on(
    planner: Planner, shown: list[Shown]
) -> None:
    vehicle = pf.find_vehicle("crazyflie-2.1-upgrade")
    slow = edited(200).fly(vehicle).plan_by(pieces=4)
    planner.ask(slow)
    until(lambda: planner.busy is not None)
    planner.cancel()
    until(lambda: planner.idle)
    assert not any(one.whole for one in shown)
    assert planner.idle
    planner.ask(edited())
    until(lambda: any(one.whole for one in shown))
    assert shown[-1].plan is not None
    assert len(shown[-1].plan.problem.waypoints) == 6


def test_something_newer_does_not_wait_for_a_long_solve(
    planner: Planner, shown: list[Shown]
) -> None:
    vehicle = pf.find_vehicle("crazyflie-2.1-upgrade")
    planner.ask(edited().fly(vehicle))
    until(lambda: planner.idle and planner._spare_ready)
    planner.ask(edited(200).fly(vehicle).plan_by(pieces=4))
    until(lambda: planner._job is not None and planner._job.whole)  # half a minute of work
    first, second = planner.pids
    shown.clear()
    planner.ask(edited())
    until(lambda: shown and shown[-1].whole)
    assert planner.pids[0] == second != first  # the one that stood ready has taken over
    assert {len(one.edited.waypoints) for one in shown} == {6}  # the long one was given up


def test_what_was_answered_has_been_shown_once_the_planner_is_idle() -> None:
    entered, gate, shown = threading.Event(), threading.Event(), []

    def show(one: Shown) -> None:
        entered.set()
        gate.wait()
        shown.append(one)

    planner = Planner(show)
    try:
        planner.ask(edited())
        assert entered.wait(300.0)
        planner.cancel()  # what else there is to do
        assert not planner.idle
        assert planner.busy is None  # the solve is over
        gate.set()
        until(lambda: planner.idle)
        assert len(shown) == 1
    finally:
        gate.set()
        planner.close()


def test_a_process_that_dies_is_replaced(planner: Planner, shown: list[Shown]) -> None:
    planner.ask(edited())
    until(lambda: shown and shown[-1].whole and len(planner.pids) == 2)
    for pid in planner.pids:
        os.kill(pid, signal.SIGTERM)
    time.sleep(0.2)
    shown.clear()
    planner.ask(edited(7))
    until(lambda: any(one.plan is not None and one.whole for one in shown))


def test_a_process_that_dies_at_work_is_said_and_replaced(
    planner: Planner, shown: list[Shown]
) -> None:
    for _ in range(2):
        shown.clear()
        planner.ask(edited().plan_by(method="proportional"))
        until(lambda: planner.busy is not None or shown)
        os.kill(planner.pids[0], signal.SIGTERM)
        until(lambda: planner.idle)
    shown.clear()
    planner.ask(edited(7))
    until(lambda: any(one.whole for one in shown))
    assert all(one.plan is not None for one in shown)  # no word of what had died before


def refuse(*arguments: object, **options: object) -> None:
    raise OSError(12, "Cannot allocate memory")


def test_without_a_process_the_page_says_so_and_goes_on(
    planner: Planner, shown: list[Shown], monkeypatch: pytest.MonkeyPatch
) -> None:
    planner.ask(edited())
    until(lambda: planner.idle)
    with monkeypatch.context() as patched:
        patched.setattr("subprocess.Popen", refuse)
        for pid in planner.pids:
            os.kill(pid, signal.SIGTERM)
        until(lambda: not planner._process.alive)
        for count in (7, 8):
            shown.clear()
            planner.ask(edited(count))
            until(lambda: planner.idle)
            assert "Cannot allocate memory" in shown[-1].error
            assert len(shown[-1].edited.waypoints) == count
    shown.clear()
    planner.ask(edited(9))
    until(lambda: planner.idle)
    assert shown[-1].whole
    assert shown[-1].plan is not None


def test_an_answer_that_cannot_be_read_is_said(
    planner: Planner, shown: list[Shown], monkeypatch: pytest.MonkeyPatch
) -> None:
    def unreadable(stream: object) -> None:
        raise AttributeError("no such class")

    planner.ask(edited())
    until(lambda: planner.idle)
    with monkeypatch.context() as patched:
        shown.clear()
        patched.setattr("peakflight.page.process.pickle.load", unreadable)
        for count in (7, 8):  # the first of them may be read by who waited already
            planner.ask(edited(count))
            until(lambda: planner.idle)
        assert any("no such class" in one.error for one in shown)
    shown.clear()
    planner.ask(edited(9))
    until(lambda: planner.idle)
    assert shown[-1].plan is not None


def test_a_plan_that_cannot_be_shown_does_not_end_the_planner() -> None:
    shown: list[Shown] = []

    def show(one: Shown) -> None:
        shown.append(one)
        raise RuntimeError("no screen")

    planner = Planner(show)
    try:
        for count in (6, 7):
            planner.ask(edited(count))
            until(lambda: planner.idle)
            assert shown[-1].whole
            assert len(shown[-1].edited.waypoints) == count
    finally:
        planner.close()


WORKING = """
import sys, threading
sys.path.insert(0, {tests!r})
from test_page_planning import *

slow = edited(200).fly(pf.find_vehicle("crazyflie-2.1-upgrade")).plan_by(pieces=8)
planner = Planner(lambda shown: None)
planner.ask(slow)
until(lambda: planner._job is not None and planner._job.whole)
print("works", flush=True)
threading.Event().wait()
"""


def test_however_the_server_ends_so_do_its_processes() -> None:
    command = [sys.executable, "-c", WORKING.format(tests=str(Path(__file__).parent))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as server:
        assert server.stdout is not None
        try:
            assert server.stdout.readline() == b"works\n"
            time.sleep(0.5)  # the solve is at work
        finally:
            server.kill()
        server.communicate(timeout=15)  # until nobody holds its standard error any more


def test_errors_are_words(shown: list[Shown]) -> None:
    course = edited()
    said = answer(Request(number=1, problem=course.problem, method="joint", options={"pieces": 0}))
    assert said.plan is None
    assert "pieces" in said.error
    assert "bug" not in said.error


def summary(plan: pf.Plan | None, *, fresh: bool = True, error: str = "") -> Summary:
    return Summary(plan=plan, fresh=fresh, whole=True, error=error, guess=None)


def test_only_a_proven_plan_of_the_course_as_it_is_is_called_certified() -> None:
    plan = pf.plan(edited().problem, pieces=1)
    assert badge(summary(plan))[0] == "certified"
    assert badge(summary(plan, fresh=False))[0] != "certified"
    assert badge(summary(plan, error="refused"))[0] != "certified"
    assert badge(summary(None))[0] != "certified"
    tight = pf.Limits(speed=0.5 * plan.problem.limits.speed)  # type: ignore[operator]
    refused = pf.certify(plan.trajectory, tight, waypoints=plan.problem.waypoints)
    assert not refused.feasible
    from dataclasses import replace

    worse = replace(plan, report=refused)
    assert badge(summary(worse))[0] == "not certified"
    assert "\u2713" not in header(summary(worse))


def test_text_of_others_is_not_markup() -> None:
    hostile = "<img src=x onerror=alert(1)>"
    assert hostile not in header(summary(None, error=hostile))
    assert hostile not in message(hostile, good=False)
    assert hostile not in course_line(hostile, 3, 1.0)


def test_legs_say_what_holds_them_back() -> None:
    plan = pf.plan(edited().problem)
    drawing = Drawing(plan, states(plan))
    assert sum(leg.duration for leg in drawing.legs) == pytest.approx(plan.duration)
    starts = np.concatenate(([0], np.cumsum(plan.pieces)))
    for leg in drawing.legs:
        part = slice(starts[leg.index], starts[leg.index + 1])
        worst = max(float(kappa[part].max()) for kappa in plan.report.peaks.values())
        assert max(held.ratio for held in leg.held) == worst
        assert leg.held[0].binds == (worst >= 0.999)
        assert all(0.0 <= held.share <= 1.0 for held in leg.held)
        assert leg.held[0].label in legs_table(drawing.legs)


@pytest.mark.parametrize("vehicle", [None, "crazyflie-2.1-upgrade"])
def test_the_vehicle_is_drawn_where_it_is_and_as_it_leans(vehicle: str | None) -> None:
    course = edited() if vehicle is None else edited().fly(pf.find_vehicle(vehicle))
    plan = pf.plan(course.problem, pieces=1)
    drawing = Drawing(plan, states(plan))
    for t in np.linspace(0.0, plan.duration, 23):
        position, (w, x, y, z), _ = drawing.at(float(t))
        assert position == pytest.approx(plan.trajectory(min(t, plan.duration)))
        up = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        if vehicle is None:  # no drag: the thrust is along a + g e3
            force = plan.trajectory(t, derivative=2) + np.array([0.0, 0.0, pf.GRAVITY])
            assert up @ force / np.linalg.norm(force) > 0.995  # between samples of the path
    assert drawing.path[0] == pytest.approx(course.waypoints[0])
    assert drawing.path[-1] == pytest.approx(course.waypoints[-1])
    for curve in drawing.curves:
        if getattr(plan.problem.limits, curve.name) is not None:
            most = curve.limits[0]
            assert max(one.max() for one in curve.values) <= most * (1.0 + 1e-9)


def test_a_limit_from_below_alone_has_its_plot() -> None:
    own = pf.find_vehicle("crazyflie-2.1-upgrade").on_rotors().limits
    alone = replace(own, rotor_thrust=None, speed=3.0)
    plan = pf.plan(replace(edited().problem, limits=alone), pieces=1)
    (curve,) = [one for one in Drawing(plan, states(plan)).curves if one.name == "rotor_thrust"]
    assert curve.limits == (own.least_rotor_thrust,)
    assert min(one.min() for one in curve.values) >= curve.limits[0] * (1.0 - 1e-9)


@pytest.mark.parametrize(
    "path",
    sorted(path for path in COURSES.iterdir() if path.name != "README.md"),
    ids=lambda path: path.name,
)
def test_every_course_comes_in_as_from_the_command_line(path: Path) -> None:
    loaded, _ = files.load_upload(path.name, path.read_bytes(), edited())
    course, _ = pf.tidy(pf.read_course(path))
    assert np.array_equal(loaded.waypoints, course.waypoints)


def test_what_is_saved_is_read_back(tmp_path: Path) -> None:
    course = edited().turn(2, 0.3)
    csv = tmp_path / "course.csv"
    csv.write_bytes(files.course_csv(course))
    read = pf.read_course(csv)
    assert np.array_equal(read.waypoints, course.waypoints)
    assert read.yaw is not None
    assert np.array_equal(read.yaw, course.angles)
    plan = pf.plan(edited().problem, pieces=2)
    again, _ = files.load_upload("plan.json", files.plan_json(plan), course)
    assert np.array_equal(again.waypoints, plan.problem.waypoints)
    assert again.problem.limits == plan.problem.limits


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.csv", b"x,y,z\n1,2\n", "line 2"),
        ("a.csv", b"", "empty"),
        ("a.csv", b"\xff\xfe\x00", "UTF-8"),
        ("plan.json", b'{"coefficients": [], "status": "solved"}', "missing"),
        ("../../etc/x.csv", b"x,y,z\n0,0,nope\n", "x.csv"),
        ("big.csv", b"x,y,z\n" + b"\n".join(b"%d,0,1" % i for i in range(2500)), "2500"),
    ],
)
def test_broken_uploads_are_refused_by_name(name: str, content: bytes, words: str) -> None:
    with pytest.raises(pf.InvalidFile, match=words) as refused:
        files.load_upload(name, content, edited())
    assert "peakflight-page-" not in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "called"),
    [
        ("a\0b.csv", "a\0b"),
        ("n" * 300 + ".csv", "n" * 300),
        ("C:\\x\\my.csv", "my"),
        ("", "upload"),
    ],
)
def test_uploads_may_have_any_name(name: str, called: str) -> None:
    found, _ = files.load_upload(name, b"x,y,z\n0,0,1\n1,0,1\n", edited())
    assert found.name == called


def test_a_plan_that_is_uploaded_is_called_as_its_file() -> None:
    content = files.plan_json(pf.plan(edited().problem, pieces=1))
    for name in ("plan", "race"):
        assert files.load_upload(f"{name}.json", content, edited())[0].name == name


@pytest.mark.parametrize("to", ["crazyswarm", "samples", "px4"])
def test_flight_files_are_proven(to: str) -> None:
    plan = pf.plan(edited().problem, pieces=1)
    name, content, report = files.flight_file(plan, to)
    assert content
    assert report.feasible
    assert name == pf.formats.FLIGHT_FORMATS[to].filename


def test_the_report_is_that_of_the_command() -> None:
    pytest.importorskip("plotly")
    plan = pf.plan(edited().problem, pieces=1)
    assert files.report(plan, "race").decode() == pf.report_html(plan, title="race")


def test_the_thread_does_the_newest_under_a_key_and_survives_a_bug() -> None:
    failures: list[Exception] = []
    thread = PageThread(failures.append)
    gate, done = threading.Event(), []
    thread.post(gate.wait)  # type: ignore[arg-type]
    for number in range(100):
        thread.post(lambda number=number: done.append(number), key="drag")
    thread.post(lambda: 1 / 0)  # type: ignore[arg-type]
    thread.post(lambda: done.append("last"))
    gate.set()
    assert thread.settle()
    assert done == [99, "last"]
    assert len(failures) == thread.failures == 1
    thread.close()


def test_the_thread_does_what_replaces_after_what_came_before_it() -> None:
    thread = PageThread(lambda error: None)
    gate, done = threading.Event(), []
    thread.post(gate.wait)  # type: ignore[arg-type]
    thread.post(lambda: done.append("slide"), key="slide")
    thread.post(lambda: done.append("undo"))
    thread.post(lambda: done.append("newest slide"), key="slide")
    gate.set()
    assert thread.settle()
    thread.close()
    assert done == ["undo", "newest slide"]
