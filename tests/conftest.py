import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import peakflight as pf

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
BROWSER_ARGUMENTS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",  # WebGL in software: 3D is drawn without a graphics card
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
NEEDS_BROWSER = "PEAKFLIGHT_NEEDS_BROWSER"
"""Environment variable with which tests that need a browser fail without one; CI sets it."""
SCREENSHOTS = Path(__file__).parent.parent / "out" / "screenshots"


def make_hand_plan(
    *,
    pieces: tuple[int, ...] = (1, 2, 1),
    degree: int = 7,
    yaw: list[float] | None = None,
    start_time: float = 0.0,
    seconds: tuple[float, float] = (0.6, 1.5),
    seed: int = 1,
) -> pf.Plan:
    """A plan that no planner made: it follows a curve of sines, smoothly, for any K pieces.

    `degree` is odd; pieces join up to the derivative (degree - 1) / 2, but at most jerk.
    """
    rng = np.random.default_rng(seed)
    count = sum(pieces)
    times = rng.uniform(*seconds, size=count)
    joints = np.concatenate(([0.0], np.cumsum(times)))[:, None, None]
    order = np.arange(4)[:, None]
    pulse, phase = rng.uniform(0.5, 1.0, size=3), rng.uniform(0.0, 6.0, size=3)
    states = 2.0 * pulse**order * np.sin(pulse * joints + phase + order * np.pi / 2)
    coefficients = np.zeros((count, degree + 1, 3))
    orders = min(degree + 1, 8) // 2
    for k, duration in enumerate(times):
        data = np.concatenate((states[k, :orders], states[k + 1, :orders]))
        coefficients[k, : 2 * orders] = np.linalg.solve(hermite_rows(duration, orders), data)
    trajectory = pf.Trajectory(coefficients, times, start_time)
    waypoints = states[np.concatenate(([0], np.cumsum(pieces))), 0]
    limits = pf.Limits(speed=5.0)
    return pf.Plan(
        problem=pf.Problem(waypoints, limits=limits, degree=degree, yaw=yaw),
        method="by hand",
        status=pf.Status.SOLVED,
        trajectory=trajectory,
        report=pf.Report(
            feasible=True, peaks={"speed": np.ones(count)}, joint_residual=0.0, waypoint_error=0.0
        ),
        pieces=pieces,
        iterations=0,
        wall_time_s=0.0,
        version=pf.__version__,
    )


def hermite_rows(duration: float, orders: int) -> np.ndarray:
    """(2n, 2n): the first n derivatives at both ends of a piece, from its coefficients."""
    count = 2 * orders
    rows = np.zeros((count, count))
    for power in range(count):
        monomial = np.polynomial.Polynomial(np.eye(count)[power])
        for order in range(orders):
            rows[order, power] = monomial(0.0)
            rows[orders + order, power] = monomial(duration)
            monomial = monomial.deriv()
    return rows


@pytest.fixture
def hand_plan() -> Callable[..., pf.Plan]:
    return make_hand_plan


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Chromium, driven by Playwright; without it tests are left out."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        path = None
    if path is None:
        reason = f"needs one of {', '.join(BROWSERS)}, and playwright from the extra dev"
        pytest.fail(reason) if os.environ.get(NEEDS_BROWSER) else pytest.skip(reason)
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=path, args=BROWSER_ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture
def screenshots() -> Path:
    """Where pictures of pages go; CI keeps them."""
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    return SCREENSHOTS
