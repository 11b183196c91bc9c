"""The report in a real browser, opened as a file."""

import dataclasses
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import peakflight as pf

pytest.importorskip("plotly")

from peakflight.reporting import write_report
from peakflight.wording import seconds

COURSES = Path(__file__).parent.parent / "examples" / "courses"
HOSTILE = "<b>x</b></script><script>document.title='hit'</script><img src=x onerror=alert(1)>"
PATIENCE = 60_000
"""ms; WebGL in software is slow, more so beside other work."""
Open = Callable[..., Any]


@pytest.fixture(scope="module")
def plan() -> pf.Plan:
    course = pf.read_course(COURSES / "tight_then_fast.json")
    vehicle = pf.find_vehicle("crazyflie-2.1-upgrade")
    return pf.plan(course.waypoints, vehicle=vehicle, yaw="velocity", pieces=2)


@pytest.fixture
def opened(browser: Any, tmp_path: Path) -> Iterator[Open]:
    """Opens the report of a plan; in the end nothing may have gone wrong or left the file."""
    file = tmp_path / "report.html"
    complaints: list[str] = []
    requests: list[str] = []

    def open_report(
        plan: pf.Plan, width: int = 1280, scheme: str = "light", title: str = "Flight plan"
    ) -> Any:
        write_report(plan, file, title=title)
        view = {"width": width, "height": 900}
        page = browser.new_page(viewport=view, color_scheme=scheme)
        page.set_default_timeout(PATIENCE)
        page.on("console", lambda said: said.type == "error" and complaints.append(said.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("dialog", lambda dialog: complaints.append(dialog.message))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(file.as_uri())
        page.wait_for_selector("html[data-ready=true]")
        return page

    yield open_report
    assert complaints == []
    assert [url for url in requests if url != file.as_uri() and not url.startswith("data:")] == []
    for context in browser.contexts:
        context.close()


def wait_for(page: Any, expression: str) -> Any:
    """The value of an expression once it is true; the page's policy lets nothing in it wait."""
    end = time.monotonic() + PATIENCE / 1000.0
    while time.monotonic() < end:
        value = page.evaluate(expression)
        if value:
            return value
        page.wait_for_timeout(50)
    raise TimeoutError(expression)


def test_everything_is_drawn(opened: Open, plan: pf.Plan, screenshots: Path) -> None:
    page = opened(plan)
    assert page.inner_text("#total") == seconds(plan.duration)
    assert page.inner_text("#verdict strong") == "Certified"
    assert page.locator("#path canvas").count() >= 1
    for plot, name in (("limits-plot", "jerk"), ("yaw-plot", "yaw"), ("legs-plot", "")):
        assert page.locator(f"#{plot} svg.main-svg").count() >= 1
        assert page.locator(f"#{plot} .trace").count() >= 1, name
    assert page.locator("#legs-plot .point").count() == len(plan.pieces)
    # what was drawn is what was planned
    ends = page.evaluate("document.getElementById('limits-plot').data[0].x.at(-1)")
    assert ends == pytest.approx(plan.duration, abs=1e-6)
    # nothing is offered that would leave the page
    titles = page.eval_on_selector_all("[data-title]", "all => all.map(one => one.dataset.title)")
    assert titles
    assert not [title for title in titles if "Cloud" in title or "Share" in title]
    page.screenshot(path=screenshots / "report.png", full_page=True)


def test_pointing_at_a_curve_shows_where_it_is(opened: Open, plan: pf.Plan) -> None:
    page = opened(plan)
    place = "(() => { const c = document.getElementById('path').data.at(-1); return c.visible && "
    place += "[c.x[0], c.y[0], c.z[0]]; })()"
    assert page.evaluate(place) is False
    panel = page.locator("#limits-plot .nsewdrag").first
    panel.hover()
    box = panel.bounding_box()
    page.mouse.move(box["x"] + 0.5 * box["width"] + 1.0, box["y"] + 0.5 * box["height"])
    at = wait_for(page, place)
    expected = plan.trajectory(0.5 * plan.duration)
    assert at == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_fits_a_telephone(opened: Open, plan: pf.Plan, scheme: str, screenshots: Path) -> None:
    page = opened(plan, width=400, scheme=scheme)
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    background = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert background == {"light": "rgb(255, 255, 255)", "dark": "rgb(23, 24, 27)"}[scheme]
    page.screenshot(path=screenshots / f"report-400-{scheme}.png", full_page=True)


def test_the_path_from_above(opened: Open, plan: pf.Plan) -> None:
    page = opened(plan)
    assert not page.locator("#above").is_visible()
    page.get_by_role("button", name="from above").click()
    page.wait_for_selector("#above .trace")
    assert not page.locator("#path").is_visible()
    points = page.evaluate("document.getElementById('above').data[1].x")
    assert points == pytest.approx(plan.problem.waypoints[:, 0].tolist())


def test_colours_follow_the_surroundings(opened: Open, plan: pf.Plan) -> None:
    page = opened(plan)
    colour = "document.getElementById('limits-plot').data[0].line.color"
    assert page.evaluate(colour) == "#1f1f1f"
    page.emulate_media(color_scheme="dark")
    wait_for(page, f"{colour} === '#e9e9e6'")


def test_an_unproven_plan_and_what_users_wrote(opened: Open, plan: pf.Plan) -> None:
    limits = dataclasses.replace(plan.problem.limits, speed=1.0)
    problem = dataclasses.replace(
        plan.problem,
        limits=limits,
        vehicle=dataclasses.replace(plan.vehicle, name=HOSTILE[:80], limits=limits),
    )
    wrong = dataclasses.replace(plan, problem=problem, message=HOSTILE, method=HOSTILE)
    page = opened(wrong, title=HOSTILE)
    assert page.inner_text("h1") == HOSTILE
    assert page.title().startswith("<b>x</b>")
    assert page.inner_text("#verdict strong") == "NOT certified"
    assert "speed reaches" in page.inner_text("#verdict")
    assert page.locator("img").count() == 0
