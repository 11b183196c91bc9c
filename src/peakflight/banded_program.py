"""Convex quadratic programs whose matrices are banded, by an interior point in linear time.

Mehrotra's predictor and corrector (Nocedal and Wright, Numerical Optimization, algorithm 16.4). The
Newton system is a band, factorised at each iteration; one more unknown, the scale, may widen every
bound and borders that band.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded

ITERATIONS = 100
"""Most; 10 to 25 are usual."""
ACCURACY = 1e-9
"""Of complementarity and residuals, relative, at which it ends."""
STALLED = 1e-6
"""Once the error is below this and no longer falls, rounding allows no better."""
GOOD_ENOUGH = 1e-2
"""Error at which an answer counts: it keeps its bounds, but need not be the very best. So it is
where bounds are a millionth of what the target asks for."""
TOLERANCE = 1e-8
"""By how much an answer may exceed its bounds, in their unit."""
BACK_OFF = 0.995
"""Part of the way to the border of what is allowed that a step goes."""
SIGNS = np.array([[1.0], [-1.0]])
"""Of the upper and the lower bounds, in arrays (2, m)."""
RIDGE = 1e-14
"""Part of the largest diagonal entry that is added to all: it bears rounding."""


class Bounds(NamedTuple):
    """|rows x + offset| <= fixed + growing * scale, row by row."""

    rows: sparse.csr_array
    """(m, n)."""
    offset: np.ndarray
    """(m,)."""
    fixed: np.ndarray
    """(m,)."""
    growing: np.ndarray
    """(m,)."""


def least_squares(rows: sparse.csr_array, target: np.ndarray, bounds: Bounds) -> np.ndarray | None:
    """The (n,) x of least |rows x - target|^2 / 2 under bounds at scale 0; None if none is found.

    The bounds are looked at only if the least of all does not keep them. rows (r, n) and the rows
    of the bounds: `rows.T @ rows` and theirs are narrow bands.
    """
    quadratic, linear = sparse.csr_array(rows.T @ rows), -(rows.T @ target)
    factor = _factor(quadratic)
    if factor is not None:
        x: np.ndarray = cho_solve_banded((factor, True), -linear)
        if _excess(bounds, x) <= 0.0:
            return x
    found = _interior_point(quadratic, linear, bounds, scaled=False)
    return found[0] if found is not None and _excess(bounds, found[0]) <= TOLERANCE else None


def least_scale(bounds: Bounds, *, enough: float) -> float | None:
    """Least scale at which some x meets the bounds, or one below `enough`; None if not found."""
    count = bounds.rows.shape[1]
    nothing = sparse.csr_array((count, count))
    found = _interior_point(nothing, np.zeros(count), bounds, scaled=True, enough=enough)
    return None if found is None else found[1]


def _excess(bounds: Bounds, x: np.ndarray) -> float:
    """By how much x exceeds bounds at scale 0 where it does most; negative if nowhere."""
    over = np.abs(bounds.rows @ x + bounds.offset) - bounds.fixed
    return float(over.max(initial=-np.inf))


def _interior_point(
    quadratic: sparse.csr_array,
    linear: np.ndarray,
    bounds: Bounds,
    *,
    scaled: bool,
    enough: float = -np.inf,
) -> tuple[np.ndarray, float] | None:
    """Least x'Px/2 + q'x, plus the scale if it is free, under the bounds."""
    rows, transposed = bounds.rows, bounds.rows.T
    m, n = rows.shape
    x, scale = np.zeros(n), 1.0 if scaled else 0.0
    growing = bounds.growing if scaled else np.zeros(m)
    room = bounds.fixed + growing * scale
    slack = np.maximum(room - SIGNS * bounds.offset, 0.1 * np.maximum(room, 1e-3))
    size = 1.0 + float(np.abs(linear).max(initial=0.0))
    steepest = float(np.abs(rows.data).max(initial=1.0))
    dual = np.full((2, m), 0.5 / float(growing.sum()) if scaled else size / steepest)
    best = np.inf
    answer = None
    for _ in range(ITERATIONS):
        value = rows @ x + bounds.offset
        room = bounds.fixed + growing * scale
        primal = slack + SIGNS * value - room
        stationary = quadratic @ x + linear + transposed @ (dual[0] - dual[1])
        scale_gradient = float(scaled) - _dot(dual.sum(axis=0), growing)
        gap = float((slack * dual).mean())
        error = max(
            gap / size,
            float(np.abs(primal).max()),
            float(np.abs(stationary).max(initial=0.0)) / size,
            abs(scale_gradient) if scaled else 0.0,
        )
        if not error < np.inf:
            break
        if error >= best and (best <= STALLED or gap <= ACCURACY * size):
            break
        if error < best:
            best, answer = error, (x, scale)
        if error <= ACCURACY:
            break
        if scale < enough and np.abs(primal).max() <= ACCURACY:
            return x, scale
        newton = _newton(quadratic, bounds, growing, dual / slack, scaled=scaled)
        if newton is None:
            break
        residuals = primal, stationary, scale_gradient
        _, _, dslack, ddual = newton.step(slack, dual, residuals, -slack * dual)
        reach = min(_reach(slack, dslack), _reach(dual, ddual))
        after = float(((slack + reach * dslack) * (dual + reach * ddual)).mean())
        centre = (after / gap) ** 3 * gap if gap > 0.0 else 0.0
        wanted = centre - slack * dual - dslack * ddual
        dx, dscale, dslack, ddual = newton.step(slack, dual, residuals, wanted)
        reach = BACK_OFF * min(_reach(slack, dslack), _reach(dual, ddual))
        reach = min(reach, 1.0)
        x, scale = x + reach * dx, scale + reach * dscale
        slack, dual = slack + reach * dslack, dual + reach * ddual
    return answer if best <= GOOD_ENOUGH else None


class _Newton(NamedTuple):
    """The factorised Newton system of one iteration."""

    bounds: Bounds
    growing: np.ndarray
    """(m,) what the scale adds to the bounds; zero if it is not free."""
    weights: np.ndarray
    """(2, m), dual over slack."""
    factor: np.ndarray
    """Band of the Cholesky factor."""
    border: np.ndarray
    """(n,) column of the scale."""
    across: np.ndarray
    """(n,) that column, solved for."""
    corner: float
    """What is left of the scale's own entry; infinite if the scale is not free."""

    def step(
        self,
        slack: np.ndarray,
        dual: np.ndarray,
        residuals: tuple[np.ndarray, np.ndarray, float],
        wanted: np.ndarray,
    ) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
        """Steps of x, the scale, (2, m) slack and (2, m) dual.

        They take away the residuals and change slack times dual by (2, m) `wanted`, to first order.
        """
        primal, stationary, scale_gradient = residuals
        rows = self.bounds.rows
        push = self.weights * primal + wanted / slack
        right = -stationary - rows.T @ (push[0] - push[1])
        dx = cho_solve_banded((self.factor, True), right)
        right_scale = -scale_gradient + _dot(push.sum(axis=0), self.growing)
        dscale = (right_scale - _dot(self.border, dx)) / self.corner
        dx = dx - dscale * self.across
        dslack = -primal - SIGNS * (rows @ dx) + self.growing * dscale
        return dx, dscale, dslack, (wanted - dual * dslack) / slack


