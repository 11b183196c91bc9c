"""Plans that are changed and proven again: slower, delayed, turned, moved, scaled, backwards.

Every function takes a plan and returns a new one, certified from its coefficients against the same
limits. Gravity decides what keeps them: turning about the vertical, mirroring at a vertical plane
and moving do, for every kind of limit. Backwards, a motion has the same speed, acceleration, jerk
and snap at the same points. Scaled, or at another pace, a flight has to be looked at anew: where a
limit is exceeded the report of the new plan says so, and `keep_limits` slows it down.

The yaw goes along with the flight, and so does what is asked of it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from numbers import Real

import numpy as np
from numpy.typing import ArrayLike

from peakflight.certificate import certify_answer, stretch_to_limits
from peakflight.errors import InvalidProblem, Status
from peakflight.limits import UNBOUNDED, Limits
from peakflight.problem import Problem, as_float_array
from peakflight.result import Plan
from peakflight.trajectory import LONGEST, SHORTEST, Trajectory
from peakflight.version import __version__
from peakflight.yaw import Heading

ATTITUDE = 2
"""Highest derivative that an edit keeps continuous at least, so that attitude does not jump."""
LEAST_STEP, LARGEST_STEP, STEPS = 1e-10, 1e-2, 200
"""How much slower, relative, a flight gets at first and at most, and how often, where a limit is
still exceeded: by rounding, or because a slower flight need not turn its thrust more slowly."""
NO_CHANGE = 1e-9
"""A plan that keeps its limits is left as it is where its pace would change by less, relative."""
STEP_GROWTH = 4.0
"""Of one such step over the one before."""
ROUNDING = 1e-12
"""How much slower than needed a flight is, relative, so that rounding does not exceed a limit."""
MIRRORS = {"x": (-1.0, 1.0, 1.0), "y": (1.0, -1.0, 1.0)}
"""Axis that is flipped to the signs of all three."""


def slow(plan: Plan, part: float) -> Plan:
    """Fly the same path at a part of its pace, above 0 and at most 1.

    Raises
    ------
    InvalidProblem
        If the part is out of range.
    """
    if not 0.0 < part <= 1.0:
        raise InvalidProblem(
            f"the pace is {100.0 * part:g} %; it must be above 0 and at most 100 %"
        )
    return _stretched(plan, 1.0 / part, f"slowed down to {100.0 * part:g} %")


def to_duration(plan: Plan, duration: float) -> Plan:
    """Fly the same path in a given time, s, slower or faster.

    Raises
    ------
    InvalidProblem
        If the time is not positive and finite.
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise InvalidProblem(f"the duration is {duration:g} s; it must be positive and finite")
    return _stretched(plan, duration / plan.duration, f"made to last {duration:g} s")


def retime(plan: Plan, *, limits: Limits | None = None) -> Plan:
    """Fly the same path as fast as the limits allow: the exact uniform stretch.

    Parameters
    ----------
    limits
        To keep from now on; by default the plan's own.

    Returns
    -------
    The plan at the pace of the limits; at its own if no pace keeps them.
    """
    if limits is not None:
        plan = under_limits(plan, limits)
    return _fitted(plan, least=0.0)


def keep_limits(plan: Plan) -> Plan:
    """Slow a plan down as far as it needs to keep its limits; as it is if it keeps them."""
    return plan if plan.feasible else _fitted(plan, least=1.0)


def under_limits(plan: Plan, limits: Limits) -> Plan:
    """The same flight, proven against other limits; those of a vehicle are replaced as a whole.

    Limits on rotors decide what is asked of a nose about which nothing is said, and what its limits
    are about: where that changes, the yaw is planned anew, or left out.
    """
    problem = replace(plan.problem, limits=limits, vehicle=None)
    if problem.heading != plan.problem.heading:
        return steered(plan, problem, plan.trajectory, plan.pieces, "")
    return answer(plan, problem, plan.trajectory, plan.yaw_motion, "")


