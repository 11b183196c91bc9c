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
ACCURACY = 1e-10
"""Of complementarity and residuals, relative, at which it ends."""
GOOD_ENOUGH = 1e-6
"""The same, for an answer where rounding allows no better."""
BACK_OFF = 0.995
"""Part of the way to the border of what is allowed that a step goes."""
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


def least_squares(
    rows: sparse.csr_array, target: np.ndarray, bounds: Bounds
) -> np.ndarray | None:
    """The (n,) x of least |rows x - target|^2 / 2 under bounds at scale 0; None if none is found.

    rows (r, n) and the rows of the bounds: `rows.T @ rows` and theirs are narrow bands.
    """
    quadratic, linear = rows.T @ rows, -(rows.T @ target)
    found = _interior_point(sparse.csr_array(quadratic), linear, bounds, scaled=False)
    return None if found is None else found[0]


def least_scale(bounds: Bounds) -> tuple[np.ndarray, float] | None:
    """The (n,) x that meets bounds at the least scale, and that scale; None if none is found."""
    count = bounds.rows.shape[1]
    return _interior_point(sparse.csr_array((count, count)), np.zeros(count), bounds, scaled=True)


def _interior_point(
    quadratic: sparse.csr_array, linear: np.ndarray, bounds: Bounds, *, scaled: bool
) -> tuple[np.ndarray, float] | None:
    """Least x'Px/2 + q'x, plus the scale if it is free, under the bounds."""
    rows, transposed = bounds.rows, sparse.csr_array(bounds.rows.T)
    m, n = rows.shape
    x, scale = np.zeros(n), 1.0 if scaled else 0.0
    growing = bounds.growing if scaled else np.zeros(m)
    if m == 0:
        factor = _factor(quadratic)
        return None if factor is None else (cho_solve_banded((factor, True), -linear), scale)
    room = bounds.fixed + growing * scale
    value = bounds.offset.copy()
    # rows (2, m): of the upper and of the lower bounds
    signs = np.array([[1.0], [-1.0]])
    slack = np.maximum(room - signs * value, 0.1 * np.maximum(room, 1e-3))
    size = 1.0 + float(np.abs(linear).max(initial=0.0))
    dual = np.full((2, m), size if not scaled else 1.0 / max(float(growing.sum()), 1.0))
    best = np.inf
    answer = None
    for _ in range(ITERATIONS):
        value = rows @ x + bounds.offset
        room = bounds.fixed + growing * scale
        primal = slack + signs * value - room
        stationary = quadratic @ x + linear + transposed @ (dual[0] - dual[1])
        scale_gradient = float(scaled) - float(dual.sum(axis=0) @ growing)
        gap = float((slack * dual).mean())
        error = max(
            gap / size,
            float(np.abs(primal).max()),
            float(np.abs(stationary).max(initial=0.0)) / size,
            abs(scale_gradient) if scaled else 0.0,
        )
        if not error < np.inf:
            break
        if error < best:
            best, answer = error, (x, scale)
        if error <= ACCURACY:
            break
        weights = dual / slack
        newton = quadratic + transposed @ sparse.diags_array(weights.sum(axis=0)) @ rows
        factor = _factor(sparse.csr_array(newton))
        if factor is None:
            break
        border = -(transposed @ ((weights[0] - weights[1]) * growing))
        across = cho_solve_banded((factor, True), border) if scaled else border
        corner = float(weights.sum(axis=0) @ growing**2) - float(border @ across)

        def step(
            wanted: np.ndarray,
            weights: np.ndarray = weights,
            primal: np.ndarray = primal,
            stationary: np.ndarray = stationary,
            scale_gradient: float = scale_gradient,
            factor: np.ndarray = factor,
            border: np.ndarray = border,
            across: np.ndarray = across,
            corner: float = corner,
        ) -> tuple[np.ndarray, float, np.ndarray, np.ndarray]:
            """The step to complementarity products `wanted`, (2, m), less what they are."""
            push = weights * primal + wanted / slack
            right = -stationary - transposed @ (push[0] - push[1])
            dx = cho_solve_banded((factor, True), right)
            dscale = 0.0
            if scaled:
                right_scale = -scale_gradient + float(push.sum(axis=0) @ growing)
                dscale = (right_scale - float(border @ dx)) / max(corner, 1e-300)
                dx = dx - dscale * across
            dslack = -primal - signs * (rows @ dx) + growing * dscale
            return dx, dscale, dslack, (wanted - dual * dslack) / slack

        _, _, dslack, ddual = step(-slack * dual)
        reach = min(_reach(slack, dslack), _reach(dual, ddual))
        after = float(((slack + reach * dslack) * (dual + reach * ddual)).mean())
        centre = (after / gap) ** 3 * gap if gap > 0.0 else 0.0
        dx, dscale, dslack, ddual = step(centre - slack * dual - dslack * ddual)
        reach = BACK_OFF * min(_reach(slack, dslack), _reach(dual, ddual))
        reach = min(reach, 1.0)
        x, scale = x + reach * dx, scale + reach * dscale
        slack, dual = slack + reach * dslack, dual + reach * ddual
    return answer if best <= GOOD_ENOUGH else None


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
