"""The yaw along a flight: a cubic spline in time, as near to what is asked as its limits allow.

Every piece of the flight is cut into even parts, whose borders are the knots of a cubic B-spline.
Yaw rate and acceleration are linear in its control points and lie in the hull of theirs, so limits
at every instant are limits on differences of control points: a convex quadratic program whose
matrices are bands, solved in linear time (`peakflight.banded_program`).

Where limits are about the body, that spline is what is added to the yaw at which the vehicle does
not turn about its thrust (`peakflight.twist`): its rate and acceleration are those of the body.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline

from peakflight.airframe import SPIN
from peakflight.banded_program import Bounds, least_scale, least_squares
from peakflight.problem import Problem
from peakflight.trajectory import Trajectory
from peakflight.twist import untwisted
from peakflight.yaw import Heading, unwrapped

SPACING = 0.05
"""Largest distance of knots, s: a third of the time in which the default acceleration reaches the
default rate."""
PARTS = (4, 400)
"""Fewest parts of a piece, so that every waypoint has control points of its own; and most."""
SAMPLES = 4
"""Points of a part at which a target is followed."""
SMOOTHING = 0.02
"""Time over which a target is smoothed, s: details shorter than this are not followed."""
SLOW = 1e-3
"""Below this part of the largest horizontal speed, or distance to the point, a direction is not
defined; the last one holds."""
FAITH = 0.01
"""Least weight of a sample beside those at full speed: where the vehicle hardly moves, the nose may
turn ahead to where it goes next."""
BRISK = 0.1
"""Part of the largest horizontal speed, or distance, at which a sample has half its weight."""
CAUTION = 1e-4
"""How much further than needed a flight is slowed down, relative: it leaves room to be smooth."""
SPARED = 0.05
"""Part of what hovering leaves of a rotor's range, at the nearer end, that turning about z to
follow a direction may take: the nose rather lags than slows the flight down."""
SAFETY = 1e-7
"""Part of a limit that is left to rounding; the certificate knows nothing of it."""
ROUNDS = 30
"""Most linear programs to the smallest stretch; 2 to 8 are usual."""
CLOSENESS = 1e-7
"""Relative change of the stretch at which that ends."""
CLOSE = 3e-4
"""Part of what turning about z may take that a free nose may be off by."""
FINER = 2
"""Parts of the yaw without turning to one of the spline that is added to it, at least."""
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)


class Turning(NamedTuple):
    """A yaw motion, and what it asks of the flight."""

    yaw: Trajectory | None
    """One axis, rad, on knots of its own; None if none was found."""
    stretch: float
    """How much slower the flight has to be for it, 1 if not at all; `yaw` is for that flight, or
    None where it has to be found anew then."""
    deviation: float
    """Largest difference from what is followed, rad; 0 if waypoints or a fixed yaw are met."""


def turning(
    problem: Problem, trajectory: Trajectory, pieces: tuple[int, ...], *, share: float = 1.0
) -> Turning:
    """The yaw that a problem asks for along a trajectory.

    Parameters
    ----------
    problem
        With a heading.
    trajectory
        (K,) pieces in three axes that answer it.
    pieces
        (legs,) how many pieces each leg has.
    share
        Part of the limits that may be used.
    """
    heading = problem.heading
    assert heading is not None
    if heading.policy == "fixed":
        constant = np.full((1, 1, 1), heading.angle)
        yaw = Trajectory(constant, [trajectory.duration], trajectory.start_time)  # type: ignore[arg-type]
        return Turning(yaw, 1.0, 0.0)
    spline = _Spline.of(trajectory.segment_times)
    heading = _sparing(problem, heading).within(share)
    free = None
    if heading.is_about_body:
        free = untwisted(
            trajectory,
            FINER * np.diff(spline.firsts),
            problem.airframe,
            closeness=_closeness(problem, heading),
        )
        if heading.policy == "free":
            return Turning(free, 1.0, 0.0)
    if heading.angles is not None:
        marks = spline.firsts[np.concatenate(([0], np.cumsum(pieces)))]
        angles = np.array(heading.angles)
        if free is not None:
            angles = angles - free(_clipped(free, free.start_time + spline.knots[3 + marks]))[:, 0]
        found = _through(heading, spline, marks, unwrapped(angles), trajectory)
    else:
        found = _following(heading, spline, trajectory, free)
    if free is None or found.yaw is None:
        return found
    if found.stretch > 1.0:  # a slower flight swings its thrust otherwise
        return found._replace(yaw=None)
    return found._replace(yaw=_added(free, found.yaw))


def _added(free: Trajectory, more: Trajectory) -> Trajectory:
    """The sum of two yaw motions, of which each piece of the first lies within one of the other."""
    middles = free.breakpoints[:-1] + 0.5 * free.segment_times
    piece = np.searchsorted(more.breakpoints[1:-1], middles)
    local = np.maximum(free.breakpoints[:-1] - more.breakpoints[piece], 0.0)
    coefficients = free.coefficients.copy()
    for order in range(more.degree + 1):
        coefficients[:, order] += more.at(piece, local, order) / math.factorial(order)
    return Trajectory(coefficients, free.segment_times, free.start_time)


def _closeness(problem: Problem, heading: Heading) -> float:
    """How near to not turning about z a free nose has to be, rad/s^2."""
    rooms, airframe = problem.limits.rotor_rooms, problem.limits.airframe
    allowed = [] if heading.acceleration is None else [heading.acceleration]
    if rooms and airframe is not None and airframe.can_steer:
        spin = float(airframe.steering[SPIN])
        allowed.append(min(rooms.values()) * 4.0 / (airframe.mass * spin))
    return CLOSE * min(allowed, default=math.inf)


def _sparing(problem: Problem, heading: Heading) -> Heading:
    """A heading that follows, changing its rate no faster than `SPARED` of the rotors gives."""
    rooms, airframe = problem.limits.rotor_rooms, problem.limits.airframe
    if not (rooms and heading.follows and heading.is_about_body and airframe is not None):
        return heading
    spin = float(airframe.steering[SPIN])
    most = SPARED * min(rooms.values()) * 4.0 / (airframe.mass * spin)
    given = heading.acceleration
    return replace(heading, acceleration=most if given is None else min(given, most))


def _through(
    heading: Heading, spline: "_Spline", marks: np.ndarray, angles: np.ndarray, flight: Trajectory
) -> Turning:
    """The yaw of least squared acceleration through (n,) angles at (n,) knots."""
    free, fixed = spline.eliminated(marks, angles)
    bounds, order = _bounds(heading, spline, free, fixed)
    x = _smoothest(spline, free, fixed, bounds._replace(fixed=np.full(len(order), np.inf)))
    stretch = 1.0
    if x is not None:
        values = np.abs(bounds.rows @ x + bounds.offset) / bounds.fixed
        stretch = float((values ** (1.0 / order)).max(initial=1.0))
    if stretch > 1.0:  # it does for this spline, but another may do with less
        bounds, order = _bounds(heading, spline.stretched(stretch), free, fixed)
        scale = _least_scale(bounds, order, 1.0 / stretch)
        stretch = max(1.0, stretch * min(1.0, scale * (1.0 + CAUTION)))
        spline = spline.stretched(stretch)
        bounds, _ = _bounds(heading, spline, free, fixed)
        x = _smoothest(spline, free, fixed, bounds)
    if x is None:
        return Turning(None, 1.0, 0.0)
    control = free @ x + fixed
    return Turning(spline.trajectory(control, flight.start_time), stretch, 0.0)


def _smoothest(
    spline: "_Spline", free: sparse.csr_array, fixed: np.ndarray, bounds: Bounds
) -> np.ndarray | None:
    """The x of least squared acceleration under bounds, where control points are free x + fixed."""
    rows = spline.roughness()
    return least_squares(sparse.csr_array(rows @ free), -(rows @ fixed), bounds)


def _least_scale(bounds: Bounds, order: np.ndarray, enough: float) -> float:
    """Least part of the time in which bounds can be kept, 1 if no less is found.

    Or one below `enough`. In a part s of the time the limits allow s times the rate and s^2 times
    the acceleration. The latter is not linear in s; its tangent at the last s is below it, so what
    each round finds is feasible, and no worse than the last.
    """
    is_squared = order == 2.0
    last = 1.0
    for _ in range(ROUNDS):
        tangent = bounds._replace(
            fixed=np.where(is_squared, -(last**2), 0.0) * bounds.fixed,
            growing=np.where(is_squared, 2.0 * last, 1.0) * bounds.fixed,
        )
        scale = least_scale(tangent, enough=enough / (1.0 + CAUTION))
        if scale is None or abs(scale - last) <= CLOSENESS * last:
            break
        last = scale
        if scale * (1.0 + CAUTION) <= enough:
            break
    return last


def _following(
    heading: Heading, spline: "_Spline", trajectory: Trajectory, base: Trajectory | None
) -> Turning:
    """The yaw nearest to the direction of the velocity, or to a point; less the base's, if any."""
    times = sample_times(spline.parts)
    target, trust = followed(heading, trajectory, trajectory.start_time + times)
    if base is not None:
        target = target - base(_clipped(base, base.start_time + times))[:, 0]
    free = spline.at_rest()
    basis = spline.basis(times)
    weights = np.sqrt(trust * np.repeat(spline.parts, SAMPLES) / SAMPLES)
    centre = float(target[0])
    roughness = SMOOTHING**2 * spline.roughness()
    rows = sparse.vstack((sparse.diags_array(weights) @ basis, roughness)) @ free
    wanted = np.concatenate((weights * (target - centre), np.zeros(roughness.shape[0])))
    offset = np.zeros(free.shape[0])
    bounds, _ = _bounds(heading, spline, free, offset)
    x = least_squares(sparse.csr_array(rows), wanted, bounds)
    if x is None:
        return Turning(None, 1.0, np.nan)
    control = free @ x + centre
    deviation = float(np.abs(basis @ control - target).max())
    return Turning(spline.trajectory(control, trajectory.start_time), 1.0, deviation)


