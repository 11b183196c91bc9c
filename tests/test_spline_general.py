"""Splines of any class: against optimality conditions in rationals, and conditions on the result."""

from dataclasses import dataclass, field
from fractions import Fraction
from math import perm

import numpy as np
import pytest

from peakflight import InvalidProblem, Limits, certify, minimum_effort_spline, spline
from peakflight.problem import SplineClass, fixed_state
from peakflight.spline import SplineTask, Undetermined

kernels = pytest.mark.kernels
NAN = np.nan


@dataclass
class Case:
    """A spline problem in few legs; `exact_optimum` solves it in rationals."""

    name: str
    degree: int
    weights: dict
    continuity: int
    times: tuple = (0.5, 1.25, 0.375)
    axes: int = 1
    start: dict | None = None
    end: dict | None = None
    derivatives: dict = field(default_factory=dict)
    free: tuple = ()
    """(waypoint, axis) of positions that are free."""
    jumps_above: int | None = None
    """Highest continuous derivative, where it is lower than `continuity`; see `is_classical`."""

    @property
    def waypoints(self):
        rng = np.random.default_rng(len(self.name))
        points = np.round(np.cumsum(rng.normal(size=(len(self.times) + 1, self.axes)), axis=0), 2)
        for waypoint, axis in self.free:
            points[waypoint, axis] = np.nan
        return points

    def solve(self):
        return minimum_effort_spline(
            self.waypoints,
            self.times,
            minimize=self.weights,
            degree=self.degree,
            continuity=self.continuity,
            start=self.start,
            end=self.end,
            derivatives=self.derivatives,
        )

    def fixed(self, axis):
        """(K+1, N) fixed derivatives 0..N-1 in one axis, NaN where free."""
        last = len(self.times)
        rest = (self.degree - 1) // 2
        table = np.full((last + 1, self.degree, self.axes), np.nan)
        table[:, 0] = self.waypoints
        table[[0, -1], 1 : rest + 1] = 0.0
        states = {0: self.start or {}, last: self.end or {}, **self.derivatives}
        for waypoint, state in states.items():
            for order, values in state.items():
                table[waypoint, order] = values
        return table[:, :, axis]


