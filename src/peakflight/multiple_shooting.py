"""The shortest motion whose snap is constant over short intervals, as a program for IPOPT.

Direct multiple shooting: the states at the ends of intervals are unknowns, tied together by exact
integration of the constant snap between them. All intervals of a leg are equally long; how long is
unknown, for each interval by itself and equal to the next, so that every condition involves
neighbours only and work grows with the length of the flight. Every unknown has a unit of its own,
near the largest value that it takes, and positions are counted from the leg's first waypoint.

CasADi is imported here and nowhere else in the package, when a program is built.
"""

import math
import signal
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from typing import Any, NamedTuple, Self, TypeAlias

import numpy as np

from peakflight.errors import InvalidProblem, Status
from peakflight.limits import GRAVITY, Limits
from peakflight.trajectory import Trajectory

ORDERS = 4
"""Derivatives that make a state: position, velocity, acceleration, jerk."""
RANGE = 1e3
"""A leg may become this many times shorter or longer than in the start."""
REACH = 100.0
"""How many times the start's largest derivative a limit may be, to be of use as a unit."""
SMALLEST_SHARE = 1e-3
"""Least unit of a derivative, in units of the one below it over an interval."""
QUIET = {"print_level": 0, "sb": "yes"}
LINEAR_ALGEBRA = {"mumps_permuting_scaling": 0, "mumps_pivot_order": 0}
"""The chain of intervals needs no permuting, which takes longer than all else on long legs, and no
ordering but by least degree."""
_NAMES = ("", "speed", "thrust_acceleration", "jerk", "snap")
"""Limits on derivatives, by order."""

Symbol: TypeAlias = Any
"""A CasADi expression."""


class Instant(NamedTuple):
    """Derivatives at one instant, each a column of three expressions."""

    velocity: Symbol
    thrust: Symbol
    """Acceleration plus gravity, a + g e3."""
    jerk: Symbol
    snap: Symbol


class Expression(NamedTuple):
    """How a kind of limit is written for the optimiser."""

    rows: Callable[[Instant, float], Sequence[Symbol]]
    """From instant and limit to expressions of the order of one that must not be positive."""
    is_convex: bool = False
    """Whether what holds at both ends of an interval holds within."""


def _at_most(quantity: str) -> Callable[[Instant, float], Sequence[Symbol]]:
    """Rows of a limit on the norm of a quantity."""

    def rows(instant: Instant, limit: float) -> Sequence[Symbol]:
        return (_square(getattr(instant, quantity)) / limit**2 - 1.0,)

    return rows


def _least_thrust(instant: Instant, limit: float) -> Sequence[Symbol]:
    return (1.0 - _square(instant.thrust) / limit**2,)


def _tilt(instant: Instant, limit: float) -> Sequence[Symbol]:
    """Within the double cone around the vertical, and in its upper half."""
    across = _square(instant.thrust[:2]) / GRAVITY**2
    upward = instant.thrust[2] / GRAVITY
    return across - math.tan(limit) ** 2 * upward**2, -upward


def _body_rate(instant: Instant, limit: float) -> Sequence[Symbol]:
    """|F x j| within the limit times |F|^2."""
    turned = _square(_cross(instant.thrust, instant.jerk))
    return ((turned / limit**2 - _square(instant.thrust) ** 2) / GRAVITY**4,)


def _angular_acceleration(instant: Instant, limit: float) -> Sequence[Symbol]:
    """| |F|^2 F x s - 2 (F.j) F x j | within the limit times |F|^4."""
    thrust, square = instant.thrust, _square(instant.thrust)
    along = thrust[0] * instant.jerk[0] + thrust[1] * instant.jerk[1] + thrust[2] * instant.jerk[2]
    turned = square * _cross(thrust, instant.snap) - 2.0 * along * _cross(thrust, instant.jerk)
    return ((_square(turned) / limit**2 - square**4) / GRAVITY**8,)


def _cross(one: Symbol, other: Symbol) -> Symbol:
    import casadi as ca

    return ca.cross(one, other)


