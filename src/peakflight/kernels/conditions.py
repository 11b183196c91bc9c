"""Constraints along a whole course, and their derivatives by all unknowns.

What `interior` asks for at an iterate: values of the constraints, gradient of objective and
constraints, product of the constraints' gradients with a step, the matrix, and limits lowered for
what happens between samples. A piece shares unknowns with its neighbours only; everything is a loop
over pieces.
"""

from typing import NamedTuple

import numpy as np

from peakflight.kernels import pieces, rows
from peakflight.kernels.jit import inner, vector, within

LEAST = 5
"""The kind that is limited from below."""
LOST = 8
"""Where `evaluate` leaves a mark; the others are those of `interior`."""
DEEPEST = 0.5
"""No limit is lowered below this part of itself."""


class Layout(NamedTuple):
    """Which unknown is where; see `peakflight.kernels.pieces`."""

    place: np.ndarray
    """(K, N+1, 3) int: the unknown of each row of end data, and of the start; -1 if known."""
    known: np.ndarray
    """(K, N, 3) what is known of the end data, by time."""
    clock: np.ndarray
    """(K,) int: index of the logarithm of each duration."""
    order: np.ndarray
    """(n,) int: derivative that an unknown is; -1 for logarithms of durations."""
    unknown: np.ndarray
    """(K, L) int: unknowns of each piece in ascending order."""
    source: np.ndarray
    """(K, L) int: where each stands among the rows of the local matrix."""
    sign: np.ndarray
    """(K, L): -1 for starts, which the step from start to end is less of; else 1."""
    size: np.ndarray
    """(K,) int: how many there are."""
    steps: np.ndarray
    """(K,) bool: whether the step from start to end is unknown."""


class Grid(NamedTuple):
    """Tables of one degree and one set of samples."""

    orders: np.ndarray
    """(N,) int: derivative in each row of the end data."""
    table: np.ndarray
    """(N, 4 S) at the samples."""
    dense: np.ndarray
    """(N, 4 C S) at C even points of each sample's cell: the first of all cells, the second, .."""
    pairs: np.ndarray
    """(P, 2) int: rows i <= j, those without the step first."""
    still: np.ndarray
    """(1,) int: how many of them are without the step."""
    products: np.ndarray
    """(4 S, P or more) of table rows; zeros fill up the last vector: see `pieces.VECTOR`."""
    steps: np.ndarray
    """(4 S,) derivative, 1 to 4, in each column of the table."""
    dense_steps: np.ndarray
    """(4 C S,) likewise."""
    quadrature: np.ndarray
    """(S,) weights on the unit interval."""


class Limited(NamedTuple):
    """What is limited."""

    kinds: np.ndarray
    """(R,) int: kinds of limit, as in `limits.KINDS`."""
    values: np.ndarray
    """(R,) their limits."""
    first: np.ndarray
    """(R+1,) int: the first of each kind's terms."""
    orders: np.ndarray
    """(P,) int: row of samples, derivative less one, of each term."""
    leaning: np.ndarray | None
    """Some number if tilt or least thrust is among them; None leaves out what these need when
    kernels are compiled."""
    turning: np.ndarray | None
    """Some number if how the thrust direction turns is limited; None likewise."""
    figures: np.ndarray | None
    """(4,) of the airframe, as in `kernels.rotors`, if rotor thrust is limited; None likewise."""
    several: np.ndarray | None
    """Some number if a kind has more than one term; None likewise."""
    effort: np.ndarray | None
    """(4,) weight of the integral of each squared derivative in the objective; None likewise."""
    gravity: np.ndarray
    """(1,) m/s^2."""
    least: np.ndarray
    """(1,) smallest stretch of interest: 1 where going faster is not for free, else 0."""


class Work(NamedTuple):
    """Everything that changes: K pieces, R kinds, P terms, S samples, n unknowns."""

    x: np.ndarray
    """(n,) the iterate."""
    best: np.ndarray
    """(n,) the iterate with the least stretched time."""
    samples: np.ndarray
    """(K, 3, 4, S), with gravity."""
    rates: np.ndarray
    """(K, 3, 4 S) by log time."""
    values: np.ndarray
    """(K, R, S) constraints c."""
    slopes: np.ndarray
    """(K, P, 3, S)."""
    bends: np.ndarray
    """(K, P, S)."""
    limits: np.ndarray
    """(K, R, S) lowered for what happens between samples."""
    slack: np.ndarray
    """(K, R, S) s."""
    dual: np.ndarray
    """(K, R, S) z."""
    matrix: np.ndarray
    """(n, w) H."""
    factor: np.ndarray
    """(n, w)."""
    stiffness: np.ndarray
    """(K,) see `interior.STIFFNESS`; 0 for pieces that are not stiffened."""
    marks: np.ndarray
    """(9,) see `interior.MARKS`."""


