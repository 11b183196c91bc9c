"""Trajectories that others have made: proven against limits, mended, and flown at another pace.

A file becomes a plan whose waypoints are the joints of its polynomials. Numbers that were written
with a few digits make small jumps at the joints; `repair` closes them by a correction of degree 5
on each piece (Hermite's polynomial of what is missing at both of its ends), no larger than the
jumps are.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from peakflight.certificate import certify_answer
from peakflight.course import MERGE_DISTANCE
from peakflight.editing import retime as to_limits
from peakflight.errors import InvalidProblem, Status
from peakflight.files import PathLike
from peakflight.limits import Limits
from peakflight.planner import plan as plan_course
from peakflight.problem import Problem
from peakflight.readers import TOLERANCE, TrajectoryFile, read_trajectory_file
from peakflight.readers.fitting import end_rows, through_angles
from peakflight.result import Plan
from peakflight.trajectory import Trajectory
from peakflight.vehicles import VehicleLike
from peakflight.version import __version__
from peakflight.yaw import Heading
from peakflight.yaw_certificate import DEGREE as YAW_DEGREE

METHOD = "imported"
"""What stands in a plan for the method that made it."""
ORDERS = 3
"""Position, velocity and acceleration: what has to meet at joints for attitude not to jump."""
LEAST_DEGREE = 5
"""Trajectories of lower degree are written at this one, which can meet all three at both ends."""
RESTS = (np.inf, 1e-2, 1e-1)
"""Velocity and acceleration at an end that stand for rest, m/s and m/s^2."""
ROUNDED = (2e-2, 1e-1, 1.0)
"""Jumps that writing six decimals makes on pieces of some seconds: m, m/s, m/s^2."""
YAW_TOLERANCE = 1e-3
"""How near a cubic yaw comes to one of a higher degree, rad."""
YAW_SAMPLES, MOST_YAW_SAMPLES = 64, 2**14
"""Points of a piece that the cubic passes at first, and of all together at most."""
BETWEEN = 8
"""Points for each of them at which the difference is taken: most of them between knots."""
WORTH = 0.6
"""Part of the difference that twice the points have to leave: where a yaw jumps, none do."""
HALVINGS = 4
"""How often pieces are halved to find waypoints apart in a motion whose joints are all alike."""
CORRECTED = 33
"""Points of a piece at which the size of a correction is taken."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Imported:
    """A trajectory file as a plan, with what was found on the way."""

    plan: Plan
    """Certified against the limits; mended, retimed or planned anew if that was asked for."""
    source: TrajectoryFile
    """The file as it was read."""
    jumps: np.ndarray
    """(3,) largest jump of position, velocity and acceleration at a joint of the file."""
    moved: np.ndarray | None = None
    """(3,) largest change of them that the repair has made; None without one."""
    yaw_off: float = 0.0
    """Largest difference of the plan's yaw from that of the file, rad."""
    file_plan: Plan
    """The file at its own pace, proven against the same limits."""

    @property
    def is_rounded(self) -> bool:
        """Whether the jumps are small enough to be those of rounded numbers."""
        return bool((self.jumps <= ROUNDED).all())


