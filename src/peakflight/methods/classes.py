"""The class of spline: what `joint` takes, what `peak` takes beside it, what was asked for."""

from dataclasses import replace
from typing import Any

import numpy as np

from peakflight.errors import InvalidProblem
from peakflight.kernels import basis
from peakflight.problem import DEGREES, Problem, derivative_name

DEGREE = 7
"""Degree where the problem leaves it to the method."""


def complete(problem: Problem) -> Problem:
    """The problem with degree and continuity filled in."""
    highest = _highest(problem)
    degree = problem.degree
    if degree is None:
        degree = min(max(DEGREE, 2 * highest + 1), DEGREES[-1])
    most = basis.counts(degree)[1] - 1
    if highest > most:
        raise InvalidProblem(
            f"{derivative_name(highest)} is fixed at a waypoint; method joint fixes up to "
            f"{derivative_name(most)} at degree {degree}"
        )
    continuity = most if problem.continuity is None else problem.continuity
    if continuity > most:
        raise InvalidProblem(
            f"continuity is {continuity}; method joint has up to {most} at degree {degree}"
        )
    if degree == problem.degree and continuity == problem.continuity:
        return problem
    return replace(problem, degree=degree, continuity=continuity)


def _highest(problem: Problem) -> int:
    """The highest derivative that is fixed at a waypoint; 0 if none is."""
    fixed = [np.flatnonzero(np.isfinite(state).any(axis=1)) for state in problem.fixed.values()]
    return 1 + max((int(rows[-1]) for rows in fixed if len(rows)), default=-1)


def without_class(problem: Problem) -> Problem:
    """The problem for a spline of the natural class, of a cost that leaves room for what is fixed.

    The optimum for a cost on the r-th derivative holds derivatives up to the one before.
    """
    highest = _highest(problem)
    if highest < problem.spline_class.cost_order:
        return replace(problem, degree=None, continuity=None)
    return replace(problem, minimize={highest + 1: 1.0}, degree=None, continuity=None)


def as_asked(problem: Problem) -> Problem:
    """The problem without what a class has filled in, as it stands in a plan and its file.

    A problem from there begins as one does whose class is left to the method.
    """
    usual: dict[str, Any] = {"degree": None, "continuity": None}
    usual |= {end: None for end in ("start", "end") if is_rest(getattr(problem, end))}
    return replace(problem, **usual)


def is_rest(state: Any) -> bool:
    """Whether the (n, 3) motion at an end of a problem is the usual one: none."""
    return state is None or not np.asarray(state).any()
