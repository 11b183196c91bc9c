"""The planner page in a real browser, with a real mouse."""

import base64
import math
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import peakflight as pf

pytest.importorskip("viser")

from peakflight.page.edited import Edited
from peakflight.page.server import PageServer

COURSES = Path(__file__).parent.parent / "examples" / "courses"
PATIENCE = 90_000
"""ms; WebGL in software is slow, more so beside other work."""
SIZE = {"width": 1440, "height": 900}


class Visit:
    """A page that is open in a browser."""

    def __init__(self, server: PageServer, tab: Any, name: str) -> None:
        self.server, self.tab = server, tab
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        tab.on("pageerror", lambda error: self.complaints.append(str(error)))
        tab.on("request", lambda request: self.hosts.add(request.url.split("/")[2]))
        tab.on("dialog", lambda dialog: self.complaints.append(dialog.message))
        known = set(server.viser.get_clients())
        tab.goto(server.url)
        tab.wait_for_selector("[data-badge]")
        until(lambda: set(server.viser.get_clients()) - known, "the client is there")
        self.client = server.viser.get_clients()[min(set(server.viser.get_clients()) - known)]
        self.name = name

    def total(self) -> float:
        """The time that is shown, s."""
        text = self.tab.inner_text("[data-total]").strip()
        return math.nan if text == "\u2013" else float(text)

    def badge(self) -> str:
        return str(self.tab.inner_text("[data-badge]")).strip()

    def settled(self) -> None:
        """Wait until the course as it is has been planned in whole, and the browser shows it."""
        page = self.server.page

        def shown() -> bool:
            page.thread.settle()
            summary = page.summary
            if not (page.planner.idle and summary.whole and summary.fresh):
                return False
            assert summary.plan is not None
            return self.total() == round(summary.plan.duration, 3)

        until(shown, "the whole plan of the course as it is, in the browser")

    def view(self) -> dict[str, float]:
        """Where the scene is on the screen: x, y, width and height in pixels."""
        return max(
            (one.bounding_box() for one in self.tab.locator("canvas").all() if one.is_visible()),
            key=lambda box: box["width"] * box["height"],
        )

    def sees(self, points: np.ndarray) -> bool:
        """Whether all of the points are on the screen, and large: by the camera as it reports."""
        box = self.view()
        places = self.pixels(points, box)
        low = (places.min(axis=0) - (box["x"], box["y"])) / (box["width"], box["height"])
        high = (places.max(axis=0) - (box["x"], box["y"])) / (box["width"], box["height"])
        return bool(np.all(low > 0.05) and np.all(high < 0.95) and (high - low).max() > 0.6)

    def pixel(self, point: np.ndarray) -> tuple[float, float]:
        """Where a point is on the screen."""
        x, y = self.pixels(point[None], self.view())[0]
        return float(x), float(y)

    def pixels(self, points: np.ndarray, box: dict[str, float]) -> np.ndarray:
        """(n, 2), where (n, 3) points are on the screen; not a number behind the eye."""
        camera = self.client.camera
        w, x, y, z = camera.wxyz
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        right, down, ahead = turn.T @ (points - camera.position).T
        ahead = np.where(ahead > 0.0, ahead, np.nan)
        focal = box["height"] / 2.0 / np.tan(camera.fov / 2.0)
        middle = (box["x"] + box["width"] / 2.0, box["y"] + box["height"] / 2.0)
        return middle + focal * np.column_stack([right / ahead, down / ahead])

    def drag(self, index: int, by: tuple[float, float], steps: int = 8) -> None:
        """Drag the ball of a waypoint by pixels."""
        x, y = self.pixel(self.server.page.edited.waypoints[index])
        mouse = self.tab.mouse
        mouse.move(x, y)
        time.sleep(0.3)  # the browser looks what is below the pointer
        mouse.down()
        for step in range(1, steps + 1):
            mouse.move(x + by[0] * step / steps, y + by[1] * step / steps)
            time.sleep(0.05)
        mouse.up()

    def open(self, tab: str) -> None:
        self.tab.get_by_role("tab", name=tab).click()

    def picture(self, folder: Path, name: str) -> None:
        for note in self.tab.get_by_text("Software WebGL rendering detected").all():
            note.locator("xpath=ancestor::*[@role='alert']").get_by_role("button").click()
            note.wait_for(state="detached")
        session = self.tab.context.new_cdp_session(self.tab)
        shot = session.send("Page.captureScreenshot", {"format": "png"})
        (folder / f"page_{name}.png").write_bytes(base64.b64decode(shot["data"]))
        session.detach()

    def close(self) -> None:
        self.tab.close()
        assert self.complaints == []
        assert all(host.startswith("127.0.0.1") for host in self.hosts if host)


