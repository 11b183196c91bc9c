"""Two plans flown as one: what lies between them is planned under the same limits, and proven."""

import numpy as np

from peakflight.course import MERGE_DISTANCE
from peakflight.editing import (
    ATTITUDE,
    answer,
    continuity_at_rest,
    rest_orders,
    steered,
    under_limits,
)
from peakflight.errors import InvalidProblem
from peakflight.limits import Limits
from peakflight.planner import plan as plan_course
from peakflight.problem import Problem
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.yaw import FIELDS, Heading

METHOD = "joint"
"""How a transition is planned: the fastest."""
MATCHED = 3
"""Highest derivative in which a transition meets a moving end: all that its degree 7 can hold."""
SAME_MOTION = 1e-9
"""Difference of two derivatives, relative to their size or 1, that counts as none."""


def join(first: Plan, second: Plan, *, limits: Limits | None = None) -> Plan:
    """Fly one plan, then what leads to the next, then that.

    The transition goes from the state in which the first plan ends to that in which the second
    begins, at rest or moving, as fast as the limits allow. There is none where the second begins
    in just that state. A yaw that changes is planned anew over the whole flight; plans that ask
    for different things of it pass, at every waypoint, the yaw that they had there.

    Parameters
    ----------
    limits
        That the whole keeps. May be left out if both plans have the same.

    Raises
    ------
    InvalidProblem
        If limits or vehicles differ and no limits are given, or if both plans move at one and the
        same point in different ways.
    """
    if limits is not None:
        first, second = (under_limits(part, limits) for part in (first, second))
    _require_alike(first, second)
    begins, ends = _begin(second), _end(first)
    if np.linalg.norm(begins[0] - ends[0]) < MERGE_DISTANCE:
        return _merged(first, None, _attached(first, second))
    at_rest = rest_orders(first.problem.end) > 0, rest_orders(second.problem.start) > 0
    try:
        between = plan_course(
            Problem(
                np.stack((ends[0], begins[0])),
                limits=first.problem.limits,
                start=None if at_rest[0] else ends[1:],
                end=None if at_rest[1] else begins[1:],
            ),
            method=METHOD,
        )
    except InvalidProblem as error:
        raise InvalidProblem(f"no transition between the plans: {error}") from None
    return _merged(first, between, second)


def _merged(first: Plan, between: Plan | None, second: Plan) -> Plan:
    """One plan of two or three that follow each other."""
    parts = [part for part in (first, between, second) if part is not None]
    pieces = tuple(count for part in parts for count in part.pieces)
    flight = Trajectory.concatenate([part.trajectory for part in parts])
    waypoints = [first.problem.waypoints]
    derivatives = dict(first.problem.derivatives)
    count = len(first.problem.waypoints) - 1
    derivatives[count] = first.problem.end  # type: ignore[assignment]
    if between is not None:
        count += 1
        waypoints.append(second.problem.waypoints)
        derivatives[count] = second.problem.start  # type: ignore[assignment]
        note = f"joined by a transition of {between.duration:.4g} s"
    else:
        waypoints.append(second.problem.waypoints[1:])
        note = "joined without a transition, as one ends where the other begins"
    for index, state in second.problem.derivatives.items():
        derivatives[count + index] = state
    problem = Problem(
        np.concatenate(waypoints),
        vehicle=first.problem.vehicle,
        limits=first.problem.limits,
        minimize=first.problem.minimize,
        degree=flight.degree,
        continuity=_continuity(first, between, second),
        start=_ending(first.problem.start, flight.degree),
        end=_ending(second.problem.end, flight.degree),
        derivatives=derivatives,
        yaw=_heading(first, second, between is not None),
    )
    start = answer(first, first.problem, first.trajectory, first.yaw_motion, "")
    heading = problem.heading
    if heading is None:
        return answer(start, problem, flight, None, note, pieces=pieces)
    return steered(start, problem, flight, pieces, note)


def _continuity(first: Plan, between: Plan | None, second: Plan) -> int:
    """Highest derivative that jumps nowhere in the whole."""
    own = [part.problem.spline_class.continuity for part in (first, between, second) if part]
    for part, state in ((first, first.problem.end), (second, second.problem.start)):
        own.append(continuity_at_rest(part.problem, state) if rest_orders(state) else MATCHED)
    if between is None and not rest_orders(first.problem.end):
        own.append(ATTITUDE)
    return min(own)


def _attached(first: Plan, second: Plan) -> Plan:
    """The second plan, if it begins in the state in which the first ends."""
    ends, begins = _end(first), _begin(second)
    off = np.abs(ends - begins)
    highest = ATTITUDE + 1
    size = np.maximum(1.0, np.maximum(np.abs(ends), np.abs(begins)))
    if rest_orders(first.problem.end) and rest_orders(second.problem.start):
        highest = 1
    if not (off[:highest] <= SAME_MOTION * size[:highest]).all():
        raise InvalidProblem(
            "the second plan begins where the first ends, but not in the same motion, or less than "
            f"{1e3 * MERGE_DISTANCE:g} mm from it; move one of them to leave room for a transition"
        )
    return second


def _end(plan: Plan) -> np.ndarray:
    """(MATCHED+1, 3) position to jerk at the end."""
    flight = plan.trajectory
    at = len(flight) - 1, flight.segment_times[-1]
    return np.stack([flight.at(*at, order) for order in range(MATCHED + 1)])


def _begin(plan: Plan) -> np.ndarray:
    """(MATCHED+1, 3) position to jerk at the beginning."""
    return np.stack([plan.trajectory.at(0, 0.0, order) for order in range(MATCHED + 1)])


def _ending(state: object, degree: int) -> np.ndarray:
    """Fixed derivatives at an end, with those that a higher degree has besides left free."""
    rows = np.asarray(state)
    free = np.full((max(0, (degree - 1) // 2 - len(rows)), 3), np.nan)
    return np.concatenate((rows, free))


def _require_alike(first: Plan, second: Plan) -> None:
    names = [None if part.vehicle is None else part.vehicle.name for part in (first, second)]
    if names[0] != names[1]:
        raise InvalidProblem(f"the plans are for {names[0]} and {names[1]}; give limits for both")
    limits = [part.problem.limits for part in (first, second)]
    if limits[0] != limits[1]:
        differing = [
            name
            for name in {**limits[0].to_dict(), **limits[1].to_dict()}
            if getattr(limits[0], name) != getattr(limits[1], name)
        ]
        raise InvalidProblem(
            f"the plans have different limits of {', '.join(differing)}; give limits for both"
        )


def _heading(first: Plan, second: Plan, apart: bool) -> Heading | None:
    """What is asked of the yaw of both; their waypoints are `apart` where they are joined."""
    if first.problem.yaw is None and second.problem.yaw is None:
        return None  # then limits on rotors decide, in the whole as in its parts
    one, two = first.problem.heading, second.problem.heading
    if one is not None and one == two and one.angles is None:
        return one
    angles = [part.yaw(part.waypoint_times) for part in (first, second)]
    asked = [heading for heading in (one, two) if heading is not None]
    if len({heading.kinds for heading in asked}) > 1:
        raise InvalidProblem(
            "the limits of one plan's yaw are about the yaw, those of the other's about the body"
        )
    limits = {}
    for name in FIELDS:
        given = [getattr(heading, name) for heading in asked]
        limits[name] = min((value for value in given if value is not None), default=None)
    passed = np.concatenate((angles[0], angles[1] if apart else angles[1][1:]))
    about = "body" if asked[0].is_about_body else "yaw"
    return Heading(policy="waypoints", angles=tuple(passed.tolist()), about=about, **limits)
