"""Other packages that choose their times, each behind one function of one signature.

An adapter takes a problem at rest at both ends and gives a call back; the call plans from scratch
and returns an `Answer`. What a package leaves out of the limits stands beside its name.
"""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from math import factorial
from typing import Any, NamedTuple

import numba as nb
import numpy as np

import peakflight as pf

DEGREE = 5
"""Of all their splines: minimum jerk, two continuous derivatives."""
PENALTIES = (10.0, 100.0, 1e3, 1e4)
"""Weights of the soft limits, one run each, from where the last has ended."""
PENALTY_STEPS = 16
"""Points of a piece at which soft limits are looked at."""
GRID = 20
"""Points of a leg between which toppra keeps the acceleration of the path parameter."""
CONTROLS = 4
"""Control points a leg that drake gets, beside those of the ends."""
SHORTEST = 1e-6
"""s: pieces of a B-spline shorter than this are joined to their neighbour."""


@dataclass(frozen=True)
class Answer:
    """What a package has planned."""

    raw: pf.Trajectory
    """Its own motion, as polynomials."""
    pieces: tuple[int, ...]
    """(legs,) polynomials in each leg."""
    times: np.ndarray | None = None
    """(legs,) s, where its own motion cannot be stretched to the limits: a spline of least effort
    is flown at these times in its place."""


Plan = Callable[[], Answer]


class Planner(NamedTuple):
    """Another package."""

    name: str
    prepare: Callable[[pf.Problem], Plan]
    note: str
    """How it takes the limits."""


class PlanningFailed(Exception):
    """The package says that it has not succeeded."""


