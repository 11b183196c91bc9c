"""The planner page under a hand that never rests: how soon it follows, and whether it lasts."""

import os
import statistics
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import peakflight as pf
from benchmarks.courses import walk
from benchmarks.report import Cell, Column, Row, Table, failure, judged
from benchmarks.scope import Scope
from peakflight.page.edited import Edited
from peakflight.page.header import badge
from peakflight.page.planner_page import Page
from peakflight.page.server import PageServer

LATENCY_BARS = {10: 0.050, 50: 0.150}
"""Legs to s from a handle that moves to the path redrawn, at the paper's limits."""
VEHICLE = "crazyflie-2.1-upgrade"
DRAGS, STEPS = 1_000, 3
"""Drags, and places that a handle passes in each before it is let go."""
REACH = 0.4
"""How far a handle goes from where it belongs, m."""
GROWTH_BAR = 20.0
"""MB that all processes may grow by over the drags after the first tenth."""
SEED = 8
PATIENCE = 300.0
"""s; the first plan of a quick run compiles."""

LATENCY_COLUMNS: list[Column] = [
    ("limits", ""), ("legs", ",d"), ("moves", "d"), ("median [ms]", ".1f"), ("90 % [ms]", ".1f"),
    ("most [ms]", ".1f"), ("at rest [ms]", ".1f"),
]  # fmt: skip
DRAG_COLUMNS: list[Column] = [
    ("drags", ",d"), ("plans drawn", ",d"), ("errors", "d"),
    ("looks called certified", ",d"), ("of another course", "d"), ("plans not proven", "d"),
    ("memory before [MB]", ".0f"), ("after [MB]", ".0f"),
    ("seconds", ".0f"),
]  # fmt: skip


def run(scope: Scope) -> list[Table]:
    """Latency by length of course, and a thousand drags."""
    moves = scope.pick(10, 100)
    rows = [_latency(legs, None, moves, bar) for legs, bar in LATENCY_BARS.items()]
    rows += [_latency(200, None, scope.pick(5, 40), None)]
    rows += [_latency(legs, VEHICLE, scope.pick(5, 40), None) for legs in LATENCY_BARS]
    return [
        Table(
            title="Planner page: from a handle to the path",
            note="From a handle that moves to the redrawn path on its way to the browser, wall "
            "time, while a client reads all that is sent. At rest: the whole plan, as `peakflight "
            "plan` gives it, from when the handle is let go.",
            columns=LATENCY_COLUMNS,
            rows=rows,
        ),
        Table(
            title="Planner page: random drags",
            note="10 legs. The page is looked at between what it does: whether what it calls "
            "certified goes through the waypoints as they are; each plan that it calls proven is "
            "proven again. Memory is that "
            "of the server and both planning processes, after the first tenth and at the end.",
            columns=DRAG_COLUMNS,
            rows=[_drags(scope.pick(30, DRAGS))],
        ),
    ]