CASES = [
    # any degree, even ones too; one weight
    Case("acceleration, degree 3, C1", 3, {2: 1}, 1),
    Case("jerk, degree 3, C1", 3, {3: 1}, 1),
    Case("velocity, degree 3, C2", 3, {1: 1}, 2),
    Case("acceleration, degree 4, C2", 4, {2: 1}, 2),
    Case("jerk, degree 4, C3", 4, {3: 1}, 3),
    Case("jerk, degree 5, C3", 5, {3: 1}, 3),
    Case("snap, degree 5, C3 (the paper)", 5, {4: 1}, 3),
    Case("snap, degree 5, C2", 5, {4: 1}, 2),
    Case("snap, degree 5, C4", 5, {4: 1}, 4),
    Case("jerk, degree 5, C1 (below r-1)", 5, {3: 1}, 1, start={1: [1]}),
    Case("acceleration, degree 5, C2", 5, {2: 1}, 2),
    Case("jerk, degree 6, C4", 6, {3: 1}, 4),
    Case("snap, degree 6, C3", 6, {4: 1}, 3),
    Case("snap, degree 6, C5 (highest)", 6, {4: 1}, 5),
    Case("jerk, degree 7, C3", 7, {3: 1}, 3),
    Case("jerk, degree 7, C4", 7, {3: 1}, 4),
    Case("crackle, degree 7, C5", 7, {5: 1}, 5),
    Case("snap, degree 8, C6", 8, {4: 1}, 6, times=(0.5, 1.25)),
    Case("snap, degree 9, C4", 9, {4: 1}, 4, times=(0.5, 1.25)),
    Case("jerk, degree 9, C0", 9, {3: 1}, 0, times=(0.5, 1.25), derivatives={1: {1: [1], 2: [0]}}),
    Case("snap, degree 10, C6", 10, {4: 1}, 6, times=(0.5, 1.25)),
    Case("jerk, degree 11, C4", 11, {3: 1}, 4, times=(0.5, 1.25)),
    Case("degree 11 itself, C5", 11, {11: 1}, 5, times=(0.5,)),
    # mixed weights
    Case("jerk and snap, degree 5", 5, {3: 1, 4: 0.03125}, 3),
    Case("jerk and snap, degree 7, C6", 7, {3: 1, 4: 0.125}, 6),
    Case("velocity to snap, degree 7", 7, {1: 0.5, 2: 0.25, 3: 1, 4: 0.125}, 4),
    Case("position and jerk", 5, {0: 40, 3: 1}, 4),
    Case("position to snap, degree 6", 6, {0: 8, 1: 2, 4: 0.25}, 3),
    Case("highest derivatives, degree 8", 8, {7: 2**-24, 8: 2**-28, 3: 64}, 4, times=(0.5, 1.25)),
    # moving and free ends
    Case("moving ends", 5, {3: 1}, 3, start={1: [2], 2: [-1]}, end={1: [1], 2: [3]}),
    Case("free ends, natural spline", 3, {2: 1}, 2, start={1: [NAN]}, end={1: [NAN]}),
    Case("free ends, min jerk", 5, {3: 1}, 4, start={1: [NAN], 2: [NAN]}, end={1: [NAN], 2: [NAN]}),
    Case("free acceleration at the end", 7, {4: 1}, 6, end={2: [NAN]}),
    Case("jerk at the start, beyond end data", 5, {3: 1}, 3, start={3: [2]}),
    Case("snap at both ends, beyond end data", 5, {3: 1}, 3, start={4: [2]}, end={4: [-3]}),
    Case("orders 3 to 5 at the start of degree 6", 6, {3: 1}, 3, start={3: [2], 4: [0], 5: [9]}),
    Case("jerk at the end of degree 6", 6, {3: 1}, 3, end={3: [2]}),
    Case("only a high order at the end", 6, {3: 1}, 2, end={1: [NAN], 2: [NAN], 4: [5]}),
    # fixed inner derivatives
    Case("inner velocity of the classical one", 5, {3: 1}, 4, derivatives={1: {1: [1]}}, jumps_above=2),
    Case("inner state", 5, {4: 1}, 3, derivatives={2: {1: [1], 2: [0]}}),
    Case("inner velocity at every waypoint", 7, {4: 1}, 4, derivatives={1: {1: [1]}, 2: {1: [-1]}}),
    Case("inner order beyond continuity", 7, {3: 1}, 2, derivatives={1: {3: [4]}}),
    Case("inner order beyond the end data", 5, {3: 1}, 4, derivatives={1: {4: [4]}}, jumps_above=2),
    Case("inner jerk at C3", 5, {4: 1}, 3, derivatives={1: {3: [4]}}),
    Case("inner snap at C3", 5, {4: 1}, 3, derivatives={1: {4: [4]}}),
    Case("inner snap at C5, degree 7", 7, {4: 1}, 5, derivatives={1: {4: [4]}}, jumps_above=3),
    Case("inner jerk, degree 6, C2", 6, {3: 1}, 2, derivatives={1: {3: [4]}}),
    Case("per axis", 5, {3: 1}, 4, axes=3, start={1: [1, 0, NAN]}, end={2: [NAN, NAN, 1]},
         derivatives={1: {1: [NAN, 2, NAN]}, 2: {2: [0, NAN, NAN]}}, jumps_above=2),
    # free positions
    Case("free inner position", 5, {3: 1}, 4, free=((1, 0),)),
    Case("free inner position, mixed", 7, {2: 1, 4: 0.5}, 4, free=((2, 0),), axes=2),
    Case("free last position", 5, {3: 1}, 4, free=((3, 0),)),
    Case("free first and inner positions", 5, {4: 1}, 3, free=((0, 0), (2, 0))),
    Case("free positions with inner velocity", 5, {3: 1}, 4, free=((1, 0),), derivatives={1: {1: [3]}},
         jumps_above=2),
    Case("all free but weighed", 5, {0: 3, 3: 1}, 4, free=tuple((k, 0) for k in range(4)),
         start={1: [2], 2: [0]}),
    Case("free position, degree 6, weighed", 6, {0: 1, 3: 1}, 5, free=((1, 0),)),
    # one and two legs
    Case("one leg", 7, {4: 1}, 6, times=(0.75,), start={1: [NAN]}),
    Case("one leg, degree 11, jerk", 11, {3: 1}, 4, times=(0.75,)),
    Case("two legs, C9 at degree 10", 10, {5: 1}, 9, times=(0.75, 0.5)),
]  # fmt: skip

