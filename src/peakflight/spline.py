"""Sub-problem 1 (Eq. mellinger_poly): the smoothest spline through waypoints at given times.

The cost is quadratic in the coefficients and the constraints are linear, so the optimum is the
solution of a banded linear system: O(K) in time and memory, whatever the class of spline.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from peakflight.errors import InvalidProblem
from peakflight.kernels import basis, classical, general
from peakflight.kernels.jit import fresh
from peakflight.kernels.layout import make_cost, make_layout
from peakflight.problem import SplineClass, StateLike, as_float_array, fixed_state
from peakflight.trajectory import Trajectory

REFINEMENTS = 3
"""Solves of a general spline with one factorisation; more change nothing at double precision."""

SINGULAR = 1e-9
"""A pivot this small, at durations that are alike, means that there is not one optimum."""
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


class Undetermined(InvalidProblem):
    """Cost and constraints leave something free, or contradict each other."""


class OutOfRange(InvalidProblem):
    """Durations or distances differ too much for double precision."""


@dataclass(frozen=True, eq=False)
class SplineTask:
    """A spline problem laid out for the kernels, ready to be solved for any segment times.

    The workspaces are overwritten by every solve: a task belongs to one thread.
    """

    spline_class: SplineClass
    waypoints: np.ndarray
    """(K+1, D) m; any reference where a position is free."""
    simple: tuple[Any, ...] | None
    """Workspace of `kernels.classical`, or None."""
    layered: tuple[Any, ...] | None
    """Workspace of `kernels.general`, or None."""

    @classmethod
    def of(
        cls, waypoints: np.ndarray, spline_class: SplineClass, fixed: Mapping[int, np.ndarray]
    ) -> "SplineTask":
        """Lay out a problem.

        Parameters
        ----------
        waypoints
            (K+1, D) m; NaN where a position is free.
        spline_class
            Degree, cost and continuity.
        fixed
            Waypoint index to fixed derivatives (n, D) from velocity on; NaN where free.

        Raises
        ------
        Undetermined
            If there is not exactly one optimum.
        """
        count, axes = waypoints.shape
        degree = spline_class.degree
        b = degree // 2
        if is_plain(waypoints, spline_class, fixed):
            joints = np.zeros((count, b, axes))
            joints[0], joints[-1] = fixed[0], fixed[count - 1]
            workspace = (
                (0,) * axes,
                fresh(basis.energy(degree, b + 1)),
                joints,
                np.zeros((count, b, b)),
                np.zeros((count, b, b)),
                np.zeros((2, degree)),
                np.zeros((count, b, axes)),
            )
            return cls(spline_class, fresh(waypoints), workspace, None)
        table = np.full((count, degree, axes), np.nan)
        table[:, 0] = waypoints
        for index, state in fixed.items():
            table[index, 1 : len(state) + 1] = state
        continuity = spline_class.continuity
        inner = np.isfinite(table[1:-1, 1:]).any()
        if spline_class.is_classical and not inner and not np.isfinite(table[:, b + 1 :]).any():
            continuity = b  # the optimum is smoother by itself
        layout = make_layout(degree, continuity, table)
        patterns, _, slots = layout.free.shape
        size = count * slots
        factors = (
            np.zeros((patterns, size)),
            np.zeros((patterns, size, 3 * (2 * slots - 1) + 1)),
            np.zeros((patterns, size), dtype=np.int64),
        )
        values = np.zeros((size, axes))
        starts = np.zeros((count - 1, axes))
        reference = _fill_free(waypoints)
        cost = make_cost(degree, spline_class.weights)
        # Whether there is one optimum does not depend on times and weights, save by coincidence:
        # ask where the matrix is well conditioned, and times are alike but in no pattern.
        probe = 1.0 + 0.3 * (GOLDEN * np.arange(1.0, count) % 1.0)
        pivot = general.factorise(
            layout, cost._replace(weights=np.ones_like(cost.weights)), probe, factors
        )
        if not pivot > SINGULAR:
            raise Undetermined(
                f"the cost and what is fixed do not determine one trajectory (degree {degree}, "
                f"continuity C{continuity}): fix less or more, ask for less continuity, weigh a "
                "lower derivative or raise the degree"
            )
        return cls(spline_class, reference, None, (layout, cost, factors, values, starts))

    @property
    def rows(self) -> tuple[int, ...]:
        """The degree, as kernels want it."""
        return (0,) * self.spline_class.degree

    def solve(self, segment_times: np.ndarray) -> Trajectory:
        """The optimal trajectory for (K,) segment times.

        Raises
        ------
        OutOfRange
            If the durations differ too much for double precision.
        """
        times = fresh(segment_times)
        count, axes = self.waypoints.shape
        data = np.empty((count - 1, self.spline_class.degree, axes))
        starts = self.waypoints[:-1]
        if self.layered is None:
            assert self.simple is not None
            shape, energy, joints, factor, coupling, powers, _ = self.simple
            classical.solve(
                self.rows, shape, energy, self.waypoints, times, joints, factor, coupling,
                powers, data,
            )  # fmt: skip
        else:
            layout, cost, factors, values, starts = self.layered
            code = general.solve(
                layout, cost, self.waypoints, times, REFINEMENTS, factors, values, data, starts
            )
            if code != 0:
                data[:] = np.nan
        with np.errstate(all="ignore"):
            coefficients = coefficients_of(data, starts, times)
        try:
            return Trajectory(coefficients, times)
        except InvalidProblem:
            raise OutOfRange(
                "the spline cannot be computed in double precision: legs and durations differ too "
                f"much ({times.min():g} to {times.max():g} s) for degree {self.spline_class.degree}"
            ) from None


def is_plain(
    waypoints: np.ndarray, spline_class: SplineClass, fixed: Mapping[int, np.ndarray]
) -> bool:
    """Whether `kernels.classical` does: full end states, and nothing else fixed or free."""
    last = len(waypoints) - 1
    return (
        spline_class.is_classical
        and bool(np.isfinite(waypoints).all())
        and all(
            np.isnan(state).all() if 0 < index < last else np.isfinite(state).all()
            for index, state in fixed.items()
        )
        and all(len(fixed[index]) == spline_class.end_orders for index in (0, last))
    )


def coefficients_of(data: np.ndarray, starts: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Coefficients (K, N+1, D) from end data (K, N, D), first positions (K, D) and durations."""
    degree = data.shape[1]
    matrix = basis.to_monomials(degree)[:, :degree]
    coefficients = np.matmul(matrix, data)
    coefficients *= times[:, None, None] ** -np.arange(degree + 1.0)[:, None]
    coefficients[:, 0] = starts
    return coefficients


