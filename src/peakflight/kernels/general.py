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

from peakflight.kernels.jit import inner, kernel, within

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
    left = _left(layout)
    size = layout.slot.size
    if not factorise(layout, cost, times, factors) > 0.0:
        return 1
    _begin(layout, values)
    residual = np.empty(values.shape)
    for _ in range(rounds):
        _residual(layout, cost, waypoints, times, values, residual)
        _substitute(layout, factors, residual)
        for i in range(values.shape[0]):
            for d in range(values.shape[1]):
                values[i, d] += residual[i, d]
    piece = np.empty(size)
    powers = np.empty(size)
    for k in range(times.size):
        _powers(times[k], powers)
        for d in range(values.shape[1]):
            _end_data(layout, values, waypoints, waypoints[k, d], powers, k, d, piece)
            starts[k, d] = waypoints[k, d] + piece[0]
            data[k, 0, d] = piece[left] - piece[0]
            for i in range(1, size):
                if i != left:
                    data[k, i if i < left else i - 1, d] = piece[i]
    return 0


@kernel
def adjoint(layout, cost, waypoints, times, factors, values, slope, gradient):
    """Gradient (K,) += derivative by log times of a function with derivative `slope` by the data.

    slope (K, N, D) is dF/ddata of a function F that depends on times through the data alone.
    """
    slot, constraints, ends = layout.slot, layout.constraints, layout.ends
    slots = layout.free.shape[2]
    left = _left(layout)
    size = slot.size
    powers = np.empty(size)
    adjoints = np.zeros(values.shape)
    for k in range(times.size):
        _powers(times[k], powers)
        for d in range(values.shape[1]):
            for i in range(size):
                row = (k + _side(i, left)) * slots + slot[i]
                if i in (0, left):
                    push = slope[k, 0, d] if i == left else -slope[k, 0, d]
                else:
                    order = _order(i, left)
                    push = slope[k, i if i < left else i - 1, d] * powers[order]
                    gradient[k] += order * push * values[row, d]
                if slot[i] >= 0:
                    adjoints[row, d] += push
    _substitute(layout, factors, adjoints)
    y = np.empty(size)
    z = np.empty(size)
    weights = np.empty(cost.orders.size)
    nowhere = np.zeros(waypoints.shape)
    for k in range(times.size):
        _powers(times[k], powers)
        _weights(cost, times[k], weights)
        for d in range(values.shape[1]):
            _end_data(layout, values, waypoints, waypoints[k, d], powers, k, d, y)
            _end_data(layout, adjoints, nowhere, 0.0, powers, k, d, z)
            for i in range(size):
                _, rate = _cost_slope(cost, weights, y, waypoints[k, d], left, i)
                gradient[k] -= z[i] * rate
            for q in range(constraints.shape[0]):
                order = constraints[q, 1]
                for end in range(2):
                    if _reads(constraints[q, 2], end, k, times.size):
                        row = (k + end) * slots + constraints[q, 0]
                        for i in range(size):
                            rate = (_order(i, left) - order) * ends[end, order, i]
                            both = adjoints[row, d] * y[i] + values[row, d] * z[i]
                            gradient[k] -= (2 * end - 1) * rate / powers[order] * both


@kernel
def factorise(layout, cost, times, factors):
    """Scale, assemble and factorise the optimality conditions; returns the smallest pivot."""
    scale, band, pivots = factors
    width = 2 * layout.free.shape[2] - 1
    smallest = np.inf
    for a in range(layout.free.shape[0]):
        _assemble(layout, cost, times, a, scale[a], band[a])
        smallest = min(smallest, _eliminate(band[a], pivots[a], width))
    return smallest


