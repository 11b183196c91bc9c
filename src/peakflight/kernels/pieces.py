"""One piece of a trajectory under the eyes of `interior`: samples, and both ways between them and
the unknowns.

The local unknowns of a piece are its end data by time (`basis`: the step from start to end, and
derivatives at both ends) and the logarithm of its duration. With table H of the basis at the sample
points, derivative s of the piece is

    d_s = t^-s sum_r H[r, s] t^o_r y_r
    d(d_s)/d(log t) = t^-s sum_r (o_r - s) H[r, s] t^o_r y_r

where o_r is the order of row r. To acceleration, s = 2, gravity is added.

Derivatives 1 to 4 at S points stand one after the other: 4 S numbers an axis. Two long loops do all
the work, `derive` from end data to samples and `carry` back; the factors t^o_r and t^-s of a piece
are `factors`. Long loops stand inside of loops over axes without literal bounds, or the compiler
would write each of them out for every axis, which takes long and makes nothing faster.
"""

import numpy as np

from peakflight.kernels.jit import inner, vector

SIX = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
"""Where the entries of a symmetric matrix stand among xx, xy, xz, yy, yz, zz."""
SIXTH = np.array(SIX)
"""The same, for loops that the compiler is not to write out."""
VECTOR = 8
"""Numbers that a processor may work on at once; whole vectors are quicker than a remainder."""


@vector
def factors(time, orders, steps, powers, scales):
    """Powers (N,) <- t^o_r of each row; scales (4 S,) <- t^-s, with s of `steps` (4 S,)."""
    for r in range(orders.size):
        powers[r] = time ** orders[r]
    first = 1.0 / time
    second = first * first
    for i in range(scales.size):
        low = first if steps[i] < 2.0 else second
        scales[i] = low if steps[i] < 3.0 else second * (first if steps[i] < 4.0 else second)


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


@inner
def step_data(place, x, k, out):
    """Likewise of a step of the unknowns: what is known does not change."""
    rows = out.shape[0]
    for r in range(rows):
        for d in range(3):
            out[r, d] = x[place[k, r, d]] if place[k, r, d] >= 0 else 0.0
    for d in range(3):
        if place[k, rows, d] >= 0:
            out[0, d] -= x[place[k, rows, d]]


@vector
def derive(data, powers, scales, table, k, out):
    """out[k] (3, 4 S) <- derivatives of end data (N, 3) by time; table (N, 4 S)."""
    for d in range(data.shape[1]):
        for i in range(scales.size):
            out[k, d, i] = 0.0
    for r in range(powers.size):
        for d in range(data.shape[1]):
            value = data[r, d] * powers[r]
            for i in range(scales.size):
                out[k, d, i] += table[r, i] * value
    for d in range(data.shape[1]):
        for i in range(scales.size):
            out[k, d, i] *= scales[i]


@vector
def sample(data, orders, steps, powers, scales, table, k, samples, rates):
    """samples[k], rates[k] (3, 4 S) <- derivatives of a piece and their own by log time.

    Without gravity. data is used up.
    """
    derive(data, powers, scales, table, k, samples)
    for r in range(orders.size):
        for d in range(3):
            data[r, d] *= orders[r]
    derive(data, powers, scales, table, k, rates)
    for d in range(samples.shape[1]):
        for i in range(scales.size):
            rates[k, d, i] -= steps[i] * samples[k, d, i]


@vector
def pull(change, lengthening, powers, scales, rates, table, k, moves):
    """moves[0] (3, 4 S) <- how samples change with end data (N, 3), and with log time."""
    first = np.int64(0)
    derive(change, powers, scales, table, first, moves)
    for d in range(moves.shape[1]):
        for i in range(scales.size):
            moves[first, d, i] += lengthening * rates[k, d, i]


@vector
def push(pulls, powers, scales, rates, table, k, out):
    """Out (N, 3) <- pulls[0] (3, 4 S) on the samples, carried to the end data.

    Pulls are scaled in place. Returns how they pull at the logarithm of the duration.
    """
    along = 0.0
    for d in range(pulls.shape[1]):
        for i in range(scales.size):
            along += pulls[0, d, i] * rates[k, d, i]
    carry(pulls, powers, scales, table, out)
    return along


