"""The function of the segment times that `peak` minimises, and its gradient.

    f(log t) = sum_k t_k / reference + (1/p) sum_samples m^(p/e)

with the measures m of `kernels.measures` at even samples of each piece. At the optimum the second
sum of a leg is as large as its share of the first, so the samples that count have m^(1/e), the
stretch they would need, near 1 to within log(samples)/p: as p rises, f becomes the total time under
hard limits. No weight balances the two sums. Beyond CAP the power goes on as a parabola of its
logarithm, so that one bad sample cannot drown the course; every term is local, so that long
courses converge like short ones.

The samples of several pieces stand side by side, BATCH at a time: few long loops are quicker than
many short ones. Each loop writes one array, which lets the compiler do several samples at once.
"""

import numpy as np

from peakflight.kernels import classical, general
from peakflight.kernels.jit import vector, within
from peakflight.kernels.measures import (
    EXPONENTS,
    KIND_ORDERS,
    LOWEST_ORDERS,
    add_slopes,
    measure,
)

CAP = 2.0
"""Logarithm of m^(p/e) from where on it is continued by a parabola."""
NEGLIGIBLE = -20.0
"""Logarithm of m^(p/e) below which samples are passed over."""
BASE_POWER = 24
"""Powers p are this times a power of two: then m^(p/e) is a product of squares for every e."""

WATCH = 8.0
"""A limit matters on a piece for a whole stage if it comes nearer than this over sqrt(p)."""
BATCH = 64
"""Samples that are worked on together; the samples of a piece must divide it."""


def workspace(
    count: int, degree: int, turning: bool, figures: np.ndarray | None
) -> tuple[np.ndarray | None, ...]:
    """Scratch arrays of `evaluate` for a number of pieces.

    turning: whether kinds from TURNING on are limited; if not, kernels are compiled without them.
    Likewise the figures of `kernels.rotors`: None if no rotor thrust is limited.
    """
    batch = (3, 4, BATCH)
    return (
        np.empty((count, degree, 3)),
        np.empty((count, degree, 3)),
        np.zeros(batch),
        np.zeros(batch[1:]),
        np.zeros(batch[1:]),
        np.zeros(BATCH),
        np.zeros(BATCH),
        np.zeros(BATCH),
        np.zeros(EXPONENTS.size, dtype=np.bool_),
        np.zeros(4, dtype=np.bool_),
        np.zeros(batch) if turning or figures is not None else None,
        figures,
    )


@within
def evaluate(
    rows, waypoints, simple, layered, times, limits, gravity, tables, watched, doublings, reference,
    work, gradient,
):  # fmt: skip
    """F and its gradient (K,) by log t; infinite where the spline or f cannot be computed.

    waypoints, simple and layered: see `solve_spline`; limits: as `Limits.as_array`; tables
    (N, 4, S) of `basis.sample_tables`; watched (K, kinds): see `watch`; doublings:
    p = 24 * 2^doublings.
    """
    (
        data,
        slope,
        samples,
        squares,
        weights,
        vertical,
        values,
        grown,
        kinds,
        orders,
        pulls,
        figures,
    ) = work
    power = BASE_POWER * 2.0**doublings
    floor = np.exp(NEGLIGIBLE / power)  # of m^(1/e)
    cap = np.exp(CAP / power)
    if not solve_spline(rows, waypoints, simple, layered, times, data):
        return np.inf
    total = 0.0
    barrier = 0.0
    each = tables.shape[2]
    batch = BATCH // each
    by_piece = samples.reshape(3, 4, batch, each)
    for begin in range(0, times.size, batch):
        end = min(begin + batch, times.size)
        count = (end - begin) * each
        for row in range(4):
            orders[row] = False
        for kind in range(EXPONENTS.size):
            kinds[kind] = False
            for k in range(begin, end):
                kinds[kind] |= watched[k, kind]
            for row in range(LOWEST_ORDERS[kind] - 1, KIND_ORDERS[kind]):
                orders[row] |= kinds[kind]
        for k in range(begin, end):
            total += times[k]
            gradient[k] = times[k] / reference
            _sample(rows, data, k, times[k], tables, orders, by_piece, k - begin)
        _square(samples, count, orders, squares)
        lowest = np.int64(4)  # range of the derivatives that some limit pulls at
        highest = np.int64(-1)
        for kind in range(EXPONENTS.size):
            if not kinds[kind]:
                continue
            row = KIND_ORDERS[kind] - 1
            measure(
                kind, samples, squares, count, row, limits[kind], gravity, values, pulls, figures
            )
            if _count_above(values, count, floor ** EXPONENTS[kind]) == 0:
                continue
            if highest < 0:
                _clear(weights, vertical, pulls, count)
            lowest = min(lowest, LOWEST_ORDERS[kind] - 1)
            highest = max(highest, row)
            capped = _count_above(values, count, cap ** EXPONENTS[kind]) > 0
            barrier += _raise(values, count, EXPONENTS[kind], power, doublings, capped, grown)
            add_slopes(
                kind, samples, squares, count, row, limits[kind], gravity, values, grown,
                weights, vertical, pulls, figures,
            )  # fmt: skip
        for row in range(lowest, highest + 1):
            _pull(samples, weights, vertical, pulls, count, row)
        for k in range(begin, end):
            gradient[k] -= _push(
                rows, data, k, times[k], tables, by_piece, k - begin, lowest, highest, slope
            )
    spline_adjoint(rows, waypoints, simple, layered, times, data, slope, gradient)
    value = total / reference + barrier / power
    return value if value < np.inf else np.inf