@within
def _assemble(layout, cost, times, pattern, scale, band):
    """Scale (n,) and band (n, 3w+1) <- the scaled optimality conditions of one pattern of axes."""
    slot, order_of, constraints, ends = layout.slot, layout.order, layout.constraints, layout.ends
    free = layout.free[pattern]
    slots = free.shape[1]
    width = 2 * slots - 1
    left = _left(layout)
    size = slot.size
    count = times.size
    local = np.empty((size, size))
    reach = np.empty(size)
    powers = np.empty(size)
    weights = np.empty(cost.orders.size)
    for row in range(scale.size):
        scale[row] = 0.0
        for j in range(band.shape[1]):
            band[row, j] = 0.0
    for k in range(count):  # variables are scaled to a unit diagonal
        _powers(times[k], powers)
        _weights(cost, times[k], weights)
        for i in range(size):
            if slot[i] >= 0:
                row = (k + _side(i, left)) * slots + slot[i]
                for s in range(weights.size):
                    energy = weights[s] * cost.energies[s, i, i]
                    scale[row] += energy * powers[_order(i, left)] ** 2
    for row in range(scale.size):
        order = order_of[row % slots]
        if order >= 0:
            k = row // slots
            time = min(times[max(k - 1, 0)], times[min(k, count - 1)])
            scale[row] = 1.0 / np.sqrt(scale[row]) if scale[row] > 0.0 else time**-order
    for k in range(count):
        _powers(times[k], powers)
        _weights(cost, times[k], weights)
        _piece_energy(cost, weights, local)
        for i in range(size):
            reach[i] = 0.0
            node = k + _side(i, left)
            if slot[i] >= 0 and free[node, slot[i]]:
                reach[i] = scale[node * slots + slot[i]] * powers[_order(i, left)]
        for i in range(size):
            if reach[i] == 0.0:
                continue
            row = (k + _side(i, left)) * slots + slot[i]
            for j in range(size):
                if reach[j] != 0.0:
                    column = (k + _side(j, left)) * slots + slot[j]
                    band[row, column - row + width] += local[i, j] * reach[i] * reach[j]
        for q in range(constraints.shape[0]):
            order = constraints[q, 1]
            for end in range(2):
                row = (k + end) * slots + constraints[q, 0]
                if not (
                    _reads(constraints[q, 2], end, k, count) and free[k + end, constraints[q, 0]]
                ):
                    continue
                for j in range(size):
                    if reach[j] != 0.0:
                        column = (k + _side(j, left)) * slots + slot[j]
                        band[row, column - row + width] += (
                            (2 * end - 1) * ends[end, order, j] * reach[j]
                        ) / powers[order]
    for row in range(scale.size):  # multipliers are scaled to a largest entry of one
        if not free[row // slots, row % slots]:
            band[row, width] = 1.0
        elif order_of[row % slots] < 0:
            top = 0.0
            for j in range(2 * width + 1):
                top = max(top, abs(band[row, j]))
            scale[row] = 1.0 / top if top > 0.0 else 1.0
            for j in range(2 * width + 1):
                column = row + j - width
                if band[row, j] != 0.0:
                    band[row, j] *= scale[row]
                    band[column, row - column + width] = band[row, j]


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


@within
def _begin(layout, values):
    """Values (n, D) <- what is fixed, and zero where a multiplier is."""
    order, known = layout.order, layout.known
    slots = order.size
    for i in range(values.shape[0]):
        for d in range(values.shape[1]):
            values[i, d] = known[i // slots, i % slots, d] if order[i % slots] >= 0 else 0.0


@inner
def _end_data(layout, values, waypoints, origin, powers, k, d, out):
    """Out (N+1,) <- full end data of piece k in axis d, positions relative to `origin`."""
    slot = layout.slot
    slots = layout.order.size
    left = _left(layout)
    for i in range(slot.size):
        node = k + _side(i, left)
        order = _order(i, left)
        value = 0.0
        if slot[i] >= 0:
            value = values[node * slots + slot[i], d]
        out[i] = value * powers[order] if order > 0 else value + (waypoints[node, d] - origin)


@within
def _residual(layout, cost, waypoints, times, values, out):
    """Out (n, D) <- by how much the optimality conditions fail at `values`, with opposite sign."""
    slot, constraints, ends = layout.slot, layout.constraints, layout.ends
    order_of, kind, known = layout.order, layout.kind, layout.known
    slots = order_of.size
    left = _left(layout)
    size = slot.size
    piece = np.empty(size)
    powers = np.empty(size)
    weights = np.empty(cost.orders.size)
    for i in range(out.shape[0]):
        for d in range(out.shape[1]):
            out[i, d] = 0.0
            if order_of[i % slots] < 0:
                value = known[i // slots, i % slots, d]
                out[i, d] = -value if kind[i % slots] == AT_START else value
    for k in range(times.size):
        _powers(times[k], powers)
        _weights(cost, times[k], weights)
        for d in range(out.shape[1]):
            _end_data(layout, values, waypoints, waypoints[k, d], powers, k, d, piece)
            for i in range(size):
                if slot[i] >= 0:
                    slope, _ = _cost_slope(cost, weights, piece, waypoints[k, d], left, i)
                    row = (k + _side(i, left)) * slots + slot[i]
                    out[row, d] -= slope * powers[_order(i, left)]
            for q in range(constraints.shape[0]):
                for end in range(2):
                    if not _reads(constraints[q, 2], end, k, times.size):
                        continue
                    order = constraints[q, 1]
                    row = (k + end) * slots + constraints[q, 0]
                    pull = (2 * end - 1) / powers[order]
                    total = 0.0
                    for j in range(size):
                        total += ends[end, order, j] * piece[j]
                        if slot[j] >= 0:
                            g = (k + _side(j, left)) * slots + slot[j]
                            push = pull * ends[end, order, j] * powers[_order(j, left)]
                            out[g, d] -= push * values[row, d]
                    out[row, d] -= pull * total


@inner
def _weights(cost, time, out):
    """Out (S,) <- weights of the squared derivatives by normalised time."""
    for s in range(out.size):
        out[s] = cost.weights[s] * time ** (1.0 - 2.0 * cost.orders[s])


@inner
def _cost_slope(cost, weights, piece, origin, left, i):
    """Half the derivative of a piece's cost by row i of its end data, and its own by log time.

    The second is with all derivatives by time held fixed; weights: of `_weights`.
    """
    orders, energies = cost.orders, cost.energies
    slope = 0.0
    rate = 0.0
    for s in range(weights.size):
        for j in range(piece.size):
            value = piece[j]
            if orders[s] == 0 and _order(j, left) == 0:
                value += origin  # the position itself is weighed: measured from zero
            part = weights[s] * energies[s, i, j] * value
            slope += part
            rate += (1.0 - 2.0 * orders[s] + _order(i, left) + _order(j, left)) * part
    return slope, rate


@inner
def _piece_energy(cost, weights, out):
    """Out (N+1, N+1) <- energy of a piece in full end data by normalised time."""
    energies = cost.energies
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = 0.0
            for s in range(weights.size):
                out[i, j] += weights[s] * energies[s, i, j]


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
    free, pattern = layout.free, layout.pattern
    slots = free.shape[2]
    size = values.shape[0]
    width = 2 * slots - 1
    for d in range(values.shape[1]):
        a = pattern[d]
        for i in range(size):
            values[i, d] *= scale[a, i] if free[a, i // slots, i % slots] else 0.0
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
            values[i, d] *= scale[a, i] if free[a, i // slots, i % slots] else 0.0
