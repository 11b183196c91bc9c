"""What is proven about a trajectory: peak ratios, joints, waypoints, and the exact stretch.

Nothing here is shared with the optimisers: bounds are taken of the coefficients that are written to
the file (`kernels.bounds`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidProblem
from peakflight.kernels import bernstein, bounds, joints, rotors, turning
from peakflight.kernels.jit import fresh
from peakflight.limits import GRAVITY, KINDS, Limits
from peakflight.problem import Problem, as_float_array, derivative_name
from peakflight.result import JOINT_TOLERANCE, Plan, Report, allowed_miss
from peakflight.trajectory import LONGEST, SHORTEST, Trajectory
from peakflight.twist_certificate import certify_twist
from peakflight.yaw_certificate import certify_yaw

JUMP_OF_LIMIT = 1e-4
"""A derivative that is limited may jump by this part of its limit, for rounding in short pieces."""
TOLERANCE = 1e-10
"""Relative distance between the certified bound of a squared norm and an attained value."""
LITTLE, EASES = 1e-2, (0.3, 1.0, 3.0, 10.0)
"""Excess over a limit on rotors up to which these multiples of it are tried as a stretch."""


def certify(
    trajectory: Trajectory,
    limits: Limits,
    *,
    waypoints: ArrayLike | None = None,
    pieces: Sequence[int] | None = None,
    continuity: int | None = None,
    fixed: Mapping[int, np.ndarray] | None = None,
) -> Report:
    """Prove what can be proven about a trajectory (Eq. kapp_i, Eq. kappa2).

    Parameters
    ----------
    trajectory
        In three axes, z up.
    limits
        What it should keep.
    waypoints
        (legs+1, 3) m that it should pass, the first and last at its ends; by default not checked.
    pieces
        (legs,) number of pieces in each leg; one each by default.
    continuity
        Highest derivative that should not jump; by default 2, so that attitude does not.
    fixed
        Waypoint index to derivatives (n, 3) from velocity on that should be met there, NaN where
        free; by default not checked. Needs waypoints.

    Raises
    ------
    InvalidProblem
        If the shapes do not fit.
    """
    _check_axes(trajectory)
    coefficients = fresh(trajectory.coefficients)
    times = fresh(trajectory.segment_times)
    upper = _bound(coefficients, times, limits)
    if waypoints is None:
        points, firsts = coefficients[:1, 0], np.zeros(0, dtype=np.int64)
    else:
        firsts = (
            np.arange(len(times), dtype=np.int64) if pieces is None else _firsts(pieces, len(times))
        )
        points = fresh(as_float_array("waypoints", waypoints, (len(firsts) + 1, 3)))
    smooth = 2 if continuity is None else continuity
    if smooth < 0:
        raise InvalidProblem(f"continuity is {smooth}; it must be 0 or more")
    factorials = bernstein.falling_factorials(trajectory.degree)
    jump, joint, order, miss, waypoint = joints.residuals(
        coefficients, times, smooth, factorials, points, firsts,
        _jump_caps(limits, smooth), JOINT_TOLERANCE,
    )  # fmt: skip
    peaks = {
        kind.name: upper[:, index]
        for index, kind in enumerate(KINDS)
        if getattr(limits, kind.name) is not None
    }
    problems = _exceeded(peaks, limits)
    if not jump <= JOINT_TOLERANCE:
        problems.append(
            f"{derivative_name(order)} jumps at the end of segment {joint}, by {jump:.1e} of its "
            "size there"
        )
    if waypoints is not None and not miss <= allowed_miss(points):
        problems.append(f"waypoint {waypoint} is missed by {miss:.3g} m")
    state_error = 0.0
    for index in fixed or ():
        if waypoints is None or not 0 <= index <= len(firsts):
            raise InvalidProblem(f"motion is fixed at waypoint {index}, which is not given")
    if fixed:
        state_error, index, order = _state_error(coefficients, times, firsts, fixed)
        if not state_error <= JOINT_TOLERANCE:
            problems.append(
                f"{derivative_name(order)} at waypoint {index} is not the one that is fixed there"
            )
    return Report(
        feasible=not problems,
        peaks=peaks,
        joint_residual=float(jump),
        waypoint_error=float(miss) if waypoints is not None else 0.0,
        state_error=state_error,
        problems=tuple(problems),
    )


def certify_plan(plan: Plan) -> Report:
    """Prove a plan again, from its trajectory, yaw motion, limits and waypoints alone."""
    return certify_answer(plan.problem, plan.trajectory, plan.pieces, yaw=plan.yaw_motion)


def certify_answer(
    problem: Problem,
    trajectory: Trajectory,
    pieces: Sequence[int] | None = None,
    *,
    yaw: Trajectory | None = None,
) -> Report:
    """Prove that a trajectory answers a problem, and a yaw motion in one axis its heading."""
    report = _certify_flight(problem, trajectory, pieces)
    if problem.heading is None:
        if yaw is None:
            return report
        line = "there is a yaw motion, but nothing is asked of the yaw that could be proven"
        return replace(report, feasible=False, problems=(*report.problems, line))
    counts = (1,) * len(trajectory) if pieces is None else pieces
    passed = trajectory.breakpoints[np.concatenate(([0], np.cumsum(counts)))]
    peaks, problems = certify_yaw(problem.heading, yaw, trajectory, passed)
    if problem.heading.is_about_body or problem.limits.on_rotors:
        twisted, exceeding = certify_twist(problem, problem.heading, yaw, trajectory)
        twisted = {  # of limits on rotors, what holds without twisting is proven as well
            name: np.maximum(kappa, report.peaks.get(name, kappa))
            for name, kappa in twisted.items()
        }
        peaks, problems = peaks | twisted, problems + exceeding
    return replace(
        report,
        feasible=report.feasible and not problems,
        peaks=report.peaks | peaks,
        problems=(*report.problems, *problems),
    )


def _certify_flight(
    problem: Problem, trajectory: Trajectory, pieces: Sequence[int] | None
) -> Report:
    return certify(
        trajectory,
        problem.limits,
        waypoints=problem.waypoints,
        pieces=pieces,
        continuity=problem.spline_class.continuity,
        fixed=problem.fixed,
    )


def stretch_to_limits(trajectory: Trajectory, limits: Limits) -> tuple[Trajectory, float] | None:
    """The same path, flown as fast as the limits allow: the exact uniform stretch.

    Scaling all times by alpha divides derivative s by alpha^s. The smallest alpha that keeps every
    limit costs no new spline; it is found by certified peaks and closed to 1e-9.

    Returns
    -------
    The certified trajectory and alpha, or None if no alpha keeps the limits.
    """
    _check_axes(trajectory)
    eased = 1.0 if limits.figures is None else _ease(trajectory, limits)
    start = trajectory if eased == 1.0 else trajectory.stretch(eased)
    coefficients, times = fresh(start.coefficients), fresh(start.segment_times)
    upper = np.empty((len(times), len(KINDS)))
    factor = bounds.certify(*_arguments(coefficients, times, limits, upper), bounds.ROUNDS)
    if not (np.isfinite(factor) and times.min() >= SHORTEST and times.max() <= LONGEST):
        return None
    return Trajectory(coefficients, times, trajectory.start_time), eased * float(factor)


def _ease(trajectory: Trajectory, limits: Limits) -> float:
    """A small stretch that keeps the limits, where they are exceeded by little; else 1.

    A slower flight need not turn its thrust slower: the nearest stretch that does may be alone
    among those that do not, which the search from the slow side would miss.
    """
    excess = np.nanmax(peak_ratios(trajectory, limits)) - 1.0
    if 0.0 < excess <= LITTLE:
        for stretch in 1.0 + excess * np.array(EASES):
            if np.nanmax(peak_ratios(trajectory.stretch(stretch), limits)) <= 1.0:
                return float(stretch)
    return 1.0


def peak_ratios(trajectory: Trajectory, limits: Limits) -> np.ndarray:
    """(K, len(KINDS)) certified kappa (Eq. kapp_i, Eq. kappa2); NaN for limits that are not set."""
    _check_axes(trajectory)
    return _bound(fresh(trajectory.coefficients), fresh(trajectory.segment_times), limits)


def _bound(coefficients: np.ndarray, times: np.ndarray, limits: Limits) -> np.ndarray:
    upper = np.empty((len(times), len(KINDS)))
    bounds.certify(*_arguments(coefficients, times, limits, upper), 1)
    return upper


def _firsts(pieces: Sequence[int], segments: int) -> np.ndarray:
    """(legs,) first segment of each leg, from the number of pieces in each."""
    counts = np.array(pieces)
    whole = counts.dtype.kind in "iu" and counts.ndim == 1
    if not (whole and (counts >= 1).all() and counts.sum() == segments):
        raise InvalidProblem(
            f"pieces must be whole numbers from 1 that add up to the {segments} segments"
        )
    return np.concatenate(([0], np.cumsum(counts)[:-1])).astype(np.int64)


def _arguments(
    coefficients: np.ndarray, times: np.ndarray, limits: Limits, upper: np.ndarray
) -> tuple[Any, ...]:
    """What `bounds.certify` takes before `rounds`; upper (K, len(KINDS)) gets the bounds."""
    degree = coefficients.shape[1] - 1
    return (
        coefficients,
        times,
        limits.as_array(),
        GRAVITY,
        bounds.lookup_tables(degree),
        TOLERANCE,
        upper,
        np.empty_like(upper),
        np.empty_like(upper),
        bounds.quotients_workspace(degree) if limits.on_leaning else None,
        turning.workspace(degree) if limits.on_turning else None,
        None if limits.figures is None else rotors.workspace(degree, limits.figures),
    )


def _state_error(
    coefficients: np.ndarray, times: np.ndarray, firsts: np.ndarray, fixed: Mapping[int, np.ndarray]
) -> tuple[float, int, int]:
    """Largest difference from what is fixed, with its waypoint and derivative."""
    indices = list(fixed)
    rows = max(len(state) for state in fixed.values())
    states = np.full((len(indices), rows, 3), np.nan)
    for row, state in zip(states, fixed.values(), strict=True):
        row[: len(state)] = state
    at_end = np.array([index == len(firsts) for index in indices])
    pieces = np.array(
        [len(times) - 1 if index == len(firsts) else firsts[index] for index in indices]
    )
    factorials = bernstein.falling_factorials(coefficients.shape[1] - 1)
    error, where, order = joints.state_errors(
        coefficients, times, factorials, pieces, at_end, states
    )
    return float(error), indices[where], order


def _jump_caps(limits: Limits, continuity: int) -> np.ndarray:
    """(continuity+1,) jumps that no motion excuses: a part of the limit on that derivative.

    What a derivative is large against in the time of a very short piece may be a great deal in
    flight.
    """
    caps = np.full(continuity + 1, np.inf)
    for kind in KINDS[:4]:
        limit = getattr(limits, kind.name)
        if limit is not None and kind.order <= continuity:
            caps[kind.order] = JUMP_OF_LIMIT * limit
    return caps


def _check_axes(trajectory: Trajectory) -> None:
    if trajectory.axes != 3:
        raise InvalidProblem(f"the trajectory has {trajectory.axes} axes; limits are about three")


def _exceeded(peaks: dict[str, np.ndarray], limits: Limits) -> list[str]:
    """One line for each limit that is not kept."""
    lines = []
    for kind in limits.active:
        kappa = peaks[kind.name]
        if not kappa.max() <= 1.0:  # NaN counts as exceeded
            segment = int(np.argmax(kappa))
            reached = limits.attained(kind, float(kappa[segment]))
            if kind.name == "least_rotor_thrust" and reached is not None:
                how = f"falls to {reached:.6g} {kind.unit}, below its limit of"  # which may be 0
            else:
                how = f"reaches {kappa[segment]:.6g} times its limit of"
            limit = getattr(limits, kind.name)
            lines.append(f"{kind.label} {how} {limit:g} {kind.unit} in segment {segment}")
    return lines