def box(limits: pf.Limits) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Boxes, each axis for itself, inside the limits on norms: lowest and highest of each axis.

    That of the acceleration is in thrust a box around zero whose top is as far above gravity as
    the sides are from it: 2 b^2 + (g + b)^2 = L^2.
    """
    found = {}
    for name, limit in (("speed", limits.speed), ("jerk", limits.jerk)):
        if limit is not None:
            found[name] = (np.full(3, -limit / np.sqrt(3.0)), np.full(3, limit / np.sqrt(3.0)))
    thrust = limits.thrust_acceleration
    if thrust is not None:
        g = pf.GRAVITY
        side = (np.sqrt(3.0 * thrust**2 - 2.0 * g**2) - g) / 3.0
        found["acceleration"] = (np.array([-side, -side, -2.0 * g - side]), np.full(3, side))
    return found


def _spline_trajectory(problem: pf.Problem) -> Plan:
    """Its optimiser of times, with cubic penalties on the four squared norms."""
    package = import_module("spline_trajectory")
    limits, points = problem.limits, problem.waypoints
    squares = np.array(
        [limits.speed, limits.thrust_acceleration, limits.jerk, limits.snap], dtype=float
    )
    squares **= 2
    mask = package.OptimizationMask()
    mask.waypoints, mask.time = [0] * len(points), [1] * (len(points) - 1)
    optimizer = package.QuinticOptimizer3D()
    optimizer.set_config(rho_energy=0.0, integral_num_steps=PENALTY_STEPS)
    begin = pf.plan(problem, method="proportional").segment_times
    seen: list[np.ndarray] = []

    def time_cost(times: np.ndarray) -> tuple[float, np.ndarray]:
        seen[:] = [np.array(times)]
        return float(times.sum()), np.ones_like(times)

    def plan() -> Answer:
        times = begin
        for weight in PENALTIES:
            context = optimizer.prepare_context(
                times.tolist(), points, package.BoundaryConditions3D(), mask
            )
            penalty = _Penalty(squares, weight)
            result = package.optimize(optimizer, context, time_cost, penalty)
            optimizer.evaluate(context, result.x, time_cost, penalty)
            times = seen[0]
        if not np.isfinite(times).all():
            raise PlanningFailed("times that are not finite")
        raw = pf.minimum_effort_spline(points, times, minimize="jerk", degree=DEGREE)
        return Answer(raw, (1,) * len(times))

    return plan


class _Penalty:
    """What its optimiser calls at every sample."""

    def __init__(self, squares: np.ndarray, weight: float) -> None:
        self._arguments = squares, weight, pf.GRAVITY

    def __call__(self, t: float, when: float, leg: int, step: int, *state: Any) -> tuple[Any, ...]:
        cost, gradient = _penalty(*state[1:], *self._arguments)
        return (cost, gradient[0], *gradient[1:], 0.0)


@nb.njit(cache=True)
def _penalty(velocity, acceleration, jerk, snap, squares, weight, gravity):
    """Cost and gradient (5, 3) by position and its four derivatives."""
    gradient = np.zeros((5, 3))
    cost = 0.0
    values = (velocity, acceleration, jerk, snap)
    for order in range(4):
        x, y, z = values[order][0], values[order][1], values[order][2]
        if order == 1:
            z += gravity
        excess = (x * x + y * y + z * z) / squares[order] - 1.0
        if excess > 0.0:
            cost += weight * excess**3
            slope = 6.0 * weight * excess * excess / squares[order]
            gradient[order + 1, 0] = slope * x
            gradient[order + 1, 1] = slope * y
            gradient[order + 1, 2] = slope * z
    return cost, gradient


def _toppra(problem: pf.Problem) -> Plan:
    """The fastest way along the minimum-jerk path at proportional times, free at its ends."""
    toppra = import_module("toppra")
    constraint = import_module("toppra.constraint")
    algorithm = import_module("toppra.algorithm")
    toppra.setup_logging("CRITICAL")
    points = problem.waypoints
    boxes = box(problem.limits)

    class Path(toppra.interpolator.AbstractGeometricPath):
        """A spline of ours, in its terms."""

        def __init__(self, spline: pf.Trajectory) -> None:
            self._spline = spline

        def __call__(self, positions: Any, order: int = 0) -> np.ndarray:
            return self._spline(positions, order)

        @property
        def dof(self) -> int:
            return 3

        @property
        def path_interval(self) -> np.ndarray:
            return np.array([0.0, self._spline.duration])

        @property
        def waypoints(self) -> tuple[np.ndarray, np.ndarray]:
            return self._spline.breakpoints, points

    limits = [
        constraint.JointVelocityConstraint(np.transpose(boxes["speed"])),
        constraint.JointAccelerationConstraint(np.transpose(boxes["acceleration"])),
    ]
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    free = np.full((2, 3), np.nan)

    def plan() -> Answer:
        spline = pf.minimum_effort_spline(
            points, lengths, minimize="jerk", degree=DEGREE, start=free, end=free
        )
        parts = np.linspace(0.0, 1.0, GRID, endpoint=False)
        grid = np.append((spline.breakpoints[:-1, None] + lengths[:, None] * parts).ravel(), 0.0)
        grid[-1] = spline.duration
        instance = algorithm.TOPPRA(limits, Path(spline), gridpoints=grid)
        second, first, _ = instance.compute_parameterization(0.0, 0.0)
        if second is None or np.isnan(first).any():
            raise PlanningFailed("no parametrisation of the path")
        times = 2.0 * np.diff(grid) / (first[:-1] + first[1:])
        raw = pf.Trajectory(_composed(spline, GRID, grid, first, times), times)
        legs = times.reshape(-1, GRID).sum(axis=1)
        return Answer(raw, (GRID,) * len(legs), legs)

    return plan


def _composed(
    spline: pf.Trajectory, count: int, grid: np.ndarray, first: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """Coefficients in time of a path whose parameter is quadratic between the points of a grid."""
    found = np.zeros((len(times), 2 * spline.degree + 1, 3))
    for index, duration in enumerate(times):
        leg = index // count
        half = (first[index + 1] - first[index]) / (2.0 * duration)
        inner = np.polynomial.Polynomial(
            [grid[index] - spline.breakpoints[leg], first[index], half]
        )
        power = np.polynomial.Polynomial([1.0])
        for coefficient in spline.coefficients[leg]:
            found[index, : len(power.coef)] += np.outer(power.coef, coefficient)
            power = power * inner
    return found


def _drake(problem: pf.Problem) -> Plan:
    """One B-spline, its waypoints at parts of the duration that follow the distance."""
    planning = import_module("pydrake.planning")
    solvers = import_module("pydrake.solvers")
    points, boxes = problem.waypoints, box(problem.limits)
    legs = len(points) - 1
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    where = np.concatenate(([0.0], np.cumsum(lengths) / lengths.sum()))
    where[-1] = 1.0
    begin = pf.plan(problem, method="proportional").duration
    nothing = np.zeros(3)

    def plan() -> Answer:
        task = planning.KinematicTrajectoryOptimization(
            3, CONTROLS * legs + DEGREE + 1, DEGREE + 1, begin
        )
        task.AddDurationCost(1.0)
        task.AddDurationConstraint(0.01 * begin, 10.0 * begin)
        for point, part in zip(points, where, strict=True):
            task.AddPathPositionConstraint(point, point, part)
        for end in (0.0, 1.0):
            task.AddPathVelocityConstraint(nothing, nothing, end)
            task.AddPathAccelerationConstraint(nothing, nothing, end)
        task.AddVelocityBounds(*boxes["speed"])
        task.AddAccelerationBounds(*boxes["acceleration"])
        task.AddJerkBounds(*boxes["jerk"])
        result = solvers.Solve(task.prog())
        if not result.is_success():
            kind = result.get_solver_id().name()
            raise PlanningFailed(f"{kind} ends with {result.get_solution_result().name}")
        spline = task.ReconstructTrajectory(result)
        return _from_bspline(spline, where)

    return plan


def _from_bspline(spline: Any, where: np.ndarray) -> Answer:
    """Polynomials between the knots and the waypoints, by derivatives in the middle of each."""
    duration = spline.end_time() - spline.start_time()
    knots = np.array(spline.basis().knots())
    moments = where * duration
    inner = knots[np.abs(knots[:, None] - moments).min(axis=1) > SHORTEST]
    breaks = np.unique(np.concatenate((moments, inner)))
    breaks = breaks[np.concatenate(([True], np.diff(breaks) > SHORTEST))]
    times = np.diff(breaks)
    middles = breaks[:-1] + 0.5 * times
    orders = range(DEGREE + 1)
    derivatives = [spline.MakeDerivative(order) for order in orders]
    coefficients = np.empty((len(times), DEGREE + 1, 3))
    for index, (middle, half) in enumerate(zip(middles, 0.5 * times, strict=True)):
        taylor = [derivatives[order].value(middle).ravel() / factorial(order) for order in orders]
        shift = np.polynomial.Polynomial([-half, 1.0])
        for axis in range(3):
            moved = np.polynomial.Polynomial([row[axis] for row in taylor])(shift)
            coefficients[index, : len(moved.coef), axis] = moved.coef
            coefficients[index, len(moved.coef) :, axis] = 0.0
    pieces = np.histogram(middles, moments)[0]
    return Answer(pf.Trajectory(coefficients, times), tuple(int(count) for count in pieces))


PLANNERS = (
    Planner(
        "spline-trajectory", _spline_trajectory,
        "times of the min-jerk spline, all four limits as penalties",
    ),
    Planner(
        "toppra", _toppra,
        "boxes for speed and acceleration on the min-jerk path; jerk and snap are not in it",
    ),
    Planner(
        "drake", _drake,
        "one B-spline, boxes for speed, acceleration and jerk; snap is not in it",
    ),
)  # fmt: skip
