"""Mellinger's method (Eq. timecost): the share of a fixed total at which the spline costs least.

The total is that of times proportional to distance at the scale that their peaks ask for. At rest
it only sets a scale: f(a t) = a^(1-2r) f(t), so the shares, and with them the plan after the exact
stretch, are the same whatever the total. With a moving start or end or a mixed cost it matters.
"""

from dataclasses import dataclass, replace

from peakflight.methods import Outcome
from peakflight.methods.least_effort import DescentSettings, descend, first_times, kernels_for
from peakflight.methods.scaling import finish
from peakflight.problem import Problem
from peakflight.result import History
from peakflight.spline import SplineTask


@dataclass(frozen=True, kw_only=True)
class Settings(DescentSettings):
    """Tuning of `mellinger`."""


def kernels(problem: Problem, settings: Settings) -> str:
    """Those of the spline and of the descent."""
    del settings
    return kernels_for(problem)


def solve(problem: Problem, settings: Settings) -> Outcome:
    """Descend at a fixed total, then stretch until every limit holds."""
    task = SplineTask.of(problem.waypoints, problem.spline_class, problem.fixed)
    start = first_times(problem, task)
    found = descend(task, start, settings, penalty=None)
    outcome = finish(problem, task, found.times, status=found.status)
    history = History(segment_times=found.road)
    return replace(outcome, iterations=found.iterations, history=history)