@vector
def carry(pulls, powers, scales, table, out):
    """Out (N, 3) <- transpose of `derive` times pulls[0] (3, 4 S), which are scaled in place."""
    for d in range(pulls.shape[1]):
        for i in range(scales.size):
            pulls[0, d, i] *= scales[i]
    for r in range(powers.size):
        x = 0.0
        y = 0.0
        z = 0.0
        for i in range(scales.size):
            x += table[r, i] * pulls[0, 0, i]
            y += table[r, i] * pulls[0, 1, i]
            z += table[r, i] * pulls[0, 2, i]
        out[r, 0] = x * powers[r]
        out[r, 1] = y * powers[r]
        out[r, 2] = z * powers[r]


@inner
def curvature(
    weights, rates, k, powers, scales, table, pairs, count, products, sums, turned, columns, out
):
    """Out (3N+1, 3N+1) += second derivative by end data and log time of a form in the samples.

    weights[0] (6, 4 S): the form at each sample, xx, xy, xz, yy, yz, zz, scaled in place; rates
    (K, 3, 4 S) of piece k; pairs (P, 2): rows i <= j of the end data, in the order of products
    (4 S, P or more) of the table, of which the first `count` are wanted; sums (6, P or more),
    turned (1, 3, 4 S), columns (N, 3): scratch. Filled are the blocks of rows i <= j, and the last
    column: duration is last.
    """
    last = 3 * powers.size
    out[last, last] += _turn(weights, rates, k, turned)
    carry(turned, powers, scales, table, columns)
    for r in range(powers.size):
        for d in range(3):
            out[3 * r + d, last] += columns[r, d]
    _accumulate(weights, scales, products, count, sums)
    for p in range(count):
        i = pairs[p, 0]
        j = pairs[p, 1]
        scale = powers[i] * powers[j]
        for a in range(3):
            for b in range(3):
                out[3 * i + a, 3 * j + b] += sums[SIX[a][b], p] * scale


@vector
def _turn(weights, rates, k, turned):
    """turned[0] (3, 4 S) <- the form applied to the rates; returns what it is of them."""
    total = 0.0
    for d in range(turned.shape[1]):
        x = SIXTH[d, 0]
        y = SIXTH[d, 1]
        z = SIXTH[d, 2]
        for i in range(turned.shape[2]):
            turned[0, d, i] = (
                weights[0, x, i] * rates[k, 0, i]
                + weights[0, y, i] * rates[k, 1, i]
                + weights[0, z, i] * rates[k, 2, i]
            )
        for i in range(turned.shape[2]):
            total += turned[0, d, i] * rates[k, d, i]
    return total


@vector
def _accumulate(weights, scales, products, count, sums):
    """Sums (6, P) <- weights[0] (6, 4 S), scaled twice, times products (4 S, P).

    The first `count` columns are wanted, and whole vectors of them are computed.
    """
    wanted = (count + VECTOR - 1) // VECTOR * VECTOR
    for c in range(weights.shape[1]):
        for i in range(scales.size):
            weights[0, c, i] *= scales[i] * scales[i]
        for p in range(wanted):
            sums[c, p] = 0.0
        whole = scales.size // VECTOR * VECTOR
        for i in range(
            0, whole, VECTOR
        ):  # so many at once, or sums would be loaded and stored most
            for p in range(wanted):
                sums[c, p] += (
                    weights[0, c, i] * products[i, p]
                    + weights[0, c, i + 1] * products[i + 1, p]
                    + weights[0, c, i + 2] * products[i + 2, p]
                    + weights[0, c, i + 3] * products[i + 3, p]
                    + weights[0, c, i + 4] * products[i + 4, p]
                    + weights[0, c, i + 5] * products[i + 5, p]
                    + weights[0, c, i + 6] * products[i + 6, p]
                    + weights[0, c, i + 7] * products[i + 7, p]
                )
        for i in range(whole, scales.size):
            for p in range(wanted):
                sums[c, p] += weights[0, c, i] * products[i, p]