every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)


def constraint_rows(case, axis, number=Fraction):
    """Rows over all coefficients of one axis, and right-hand sides, none twice."""
    size, legs = case.degree + 1, len(case.times)
    times = [number(t) for t in case.times]
    fixed = case.fixed(axis)
    rows, right = [], []

    def derivative(entries, value):
        row = [number(0)] * (size * legs)
        for piece, t, order, sign in entries:
            for j in range(order, size):
                row[piece * size + j] += sign * perm(j, order) * t ** (j - order)
        rows.append(row)
        right.append(number(value))

    continuity = case.continuity if case.jumps_above is None else case.jumps_above
    for waypoint in range(legs + 1):
        for order in range(case.degree):
            known = not np.isnan(fixed[waypoint, order])
            joined = 0 < waypoint < legs and order <= continuity
            if joined:
                derivative([(waypoint - 1, times[waypoint - 1], order, 1),
                            (waypoint, number(0), order, -1)], 0)  # fmt: skip
            if known and waypoint < legs:
                derivative([(waypoint, number(0), order, 1)], fixed[waypoint, order])
            if known and waypoint > 0 and not joined:
                derivative([(waypoint - 1, times[waypoint - 1], order, 1)], fixed[waypoint, order])
    return rows, right


def cost_blocks(case, number=Fraction):
    """(K, N+1, N+1) of the cost in coefficients by time."""
    size = case.degree + 1
    blocks = []
    for time in case.times:
        t = number(time)
        block = [[number(0)] * size for _ in range(size)]
        for s, weight in case.weights.items():
            for i in range(s, size):
                for j in range(s, size):
                    e = i + j - 2 * s + 1
                    block[i][j] += number(weight) * perm(i, s) * perm(j, s) * t**e / e
        blocks.append(block)
    return blocks


def exact_optimum(case):
    """(K, N+1, D) from the optimality conditions (KKT), by elimination in rationals."""
    legs, size = len(case.times), case.degree + 1
    found = np.zeros((legs, size, case.axes))
    blocks = cost_blocks(case)
    for axis in range(case.axes):
        rows, right = constraint_rows(case, axis)
        unknowns, total = legs * size, legs * size + len(rows)
        matrix = [[Fraction(0)] * (total + 1) for _ in range(total)]
        for k, block in enumerate(blocks):
            for i in range(size):
                matrix[k * size + i][k * size : (k + 1) * size] = block[i]
        for m, (row, value) in enumerate(zip(rows, right, strict=True)):
            for j, entry in enumerate(row):
                matrix[unknowns + m][j] = matrix[j][unknowns + m] = entry
            matrix[unknowns + m][total] = value
        found[:, :, axis] = np.reshape(eliminate(matrix)[:unknowns], (legs, size))
    return found


def eliminate(rows):
    """Solution of an augmented system, as floats."""
    size = len(rows)
    for i in range(size):
        pivot = next(k for k in range(i, size) if rows[k][i])
        rows[i], rows[pivot] = rows[pivot], rows[i]
        scale = rows[i][i]
        rows[i] = [a / scale if a else a for a in rows[i]]
        for k in range(i + 1, size):
            if rows[k][i]:
                factor = rows[k][i]
                rows[k] = [a - factor * b if b else a for a, b in zip(rows[k], rows[i], strict=True)]
    solution = [Fraction(0)] * size
    for i in reversed(range(size)):
        row = rows[i]
        solution[i] = row[size] - sum((row[k] * solution[k] for k in range(i + 1, size) if row[k]),
                                      Fraction(0))  # fmt: skip
    return np.array([float(value) for value in solution])


def normalised(coefficients, times):
    return coefficients * np.asarray(times)[:, None, None] ** np.arange(coefficients.shape[1])[:, None]


# ---- against rationals ----------------------------------------------------------------------


@kernels
@every_case
def test_matches_the_optimum_in_rationals(case):
    found, exact = case.solve(), exact_optimum(case)
    error = np.abs(normalised(found.coefficients - exact, case.times)).max()
    # 2e-13 measured; the worst are those whose weights make terms of very different size
    assert error <= 2e-12 * np.abs(normalised(exact, case.times)).max()