def import_trajectory(
    source: PathLike | TrajectoryFile,
    *,
    limits: Limits | None = None,
    vehicle: VehicleLike | None = None,
    yaw_limits: Mapping[str, float | None] | None = None,
    repair: bool = False,
    retime: bool = False,
    method: str | None = None,
    tolerance: float = TOLERANCE,
) -> Imported:
    """Read a trajectory and prove what it keeps.

    Parameters
    ----------
    source
        A file as `peakflight.read_trajectory_file` reads it, or what that has read.
    limits, vehicle
        To keep; by default those of a plan file. Needed for other files, as for a `Problem`.
    yaw_limits
        Largest "rate", rad/s, and "acceleration", rad/s^2, of the yaw; by default those of a plan
        file, and else none.
    repair
        Close jumps at joints, and bring to rest ends that nearly are.
    retime
        Fly the path as fast as the limits allow.
    method
        Plan anew through the joints as waypoints, by this method, in place of keeping the path;
        not together with `retime`.
    tolerance
        How near polynomials come to a file of samples, m.

    Raises
    ------
    InvalidFile
        If the file cannot be read or holds no trajectory.
    InvalidProblem
        If no limits are given and the file has none, both `retime` and `method` are asked for, or
        the motion has no plan: it stays where it is, or its degree is above 11.
    """
    began = time.perf_counter()
    if retime and method is not None:
        raise InvalidProblem(
            f"retime flies the path of the file, and method {method} plans another, as fast as "
            "it can be; ask for one of them"
        )
    if not isinstance(source, TrajectoryFile):
        source = read_trajectory_file(source, tolerance=tolerance)
    flight = source.trajectory
    flight = flight.elevate(max(flight.degree, LEAST_DEGREE))
    jumps = joint_jumps(flight)
    moved = None
    if repair:
        flight, moved = repaired(flight)
    if source.plan is not None:
        plan, off = _of_plan(source.plan, flight, limits, vehicle, yaw_limits, repair), 0.0
    else:
        plan, off = _of_motion(source, flight, limits, vehicle, yaw_limits)
    plan = replace(plan, wall_time_s=time.perf_counter() - began)
    made = plan
    if method is not None:
        made = _planned(plan, method)
    elif retime:
        made = to_limits(plan)
    return Imported(plan=made, source=source, jumps=jumps, moved=moved, yaw_off=off, file_plan=plan)


def joint_jumps(trajectory: Trajectory) -> np.ndarray:
    """(3,) largest jump of position, velocity and acceleration at a joint, m, m/s, m/s^2."""
    begins, ends = _end_states(trajectory)
    jumps = np.linalg.norm(begins[1:] - ends[:-1], axis=2)
    return jumps.max(axis=0, initial=0.0)


def repaired(trajectory: Trajectory) -> tuple[Trajectory, np.ndarray]:
    """The motion with continuous position, velocity and acceleration; at rest where it nearly was.

    At a joint both pieces are brought to the mean of what they have there.

    Returns
    -------
    The trajectory, and (3,) the largest change of position, velocity and acceleration.
    """
    trajectory = trajectory.elevate(max(trajectory.degree, LEAST_DEGREE))
    begins, ends = _end_states(trajectory)
    means = 0.5 * (begins[1:] + ends[:-1])
    wanted = np.concatenate((_rested(begins[:1]), means, _rested(ends[-1:])))
    scales = trajectory.segment_times[:, None, None] ** np.arange(ORDERS)[:, None]
    missing = np.concatenate(
        ((wanted[:-1] - begins) * scales, (wanted[1:] - ends) * scales), axis=1
    )
    times = trajectory.segment_times
    correction = np.linalg.inv(end_rows(ORDERS)) @ missing
    correction = correction / times[:, None, None] ** np.arange(2 * ORDERS)[:, None]
    change = Trajectory(correction, times, trajectory.start_time)
    coefficients = trajectory.coefficients.copy()
    coefficients[:, : 2 * ORDERS] += correction
    moved = np.array(
        [np.linalg.norm(change.sample(CORRECTED, order), axis=2).max() for order in range(ORDERS)]
    )
    return Trajectory(coefficients, times, trajectory.start_time), moved