EXPRESSIONS: dict[str, Expression] = {
    "speed": Expression(_at_most("velocity")),
    "thrust_acceleration": Expression(_at_most("thrust")),
    "jerk": Expression(_at_most("jerk"), is_convex=True),  # linear in time
    "snap": Expression(_at_most("snap"), is_convex=True),
    "tilt": Expression(_tilt),
    "least_thrust_acceleration": Expression(_least_thrust),
    "body_rate": Expression(_body_rate),
    "angular_acceleration": Expression(_angular_acceleration),
}
"""Name of a kind of limit to its expression; a new kind is one entry."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Intervals, and the motion on them from which the search begins."""

    waypoints: np.ndarray
    """(legs+1, 3) m."""
    counts: np.ndarray
    """(legs,) intervals in each leg."""
    steps: np.ndarray
    """(legs,) s, length of the intervals of each leg."""
    states: np.ndarray
    """(N+1, 4, 3) position since the leg's first waypoint, velocity, acceleration, jerk."""

    @classmethod
    def of(
        cls,
        start: Trajectory,
        waypoints: np.ndarray,
        waypoint_times: np.ndarray,
        *,
        interval: float,
        fewest: int,
        most: int,
    ) -> Self:
        """Sample a trajectory.

        Parameters
        ----------
        waypoint_times
            (legs+1,) s, when it passes the waypoints.
        interval
            s, that no interval exceeds unless there would be too many.
        fewest, most
            Intervals in a leg.
        """
        times = np.diff(waypoint_times)
        counts = np.clip(np.ceil(times / interval), fewest, most).astype(int)
        steps = times / counts
        leg = np.repeat(np.arange(len(counts)), counts)
        within = np.arange(len(leg)) - (np.cumsum(counts) - counts)[leg]
        instants = np.append(waypoint_times[leg] + within * steps[leg], start.end_time)
        states = np.stack([start(instants, order) for order in range(ORDERS)], axis=1)
        states[:-1, 0] -= waypoints[leg]
        states[np.append(within == 0, True), 0] = 0.0
        return cls(waypoints, counts, steps, states)

    @cached_property
    def leg(self) -> np.ndarray:
        """(N,) leg of each interval."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def last(self) -> np.ndarray:
        """(legs,) last interval of each leg."""
        return np.cumsum(self.counts) - 1

    def leg_times(self, trajectory: Trajectory) -> np.ndarray:
        """(legs,) s, of a motion with one piece an interval."""
        return np.add.reduceat(trajectory.segment_times, self.last + 1 - self.counts)

    @property
    def intervals(self) -> int:
        """N."""
        return int(self.counts.sum())

    @property
    def duration(self) -> float:
        """Of the start, s."""
        return float(self.counts @ self.steps)

    def units(self, limits: Limits) -> np.ndarray:
        """(5,) in which position, velocity, acceleration, jerk and snap are measured.

        The largest in the start; or the limit, as far as the motion can be expected to reach it.
        """
        step = self.duration / self.intervals
        units = [float(np.abs(np.diff(self.waypoints, axis=0)).max())]
        snap = np.diff(self.states[:, ORDERS - 1], axis=0) / step
        for order, values in enumerate((*self.states[:, 1:].swapaxes(0, 1), snap), start=1):
            size = max(float(np.abs(values).max()), SMALLEST_SHARE * units[-1] / step)
            limit = getattr(limits, _NAMES[order]) or 0.0
            units.append(min(max(size, limit), REACH * size))
        return np.array(units)


@dataclass(frozen=True, eq=False)
class Solution:
    """How the search ended."""

    status: Status
    said: str
    """By the optimiser, in its words."""
    iterations: int
    trajectory: Trajectory | None
    """The motion, one piece of degree 4 an interval; None unless the status is SOLVED."""


def solve(
    grid: Grid,
    limits: Limits,
    held: Mapping[int, np.ndarray],
    *,
    points: int,
    options: Mapping[str, Any],
    on_iteration: Callable[[int], None] | None = None,
) -> Solution:
    """Find the shortest motion near the start.

    Parameters
    ----------
    held
        Waypoint to (3, 3) velocity, acceleration and jerk there, NaN where free.
    points
        Points of each interval at which limits are held, from its beginning.
    options
        Of IPOPT, by name.
    on_iteration
        Called with the number of each iteration.
    """
    ca = import_module("casadi")
    count, units = grid.intervals, grid.units(limits)
    step = _interval(ca, limits, units, points).map(count)
    scale = ca.MX.sym("scale", 1, count)
    state = ca.MX.sym("state", 3 * ORDERS, count + 1)
    snap = ca.MX.sym("snap", 3, count)
    inner = np.delete(np.arange(count), grid.last)
    following, within = step(state[:, :-1], snap, scale * ca.DM(grid.steps[grid.leg][None]))
    offsets = np.zeros((3 * ORDERS, count))
    offsets[:3, grid.last] = np.diff(grid.waypoints, axis=0).T / units[0]
    unequal = (scale[:, 1:] - scale[:, :-1])[:, inner.tolist()]
    gaps = ca.vertcat(ca.vec(following - state[:, 1:] - ca.DM(offsets)), ca.vec(unequal))
    rows = ca.vertcat(ca.vec(within), _final_rows(ca, limits, units, state[:, -1]))
    unknowns = ca.vertcat(ca.vec(scale), ca.vec(state), ca.vec(snap))
    share = grid.steps[grid.leg] / grid.duration
    program = {"x": unknowns, "f": ca.mtimes(scale, ca.DM(share)), "g": ca.vertcat(gaps, rows)}
    watch = _watch(ca, int(unknowns.shape[0]), int(gaps.shape[0] + rows.shape[0]), on_iteration)
    solver = ca.nlpsol(
        "bound",
        "ipopt",
        program,
        {
            "print_time": False,
            "error_on_fail": False,
            "show_eval_warnings": False,
            "iteration_callback": watch,
            "ipopt": {**QUIET, **LINEAR_ALGEBRA, **options},
        },
    )
    first, lowest, highest = _start(grid, units, held)
    zeros, below = np.zeros(gaps.shape[0]), np.full(rows.shape[0], -np.inf)
    with watch.interrupts():
        found = solver(
            x0=first,
            lbx=lowest,
            ubx=highest,
            lbg=np.concatenate((zeros, below)),
            ubg=np.zeros(len(zeros) + len(below)),
        )
    if watch.error is not None:
        raise watch.error
    said, iterations = str(solver.stats()["return_status"]), int(solver.stats()["iter_count"])
    status = _STATUSES.get(said, Status.NUMERICAL)
    trajectory = None
    if status is Status.SOLVED:
        try:
            trajectory = _trajectory(grid, units, np.array(found["x"]).ravel())
        except InvalidProblem as error:
            status, said = Status.NUMERICAL, f"{said}, but {error}"
    return Solution(status, said, iterations, trajectory)


_STATUSES = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "Search_Direction_Becomes_Too_Small": Status.NO_PROGRESS,
    "Feasible_Point_Found": Status.NO_PROGRESS,
    "Restoration_Failed": Status.NO_PROGRESS,
    "Diverging_Iterates": Status.NO_PROGRESS,
}


def _interval(ca: Any, limits: Limits, units: np.ndarray, points: int) -> Symbol:
    """Function of state, snap and length of an interval: the state at its end, and the limits."""
    state, scaled, length = ca.SX.sym("state", 12), ca.SX.sym("snap", 3), ca.SX.sym("length")
    parts = [state[3 * order : 3 * order + 3] * units[order] for order in range(ORDERS)]
    parts.append(scaled * units[ORDERS])
    following = ca.vertcat(
        *(_after(parts, order, length) / units[order] for order in range(ORDERS))
    )
    rows: list[Symbol] = []
    for point in range(points):
        instant = _instant(
            ca, [_after(parts, order, point / points * length) for order in range(1, ORDERS + 1)]
        )
        for kind in limits.active:
            expression = EXPRESSIONS[kind.name]
            if point == 0 or not expression.is_convex:
                rows += expression.rows(instant, getattr(limits, kind.name))
    return ca.Function("interval", [state, scaled, length], [following, ca.vertcat(*rows)])


def _final_rows(ca: Any, limits: Limits, units: np.ndarray, state: Symbol) -> Symbol:
    """Limits at the end of the flight."""
    parts = [state[3 * order : 3 * order + 3] * units[order] for order in range(1, ORDERS)]
    instant = _instant(ca, [*parts, ca.MX.zeros(3)])
    rows: list[Symbol] = []
    for kind in limits.active:
        if kind.order < ORDERS:
            rows += EXPRESSIONS[kind.name].rows(instant, getattr(limits, kind.name))
    return ca.vertcat(*rows)


def _instant(ca: Any, derivatives: Sequence[Symbol]) -> Instant:
    velocity, acceleration, jerk, snap = derivatives
    return Instant(velocity, acceleration + ca.DM([0.0, 0.0, GRAVITY]), jerk, snap)


def _after(parts: Sequence[Symbol], order: int, time: Symbol) -> Symbol:
    """A derivative some time after the state: constant snap, integrated exactly."""
    value = parts[order]
    power: Symbol = 1.0
    for further, part in enumerate(parts[order + 1 :], start=1):
        power = power * time / further
        value = value + power * part
    return value


def _square(column: Symbol) -> Symbol:
    """The sum of squares."""
    return sum((column[axis] ** 2 for axis in range(1, column.shape[0])), column[0] ** 2)


def _start(
    grid: Grid, units: np.ndarray, held: Mapping[int, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First, lowest and highest values of all unknowns."""
    states = grid.states / units[:ORDERS, None]
    lowest, highest = np.full_like(states, -np.inf), np.full_like(states, np.inf)
    nodes = np.concatenate(([0], grid.last + 1))
    lowest[nodes, 0] = highest[nodes, 0] = 0.0
    for index, state in held.items():
        known = np.isfinite(state)
        scaled = state / units[1:ORDERS, None]
        for values in (states, lowest, highest):
            values[nodes[index], 1:][known] = scaled[known]
    jerk = states[:, ORDERS - 1] * units[ORDERS - 1]
    snap = np.diff(jerk, axis=0) / (grid.steps[grid.leg, None] * units[ORDERS])
    free = np.full(snap.size, np.inf)
    return (
        np.concatenate((np.ones(grid.intervals), states.ravel(), snap.ravel())),
        np.concatenate((np.full(grid.intervals, 1.0 / RANGE), lowest.ravel(), -free)),
        np.concatenate((np.full(grid.intervals, RANGE), highest.ravel(), free)),
    )


