from collections.abc import Callable

import numpy as np
import pytest

import peakflight as pf


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