def minimum_effort_spline(
    waypoints: ArrayLike,
    segment_times: ArrayLike,
    *,
    minimize: str | Mapping[str | int, float] = "jerk",
    degree: int | None = None,
    continuity: int | None = None,
    start: StateLike | None = None,
    end: StateLike | None = None,
    derivatives: Mapping[int, StateLike] | None = None,
) -> Trajectory:
    """The spline of least effort through waypoints at given times (Eq. minfuncP, mellinger_poly).

    Parameters
    ----------
    waypoints
        (K+1, D) m, in any number of axes; NaN where a position is free.
    segment_times
        (K,) s.
    minimize, degree, continuity
        The class of spline, as in `Problem`: any non-negative weights on the squared derivatives,
        degree 3 to 11, continuity up to degree - 1.
    start, end, derivatives
        Fixed derivatives at the first, the last and at inner waypoints by index, as in `Problem`.

    Raises
    ------
    InvalidProblem
        If an argument is against a rule, or the optimum is not determined.
    """
    points = as_float_array("waypoints", waypoints, (None, None))
    if len(points) < 2 or np.isinf(points).any():
        raise InvalidProblem("waypoints must be two at least, and finite or NaN")
    times = as_float_array("segment_times", segment_times, (len(points) - 1,))
    bad = ~(np.isfinite(times) & (times > 0.0))
    if bad.any():
        index = int(bad.argmax())
        raise InvalidProblem(f"segment {index} lasts {times[index]} s; it must be positive")
    spline_class = SplineClass.of(minimize, degree, continuity, inner=bool(derivatives))
    axes, last = points.shape[1], len(points) - 1
    rest = spline_class.end_orders
    fixed = {
        0: fixed_state("start", start, axes, spline_class.degree, zeros=rest),
        last: fixed_state("end", end, axes, spline_class.degree, zeros=rest),
    }
    for index, state in (derivatives or {}).items():
        if not 0 < index < last:
            raise InvalidProblem(f"derivatives at waypoint {index}: inner ones are 1 to {last - 1}")
        what = f"waypoint {index}"
        fixed[index] = fixed_state(what, state, axes, spline_class.degree, zeros=0)
    return SplineTask.of(points, spline_class, fixed).solve(times)


def _fill_free(waypoints: np.ndarray) -> np.ndarray:
    """Put a reference where positions are free: between the fixed ones around."""
    filled = fresh(waypoints)
    index = np.arange(len(filled))
    for column in filled.T:
        known = np.isfinite(column)
        column[~known] = np.interp(index[~known], index[known], column[known]) if known.any() else 0
    return filled
