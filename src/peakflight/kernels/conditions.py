"""Constraints along a whole course, and their derivatives by all unknowns.

What `interior` asks for at an iterate: values of the constraints, gradient of objective and
constraints, product of the constraints' gradients with a step, the matrix, and limits lowered for
what happens between samples. A piece shares unknowns with its neighbours only; everything is a loop
over pieces.
"""

from typing import NamedTuple

import numpy as np

from peakflight.kernels import pieces, rows
from peakflight.kernels.jit import inner, within

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
    """(N, 4, S) at the samples."""
    dense: np.ndarray
    """(N, 4, S C) at C even points of each sample's cell, one after the other."""
    pairs: np.ndarray
    """(P, 2) int: rows i <= j, those without the step first."""
    still: np.ndarray
    """(1,) int: how many of them are without the step."""
    products: np.ndarray
    """(4, S, P) of table rows."""
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
    """(1,) of the airframe, m, if rotor thrust is limited; None likewise."""
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
    """(K, 3, 4, S) by log time."""
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
def evaluate(layout, grid, limited, work, x):
    """Samples and constraints at x; returns the stretch that they need, total time and effort.

    work.marks[LOST] <- the time that pieces would lose if each were stretched for itself.
    """
    count = grid.table.shape[2]
    data = np.empty((grid.orders.size, 3))
    needed = limited.least[0]
    lost = 0.0
    total = 0.0
    effort = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        total += time
        pieces.end_data(layout.place, layout.known, x, k, data)
        pieces.sample(
            data, grid.orders, time, limited.gravity[0], grid.table, work.samples[k], work.rates[k]
        )
        own = limited.least[0]
        for r in range(limited.kinds.size):
            own = max(
                own,
                rows.constrain(
                    limited.kinds[r], limited.leaning, limited.turning, limited.figures,
                    work.samples[k], count, work.limits[k, r], limited.gravity[0],
                    work.values[k, r], limited.first[r], work.slopes[k], work.bends[k],
                ),
            )  # fmt: skip
        needed = max(needed, own)
        lost += time * max(own - 1.0, 0.0)
        effort += _effort(limited.effort, grid, limited, work.samples[k], time)
    work.marks[LOST] = lost
    return needed, total, effort


@inner
def _effort(effort, grid, limited, samples, time):
    """What a piece adds to the weighed integrals of squared derivatives."""
    total = 0.0
    if effort is None:
        return total
    for s in range(4):
        for q in range(grid.quadrature.size):
            for d in range(3):
                value = _without_gravity(samples[d, s, q], d, s, limited)
                total += effort[s] * grid.quadrature[q] * time * value * value
    return total


@inner
def _pull_effort(effort, grid, limited, samples, time, sums):
    """Sums (3, 4, S) += slope of a piece's effort by its samples; returns its own by log time."""
    direct = 0.0
    if effort is None:
        return direct
    for s in range(4):
        for d in range(3):
            for q in range(grid.quadrature.size):
                value = _without_gravity(samples[d, s, q], d, s, limited)
                weight = effort[s] * grid.quadrature[q] * time
                sums[d, s, q] += 2.0 * weight * value
                direct += weight * value * value
    return direct


@inner
def _without_gravity(value, d, s, limited):
    return value - limited.gravity[0] if d == 2 and s == 1 else value


@inner
def gradient(layout, grid, limited, work, x, flat_pulls, out):
    """Out (n,) <- gradient of the objective, and of the constraints times pulls (K R S,)."""
    pulls = flat_pulls.reshape(work.values.shape)
    count = grid.table.shape[2]
    sums = np.empty((3, 4, count))
    local = np.empty((grid.orders.size, 3))
    for i in range(out.size):
        out[i] = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        sums[:] = 0.0
        for r in range(limited.kinds.size):
            for p in range(limited.first[r], limited.first[r + 1]):
                _add_pull(pulls[k, r], work.slopes[k, p], limited.orders[p], sums)
        direct = time + _pull_effort(limited.effort, grid, limited, work.samples[k], time, sums)
        along = pieces.push(sums, work.rates[k], grid.orders, time, grid.table, local)
        out[layout.clock[k]] += direct + along
        for r in range(grid.orders.size):
            for d in range(3):
                if layout.place[k, r, d] >= 0:
                    out[layout.place[k, r, d]] += local[r, d]
        for d in range(3):
            if layout.place[k, grid.orders.size, d] >= 0:
                out[layout.place[k, grid.orders.size, d]] -= local[0, d]


