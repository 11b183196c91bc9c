"""The optimal cost of a spline as a function of its segment times, and descent on it.

    f(t) = min over the coefficients of sum_s c_s integral |p^(s)|^2 dt         (Eq. timecost)
    J(t) = f(t) + c_t sum_k t_k                                                  (Eq. BryOpt)

A piece's integral is a sum of squares, t^(1-2s) |R_s y|^2 with y its end data and R_s of
`basis.energy_roots`: nothing cancels where a piece is nearly free of effort. The gradient goes
through sub-problem 1 by its adjoint.

The descent is that of the projected gradient in the metric sum_k dt_k^2 / t_k. At a minimum f falls
by as much a second on every segment, so that its curvature by t_k is about as 1 / t_k: the metric
makes long and short segments alike, and cutting a segment in two does not change it. The first
trial step is that of Barzilai and Borwein, halved until f has fallen enough (Armijo).
"""

import numpy as np

from peakflight.kernels.barrier import solve_spline, spline_adjoint
from peakflight.kernels.jit import inner, kernel, within

ARMIJO = 1e-4
"""Sufficient decrease: this part of what the slope promises."""
FIRST_STEP = 0.1
"""Largest relative change of a segment time in the first step."""
LONGEST_STEP = 0.5
"""No segment time changes by more than this part in one step, so that all stay positive."""
HALVINGS = 40
"""Most in one line search; then f is as low as rounding lets it be."""
SHORTER = 0.5
"""The shorter step of Barzilai and Borwein is taken where it is below this part of the longer."""


def workspace(count: int, degree: int) -> tuple[np.ndarray, ...]:
    """Scratch arrays of `descend` for a number of pieces."""
    return (
        np.empty((count, degree, 3)),
        np.empty((count, degree, 3)),
        np.empty(count),
        np.empty(count),
        np.empty(count),
    )


@kernel
def descend(
    rows, waypoints, simple, layered, times, cost, penalty, held, tolerance, longest, work,
    gradient, history,
):  # fmt: skip
    """Minimise J over the segment times; if held, f at the total that they have.

    waypoints, simple and layered: see `barrier.solve_spline`; times (K,) is replaced; cost: orders
    s (S,), weights c_s (S,) and roots R_s (S, N+1, N+1); penalty: c_t; tolerance: of what remains
    of the gradient, see `_project`; longest: most iterations; gradient (K,) gets df/dt at the end;
    history (rows, K) gets the times of the first iterations.

    Returns f, what remains of the gradient, iterations and whether there is nothing lower within
    rounding along the last direction.
    """
    data, slope, residual, trial, trial_gradient = work
    count = times.size
    iterations = 0
    stalled = False
    step = 0.0
    effort = evaluate(rows, waypoints, simple, layered, times, cost, data, slope, gradient)
    square, remaining = _project(times, gradient, penalty, held, residual)
    while effort < np.inf and remaining > tolerance and iterations < longest:
        largest = 0.0
        total = 0.0
        for k in range(count):
            largest = max(largest, abs(residual[k]))
            total += times[k]
        step = min(step, LONGEST_STEP / largest) if iterations > 0 else FIRST_STEP / largest
        stalled = True
        for _ in range(HALVINGS):
            longer = 0.0
            for k in range(count):
                trial[k] = times[k] - step * times[k] * residual[k]
                longer += trial[k]
            trial_effort = evaluate(
                rows, waypoints, simple, layered, trial, cost, data, slope, trial_gradient
            )
            rise = trial_effort - effort + (0.0 if held else penalty * (longer - total))
            if rise <= -ARMIJO * step * square and rise < 0.0:
                stalled = False
                break
            step *= 0.5
        if stalled:
            break
        for k in range(count):  # trial and its gradient become the differences
            trial[k] -= times[k]
            times[k] += trial[k]
            trial_gradient[k] -= gradient[k]
            gradient[k] += trial_gradient[k]
        step = _next_step(times, trial, trial_gradient, held, step)
        effort = trial_effort
        if iterations < history.shape[0]:
            for k in range(count):
                history[iterations, k] = times[k]
        iterations += 1
        square, remaining = _project(times, gradient, penalty, held, residual)
    return effort, remaining, iterations, stalled


@within
def evaluate(rows, waypoints, simple, layered, times, cost, data, slope, gradient):
    """The optimal cost f and its gradient (K,) by t; infinite where it cannot be computed.

    data and slope (K, N, D) are scratch.
    """
    orders, weights, roots = cost
    if not solve_spline(rows, waypoints, simple, layered, times, data):
        return np.inf
    total = 0.0
    for k in range(times.size):
        total += _effort(
            rows, waypoints, times[k], orders, weights, roots, data, slope, k, gradient
        )
    spline_adjoint(rows, waypoints, simple, layered, times, data, slope, gradient)
    for k in range(times.size):
        gradient[k] /= times[k]
    return total if total < np.inf else np.inf


@inner
def _effort(rows, waypoints, time, orders, weights, roots, data, slope, piece, gradient):
    """Cost of a piece; slope[piece] <- its derivative by the end data, gradient by log time."""
    last = len(rows)
    total = 0.0
    rate = 0.0
    for i in range(last):
        for d in range(data.shape[2]):
            slope[piece, i, d] = 0.0
    for s in range(orders.size):
        weight = weights[s] * time ** (1.0 - 2.0 * orders[s])
        for row in range(last + 1 - orders[s]):
            for d in range(data.shape[2]):
                value = roots[s, row, last] * waypoints[piece, d]  # seen only if s = 0
                for i in range(last):
                    value += roots[s, row, i] * data[piece, i, d]
                total += weight * value * value
                rate += (1.0 - 2.0 * orders[s]) * weight * value * value
                for i in range(last):
                    slope[piece, i, d] += 2.0 * weight * value * roots[s, row, i]
    gradient[piece] = rate
    return total


@inner
def _project(times, gradient, penalty, held, residual):
    """Residual (K,) <- gradient of J; if held, that of f less its part along the total.

    Returns its square in the metric, and its size over that of the gradient of f.
    """
    level = -penalty
    if held:
        level = _mean(times, gradient)
    square = 0.0
    whole = 0.0
    for k in range(times.size):
        residual[k] = gradient[k] - level
        square += times[k] * residual[k] * residual[k]
        whole += times[k] * gradient[k] * gradient[k]
    return square, np.sqrt(square / whole) if square > 0.0 else 0.0


@inner
def _mean(times, values):
    """Mean of values (K,) over the time."""
    total = 0.0
    weighed = 0.0
    for k in range(times.size):
        total += times[k]
        weighed += times[k] * values[k]
    return weighed / total


@inner
def _next_step(times, moved, change, held, step):
    """Step of Barzilai and Borwein from the last one (K,) and the change of the gradient (K,)."""
    level = 0.0
    if held:
        level = _mean(times, change)
    length = 0.0
    product = 0.0
    square = 0.0
    for k in range(times.size):
        length += moved[k] * moved[k] / times[k]
        product += moved[k] * change[k]
        square += times[k] * (change[k] - level) * (change[k] - level)
    if not product > 0.0:
        return 2.0 * step
    longer = length / product
    shorter = product / square
    return shorter if shorter < SHORTER * longer else longer
