"""Motions for `joint` to begin from: a guess, or any trajectory."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from peakflight.kernels import basis
from peakflight.methods import peak, proportional
from peakflight.methods.classes import as_asked, without_class
from peakflight.problem import Problem, SplineClass
from peakflight.result import Plan
from peakflight.spline import SplineTask
from peakflight.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Start:
    """A motion to begin from: what `unknowns.set_unknowns` takes."""

    pieces: np.ndarray
    """(legs,)."""
    data: np.ndarray
    """(K, N, 3) end data by time."""
    starts: np.ndarray
    """(K, 3) m, where pieces begin, from the first waypoint of their leg."""
    times: np.ndarray
    """(K,) s."""
    dual: np.ndarray | None = None
    """Multipliers of a similar problem, if they are known."""


def start_of(
    trajectory: Trajectory, pieces: np.ndarray, problem: Problem, moved: np.ndarray | None = None
) -> Start:
    """A trajectory as a start; waypoints that moved, by (legs+1, 3) m, take joints with them."""
    degree = problem.spline_class.degree
    times = trajectory.segment_times
    powers = times[:, None] ** np.arange(trajectory.degree + 1.0)
    orders = basis.row_orders(degree)[:-1]
    scaled = trajectory.coefficients * powers[:, :, None]
    data = basis.from_monomials(degree, trajectory.degree) @ scaled
    data /= times[:, None, None] ** orders[:, None]
    leg = np.repeat(np.arange(len(pieces)), pieces)
    firsts = np.cumsum(pieces) - pieces
    begins = trajectory.coefficients[:, 0]
    starts = begins - begins[firsts][leg]
    if moved is not None:
        longer = ((moved[1:] - moved[:-1]) / pieces[:, None])[leg]
        data[:, 0] += longer
        starts += (np.arange(len(times)) - firsts[leg])[:, None] * longer
    return Start(pieces, data, starts, times)


def guess(problem: Problem, ease: float) -> Start:
    """Velocities of the spline of least jerk at durations that one can tell beforehand.

    ease: weight of the time that it takes to speed up, beside the time at the limit of speed.
    """
    degree = problem.spline_class.degree
    left, _ = basis.counts(degree)
    limits, lengths = problem.limits, problem.leg_lengths
    times = lengths / (limits.speed or 1.0)
    if ease > 0.0 and limits.jerk:
        times = ease * np.cbrt(lengths / limits.jerk) + (times if limits.speed else 0.0)
    last = len(times)
    ends = {index: np.nan_to_num(problem.fixed[index][:2]) for index in (0, last)}
    spline = SplineTask.of(problem.waypoints, SplineClass.of("jerk"), ends).solve(times)
    data = np.zeros((last, degree, 3))
    data[:, 0] = problem.waypoints[1:] - problem.waypoints[:-1]
    data[:, 1] = spline.coefficients[:, 1]
    data[:-1, left] = spline.coefficients[1:, 1]
    return Start(np.ones(last, dtype=np.int64), data, np.zeros((last, 3)), times)


def given(
    initial: Literal["guess", "proportional", "peak"] | Plan,
    problem: Problem,
    completed: Problem,
    *,
    pieces: int | Literal["auto"],
    most: int | None,
) -> Start | None:
    """What is named to begin from; None for a guess, also where a plan does not fit.

    completed: the problem with what it leaves to the method filled in; pieces: in each leg; most:
    pieces in all.
    """
    legs = len(problem.waypoints) - 1
    if isinstance(initial, Plan):
        if most is not None and sum(initial.pieces) > most:
            return None
        if len(initial.pieces) != legs or (pieces != "auto" and set(initial.pieces) != {pieces}):
            return None
        moved = problem.waypoints - initial.problem.waypoints
        start = start_of(initial.trajectory, np.array(initial.pieces), completed, moved)
        return replace(start, dual=initial.memory)
    if initial == "guess":
        return None
    method = peak if initial == "peak" else proportional
    found = method.solve(without_class(as_asked(problem)), method.Settings())
    return start_of(found.trajectory, np.ones(legs, dtype=np.int64), completed)