@within
def watch(rows, times, limits, gravity, tables, doublings, work, watched):
    """Look up which limits come near enough to matter on which pieces: watched (K, kinds).

    tables: of BATCH samples; the end data in `work` are those of `times`. The higher the power, the
    less the times will change, and the nearer a limit must be. Returns how many limits are exceeded
    that were not watched before.
    """
    data, _, samples, squares, _, _, values, _, _, orders, pulls, figures = work
    nearest = 1.0 - WATCH / np.sqrt(BASE_POWER * 2.0**doublings)
    missed = 0
    count = values.size  # BATCH, but not as a literal, for which callees compile once more
    place = np.int64(0)
    for row in range(4):
        orders[row] = True
    for k in range(times.size):
        _sample(rows, data, k, times[k], tables, orders, samples.reshape(3, 4, 1, count), place)
        _square(samples, count, orders, squares)
        for kind in range(EXPONENTS.size):
            if limits[kind] > 0.0:
                row = KIND_ORDERS[kind] - 1
                measure(
                    kind,
                    samples,
                    squares,
                    count,
                    row,
                    limits[kind],
                    gravity,
                    values,
                    pulls,
                    figures,
                )
                if not watched[k, kind] and _count_above(values, count, 1.0) > 0:
                    missed += 1
                bound = max(nearest, 0.0) ** EXPONENTS[kind]
                watched[k, kind] = nearest <= 0.0 or _count_above(values, count, bound) > 0
    return missed


@within
def solve_spline(rows, waypoints, simple, layered, times, data):
    """End data (K, N, D) of the spline for given times; False where there is none.

    simple is a workspace of `kernels.classical`, layered one of `kernels.general`. One of them is
    None: that is known when the kernel is compiled, and its branch is left out. (They must be
    arguments of the function that is compiled, not parts of a tuple, for Numba to see that.)
    """
    solved = True
    if simple is None:
        pass
    else:
        axes, energy, joints, factor, coupling, powers, _ = simple
        classical.solve(
            rows, axes, energy, waypoints, times, joints, factor, coupling, powers, data
        )
    if layered is None:
        pass
    else:
        layout, cost, factors, values, starts = layered
        rounds = np.int64(1)
        code = general.solve(layout, cost, waypoints, times, rounds, factors, values, data, starts)
        solved = code == 0
    return solved


@within
def spline_adjoint(rows, waypoints, simple, layered, times, data, slope, gradient):
    """Add to gradient (K,) how what has derivative `slope` by the end data changes by log times."""
    if simple is None:
        pass
    else:
        axes, energy, _, factor, coupling, _, multipliers = simple
        classical.adjoint(
            rows, axes, energy, times, factor, coupling, data, slope, multipliers, gradient
        )
    if layered is None:
        pass
    else:
        layout, cost, factors, values, _ = layered
        general.adjoint(layout, cost, waypoints, times, factors, values, slope, gradient)