@inner
def _add_pull(pulls, slope, order, sums):
    for d in range(3):
        for q in range(pulls.size):
            sums[d, order, q] += pulls[q] * slope[d, q]


@within
def product(layout, grid, limited, work, x, step, flat):
    """Flat (K R S,) <- gradients of the constraints times a step (n,)."""
    out = flat.reshape(work.values.shape)
    count = grid.table.shape[2]
    moves = np.empty((3, 4, count))
    local = np.empty((grid.orders.size, 3))
    nothing = np.zeros(layout.known.shape)
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.end_data(layout.place, nothing, step, k, local)
        pieces.pull(
            local, step[layout.clock[k]], work.rates[k], grid.orders, time, grid.table, moves
        )
        for r in range(limited.kinds.size):
            for q in range(count):
                out[k, r, q] = 0.0
            for p in range(limited.first[r], limited.first[r + 1]):
                _add_move(moves, work.slopes[k, p], limited.orders[p], out[k, r])


@inner
def _add_move(moves, slope, order, out):
    for d in range(3):
        for q in range(out.size):
            out[q] += moves[d, order, q] * slope[d, q]


@within
def assemble(layout, grid, limited, work, x):
    """The matrix H in band storage."""
    count, rows_ = grid.table.shape[2], grid.orders.size
    weights = np.empty((4, 6, count))
    local = np.empty((3 * rows_ + 1, 3 * rows_ + 1))
    powers = np.empty(rows_)
    sums = np.empty((6, grid.pairs.shape[0]))
    columns = np.empty(3 * rows_)
    work.matrix[:] = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        local[:] = 0.0
        weights[:] = 0.0
        for r in range(limited.kinds.size):
            single = limited.first[r + 1] == limited.first[r] + 1
            for p in range(limited.first[r], limited.first[r + 1]):
                _add_weights(
                    work.dual[k, r], work.slack[k, r], work.bends[k, p], work.slopes[k, p], single,
                    weights[limited.orders[p]],
                )  # fmt: skip
        wanted = grid.pairs.shape[0] if layout.steps[k] else grid.still[0]
        pieces.curvature(
            weights, work.rates[k], grid.orders, time, grid.table, grid.pairs, wanted,
            grid.products, powers, sums, columns, local,
        )  # fmt: skip
        local[3 * rows_, 3 * rows_] += time * (1.0 + work.stiffness[k])
        _add_outer(limited.several, grid, limited, work, k, time, local)
        _add_effort(
            limited.effort, grid, limited, work, k, time, weights, powers, sums, columns, local
        )
        _scatter(layout, k, local, work.matrix)


@inner
def _add_weights(dual, slack, bend, slope, single, weights):
    """Weights (6, S) += z bend I, and z/s times the slope's outer product if it is the only one."""
    for q in range(dual.size):
        isotropic = dual[q] * bend[q]
        weights[0, q] += isotropic
        weights[3, q] += isotropic
        weights[5, q] += isotropic
    if single:
        for q in range(dual.size):
            ratio = dual[q] / slack[q]
            x = slope[0, q]
            y = slope[1, q]
            z = slope[2, q]
            weights[0, q] += ratio * x * x
            weights[1, q] += ratio * x * y
            weights[2, q] += ratio * x * z
            weights[3, q] += ratio * y * y
            weights[4, q] += ratio * y * z
            weights[5, q] += ratio * z * z