@inner
def evaluate(layout, grid, limited, work, x, moved):
    """Samples and constraints at x; returns the stretch that they need, total time and effort.

    moved: False if only limits have changed since the last call.
    work.marks[LOST] <- the time that pieces would lose if each were stretched for itself.
    """
    data = np.empty((grid.orders.size, 3))
    powers = np.empty(grid.orders.size)
    scales = np.empty(grid.table.shape[1])
    samples = work.samples.reshape(work.rates.shape)
    needed = limited.least[0]
    lost = 0.0
    total = 0.0
    effort = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        total += time
        if moved:
            pieces.factors(time, grid.orders, grid.steps, powers, scales)
            pieces.end_data(layout.place, layout.known, x, k, data)
            pieces.sample(
                data, grid.orders, grid.steps, powers, scales, grid.table, k, samples, work.rates
            )
            _add_gravity(limited.gravity[0], k, work.samples)
        own = max(limited.least[0], _constrain(limited, work, k))
        needed = max(needed, own)
        lost += time * max(own - 1.0, 0.0)
        effort += _effort(limited.effort, grid, limited, work, k, time)
    work.marks[LOST] = lost
    return needed, total, effort


@inner
def _add_gravity(gravity, k, samples):
    for q in range(samples.shape[3]):
        samples[k, 2, 1, q] += gravity


@within
def _constrain(limited, work, k):
    """Constraints of a piece; returns the stretch that they need."""
    samples = work.samples[k]
    limits = work.limits[k]
    values = work.values[k]
    slopes = work.slopes[k]
    bends = work.bends[k]
    needed = 0.0
    for r in range(limited.kinds.size):
        stretch = rows.constrain(
            limited.kinds[r], limited.leaning, limited.turning, limited.figures, samples, limits,
            limited.gravity[0], values, r, limited.first[r], slopes, bends,
        )  # fmt: skip
        needed = max(needed, stretch)
    return needed


@inner
def _effort(effort, grid, limited, work, k, time):
    """What a piece adds to the weighed integrals of squared derivatives."""
    total = 0.0
    if effort is None:
        return total
    for s in range(effort.size):
        for q in range(grid.quadrature.size):
            for d in range(work.samples.shape[1]):
                value = _without_gravity(work.samples[k, d, s, q], d, s, limited)
                total += effort[s] * grid.quadrature[q] * time * value * value
    return total


@inner
def _pull_effort(effort, grid, limited, work, k, time, sums):
    """Sums (1, 3, 4, S) += slope of a piece's effort by samples; returns its own by log time."""
    direct = 0.0
    if effort is None:
        return direct
    for s in range(effort.size):
        for d in range(work.samples.shape[1]):
            for q in range(grid.quadrature.size):
                value = _without_gravity(work.samples[k, d, s, q], d, s, limited)
                weight = effort[s] * grid.quadrature[q] * time
                sums[0, d, s, q] += 2.0 * weight * value
                direct += weight * value * value
    return direct


@inner
def _without_gravity(value, d, s, limited):
    return value - limited.gravity[0] if d == 2 and s == 1 else value


@inner
def gradient(layout, grid, limited, work, x, flat_pulls, out):
    """Out (n,) <- gradient of the objective, and of the constraints times pulls (K R S,)."""
    pulls = flat_pulls.reshape(work.values.shape)
    powers = np.empty(grid.orders.size)
    scales = np.empty(grid.table.shape[1])
    sums = np.empty((1, 3, 4, pulls.shape[2]))
    flat_sums = sums.reshape((1, 3, grid.table.shape[1]))
    local = np.empty((grid.orders.size, 3))
    for i in range(out.size):
        out[i] = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.factors(time, grid.orders, grid.steps, powers, scales)
        flat_sums[:] = 0.0
        for r in range(limited.kinds.size):
            for p in range(limited.first[r], limited.first[r + 1]):
                _add_pull(pulls, k, r, work.slopes, p, limited.orders[p], sums)
        out[layout.clock[k]] += time + _pull_effort(
            limited.effort, grid, limited, work, k, time, sums
        )
        out[layout.clock[k]] += pieces.push(
            flat_sums, powers, scales, work.rates, grid.table, k, local
        )
        for r in range(grid.orders.size):
            for d in range(3):
                if layout.place[k, r, d] >= 0:
                    out[layout.place[k, r, d]] += local[r, d]
        for d in range(3):
            if layout.place[k, grid.orders.size, d] >= 0:
                out[layout.place[k, grid.orders.size, d]] -= local[0, d]


