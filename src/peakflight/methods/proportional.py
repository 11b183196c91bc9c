"""Segment times proportional to distance: the paper's initial guess, made feasible."""

from dataclasses import dataclass

from peakflight.methods import Outcome, spline_kernels
from peakflight.methods.scaling import finish, proportional_times
from peakflight.problem import Problem
from peakflight.result import History
from peakflight.spline import SplineTask


@dataclass(frozen=True, kw_only=True)
class Settings:
    """There is nothing to set."""


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the spline."""
    del settings
    return f"proportional-{spline_kernels(problem)}"


def solve(problem: Problem, settings: Settings) -> Outcome:
    """Share out the time by distance and stretch it until every limit holds."""
    del settings
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    outcome = finish(problem, task, proportional_times(problem))
    history = History(segment_times=outcome.trajectory.segment_times[None])
    return Outcome(
        status=outcome.status,
        trajectory=outcome.trajectory,
        history=history,
        message=outcome.message,
    )