@inner
def _add_outer(several, grid, limited, work, k, time, local):
    """Local += z/s times the outer products of gradients in several derivatives at once."""
    if several is None:
        return
    size = 3 * grid.orders.size
    column = np.empty(size + 1)
    for r in range(limited.kinds.size):
        if limited.first[r + 1] == limited.first[r] + 1:
            continue
        for q in range(grid.table.shape[2]):
            ratio = work.dual[k, r, q] / work.slack[k, r, q]
            for c in range(size + 1):
                column[c] = 0.0
            for p in range(limited.first[r], limited.first[r + 1]):
                s = limited.orders[p]
                for d in range(3):
                    slope = work.slopes[k, p, d, q]
                    column[size] += slope * work.rates[k, d, s, q]
                    for row in range(grid.orders.size):
                        column[3 * row + d] += (
                            slope * grid.table[row, s, q] * time ** (grid.orders[row] - s - 1)
                        )
            for i in range(size + 1):
                scaled = ratio * column[i]
                for j in range(i - i % 3, size + 1):
                    local[i, j] += scaled * column[j]


@inner
def _add_effort(effort, grid, limited, work, k, time, weights, powers, sums, columns, local):
    """Local += Gauss-Newton matrix of the effort: residuals sqrt(t) d, so rates are d/2 more."""
    if effort is None:
        return
    rates = np.empty((3, 4, grid.quadrature.size))
    weights[:] = 0.0
    for s in range(4):
        for q in range(grid.quadrature.size):
            weight = 2.0 * effort[s] * grid.quadrature[q] * time
            weights[s, 0, q] = weight
            weights[s, 3, q] = weight
            weights[s, 5, q] = weight
        for d in range(3):
            for q in range(grid.quadrature.size):
                value = _without_gravity(work.samples[k, d, s, q], d, s, limited)
                rates[d, s, q] = work.rates[k, d, s, q] + 0.5 * value
    pieces.curvature(
        weights, rates, grid.orders, time, grid.table, grid.pairs, grid.pairs.shape[0],
        grid.products, powers, sums, columns, local,
    )  # fmt: skip


@within
def _scatter(layout, k, local, matrix):
    """Add the local matrix of a piece to the band."""
    for a in range(layout.size[k]):
        row = layout.unknown[k, a]
        i = layout.source[k, a]
        for b in range(a, layout.size[k]):
            j = layout.source[k, b]
            value = local[i, j] if i // 3 <= j // 3 else local[j, i]
            matrix[row, layout.unknown[k, b] - row] += layout.sign[k, a] * layout.sign[k, b] * value


@within
def lower(layout, grid, limited, work, x, slowly):
    """Lower the limit of each sample by how much more than the sample its cell reaches."""
    count = grid.table.shape[2]
    cells = grid.dense.shape[2] // count
    data = np.empty((grid.orders.size, 3))
    near = np.empty((3, 4, count * cells))
    rates = np.empty((3, 4, count * cells))
    around = np.empty(count * cells)
    there = np.empty(count)
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.end_data(layout.place, layout.known, x, k, data)
        pieces.sample(data, grid.orders, time, limited.gravity[0], grid.dense, near, rates)
        for r in range(limited.kinds.size):
            kind, limit = limited.kinds[r], limited.values[r]
            rows.kappa(
                kind, limited.leaning, limited.turning, limited.figures, near, count * cells, limit,
                limited.gravity[0], around,
            )  # fmt: skip
            rows.kappa(
                kind, limited.leaning, limited.turning, limited.figures, work.samples[k], count,
                limit, limited.gravity[0], there,
            )  # fmt: skip
            for q in range(count):
                peak = 1e-300
                for c in range(cells):
                    value = around[q * cells + c]
                    if 0 < c < cells - 1:  # a parabola through an inner maximum
                        left = around[q * cells + c - 1]
                        right = around[q * cells + c + 1]
                        curve = 2.0 * value - left - right
                        if value >= left and value >= right and curve > 0.0:
                            value += (right - left) ** 2 / (8.0 * curve)
                    peak = max(peak, value)
                ratio = min(max(there[q] / peak, DEEPEST), 1.0)
                lowered = limit / ratio if kind == LEAST else limit * ratio
                work.limits[k, r, q] += slowly * (lowered - work.limits[k, r, q])