@vector
def _add_pull(pulls, k, r, slopes, p, order, sums):
    for d in range(sums.shape[1]):
        for q in range(sums.shape[3]):
            sums[0, d, order, q] += pulls[k, r, q] * slopes[k, p, d, q]


@within
def product(layout, grid, limited, work, x, step, flat):
    """Flat (K R S,) <- gradients of the constraints times a step (n,)."""
    out = flat.reshape(work.values.shape)
    powers = np.empty(grid.orders.size)
    scales = np.empty(grid.table.shape[1])
    moves = np.empty((1, 3, 4, out.shape[2]))
    flat_moves = moves.reshape((1, 3, grid.table.shape[1]))
    local = np.empty((grid.orders.size, 3))
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.factors(time, grid.orders, grid.steps, powers, scales)
        pieces.step_data(layout.place, step, k, local)
        pieces.pull(
            local, step[layout.clock[k]], powers, scales, work.rates, grid.table, k, flat_moves
        )
        for r in range(limited.kinds.size):
            for q in range(out.shape[2]):
                out[k, r, q] = 0.0
            for p in range(limited.first[r], limited.first[r + 1]):
                _add_move(moves, work.slopes, k, p, limited.orders[p], r, out)


@vector
def _add_move(moves, slopes, k, p, order, r, out):
    for q in range(out.shape[2]):
        out[k, r, q] += (
            moves[0, 0, order, q] * slopes[k, p, 0, q]
            + moves[0, 1, order, q] * slopes[k, p, 1, q]
            + moves[0, 2, order, q] * slopes[k, p, 2, q]
        )


@within
def assemble(layout, grid, limited, work, x):
    """The matrix H in band storage."""
    last = 3 * grid.orders.size
    powers = np.empty(grid.orders.size)
    scales = np.empty(grid.table.shape[1])
    weights = np.empty((1, 6, 4, grid.quadrature.size))
    flat_weights = weights.reshape((1, 6, grid.table.shape[1]))
    turned = np.empty((1, 3, grid.table.shape[1]))
    sums = np.empty((6, grid.products.shape[1]))
    columns = np.empty((grid.orders.size, 3))
    local = np.empty((last + 1, last + 1))
    work.matrix[:] = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.factors(time, grid.orders, grid.steps, powers, scales)
        local[:] = 0.0
        flat_weights[:] = 0.0
        for r in range(limited.kinds.size):
            single = limited.first[r + 1] == limited.first[r] + 1
            for p in range(limited.first[r], limited.first[r + 1]):
                _add_weights(
                    work.dual, work.slack, work.bends, work.slopes, k, r, p, single,
                    limited.orders[p], weights,
                )  # fmt: skip
        wanted = grid.pairs.shape[0] if layout.steps[k] else grid.still[0]
        pieces.curvature(
            flat_weights, work.rates, k, powers, scales, grid.table, grid.pairs, wanted,
            grid.products, sums, turned, columns, local,
        )  # fmt: skip
        local[last, last] += time * (1.0 + work.stiffness[k])
        _add_outer(limited.several, grid, limited, work, k, powers, scales, local)
        _add_effort(
            limited.effort, grid, limited, work, k, time, powers, scales, weights, flat_weights,
            sums, turned, columns, local,
        )  # fmt: skip
        _scatter(layout, k, local, work.matrix)


@vector
def _add_weights(dual, slack, bends, slopes, k, r, p, single, order, weights):
    """Weights (1, 6, 4, S) += z bend I, and z/s times the slope's outer product if it is the only.

    Of one derivative.
    """
    for q in range(dual.shape[2]):
        bend = dual[k, r, q] * bends[k, p, q]
        ratio = dual[k, r, q] / slack[k, r, q] if single else 0.0
        x = slopes[k, p, 0, q]
        y = slopes[k, p, 1, q]
        z = slopes[k, p, 2, q]
        weights[0, 0, order, q] += bend + ratio * x * x
        weights[0, 1, order, q] += ratio * x * y
        weights[0, 2, order, q] += ratio * x * z
        weights[0, 3, order, q] += bend + ratio * y * y
        weights[0, 4, order, q] += ratio * y * z
        weights[0, 5, order, q] += bend + ratio * z * z


