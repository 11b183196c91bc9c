"""What a report says of a plan: proven anew, measured, and compared with the guess."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from peakflight.certificate import certify_plan
from peakflight.claims import false_claims
from peakflight.curves import sampled_curves
from peakflight.errors import PeakflightError
from peakflight.methods.classes import as_asked
from peakflight.planner import plan as solve
from peakflight.result import Plan
from peakflight.summary import LegSummary, LimitSummary, leg_summaries, limit_summaries
from peakflight.trajectory import Trajectory

GUESS = "proportional"
"""The method that a plan is compared with: the paper's initial guess."""


class Jump(NamedTuple):
    """How much a derivative of position jumps at the joints."""

    order: int
    """Of the derivative."""
    size: float
    """Of the largest jump, in m/s^order; 0 without joints."""
    joint: int
    """Where it is: the segment that ends there."""


@dataclass(frozen=True, kw_only=True)
class Findings:
    """Everything that a report shows."""

    plan: Plan
    """With the `report` that was proven now, whatever its file says."""
    false_claims: tuple[str, ...]
    """What the file says that is not so."""
    guess: Plan | None
    """The proportional guess for the same problem; None if there is none."""
    legs: list[LegSummary]
    limits: list[LimitSummary]
    leg_lengths: np.ndarray
    """(legs,) m, along the path."""
    misses: np.ndarray
    """(legs+1,) m by which each waypoint is missed."""
    jumps: list[Jump]
    """Of the derivatives that must not jump, from position on."""


@np.errstate(over="ignore", invalid="ignore")  # a file may be far from a flight
def find(plan: Plan, claims: Mapping[str, Any] | None = None) -> Findings:
    """Prove a plan again and gather what there is to say of it.

    Parameters
    ----------
    claims
        The plan file, to be compared with the proof; by default what the plan would write.
    """
    proven = certify_plan(plan)
    wrong = false_claims(plan.to_dict() if claims is None else claims, plan, proven)
    plan = replace(plan, report=proven)
    return Findings(
        plan=plan,
        false_claims=wrong,
        guess=initial_guess(plan),
        legs=leg_summaries(plan),
        limits=limit_summaries(plan),
        leg_lengths=_leg_lengths(plan),
        misses=_misses(plan),
        jumps=_jumps(plan.trajectory, plan.problem.spline_class.continuity),
    )


def initial_guess(plan: Plan) -> Plan | None:
    """The paper's guess, with the spline that is usual for what the problem minimizes.

    None where the plan is that guess, or where it cannot be made.
    """
    if plan.method == GUESS:
        return None
    try:
        guess = solve(as_asked(plan.problem), method=GUESS)
    except PeakflightError:  # a motion that splines cannot have: there is nothing to compare with
        return None
    return guess if guess.feasible else None


def _leg_lengths(plan: Plan) -> np.ndarray:
    times, curves = sampled_curves(plan.trajectory)
    along = np.trapezoid(curves["speed"], times, axis=1)
    first = np.cumsum((0, *plan.pieces[:-1]))
    lengths: np.ndarray = np.add.reduceat(along, first)
    return lengths


def _misses(plan: Plan) -> np.ndarray:
    """The larger miss of the two legs that meet at a waypoint."""
    last = np.cumsum(plan.pieces) - 1
    first = last - np.array(plan.pieces) + 1
    ends = plan.trajectory.sample(2)
    points = plan.problem.waypoints
    misses = np.zeros(len(points))
    misses[:-1] = np.linalg.norm(ends[first, 0] - points[:-1], axis=1)
    misses[1:] = np.maximum(misses[1:], np.linalg.norm(ends[last, 1] - points[1:], axis=1))
    return misses


def _jumps(trajectory: Trajectory, continuity: int) -> list[Jump]:
    jumps = []
    for order in range(continuity + 1):
        ends = trajectory.sample(2, order)
        sizes = np.linalg.norm(ends[1:, 0] - ends[:-1, 1], axis=1)
        joint = int(sizes.argmax()) if len(sizes) else 0
        jumps.append(Jump(order, float(sizes[joint]) if len(sizes) else 0.0, joint))
    return jumps
