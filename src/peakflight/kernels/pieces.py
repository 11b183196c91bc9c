"""One piece of a trajectory under the eyes of `interior`: samples, and both ways between them and
the unknowns.

The local unknowns of a piece are its end data by time (`basis`: the step from start to end, and
derivatives at both ends) and the logarithm of its duration. With table H of the basis at the sample
points, derivative s of the piece is

    d_s = t^-s sum_r H[r, s] t^o_r y_r
    d(d_s)/d(log t) = t^-s sum_r (o_r - s) H[r, s] t^o_r y_r

where o_r is the order of row r. To acceleration, s = 2, gravity is added.
"""

import numpy as np

from peakflight.kernels.jit import inner, vector

SIX = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
"""Where the entries of a symmetric matrix stand among xx, xy, xz, yy, yz, zz."""


@inner
def end_data(place, known, x, k, out):
    """Out (N, 3) <- end data of piece k by time, from the unknowns x and what is known.

    place (K, N+1, 3): index of each row's unknown, -1 where it is known; row N is the start.
    """
    rows = out.shape[0]
    for r in range(rows):
        for d in range(3):
            out[r, d] = known[k, r, d]
            if place[k, r, d] >= 0:
                out[r, d] += x[place[k, r, d]]
    for d in range(3):
        if place[k, rows, d] >= 0:
            out[0, d] -= x[place[k, rows, d]]


@vector
def sample(data, orders, time, gravity, table, samples, rates):
    """Samples, rates (3, 4, S) <- derivatives of a piece and their own by log time."""
    flat = table.reshape(table.shape[0], -1)
    values = samples.reshape(3, -1)
    slopes = rates.reshape(3, -1)
    for d in range(3):
        for q in range(flat.shape[1]):
            values[d, q] = 0.0
        for q in range(flat.shape[1]):
            slopes[d, q] = 0.0
        for r in range(flat.shape[0]):
            scaled = data[r, d] * time ** orders[r]
            weighed = scaled * orders[r]
            for q in range(flat.shape[1]):
                values[d, q] += flat[r, q] * scaled
            if weighed != 0.0:
                for q in range(flat.shape[1]):
                    slopes[d, q] += flat[r, q] * weighed
        scale = 1.0
        for s in range(4):
            scale /= time
            for q in range(table.shape[2]):
                samples[d, s, q] *= scale
            for q in range(table.shape[2]):
                rates[d, s, q] = rates[d, s, q] * scale - (s + 1) * samples[d, s, q]
    for q in range(table.shape[2]):
        samples[2, 1, q] += gravity


@vector
def push(pulls, rates, orders, time, table, out):
    """Out (N, 3) <- pulls (3, 4, S) on the samples, carried to the end data.

    Pulls are scaled in place. Returns how they pull at the logarithm of the duration.
    """
    flat = table.reshape(table.shape[0], -1)
    along = 0.0
    for d in range(3):
        scale = 1.0
        for s in range(4):
            scale /= time
            for q in range(table.shape[2]):
                along += pulls[d, s, q] * rates[d, s, q]
            for q in range(table.shape[2]):
                pulls[d, s, q] *= scale
    values = pulls.reshape(3, -1)
    for d in range(3):
        for r in range(flat.shape[0]):
            total = 0.0
            for q in range(flat.shape[1]):
                total += flat[r, q] * values[d, q]
            out[r, d] = total * time ** orders[r]
    return along


@vector
def pull(steps, lengthening, rates, orders, time, table, moves):
    """Moves (3, 4, S) <- how samples change with steps (N, 3) of the end data and of log time."""
    flat = table.reshape(table.shape[0], -1)
    values = moves.reshape(3, -1)
    for d in range(3):
        for q in range(flat.shape[1]):
            values[d, q] = 0.0
        for r in range(flat.shape[0]):
            scaled = steps[r, d] * time ** orders[r]
            if scaled != 0.0:
                for q in range(flat.shape[1]):
                    values[d, q] += flat[r, q] * scaled
        scale = 1.0
        for s in range(4):
            scale /= time
            for q in range(table.shape[2]):
                moves[d, s, q] = moves[d, s, q] * scale + lengthening * rates[d, s, q]


@inner
def curvature(
    weights, rates, orders, time, table, pairs, count, products, powers, sums, columns, out
):
    """Out (3N+1, 3N+1) += second derivative by end data and log time of a form in the samples.

    weights (4, 6, S): the form at each sample, xx, xy, xz, yy, yz, zz of each derivative; pairs
    (P, 2): rows i <= j of the end data, in the order of products (4, S, P) of the table, of which
    the first `count` are wanted; powers (N,), sums (6, P), columns (3N,): scratch. Filled are the
    blocks of rows i <= j, and the last column: duration is last.
    """
    rows = table.shape[0]
    for r in range(rows):
        powers[r] = time ** orders[r]
    _accumulate(weights, products, count, time, sums)
    for p in range(count):
        i = pairs[p, 0]
        j = pairs[p, 1]
        scale = powers[i] * powers[j]
        q = 0
        for a in range(3):
            for b in range(a, 3):
                value = sums[q, p] * scale
                q += 1
                out[3 * i + a, 3 * j + b] += value
                if a != b:
                    out[3 * i + b, 3 * j + a] += value
    along = _along(weights, rates, time, table, columns)
    for r in range(rows):
        for d in range(3):
            out[3 * r + d, 3 * rows] += columns[3 * r + d] * powers[r]
    out[3 * rows, 3 * rows] += along


@vector
def _accumulate(weights, products, count, time, sums):
    for q in range(6):
        for p in range(count):
            sums[q, p] = 0.0
    scale = 1.0
    for s in range(4):
        scale /= time * time
        for i in range(weights.shape[2]):
            for q in range(6):
                weight = weights[s, q, i] * scale
                for p in range(count):
                    sums[q, p] += weight * products[s, i, p]


@vector
def _along(weights, rates, time, table, columns):
    """Columns (3N,) <- the form applied to the rates, carried to the end data (without powers)."""
    count = table.shape[2]
    turned = np.empty(count)
    total = 0.0
    for c in range(columns.size):
        columns[c] = 0.0
    scale = 1.0
    for s in range(4):
        scale /= time
        for d in range(3):
            for q in range(count):
                turned[q] = (
                    weights[s, SIX[d][0], q] * rates[0, s, q]
                    + weights[s, SIX[d][1], q] * rates[1, s, q]
                    + weights[s, SIX[d][2], q] * rates[2, s, q]
                )
            for q in range(count):
                total += rates[d, s, q] * turned[q]
            for r in range(table.shape[0]):
                value = 0.0
                for q in range(count):
                    value += table[r, s, q] * turned[q]
                columns[3 * r + d] += value * scale
    return total