def delay(plan: Plan, seconds: float) -> Plan:
    """Hover at the first waypoint for some time, then fly.

    The first leg gets one more piece. A yaw that is to change is planned anew, as it may begin to
    turn while hovering.

    Raises
    ------
    InvalidProblem
        If the time is not positive and finite, or the flight does not begin at rest.
    """
    if not (math.isfinite(seconds) and seconds > 0.0):
        raise InvalidProblem(f"the delay is {seconds:g} s; it must be positive and finite")
    problem, flight = plan.problem, plan.trajectory
    if not rest_orders(problem.start):
        raise InvalidProblem("the flight does not begin at rest; nothing can hover before it")
    hover = np.zeros((1, flight.degree + 1, 3))
    hover[0, 0] = flight.coefficients[0, 0]
    whole = Trajectory(hover, np.array([seconds]), flight.start_time).join(flight)
    problem = replace(problem, continuity=continuity_at_rest(problem, problem.start))
    pieces = (plan.pieces[0] + 1, *plan.pieces[1:])
    return steered(plan, problem, whole, pieces, f"delayed by {seconds:g} s")


def rotate(plan: Plan, angle: float) -> Plan:
    """Turn a plan about the vertical through the origin, counterclockwise from above, by rad.

    Motion that is fixed at a waypoint along one horizontal axis only is free afterwards.

    Raises
    ------
    InvalidProblem
        If the angle is not finite.
    """
    if not math.isfinite(angle):
        raise InvalidProblem(f"the angle is {angle}; it must be finite")
    cos, sin = math.cos(angle), math.sin(angle)

    def turned(vectors: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(vectors, -1, 0)
        return np.stack((cos * x - sin * y, sin * x + cos * y, z), axis=-1)

    return _mapped(
        plan, turned, f"turned by {math.degrees(angle):.6g} deg about z", yaw=(1.0, angle)
    )


def mirror(plan: Plan, axis: str) -> Plan:
    """Mirror a plan: "x" changes the sign of x, "y" that of y; the nose is mirrored too.

    Raises
    ------
    InvalidProblem
        If the axis is neither.
    """
    if axis not in MIRRORS:
        raise InvalidProblem(
            f"mirror axis is {axis!r}; it must be x or y, as gravity does not turn round with z"
        )
    signs = np.array(MIRRORS[axis])
    yaw = (-1.0, math.pi if axis == "x" else 0.0)
    return _mapped(plan, lambda vectors: vectors * signs, f"mirrored in {axis}", yaw=yaw)


def move(plan: Plan, offset: ArrayLike) -> Plan:
    """Move a plan by (3,) m.

    Raises
    ------
    InvalidProblem
        If the offset is not three finite numbers.
    """
    by = _three("the offset", offset)
    return _mapped(
        plan, lambda vectors: vectors, f"moved by ({_listed(by)}) m", offset=by, yaw=(1.0, 0.0)
    )


def scale(plan: Plan, factors: ArrayLike) -> Plan:
    """Make a plan larger about the origin, by one factor or one for each axis, at the same times.

    With different factors a yaw that follows a direction is planned anew.

    Raises
    ------
    InvalidProblem
        If a factor is not positive and finite.
    """
    by = _three("the factors", (factors,) * 3 if isinstance(factors, Real) else factors)
    if not (by > 0.0).all():
        raise InvalidProblem(f"the factors are {_listed(by)}; they must be positive (see mirror)")
    note = f"scaled by {_listed(by) if len(set(by.tolist())) > 1 else f'{by[0]:g}'}"
    scaled = _mapped(plan, lambda vectors: vectors * by, note, yaw=(1.0, 0.0))
    heading = plan.problem.heading
    if heading is None or not heading.follows or by[0] == by[1]:
        return scaled
    return steered(scaled, scaled.problem, scaled.trajectory, scaled.pieces, "")


def reverse(plan: Plan) -> Plan:
    """Fly a plan backwards; a nose that points ahead still does."""
    problem, flight, yaw = plan.problem, plan.trajectory, plan.yaw_motion
    legs = len(problem.waypoints) - 1

    def flipped(state: np.ndarray) -> np.ndarray:
        return state * (-1.0) ** np.arange(1, len(state) + 1)[:, None] + 0.0

    heading = problem.heading
    turn = 0.0
    if heading is not None and heading.policy == "velocity":
        turn = math.pi
    if heading is not None and heading.angles is not None:
        heading = replace(heading, angles=heading.angles[::-1])
    reversed_problem = replace(
        problem,
        waypoints=problem.waypoints[::-1],
        start=flipped(np.asarray(problem.end)),
        end=flipped(np.asarray(problem.start)),
        derivatives={
            legs - index: flipped(np.asarray(state))
            for index, state in sorted(problem.derivatives.items(), reverse=True)
        },
        yaw=heading,
    )
    back = None if yaw is None else _offset_yaw(yaw.reverse(), 1.0, turn)
    return answer(
        plan, reversed_problem, flight.reverse(), back, "reversed", pieces=plan.pieces[::-1]
    )


def answer(
    plan: Plan,
    problem: Problem,
    trajectory: Trajectory,
    yaw: Trajectory | None,
    note: str,
    *,
    pieces: Sequence[int] | None = None,
    deviation: float | None = None,
) -> Plan:
    """Make a plan of what has become of another, and prove it.

    Parameters
    ----------
    note
        What was done, in words; empty for nothing.
    pieces, deviation
        As of the plan if they are left out.
    """
    counts = plan.pieces if pieces is None else tuple(pieces)
    report = certify_answer(problem, trajectory, counts, yaw=yaw)
    status = plan.status
    if not report.feasible:
        status = Status.INFEASIBLE
    elif not plan.feasible:
        status = Status.SOLVED
    before = [line for line in plan.message.split("; ") if line not in plan.report.problems]
    lines = [*before, note, *report.problems]
    return replace(
        plan,
        problem=problem,
        status=status,
        trajectory=trajectory,
        report=report,
        pieces=counts,
        message="; ".join(line for line in lines if line),
        history=None,
        yaw_motion=yaw,
        yaw_deviation=plan.yaw_deviation if deviation is None else deviation,
        version=__version__,
        memory=None,
    )


def steered(
    plan: Plan, problem: Problem, trajectory: Trajectory, pieces: Sequence[int], note: str
) -> Plan:
    """As `answer`, with the yaw that the problem asks for planned anew along the trajectory."""
    if problem.heading is None:
        return answer(plan, problem, trajectory, None, note, pieces=pieces)
    from peakflight.yaw_motion import turning

    yaw, factor, deviation = turning(problem, trajectory, tuple(pieces))
    slower = yaw is not None and factor > 1.0
    if yaw is not None and slower:
        yaw = yaw.stretch(1.0 / factor)
    made = answer(plan, problem, trajectory, yaw, note, pieces=pieces, deviation=deviation)
    return keep_limits(made) if slower else made


def rest_orders(state: object) -> int:
    """How many derivatives, from velocity on, a fixed state has at zero; 0 if it has motion."""
    rows = np.asarray(state)
    if (np.abs(rows) > 0.0).any():
        return 0
    zero = (rows == 0.0).all(axis=1)
    return len(zero) if zero.all() else int(zero.argmin())


def continuity_at_rest(problem: Problem, state: object) -> int:
    """Highest derivative that does not jump where a flight in a state of rest meets a hover."""
    return min(problem.spline_class.continuity, max(rest_orders(state), ATTITUDE))


def _stretched(plan: Plan, factor: float, note: str) -> Plan:
    """The path flown slower by a factor, and motion that is fixed at waypoints with it."""
    problem = plan.problem
    times = plan.trajectory.segment_times
    # compared without a product, which overflows
    if not (SHORTEST / times.min() <= factor <= LONGEST / times.max()):
        raise InvalidProblem(
            f"the pace would change by a factor of {factor:.3g}; every piece must last from "
            f"{SHORTEST:g} to {LONGEST:g} s"
        )

    def slower(state: np.ndarray) -> np.ndarray:
        return state * float(factor) ** -np.arange(1.0, len(state) + 1.0)[:, None]

    if not problem.is_at_rest:
        problem = _with_states(problem, slower)
    if problem.heading is not None and problem.heading.is_about_body:
        slowed = plan.trajectory.stretch(factor)  # its thrust swings otherwise
        return steered(plan, problem, slowed, plan.pieces, note)
    yaw = plan.yaw_motion
    return answer(
        plan,
        problem,
        plan.trajectory.stretch(factor),
        None if yaw is None else yaw.stretch(factor),
        note,
    )


def _fitted(plan: Plan, *, least: float) -> Plan:
    """The path at the fastest pace that keeps every limit, stretched by `least` or more."""
    found = stretch_to_limits(plan.trajectory, plan.problem.limits)
    if found is None or _is_unproven(plan):
        return plan
    factor = max(found[1], _yaw_stretch(plan) * (1.0 + ROUNDING), least)
    if plan.feasible and abs(factor - 1.0) <= NO_CHANGE:
        return plan
    step = LEAST_STEP
    for _ in range(STEPS):
        change = 100.0 * abs(factor - 1.0)
        verb = "slowed down" if factor >= 1.0 else "sped up"
        made = _stretched(plan, factor, f"{verb} by {change:.3g} % to what the limits allow")
        if made.report.worst <= 1.0:
            return made
        factor *= 1.0 + step
        step = min(STEP_GROWTH * step, LARGEST_STEP)
    return plan


def _is_unproven(plan: Plan) -> bool:
    """Whether nothing is known of the yaw that a pace could mend."""
    peaks, heading = plan.report.peaks, plan.problem.heading
    kinds = () if heading is None else heading.kinds
    return any(kind.name in peaks and peaks[kind.name].max() >= UNBOUNDED for kind in kinds)


def _yaw_stretch(plan: Plan) -> float:
    """How much slower the yaw has to be for its own limits, 0 if nothing limits it."""
    report, heading = plan.report, plan.problem.heading
    kinds = () if heading is None else heading.kinds
    needs = [
        float(report.peaks[kind.name].max()) ** (1.0 / kind.order)
        for kind in kinds
        if kind.name in report.peaks
    ]
    return max(needs, default=0.0)


def _mapped(
    plan: Plan,
    linear: Callable[[np.ndarray], np.ndarray],
    note: str,
    *,
    yaw: tuple[float, float],
    offset: np.ndarray | None = None,
) -> Plan:
    """A plan whose space is mapped.

    Parameters
    ----------
    linear
        What becomes of (..., 3) vectors.
    yaw
        Sign and offset, rad, that the map gives the yaw.
    offset
        (3,) m, added to positions afterwards.
    """
    by = np.zeros(3) if offset is None else offset
    flight = plan.trajectory
    coefficients = np.array(linear(flight.coefficients))
    coefficients[:, 0] += by
    heading = plan.problem.heading
    problem = replace(
        _with_states(plan.problem, linear),
        waypoints=linear(plan.problem.waypoints) + by,
        yaw=None if heading is None else _mapped_heading(heading, linear, by, yaw),
    )
    motion = plan.yaw_motion
    return answer(
        plan,
        problem,
        Trajectory(coefficients, flight.segment_times, flight.start_time),
        None if motion is None else _offset_yaw(motion, *yaw),
        note,
    )


def _mapped_heading(
    heading: Heading,
    linear: Callable[[np.ndarray], np.ndarray],
    offset: np.ndarray,
    yaw: tuple[float, float],
) -> Heading:
    sign, turn = yaw
    if heading.angle is not None:
        return replace(heading, angle=sign * heading.angle + turn)
    if heading.angles is not None:
        return replace(heading, angles=tuple(sign * angle + turn for angle in heading.angles))
    if heading.point is not None:
        point = linear(np.array(heading.point)) + offset
        return replace(heading, point=tuple(point.tolist()))
    return heading


def _offset_yaw(motion: Trajectory, sign: float, turn: float) -> Trajectory:
    coefficients = sign * motion.coefficients
    coefficients[:, 0] += turn
    return Trajectory(coefficients, motion.segment_times, motion.start_time)


def _with_states(problem: Problem, change: Callable[[np.ndarray], np.ndarray]) -> Problem:
    """The problem with every fixed state (n, 3), NaN where free, changed."""
    return replace(
        problem,
        start=change(np.asarray(problem.start)) + 0.0,
        end=change(np.asarray(problem.end)) + 0.0,
        derivatives={
            index: change(np.asarray(state)) + 0.0 for index, state in problem.derivatives.items()
        },
    )


def _three(name: str, values: ArrayLike) -> np.ndarray:
    numbers = as_float_array(name, values, (3,))
    if not np.isfinite(numbers).all():
        raise InvalidProblem(f"{name} are {_listed(numbers)}; they must be finite")
    return numbers


def _listed(numbers: np.ndarray) -> str:
    return ", ".join(f"{number:g}" for number in numbers)