def _latency(legs: int, vehicle: str | None, moves: int, bar: float | None) -> Row:
    cells: dict[str, Cell] = {"limits": vehicle or "the paper's", "legs": legs, "moves": moves}
    words = "" if bar is None else f"<= {1e3 * bar:.0f} ms"
    rng = np.random.default_rng(SEED)
    try:
        with _served(legs, vehicle) as server:
            page = server.page
            _rest(server)
            index = legs // 2
            home = page.edited.waypoints[index].copy()
            times, rests = [], []
            page.move(index, home, "start")
            for _ in range(moves):
                place = home + rng.uniform(-REACH, REACH, 3)
                times.append(_follow(server, index, place))
            for _ in range(max(moves // 10, 1)):
                place = home + rng.uniform(-REACH, REACH, 3)
                _follow(server, index, place)
                began = time.perf_counter()
                page.move(index, place, "end")
                _rest(server)
                rests.append(time.perf_counter() - began)
    except Exception as error:
        return failure(cells, error, words)
    cells |= {
        "median [ms]": 1e3 * statistics.median(times),
        "90 % [ms]": 1e3 * float(np.quantile(times, 0.9)),
        "most [ms]": 1e3 * max(times),
        "at rest [ms]": 1e3 * statistics.median(rests),
    }
    return Row(cells=cells) if bar is None else judged(cells, "median [ms]", 1e3 * bar, words)


def _follow(server: PageServer, index: int, place: np.ndarray) -> float:
    """Move a handle; the time until a plan through it is drawn, s."""
    page = server.page
    began = time.perf_counter()
    page.move(index, place, "update")
    while True:
        plan = page.drawn
        if plan is not None and np.array_equal(plan.problem.waypoints[index], place):
            page.thread.settle()  # the path, the time and the plots have been sent
            return time.perf_counter() - began
        if time.perf_counter() - began > PATIENCE:
            raise TimeoutError(f"no plan in {PATIENCE:g} s")
        time.sleep(2e-4)


def _rest(server: PageServer) -> None:
    """Wait until the course as it is has been planned in whole and drawn."""
    page, began = server.page, time.perf_counter()
    while not (
        page.thread.settle() and page.planner.idle and page.summary.fresh and page.summary.whole
    ):
        if time.perf_counter() - began > PATIENCE:
            raise TimeoutError(f"no whole plan in {PATIENCE:g} s")
        time.sleep(2e-4)


def _drags(count: int) -> Row:
    cells: dict[str, Cell] = {"drags": count}
    bar = f"no error, all proven, <= {GROWTH_BAR:g} MB"
    rng = np.random.default_rng(SEED)
    drawn = errors = certified = unproven = outdated = 0
    seen: list[_Look] = []
    before = after = 0.0
    began = time.perf_counter()
    try:
        with _served(10, None) as server:
            page = server.page
            _rest(server)
            homes = page.edited.waypoints.copy()
            last: pf.Plan | None = None
            for drag in range(count):
                if drag == count // 10:
                    before = _memory(server)
                index = int(rng.integers(len(homes)))
                for step in range(STEPS):
                    place = homes[index] + rng.uniform(-REACH, REACH, 3)
                    page.move(index, place, "update" if step else "start")
                    time.sleep(float(rng.uniform(0.0, 0.04)))
                    page.thread.post(partial(_look, page, seen))
                page.move(index, place, "end")
                if drag % 10 == 0:
                    _rest(server)
                    page.thread.post(partial(_look, page, seen))
                errors += bool(page.summary.error)
                page.thread.settle()
                for look in seen:
                    outdated += look.word == CERTIFIED and not look.is_of_course
                    certified += look.word == CERTIFIED
                    if look.plan is not None and look.plan is not last:
                        last, drawn = look.plan, drawn + 1
                        unproven += look.word in PROVEN and not pf.certify_plan(last).feasible
                seen.clear()
            _rest(server)
            errors += page.thread.failures
            after = _memory(server)
    except Exception as error:
        return failure(cells, error, bar)
    cells |= {
        "plans drawn": drawn,
        "errors": errors,
        "looks called certified": certified,
        "of another course": outdated,
        "plans not proven": unproven,
        "memory before [MB]": before,
        "after [MB]": after,
        "seconds": time.perf_counter() - began,
    }
    met = not (errors or unproven or outdated) and certified > 0 and after - before <= GROWTH_BAR
    return Row(cells=cells, bar=bar, met=met)


CERTIFIED, PROVEN = "certified", ("certified", "draft, proven")
"""What the badge says."""


class _Look(NamedTuple):
    """What the page says at a moment."""

    plan: pf.Plan | None
    word: str
    is_of_course: bool
    """Whether the plan that is drawn goes through the waypoints as they are."""


def _look(page: Page, seen: list[_Look]) -> None:
    """On the thread of the page, between what it does."""
    plan = page.drawn
    through = plan is not None and np.array_equal(plan.problem.waypoints, page.edited.waypoints)
    seen.append(_Look(plan, badge(page.summary)[0], through))


@contextmanager
def _served(legs: int, vehicle: str | None) -> Iterator[PageServer]:
    """A page with a random course, and a client that reads all that it sends."""
    edited = Edited.of_course(pf.Course(walk(legs) + np.array([0.0, 0.0, 5.0])))
    if vehicle is not None:
        edited = edited.fly(pf.find_vehicle(vehicle))
    server = PageServer(edited, port=0)
    reader = threading.Thread(target=_read, args=(server.viser.get_port(),), daemon=True)
    try:
        reader.start()
        yield server
    finally:
        server.close()
        reader.join()


def _read(port: int) -> None:
    import viser
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    protocol = f"viser-v{viser.__version__}"
    url = f"ws://127.0.0.1:{port}"
    with connect(url, subprotocols=[protocol], max_size=None) as client:  # type: ignore[list-item]
        try:
            while True:
                client.recv()
        except ConnectionClosed:
            return


def _memory(server: PageServer) -> float:
    """Of the server and the processes that plan, MB; NaN where the system does not say."""
    total = 0.0
    for pid in (os.getpid(), *server.page.planner.pids):
        status = Path(f"/proc/{pid}/status")
        if not status.exists():
            return float("nan")
        line = next(line for line in status.read_text().splitlines() if line.startswith("VmRSS"))
        total += float(line.split()[1]) / 1024.0
    return total