@vector
def _sample(rows, data, piece, time, tables, orders, out, place):
    """Out (3, 4, place, S) <- derivatives 1 to 4 of a piece, those that `orders` names."""
    scale = 1.0
    for row in range(4):
        scale /= time
        if not orders[row]:
            continue
        for d in range(3):
            for q in range(tables.shape[2]):
                value = 0.0
                for i in range(len(rows)):
                    value += tables[i, row, q] * data[piece, i, d]
                out[d, row, place, q] = scale * value


@vector
def _square(samples, count, orders, out):
    """Out (4, S) <- squared norms of samples (3, 4, S), of the derivatives that `orders` names."""
    for row in range(4):
        if not orders[row]:
            continue
        for q in range(count):
            x = samples[0, row, q]
            y = samples[1, row, q]
            z = samples[2, row, q]
            out[row, q] = x * x + y * y + z * z


@vector
def _clear(weights, vertical, pulls, count):
    for row in range(4):
        for q in range(count):
            weights[row, q] = 0.0
    for q in range(count):
        vertical[q] = 0.0
    if pulls is None:
        pass
    else:
        pulls[:] = 0.0


@vector
def _count_above(values, count, bound):
    above = 0  # a count is quick where a maximum is not: integers can be added in any order
    for q in range(count):
        above += 0 if values[q] <= bound else 1  # NaN counts as above
    return above


@vector
def _raise(values, count, base, power, doublings, capped, out):
    """Out <- values^(power / base) with power = 24 * 2^doublings, by squaring; returns its sum.

    If capped, the sum is of the parabolas beyond CAP, and out their slope by the logarithm.
    """
    if base == 2:
        for q in range(count):
            cube = values[q] * values[q] * values[q]  # 12 = 3 * 2 * 2
            out[q] = (cube * cube) * (cube * cube)
    elif base == 6:
        for q in range(count):
            out[q] = (values[q] * values[q]) * (values[q] * values[q])
    else:
        for q in range(count):
            out[q] = values[q] * values[q] * values[q]
    for _ in range(doublings):
        for q in range(count):
            out[q] *= out[q]
    for _ in range(-doublings):
        for q in range(count):
            out[q] = np.sqrt(out[q])
    total = 0.0
    if not capped:
        for q in range(count):
            total += out[q]
        return total
    for q in range(count):
        excess = (power / base) * np.log(values[q] + 1e-300) - CAP
        if excess > 0.0:
            total += np.exp(CAP) * (1.0 + excess + 0.5 * excess * excess)
            out[q] = np.exp(CAP) * (1.0 + excess)
        else:
            total += out[q]
    return total


@vector
def _pull(samples, weights, vertical, pulls, count, row):
    """Samples <- slope of the barrier by each of them."""
    for d in range(3):
        for q in range(count):
            samples[d, row, q] *= weights[row, q]
    if row == 1:  # gravity acts on accelerations
        for q in range(count):
            samples[2, 1, q] += vertical[q]
    if pulls is None:
        pass
    else:
        for d in range(3):
            for q in range(count):
                samples[d, row, q] += pulls[d, row, q]


@vector
def _push(rows, data, piece, time, tables, pulls, place, lowest, highest, slope):
    """slope[piece] <- pulls (3, 4, place, S) carried to the end data.

    Returns how fast the barrier falls with log time through the derivatives themselves.
    """
    rate = 0.0
    scale = 1.0
    for i in range(len(rows)):
        for d in range(3):
            slope[piece, i, d] = 0.0
    for row in range(highest + 1):
        scale /= time
        if row < lowest:
            continue
        for i in range(len(rows)):
            x = 0.0
            y = 0.0
            z = 0.0
            for q in range(tables.shape[2]):
                x += tables[i, row, q] * pulls[0, row, place, q]
                y += tables[i, row, q] * pulls[1, row, place, q]
                z += tables[i, row, q] * pulls[2, row, place, q]
            rate += (scale * (row + 1)) * (
                x * data[piece, i, 0] + y * data[piece, i, 1] + z * data[piece, i, 2]
            )
            slope[piece, i, 0] += scale * x
            slope[piece, i, 1] += scale * y
            slope[piece, i, 2] += scale * z
    return rate