def _newton(
    quadratic: sparse.csr_array,
    bounds: Bounds,
    growing: np.ndarray,
    weights: np.ndarray,
    *,
    scaled: bool,
) -> _Newton | None:
    """Factorise the Newton system; None if rounding does not let it."""
    rows = bounds.rows
    factor = _factor(quadratic + rows.T @ sparse.diags_array(weights.sum(axis=0)) @ rows)
    if factor is None:
        return None
    border = -(rows.T @ ((weights[0] - weights[1]) * growing))
    across, corner = border, np.inf
    if scaled:
        across = cho_solve_banded((factor, True), border)
        corner = _dot(weights.sum(axis=0), growing**2) - _dot(border, across)
        if not corner > 0.0:
            return None
    return _Newton(bounds, growing, weights, factor, border, across, corner)


def _dot(a: np.ndarray, b: np.ndarray) -> float:
    """Inner product, without the threads of a BLAS: they cost more than they bring here."""
    return float((a * b).sum())


def _reach(values: np.ndarray, steps: np.ndarray) -> float:
    """How far positive values can go along steps, at most 1/BACK_OFF, before one is zero."""
    shrinking = steps < 0.0
    if not shrinking.any():
        return 1.0 / BACK_OFF
    return min(1.0 / BACK_OFF, float((-values[shrinking] / steps[shrinking]).min()))


def _factor(matrix: sparse.csr_array) -> np.ndarray | None:
    """Lower Cholesky factor, as a band, of a symmetric matrix; None if it is not definite."""
    entries = matrix.tocoo()
    row, column = entries.coords
    lower = row >= column
    width = int((row - column).max(initial=0))
    band = np.zeros((width + 1, matrix.shape[0]))
    band[(row - column)[lower], column[lower]] = entries.data[lower]
    band[0] += RIDGE * float(np.abs(band[0]).max(initial=1e-300))
    try:
        factor: np.ndarray = cholesky_banded(band, lower=True)
    except (LinAlgError, ValueError):
        return None
    return factor