def sample_times(parts: np.ndarray) -> np.ndarray:
    """(M SAMPLES,) s since the first of (M,) s parts began, at which a direction is followed."""
    begins = np.cumsum(parts) - parts
    inside = (np.arange(SAMPLES) + 0.5) / SAMPLES
    times: np.ndarray = (begins[:, None] + parts[:, None] * inside).ravel()
    return times


def followed(
    heading: Heading, trajectory: Trajectory, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The direction that a heading follows at (n,) s, and its weights, both as `directions`."""
    times = _clipped(trajectory, times)
    if heading.point is None:
        return directions(trajectory(times, derivative=1)[:, :2])
    return directions(np.array(heading.point[:2]) - trajectory(times)[:, :2])


def directions(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) rad, unwrapped, the directions of (n, 2) vectors; and (n,) how much each counts.

    A vector that is much shorter than the longest has no direction: the last one before it holds,
    and before the first direction that. Without any it is 0.
    """
    lengths = np.hypot(vectors[:, 0], vectors[:, 1])
    longest = float(lengths.max())
    known = lengths > SLOW * longest
    if not known.any():
        return np.zeros(len(vectors)), np.ones(len(vectors))
    angles = np.arctan2(vectors[:, 1], vectors[:, 0])
    last = np.maximum.accumulate(np.where(known, np.arange(len(vectors)), -1))
    last[last < 0] = int(known.argmax())
    square = (lengths / longest) ** 2
    return unwrapped(angles[last]), np.maximum(square / (square + BRISK**2), FAITH)


def _clipped(motion: Trajectory, times: np.ndarray) -> np.ndarray:
    return np.clip(times, motion.start_time, motion.end_time)


def _bounds(
    heading: Heading, spline: "_Spline", free: sparse.csr_array, fixed: np.ndarray
) -> tuple[Bounds, np.ndarray]:
    """Limits of rate and acceleration on x, where the control points are free x + fixed.

    Returns
    -------
    Bounds relative to the limits, and (m,) the order of the derivative that each is about.
    """
    rows, offsets, orders = [], [], []
    for kind, limit in heading.limits.items():
        differences = spline.differences[kind.order - 1] / limit
        rows.append(differences @ free)
        offsets.append(differences @ fixed)
        orders.append(np.full(differences.shape[0], float(kind.order)))
    if not rows:
        empty = np.zeros(0)
        return Bounds(sparse.csr_array((0, free.shape[1])), empty, empty, empty), empty
    order = np.concatenate(orders)
    room = np.full(len(order), 1.0 - SAFETY)
    every = sparse.csr_array(sparse.vstack(rows))
    return Bounds(every, np.concatenate(offsets), room, np.zeros(len(order))), order


class _Spline(NamedTuple):
    """Cubic splines on given knots, by their n = M + 3 control points."""

    parts: np.ndarray
    """(M,) s, time between knots."""
    firsts: np.ndarray
    """(K+1,) knot at which each piece of the flight begins, and the last one."""
    knots: np.ndarray
    """(M+7,) s, from 0, the first and last four times."""
    differences: tuple[sparse.csr_array, sparse.csr_array]
    """(n-1, n) and (n-2, n): control points of rate and acceleration from those of the yaw."""

    @classmethod
    def of(cls, segment_times: np.ndarray) -> "_Spline":
        """Knots for a flight of (K,) s pieces."""
        counts = np.clip(np.ceil(segment_times / SPACING), *PARTS).astype(np.int64)
        firsts = np.concatenate(([0], np.cumsum(counts)))
        return cls._on(np.repeat(segment_times / counts, counts), firsts)

    @classmethod
    def _on(cls, parts: np.ndarray, firsts: np.ndarray) -> "_Spline":
        times = np.concatenate(([0.0], np.cumsum(parts)))
        knots = np.concatenate((times[[0, 0, 0]], times, times[[-1, -1, -1]]))
        count = len(parts) + 3
        rate = 3.0 / (knots[4:-1] - knots[1:-4])
        acceleration = 2.0 / (knots[4:-2] - knots[2:-4])
        first = sparse.diags_array((-rate, rate), offsets=(0, 1), shape=(count - 1, count))
        second = sparse.diags_array(
            (-acceleration, acceleration), offsets=(0, 1), shape=(count - 2, count - 1)
        )
        return cls(
            parts, firsts, knots, (sparse.csr_array(first), sparse.csr_array(second @ first))
        )

    def stretched(self, factor: float) -> "_Spline":
        """The same knots with all times multiplied."""
        return self if factor == 1.0 else self._on(self.parts * factor, self.firsts)

    def basis(self, times: np.ndarray) -> sparse.csr_array:
        """(len(times), n): the yaw at times from the control points."""
        if len(times) == 0:
            return sparse.csr_array((0, len(self.parts) + 3))
        return sparse.csr_array(BSpline.design_matrix(times, self.knots, 3))

    def roughness(self) -> sparse.csr_array:
        """(2M, n): rows whose squares add up to the integral of the squared acceleration.

        Acceleration is linear between knots, so two points of Gauss are exact.
        """
        m = len(self.parts)
        weights = np.sqrt(0.5 * self.parts)
        rows = [
            sparse.diags_array(
                (weights * (1.0 - at), weights * at), offsets=(0, 1), shape=(m, m + 1)
            )
            for at in _GAUSS
        ]
        return sparse.csr_array(sparse.vstack(rows) @ self.differences[1])

    def at_rest(self) -> sparse.csr_array:
        """(n, n-2): control points of splines that begin and end at rate 0."""
        inner = len(self.parts) + 1
        columns = np.concatenate(([0], np.arange(inner), [inner - 1]))
        ones = np.ones(inner + 2)
        return sparse.csr_array((ones, (np.arange(inner + 2), columns)))

    def eliminated(
        self, marks: np.ndarray, values: np.ndarray
    ) -> tuple[sparse.csr_array, np.ndarray]:
        """Splines that begin and end at rate 0 and pass (n,) values at (n,) knots.

        Of the three control points that make the value at a knot, the weightiest follows from the
        other two; knots are far enough apart for them to be different ones.

        Returns
        -------
        Matrix and vector that make the control points of what stays free.
        """
        count = len(self.parts) + 3
        fixed = np.zeros(count)
        fixed[:2], fixed[-2:] = values[0], values[-1]
        inner = marks[1:-1]
        rows = self.basis(self.knots[3 + inner])  # four entries each, of which the last is 0
        members = rows.indices.reshape(-1, 4)[:, :3]
        weights = rows.data.reshape(-1, 4)[:, :3]
        chosen = weights.argmax(axis=1)
        pick = np.arange(len(inner))
        dependent, pivot = members[pick, chosen], weights[pick, chosen]
        fixed[dependent] = values[1:-1] / pivot
        is_free = np.ones(count, dtype=bool)
        is_free[[0, 1, -2, -1]] = False
        is_free[dependent] = False
        number = np.cumsum(is_free) - 1
        own = np.flatnonzero(is_free)
        others = np.array([[1, 2], [0, 2], [0, 1]])[chosen]
        partners = np.take_along_axis(members, others, axis=1)
        shares = -np.take_along_axis(weights, others, axis=1) / pivot[:, None]
        row = np.concatenate((own, np.repeat(dependent, 2)))
        column = np.concatenate((number[own], number[partners.ravel()]))
        data = np.concatenate((np.ones(len(own)), shares.ravel()))
        return sparse.csr_array((data, (row, column)), shape=(count, len(own))), fixed

    def trajectory(self, control: np.ndarray, start_time: float) -> Trajectory:
        """The spline of (n,) control points as ascending polynomials."""
        first, second = (differences @ control for differences in self.differences)
        yaw = self.basis(self.knots[3:-3]) @ control
        rate = self._rates(first)
        third = np.diff(second) / self.parts
        coefficients = np.stack((yaw[:-1], rate[:-1], second[:-1] / 2.0, third / 6.0), axis=1)
        return Trajectory(coefficients[:, :, None], self.parts, start_time)

    def _rates(self, control: np.ndarray) -> np.ndarray:
        """(M+1,) rate at the knots from its (M+2,) control points."""
        before = np.concatenate(([0.0], self.parts))
        after = np.concatenate((self.parts, [0.0]))
        share = before / (before + after)
        rates: np.ndarray = (1.0 - share) * control[:-1] + share * control[1:]
        return rates
