"""What the page says of the plan that is drawn, while answers come late, fail or not at all."""

import time
from collections.abc import Iterator

import numpy as np
import pytest

import peakflight as pf

pytest.importorskip("viser")

from peakflight.page.asking import Shown
from peakflight.page.edited import Edited
from peakflight.page.header import badge, header
from peakflight.page.planner_page import Page
from peakflight.page.server import PageServer
from peakflight.page.solver import Request
from peakflight.page.solver import answer as answer_of

COURSE = pf.Course(np.array([[0.0, 0, 1], [2, 0, 1], [2, 2, 1.5]]))
PATIENCE = 300.0
"""s; the first plan of a machine compiles."""


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    server = PageServer(Edited.of_course(COURSE), port=0)
    yield server
    server.close()


@pytest.fixture
def page(server: PageServer) -> Page:
    """The course as it was at first, planned."""
    page = server.page
    page.limit("speed", 4.9, False)  # an edit takes messages away
    assert page.thread.settle()
    while page._history.past:
        page.undo()
        assert page.thread.settle()
    until(lambda: page.planner.idle and page.thread.settle() and page.summary.whole)
    until(lambda: badge(page.summary)[0] == "certified")
    return page


@pytest.fixture
def unplanned(page: Page, monkeypatch: pytest.MonkeyPatch) -> Page:
    """The same, and nobody plans any more."""
    monkeypatch.setattr(page.planner, "ask", lambda edited, rests=True: None)
    return page


def until(what: object) -> None:
    end = time.monotonic() + PATIENCE
    while not what():  # type: ignore[operator]
        assert time.monotonic() < end
        time.sleep(0.01)


def answer(page: Page, error: str) -> None:
    """What the planner says where there is no plan of the course as it is."""
    page._planned(Shown(edited=page.edited, plan=None, states=None, whole=True, error=error))
    assert page.thread.settle()


def said(page: Page) -> str:
    return str(page._panel._message.content)


def test_a_plan_of_before_an_error_is_not_certified_nor_saved(unplanned: Page) -> None:
    page = unplanned
    page.limit("speed", 1.0, False)
    assert page.thread.settle()
    answer(page, "the limits leave nothing")
    assert badge(page.summary)[0] == "earlier plan"
    assert "the limits leave nothing" in header(page.summary)
    page.save("plan", None)
    until(lambda: "there is no plan of the course as it is yet" in said(page))
    page.limit("speed", 2.0, False)
    assert page.thread.settle()
    page.undo()  # back to what has failed
    assert page.thread.settle()
    assert badge(page.summary)[0] == "earlier plan"


def test_while_something_is_dragged_nothing_is_certified_that_lags(
    unplanned: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = unplanned
    monkeypatch.setattr(type(page.planner), "idle", property(lambda self: False))
    page.limit("speed", 1.0, True)
    assert page.thread.settle()
    assert badge(page.summary)[0] == "draft, proven"
    page.save("plan", None)
    until(lambda: "there is no plan of the course as it is yet" in said(page))
    page.limit("speed", 2.0, False)
    assert page.thread.settle()
    assert badge(page.summary)[0] == "planning"


def test_a_change_that_is_refused_leaves_what_is_proven(page: Page) -> None:
    page.place(tuple(page.edited.waypoints[0]))
    assert page.thread.settle()
    assert badge(page.summary)[0] == "certified"
    assert "waypoint 1 repeats waypoint 0" in header(page.summary)
    page.limit("speed", 4.0, False)
    assert page.thread.settle()
    assert "repeats" not in header(page.summary)


def test_sliders_show_the_limits(page: Page) -> None:
    panel = page._panel._limits
    before = panel._sliders["speed"].value
    panel._sliders["speed"].value = 8.0  # as a hand does
    page.limit("speed", 8.0, True)
    assert page.thread.settle()
    page.undo()
    assert page.thread.settle()
    assert panel._sliders["speed"].value == pytest.approx(before)
    for name in ("thrust_acceleration", "jerk", "snap"):
        page.limit(name, None, False)
    assert page.thread.settle()
    panel._boxes["speed"].value = False
    page.limit("speed", None, False)  # the last one
    assert page.thread.settle()
    assert panel._boxes["speed"].value
    assert "limit" in header(page.summary)


def test_what_cannot_be_loaded_is_said_whatever_it_is(
    page: Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OverflowError("too far")

    monkeypatch.setattr("peakflight.page.files.load_upload", broken)
    failures = page.thread.failures
    page.load("x.csv", b"", None)
    until(lambda: "x.csv: unexpected OverflowError: too far" in said(page))
    assert page.thread.failures == failures + 1
    assert "this is a bug" in header(page.summary)


def test_a_plan_without_a_guess_to_compare_with_is_a_plan(page: Page) -> None:
    """No spline of the guess has this motion at the start."""
    problem = pf.Problem(
        COURSE.waypoints,
        limits=page.edited.problem.limits,
        start={"velocity": [1.0, 0, 0], "snap": [3.0, 0, 0]},
    )
    found = answer_of(Request(number=1, problem=problem, method="joint", options={}, guess=True))
    assert found.plan is not None, found.error
    assert found.plan.feasible
    assert found.guess is None