def _trajectory(grid: Grid, units: np.ndarray, values: np.ndarray) -> Trajectory:
    """The motion that values of the unknowns stand for."""
    count = grid.intervals
    scale, states, snap = np.split(values, (count, count + 3 * ORDERS * (count + 1)))
    coefficients = np.empty((count, ORDERS + 1, 3))
    coefficients[:, :ORDERS] = states.reshape(-1, ORDERS, 3)[:-1] * units[:ORDERS, None]
    coefficients[:, ORDERS] = snap.reshape(-1, 3) * units[ORDERS]
    coefficients /= np.array([math.factorial(order) for order in range(ORDERS + 1)])[:, None]
    coefficients[:, 0] += grid.waypoints[grid.leg]
    return Trajectory(coefficients, scale * grid.steps[grid.leg])


def _watch(ca: Any, unknowns: int, rows: int, on_iteration: Callable[[int], None] | None) -> Any:
    """What IPOPT calls after each iteration; an error there, as by Ctrl-C, ends the search."""

    class Watch(ca.Callback):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.error: BaseException | None = None
            self.iteration = 0
            self.construct("watch", {})

        def get_n_in(self) -> int:
            return int(ca.nlpsol_n_out())

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, index: int) -> Any:
            name = ca.nlpsol_out(index)
            sizes = {"f": 1, "x": unknowns, "lam_x": unknowns, "g": rows, "lam_g": rows}
            return ca.Sparsity.dense(sizes[name], 1) if name in sizes else ca.Sparsity(0, 0)

        def eval(self, _: Any) -> list[int]:
            try:
                if on_iteration is not None:
                    on_iteration(self.iteration)
                self.iteration += 1
            except BaseException as error:
                self.error = error
            return [0 if self.error is None else 1]

        @contextmanager
        def interrupts(self) -> Iterator[None]:
            """Keep Ctrl-C until the iteration ends: CasADi would print a warning and go on."""
            if threading.current_thread() is not threading.main_thread():
                yield
                return
            before = signal.signal(signal.SIGINT, self._keep)
            try:
                yield
            finally:
                signal.signal(signal.SIGINT, before)

        def _keep(self, *_: Any) -> None:
            self.error = KeyboardInterrupt()

    return Watch()