def _end_states(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """(K, 3, D) position, velocity and acceleration where pieces begin, and where they end."""
    states = np.stack([trajectory.sample(2, order) for order in range(ORDERS)], axis=2)
    return states[:, 0], states[:, 1]


def _rested(state: np.ndarray) -> np.ndarray:
    """(1, 3, D) of an end; at rest if it nearly is."""
    near = np.linalg.norm(state, axis=2) <= RESTS
    if not near.all():
        return state
    return state * np.array([1.0, 0.0, 0.0])[:, None]


def _of_plan(
    plan: Plan,
    flight: Trajectory,
    limits: Limits | None,
    vehicle: VehicleLike | None,
    yaw_limits: Mapping[str, float | None] | None,
    repair: bool,
) -> Plan:
    """A plan file under other limits, and with its joints mended."""
    problem, yaw = plan.problem, plan.yaw_motion
    if vehicle is not None:
        problem = replace(problem, vehicle=vehicle, limits=limits)  # type: ignore[arg-type]
    elif limits is not None:
        problem = replace(problem, vehicle=None, limits=limits)
    # a nose about which nothing is said is free exactly where rotors are limited
    is_new = plan.problem.yaw is None and problem.heading != plan.problem.heading
    if yaw_limits is not None:
        if problem.heading is None:
            raise InvalidProblem("yaw limits are given, and the file has no yaw")
        problem = replace(problem, yaw=replace(problem.heading, **yaw_limits))  # type: ignore[arg-type]
    if repair:
        borders = np.concatenate(([0], np.cumsum(plan.pieces)))
        problem = replace(
            problem,
            waypoints=_joints(flight)[borders],
            continuity=min(ORDERS - 1, problem.spline_class.continuity),
        )
    else:
        flight = plan.trajectory
    if is_new:
        yaw = _free(problem, flight, plan.pieces)
    return replace(
        plan,
        problem=problem,
        trajectory=flight,
        yaw_motion=yaw,
        history=None,
        memory=None,
        **_proof(problem, flight, plan.pieces, yaw),
    )


def _of_motion(
    source: TrajectoryFile,
    flight: Trajectory,
    limits: Limits | None,
    vehicle: VehicleLike | None,
    yaw_limits: Mapping[str, float | None] | None,
) -> tuple[Plan, float]:
    """A motion as a plan through its joints; and how far off its yaw is, rad."""
    flight, borders = _apart(flight)
    yaw, off = _cubic(source.yaw, flight)
    begins, ends = _end_states(flight)
    problem = Problem(
        _joints(flight)[borders],
        limits=limits,  # type: ignore[arg-type]
        vehicle=vehicle,
        degree=flight.degree,
        continuity=ORDERS - 1,
        start=_state(begins[0], flight.degree),
        end=_state(ends[-1], flight.degree),
        yaw=_heading(yaw, flight.breakpoints[borders], yaw_limits),
    )
    pieces = tuple(np.diff(borders).tolist())
    if yaw is None:
        yaw = _free(problem, flight, pieces)
    return Plan(
        problem=problem,
        method=METHOD,
        trajectory=flight,
        pieces=pieces,
        iterations=0,
        wall_time_s=0.0,
        yaw_motion=yaw,
        **_proof(problem, flight, pieces, yaw),
    ), off


def _free(problem: Problem, flight: Trajectory, pieces: tuple[int, ...]) -> Trajectory | None:
    """Where a nose ends up about which nothing is said; None where nobody asks."""
    if problem.heading is None:
        return None
    from peakflight.yaw_motion import turning

    return turning(problem, flight, pieces).yaw


def _proof(
    problem: Problem, flight: Trajectory, pieces: tuple[int, ...], yaw: Trajectory | None
) -> dict[str, Any]:
    """The fields of a plan that say what is proven of it."""
    report = certify_answer(problem, flight, pieces, yaw=yaw)
    return {
        "report": report,
        "status": Status.SOLVED if report.feasible else Status.INFEASIBLE,
        "message": "; ".join(report.problems),
        "version": __version__,
    }


def _apart(flight: Trajectory) -> tuple[Trajectory, np.ndarray]:
    """The motion, and which of its joints are waypoints: those that are apart, and both ends.

    Pieces are halved as far as it takes to have two waypoints at all.
    """
    for _ in range(HALVINGS):
        points = _joints(flight)
        kept = [0]
        for index in range(1, len(points) - 1):
            if np.linalg.norm(points[index] - points[kept[-1]]) >= MERGE_DISTANCE:
                kept.append(index)
        while len(kept) > 1 and np.linalg.norm(points[-1] - points[kept[-1]]) < MERGE_DISTANCE:
            kept.pop()
        if len(kept) > 1 or np.linalg.norm(points[-1] - points[0]) >= MERGE_DISTANCE:
            return flight, np.array([*kept, len(points) - 1])
        flight = flight.subdivide(2)
    raise InvalidProblem(
        f"the motion stays within {1e3 * MERGE_DISTANCE:g} mm of "
        f"({', '.join(f'{value:g}' for value in points[0])}); a plan goes somewhere"
    )


def _joints(flight: Trajectory) -> np.ndarray:
    """(K+1, 3) m, where pieces begin, and where the last ends."""
    return np.concatenate((flight.coefficients[:, 0], flight.sample(2)[-1:, 1]))


def _state(state: np.ndarray, degree: int) -> np.ndarray:
    """Velocity and acceleration as they are; what else a state of rest has at zero is free."""
    free = np.full((max(0, (degree - 1) // 2 - (ORDERS - 1)), 3), np.nan)
    return np.concatenate((state[1:], free))


def _cubic(yaw: Trajectory | None, flight: Trajectory) -> tuple[Trajectory | None, float]:
    """A yaw that can be proven, and how far off it is, rad."""
    if yaw is None or yaw.degree <= YAW_DEGREE:
        return yaw, 0.0
    if not yaw.coefficients[:, 1:].any() and np.ptp(yaw.coefficients[:, 0]) == 0.0:
        constant = yaw.coefficients[:1, :1]
        return Trajectory(constant, [flight.duration], flight.start_time), 0.0  # type: ignore[arg-type]
    count = YAW_SAMPLES
    best, off = _through(yaw, count)
    while off > YAW_TOLERANCE and 2 * count * len(yaw) <= MOST_YAW_SAMPLES:
        count *= 2
        finer, left = _through(yaw, count)
        if left > WORTH * off:
            break
        best, off = finer, left
    return best, off


def _through(yaw: Trajectory, count: int) -> tuple[Trajectory, float]:
    """A cubic near so many points of each piece, and how far off it is between them too, rad."""
    times, angles = _points(yaw, count)
    times, angles = (
        np.append(times[:, :-1], times[-1, -1]),
        np.append(angles[:, :-1], angles[-1, -1]),
    )
    cubic = through_angles(times, angles, 0.5 * YAW_TOLERANCE)
    times, angles = _points(yaw, BETWEEN * count)
    inside = np.clip(times, cubic.start_time, cubic.end_time)
    return cubic, float(np.abs(cubic(inside)[:, :, 0] - angles).max())


def _points(yaw: Trajectory, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(K, count+1) s and rad, both ends of each piece included."""
    local = yaw.segment_times[:, None] * np.linspace(0.0, 1.0, count + 1)
    return yaw.breakpoints[:-1, None] + local, yaw.sample(count + 1)[:, :, 0]


def _heading(
    yaw: Trajectory | None, passed: np.ndarray, limits: Mapping[str, float | None] | None
) -> Heading | None:
    """What asks for a yaw motion as it is."""
    if yaw is None:
        if limits is not None:
            raise InvalidProblem("yaw limits are given, and the file has no yaw")
        return None
    limited = {"rate": None, "acceleration": None, **(limits or {})}
    if len(yaw) == 1 and not yaw.coefficients[:, 1:].any():
        angle = float(yaw.coefficients[0, 0, 0])
        return Heading(policy="fixed", angle=angle, **limited)  # type: ignore[arg-type]
    angles = yaw(np.clip(passed, yaw.start_time, yaw.end_time))[:, 0]
    return Heading(policy="waypoints", angles=tuple(angles.tolist()), **limited)  # type: ignore[arg-type]


def _planned(plan: Plan, method: str) -> Plan:
    """A plan through the same waypoints, with the motion at the ends, by a method."""
    problem = plan.problem
    states = [
        None
        if (np.linalg.norm(np.asarray(state)[: ORDERS - 1], axis=1) <= RESTS[1:]).all()
        else state
        for state in (problem.start, problem.end)
    ]
    problem = replace(problem, degree=None, continuity=None, start=states[0], end=states[1])
    return plan_course(problem, method=method)