def until(ready: Callable[[], Any], what: str, seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not ready():
        assert time.monotonic() < end, f"not in time: {what}"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    course = pf.read_course(COURSES / "tight_then_fast.csv")
    server = PageServer(Edited.of_course(course), port=0)
    yield server
    server.close()


@pytest.fixture
def visit(server: PageServer, browser: Any) -> Iterator[Callable[..., Visit]]:
    visits: list[Visit] = []

    def visit(name: str = "tight_then_fast.csv") -> Visit:
        if not visits:
            content = (COURSES / name).read_bytes()
            server.page.load(name, content, None)
        tab = browser.new_page(viewport=SIZE, accept_downloads=True)
        tab.set_default_timeout(PATIENCE)
        visits.append(Visit(server, tab, name))
        visits[-1].settled()
        return visits[-1]

    yield visit
    for one in visits:
        one.close()
    assert server.page.thread.failures == 0


def test_a_handle_that_is_dragged_changes_the_plan_and_undo_brings_it_back(
    visit: Callable[..., Visit], server: PageServer, screenshots: Path
) -> None:
    page = visit()
    before, place = page.total(), server.page.edited.waypoints[6].copy()
    assert page.badge() == "✓ certified"
    page.drag(6, (60.0, 20.0))
    until(lambda: not np.array_equal(server.page.edited.waypoints[6], place), "the waypoint moves")
    page.settled()
    moved = server.page.edited.waypoints[6]
    assert moved[2] == place[2]  # a drag stays at its height
    assert np.linalg.norm(moved - place) > 0.1
    assert page.total() != before
    assert page.badge() == "✓ certified"
    plan = server.page.drawn
    assert plan is not None
    assert pf.certify_plan(plan).feasible
    again = pf.plan(server.page.edited.problem)
    assert plan.duration == pytest.approx(again.duration, rel=1e-9)  # as `peakflight plan` would
    page.picture(screenshots, "dragged")
    page.tab.get_by_role("button", name="Undo").click()
    until(lambda: np.array_equal(server.page.edited.waypoints[6], place), "undone in one step")
    page.settled()
    assert page.total() == before


def test_a_limit_that_is_raised_makes_the_flight_faster(
    visit: Callable[..., Visit], server: PageServer
) -> None:
    page = visit()
    before = page.total()
    page.open("Limits")
    unit = page.tab.locator("label").filter(has_text=re.compile(r"^at most \(m/s\)$"))
    box = unit.locator("xpath=ancestor::div[2]").locator("input[type=text]")
    box.fill("8")
    box.press("Enter")
    until(lambda: server.page.edited.problem.limits.speed == 8.0, "the limit is set")
    page.settled()
    assert page.total() < before
    assert page.badge() == "✓ certified"
    page.open("Legs")
    page.tab.wait_for_selector("[data-legs]")
    assert "thrust acceleration" in page.tab.inner_text("[data-legs]")


def test_an_exported_file_is_what_its_reader_reads_and_keeps_the_limits(
    visit: Callable[..., Visit], server: PageServer, tmp_path: Path
) -> None:
    page = visit()
    page.open("Files")
    with page.tab.expect_download() as download:
        page.tab.get_by_role("button", name="Export the flight file").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    plan = server.page.drawn
    assert plan is not None
    read = pf.read_trajectory(path)
    assert read.duration == pytest.approx(plan.duration, rel=1e-2)
    report = pf.certify(read, plan.problem.limits)
    assert report.worst <= 1.0 + pf.formats.FLIGHT_FORMATS["crazyswarm"].tolerance


def test_a_broken_upload_is_refused_with_words_and_all_stays(
    visit: Callable[..., Visit], server: PageServer, tmp_path: Path, screenshots: Path
) -> None:
    page = visit()
    before = server.page.edited
    broken = tmp_path / "broken.csv"
    broken.write_text("x,y,z\n0,0,1\n1,one,1\n")
    page.open("Files")
    with page.tab.expect_file_chooser() as chooser:
        page.tab.get_by_role("button", name="Load a course or plan").click()
    chooser.value.set_files(broken)
    page.tab.wait_for_selector("[data-file]")
    until(lambda: "line 3" in page.tab.inner_text("[data-file]"), "the message names the line")
    assert "broken.csv" in page.tab.inner_text("[data-file]")
    assert "/tmp" not in page.tab.inner_text("[data-file]")
    page.picture(screenshots, "refused")
    assert server.page.edited is before


def test_two_clients_see_the_same_course(visit: Callable[..., Visit], server: PageServer) -> None:
    one, other = visit(), visit()
    one.tab.bring_to_front()
    one.open("Course")
    one.tab.get_by_role("button", name="At the end").click()
    until(lambda: len(server.page.edited.waypoints) == 10, "a waypoint is added")
    one.settled()
    other.tab.bring_to_front()
    other.settled()
    assert one.total() == other.total()


def test_a_course_of_200_waypoints_is_still_edited_by_hand(
    visit: Callable[..., Visit], server: PageServer, screenshots: Path, tmp_path: Path
) -> None:
    page = visit()
    steps = np.random.default_rng(3).normal(size=(200, 3)) * (1.5, 1.5, 0.2)
    waypoints = np.cumsum(steps, axis=0) + np.array([0.0, 0.0, 5.0])
    text = "x,y,z\n" + "\n".join(",".join(f"{x:.3f}" for x in row) for row in waypoints)
    first = server.page.edited
    until(lambda: page.sees(first.waypoints), "the small course is framed")
    server.page.load("long.csv", text.encode(), None)
    until(lambda: len(server.page.edited.waypoints) == 200, "loaded")
    page.settled()
    until(lambda: page.sees(waypoints), "the large course is framed")
    page.client.camera.position = page.client.camera.position + np.array([80.0, 0.0, 0.0])
    until(lambda: not page.sees(waypoints), "someone looks elsewhere")
    page.tab.get_by_role("button", name="Top").click()
    until(lambda: page.sees(waypoints), "all is seen again")
    eye = page.client.camera.position
    assert np.all(np.abs(eye - waypoints.mean(axis=0))[:2] < np.ptp(waypoints, axis=0)[:2])
    page.tab.get_by_role("button", name="Fit", exact=True).click()
    until(lambda: page.client.camera.position[2] < eye[2] - 1.0, "from the side again")
    until(lambda: page.sees(waypoints), "and all is seen")
    before = page.total()
    page.open("Course")
    page.tab.get_by_role("button", name="Delete it").click()
    until(lambda: len(server.page.edited.waypoints) == 199, "deleted")
    page.settled()
    assert page.total() != before
    assert page.badge() == "✓ certified"
    page.picture(screenshots, "200_waypoints")
    page.tab.get_by_role("button", name="Undo").click()
    page.tab.get_by_role("button", name="Undo").click()
    until(lambda: server.page.edited is first, "loading is undone")
    page.settled()
    until(lambda: page.sees(first.waypoints), "the first course is framed again")
