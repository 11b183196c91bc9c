"""Minimum-effort splines of any class: degree, weights, continuity, and what is fixed where.

Each waypoint is a *node* with `slots` unknowns an axis: derivatives by time (shared by the two
pieces up to the continuity that end data can carry, one for each side beyond it), and multipliers
of the constraints that end data cannot carry (higher continuity, higher fixed derivatives). The
optimality conditions are a symmetric indefinite band, scaled to a unit diagonal and factorised by
LU with row pivoting, in O(K). Slots that are fixed or unused at a node are rows of the identity.

This file uses *full* end data, N+1 rows: position and derivatives at the start of a piece, then
at its end, by normalised time. A `Layout` says where they are among the unknowns and a `Cost`
what is minimised; `kernels.layout` makes both.
"""

import numpy as np

from peakflight.kernels.jit import inner, kernel

JUMP = 0
"""Kind of constraint: a derivative is continuous."""
AT_START = 1
"""Kind of constraint: a derivative has a given value where a piece starts."""
AT_END = 2
"""Kind of constraint: a derivative has a given value where a piece ends."""


@kernel
def solve(layout, cost, waypoints, times, rounds, factors, values, data, starts):
    """End data of the optimum for given times; returns 0, or 1 if something is undetermined.

    waypoints (K+1, D): positions, or any reference where they are free; rounds: 1, or more to
    refine the solution; factors: scale (A, n), band (A, n, 3w+1) and pivots (A, n) with
    n = (K+1) slots and w = 2 slots - 1, kept for `adjoint`; values (n, D) gets unknowns and
    multipliers, data (K, N, D) the end data, starts (K, D) the first position of each piece.
    """
    slots = layout.free.shape[2]
    left = _left(layout)
    if not factorise(layout, cost, times, factors) > 0.0:
        return 1
    for i in range(values.shape[0]):
        for d in range(values.shape[1]):
            values[i, d] = (
                layout.known[i // slots, i % slots, d] if layout.order[i % slots] >= 0 else 0.0
            )
    residual = np.empty(values.shape)
    for _ in range(rounds):
        _residual(layout, cost, waypoints, times, values, residual)
        _substitute(layout, factors, residual)
        for i in range(values.shape[0]):
            for d in range(values.shape[1]):
                values[i, d] += residual[i, d]
    piece = np.empty(layout.slot.size)
    powers = np.empty(layout.slot.size)
    for k in range(times.size):
        _powers(times[k], powers)
        for d in range(values.shape[1]):
            _end_data(layout, values, waypoints, waypoints[k, d], powers, k, d, piece)
            starts[k, d] = waypoints[k, d] + piece[0]
            data[k, 0, d] = piece[left] - piece[0]
            for i in range(1, layout.slot.size):
                if i != left:
                    data[k, i if i < left else i - 1, d] = piece[i]
    return 0


@kernel
def adjoint(layout, cost, waypoints, times, factors, values, slope, gradient):
    """Gradient (K,) += derivative by log times of a function with derivative `slope` by the data.

    slope (K, N, D) is dF/ddata of a function F that depends on times through the data alone.
    """
    slots = layout.free.shape[2]
    left = _left(layout)
    powers = np.empty(layout.slot.size)
    adjoints = np.zeros(values.shape)
    for k in range(times.size):
        _powers(times[k], powers)
        for d in range(values.shape[1]):
            for i in range(layout.slot.size):
                if i in (0, left):
                    push = slope[k, 0, d] if i == left else -slope[k, 0, d]
                else:
                    order = _order(i, left)
                    push = slope[k, i if i < left else i - 1, d] * powers[order]
                    row = (k + _side(i, left)) * slots + layout.slot[i]
                    gradient[k] += order * push * values[row, d]
                if layout.slot[i] >= 0:
                    adjoints[(k + _side(i, left)) * slots + layout.slot[i], d] += push
    _substitute(layout, factors, adjoints)
    y = np.empty(layout.slot.size)
    z = np.empty(layout.slot.size)
    nowhere = np.zeros(waypoints.shape)
    for k in range(times.size):
        _powers(times[k], powers)
        for d in range(values.shape[1]):
            _end_data(layout, values, waypoints, waypoints[k, d], powers, k, d, y)
            _end_data(layout, adjoints, nowhere, 0.0, powers, k, d, z)
            for i in range(layout.slot.size):
                _, rate = _cost_slope(cost, times[k], y, waypoints[k, d], left, i)
                gradient[k] -= z[i] * rate
            for q in range(layout.constraints.shape[0]):
                order = layout.constraints[q, 1]
                for end in range(2):
                    if _reads(layout.constraints[q, 2], end, k, times.size):
                        row = (k + end) * slots + layout.constraints[q, 0]
                        for i in range(layout.slot.size):
                            rate = (_order(i, left) - order) * layout.ends[end, order, i]
                            both = adjoints[row, d] * y[i] + values[row, d] * z[i]
                            gradient[k] -= (2 * end - 1) * rate / powers[order] * both


@kernel
def factorise(layout, cost, times, factors):
    """Scale, assemble and factorise the optimality conditions; returns the smallest pivot."""
    smallest = np.inf
    scale, band, pivots = factors
    slots = layout.free.shape[2]
    width = 2 * slots - 1
    left = _left(layout)
    count = times.size
    local = np.empty((layout.slot.size, layout.slot.size))
    reach = np.empty(layout.slot.size)
    powers = np.empty(layout.slot.size)
    for a in range(layout.free.shape[0]):
        scale[a] = 0.0
        band[a] = 0.0
        for k in range(count):  # variables are scaled to a unit diagonal
            _powers(times[k], powers)
            _piece_energy(cost, times[k], local)
            for i in range(layout.slot.size):
                if layout.slot[i] >= 0:
                    row = (k + _side(i, left)) * slots + layout.slot[i]
                    scale[a, row] += local[i, i] * powers[_order(i, left)] ** 2
        for k in range(count + 1):
            time = min(times[max(k - 1, 0)], times[min(k, count - 1)])
            for i in range(slots):
                if layout.order[i] >= 0:
                    row = k * slots + i
                    diagonal = scale[a, row]
                    scale[a, row] = (
                        1.0 / np.sqrt(diagonal) if diagonal > 0.0 else time ** -layout.order[i]
                    )
        for k in range(count):
            _powers(times[k], powers)
            _piece_energy(cost, times[k], local)
            for i in range(layout.slot.size):
                reach[i] = 0.0
                node = k + _side(i, left)
                if layout.slot[i] >= 0 and layout.free[a, node, layout.slot[i]]:
                    row = node * slots + layout.slot[i]
                    reach[i] = scale[a, row] * powers[_order(i, left)]
            for i in range(layout.slot.size):
                if reach[i] == 0.0:
                    continue
                row = (k + _side(i, left)) * slots + layout.slot[i]
                for j in range(layout.slot.size):
                    if reach[j] != 0.0:
                        column = (k + _side(j, left)) * slots + layout.slot[j]
                        band[a, row, column - row + width] += local[i, j] * reach[i] * reach[j]
            for q in range(layout.constraints.shape[0]):
                for end in range(2):
                    if not _reads(layout.constraints[q, 2], end, k, count):
                        continue
                    row = (k + end) * slots + layout.constraints[q, 0]
                    order = layout.constraints[q, 1]
                    for j in range(layout.slot.size):
                        if reach[j] != 0.0 and layout.free[a, k + end, layout.constraints[q, 0]]:
                            column = (k + _side(j, left)) * slots + layout.slot[j]
                            band[a, row, column - row + width] += (
                                (2 * end - 1) * layout.ends[end, order, j] * reach[j]
                            ) / powers[order]
        for k in range(count + 1):  # multipliers are scaled to a largest entry of one
            for i in range(slots):
                row = k * slots + i
                if not layout.free[a, k, i]:
                    band[a, row, width] = 1.0
                elif layout.order[i] < 0:
                    top = 0.0
                    for j in range(2 * width + 1):
                        top = max(top, abs(band[a, row, j]))
                    scale[a, row] = 1.0 / top if top > 0.0 else 1.0
                    for j in range(2 * width + 1):
                        column = row + j - width
                        if band[a, row, j] != 0.0:
                            band[a, row, j] *= scale[a, row]
                            band[a, column, row - column + width] = band[a, row, j]
        smallest = min(smallest, _eliminate(band[a], pivots[a], width))
    return smallest


@inner
def _left(layout):
    """How many rows of the full end data belong to the start of a piece."""
    return (layout.slot.size - 1) // 2 + 1


@inner
def _side(row, left):
    """0 if a row of the full end data belongs to the start of the piece, 1 for its end."""
    return 0 if row < left else 1


@inner
def _order(row, left):
    """Order of the derivative in a row of the full end data."""
    return row if row < left else row - left


@inner
def _reads(kind, end, piece, count):
    """Whether a constraint at the start (0) or end (1) of a piece reads that piece."""
    if kind == JUMP:
        return 0 < piece + end < count
    return end == kind - AT_START


@inner
def _powers(time, out):
    """out[e] = time^e."""
    out[0] = 1.0
    for e in range(1, out.size):
        out[e] = out[e - 1] * time


@inner
def _end_data(layout, values, waypoints, origin, powers, k, d, out):
    """Out (N+1,) <- full end data of piece k in axis d, positions relative to `origin`."""
    left = _left(layout)
    for i in range(layout.slot.size):
        node = k + _side(i, left)
        order = _order(i, left)
        value = 0.0
        if layout.slot[i] >= 0:
            value = values[node * layout.free.shape[2] + layout.slot[i], d]
        out[i] = value * powers[order] if order > 0 else value + (waypoints[node, d] - origin)


@inner
def _residual(layout, cost, waypoints, times, values, out):
    """Out (n, D) <- by how much the optimality conditions fail at `values`, with opposite sign."""
    slots = layout.free.shape[2]
    left = _left(layout)
    piece = np.empty(layout.slot.size)
    powers = np.empty(layout.slot.size)
    for i in range(out.shape[0]):
        for d in range(out.shape[1]):
            out[i, d] = 0.0
            if layout.order[i % slots] < 0:
                value = layout.known[i // slots, i % slots, d]
                out[i, d] = -value if layout.kind[i % slots] == AT_START else value
    for k in range(times.size):
        _powers(times[k], powers)
        for d in range(out.shape[1]):
            _end_data(layout, values, waypoints, waypoints[k, d], powers, k, d, piece)
            for i in range(layout.slot.size):
                if layout.slot[i] >= 0:
                    slope, _ = _cost_slope(cost, times[k], piece, waypoints[k, d], left, i)
                    row = (k + _side(i, left)) * slots + layout.slot[i]
                    out[row, d] -= slope * powers[_order(i, left)]
            for q in range(layout.constraints.shape[0]):
                for end in range(2):
                    if not _reads(layout.constraints[q, 2], end, k, times.size):
                        continue
                    order = layout.constraints[q, 1]
                    row = (k + end) * slots + layout.constraints[q, 0]
                    pull = (2 * end - 1) / powers[order]
                    total = 0.0
                    for j in range(layout.slot.size):
                        total += layout.ends[end, order, j] * piece[j]
                        if layout.slot[j] >= 0:
                            g = (k + _side(j, left)) * slots + layout.slot[j]
                            push = pull * layout.ends[end, order, j] * powers[_order(j, left)]
                            out[g, d] -= push * values[row, d]
                    out[row, d] -= pull * total


@inner
def _cost_slope(cost, time, piece, origin, left, i):
    """Half the derivative of a piece's cost by row i of its end data, and its own by log time.

    The second is with all derivatives by time held fixed.
    """
    slope = 0.0
    rate = 0.0
    for s in range(cost.orders.size):
        factor = cost.weights[s] * time ** (1.0 - 2.0 * cost.orders[s])
        for j in range(piece.size):
            value = piece[j]
            if cost.orders[s] == 0 and _order(j, left) == 0:
                value += origin  # the position itself is weighed: measured from zero
            part = factor * cost.energies[s, i, j] * value
            slope += part
            rate += (1.0 - 2.0 * cost.orders[s] + _order(i, left) + _order(j, left)) * part
    return slope, rate


@inner
def _piece_energy(cost, time, out):
    """Out (N+1, N+1) <- energy of a piece in full end data by normalised time."""
    out[:] = 0.0
    for s in range(cost.orders.size):
        factor = cost.weights[s] * time ** (1.0 - 2.0 * cost.orders[s])
        for i in range(out.shape[0]):
            for j in range(out.shape[1]):
                out[i, j] += factor * cost.energies[s, i, j]


@inner
def _eliminate(band, pivots, width):
    """LU with row pivoting in place; band[i, j-i+width] is entry (i, j).

    Returns the smallest pivot, 0 or NaN where it had to stop.
    """
    size = band.shape[0]
    smallest = np.inf
    for k in range(size):
        best = k
        for i in range(k + 1, min(k + width + 1, size)):
            if abs(band[i, k - i + width]) > abs(band[best, k - best + width]):
                best = i
        pivot = abs(band[best, k - best + width])
        if not 0.0 < pivot < np.inf:
            return 0.0
        smallest = min(smallest, pivot)
        pivots[k] = best
        last = min(k + 2 * width, size - 1)
        if best != k:
            for j in range(k, last + 1):
                kept = band[k, j - k + width]
                band[k, j - k + width] = band[best, j - best + width]
                band[best, j - best + width] = kept
        for i in range(k + 1, min(k + width + 1, size)):
            factor = band[i, k - i + width] / band[k, width]
            band[i, k - i + width] = factor
            if factor != 0.0:
                for j in range(k + 1, last + 1):
                    band[i, j - i + width] -= factor * band[k, j - k + width]
    return smallest


@inner
def _substitute(layout, factors, values):
    """Values (n, D) <- inverse of the unscaled matrix, times values; fixed slots give zero."""
    scale, band, pivots = factors
    slots = layout.free.shape[2]
    size = values.shape[0]
    width = 2 * slots - 1
    for d in range(values.shape[1]):
        a = layout.pattern[d]
        for i in range(size):
            values[i, d] *= scale[a, i] if layout.free[a, i // slots, i % slots] else 0.0
        for k in range(size):
            p = pivots[a, k]
            if p != k:
                kept = values[k, d]
                values[k, d] = values[p, d]
                values[p, d] = kept
            for i in range(k + 1, min(k + width + 1, size)):
                values[i, d] -= band[a, i, k - i + width] * values[k, d]
        for k in range(size - 1, -1, -1):
            total = values[k, d]
            for j in range(k + 1, min(k + 2 * width + 1, size)):
                total -= band[a, k, j - k + width] * values[j, d]
            values[k, d] = total / band[a, k, width]
        for i in range(size):
            values[i, d] *= scale[a, i] if layout.free[a, i // slots, i % slots] else 0.0