@inner
def _add_outer(several, grid, limited, work, k, powers, scales, local):
    """Local += z/s times the outer products of gradients in several derivatives at once."""
    if several is None:
        return
    size = 3 * grid.orders.size
    count = grid.quadrature.size
    column = np.empty(size + 1)
    for r in range(limited.kinds.size):
        if limited.first[r + 1] == limited.first[r] + 1:
            continue
        for q in range(count):
            ratio = work.dual[k, r, q] / work.slack[k, r, q]
            for c in range(size + 1):
                column[c] = 0.0
            for p in range(limited.first[r], limited.first[r + 1]):
                i = limited.orders[p] * count + q
                for d in range(work.slopes.shape[2]):
                    slope = work.slopes[k, p, d, q]
                    column[size] += slope * work.rates[k, d, i]
                    for row in range(grid.orders.size):
                        column[3 * row + d] += slope * grid.table[row, i] * powers[row] * scales[i]
            for i in range(size + 1):
                scaled = ratio * column[i]
                for j in range(i, size + 1):
                    local[i, j] += scaled * column[j]


@inner
def _add_effort(
    effort, grid, limited, work, k, time, powers, scales, weights, flat_weights, sums, turned,
    columns, local,
):  # fmt: skip
    """Local += Gauss-Newton matrix of the effort: residuals sqrt(t) d, so rates are d/2 more."""
    if effort is None:
        return
    count = grid.quadrature.size
    rates = np.empty((1, 3, scales.size))
    first = np.int64(0)
    flat_weights[:] = 0.0
    for s in range(effort.size):
        for q in range(count):
            i = s * count + q
            weight = 2.0 * effort[s] * grid.quadrature[q] * time
            for d in range(3):
                value = _without_gravity(work.samples[k, d, s, q], d, s, limited)
                rates[first, d, i] = work.rates[k, d, i] + 0.5 * value
                weights[first, pieces.SIX[d][d], s, q] = weight
    pieces.curvature(
        flat_weights, rates, first, powers, scales, grid.table, grid.pairs, grid.pairs.shape[0],
        grid.products, sums, turned, columns, local,
    )  # fmt: skip


@within
def _scatter(layout, k, local, matrix):
    """Add the local matrix of a piece, whose upper half is filled, to the band."""
    for a in range(layout.size[k]):
        row = layout.unknown[k, a]
        i = layout.source[k, a]
        for b in range(a, layout.size[k]):
            j = layout.source[k, b]
            matrix[row, layout.unknown[k, b] - row] += (
                layout.sign[k, a] * layout.sign[k, b] * local[min(i, j), max(i, j)]
            )


@within
def lower(layout, grid, limited, work, x, slowly):
    """Lower the limit of each sample by how much more than the sample its cell reaches."""
    count = grid.quadrature.size
    many = grid.dense.shape[1] // 4
    first = np.int64(0)
    data = np.empty((grid.orders.size, 3))
    powers = np.empty(grid.orders.size)
    scales = np.empty(grid.dense.shape[1])
    near = np.empty((1, 3, 4, many))
    flat = near.reshape((1, 3, grid.dense.shape[1]))
    around = np.empty(many)
    peak = np.empty(count)
    there = np.empty(count)
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.factors(time, grid.orders, grid.dense_steps, powers, scales)
        pieces.end_data(layout.place, layout.known, x, k, data)
        pieces.derive(data, powers, scales, grid.dense, first, flat)
        _add_gravity(limited.gravity[0], first, near)
        samples = work.samples[k]
        for r in range(limited.kinds.size):
            kind, limit = limited.kinds[r], limited.values[r]
            rows.kappa(
                kind, limited.leaning, limited.turning, limited.figures, near[first], limit,
                limited.gravity[0], around,
            )  # fmt: skip
            rows.kappa(
                kind, limited.leaning, limited.turning, limited.figures, samples, limit,
                limited.gravity[0], there,
            )  # fmt: skip
            _peaks(around, peak)
            for q in range(count):
                ratio = min(max(there[q] / peak[q], DEEPEST), 1.0)
                lowered = limit / ratio if kind == LEAST else limit * ratio
                work.limits[k, r, q] += slowly * (lowered - work.limits[k, r, q])


@vector
def _peaks(around, peak):
    """Peak (S,) <- the largest around each sample, of C values (C S,) or of parabolas through them.

    A parabola goes through an inner maximum and its neighbours.
    """
    count = peak.size
    for q in range(count):
        peak[q] = 1e-300
    for i in range(0, around.size, count):
        for q in range(count):
            peak[q] = max(peak[q], around[i + q])
    for i in range(count, around.size - count, count):
        for q in range(count):
            left = around[i + q - count]
            value = around[i + q]
            right = around[i + q + count]
            curve = max(2.0 * value - left - right, 1e-300)
            vertex = value + (right - left) * (right - left) / (8.0 * curve)
            peak[q] = max(peak[q], vertex if value >= left and value >= right else value)
