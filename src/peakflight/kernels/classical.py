"""The classical splines: degree 2r-1, least integral of the squared r-th derivative.

Unknown are the derivatives 1..b of the inner joints, b = r-1; the optimality conditions are block
tridiagonal with one block (b, b) a joint, symmetric and positive definite, and their solution is
C^(2r-2) by itself (Eq. mellinger_poly; Mellinger and Kumar 2011). A block factorisation without
pivoting does not mind how the unknowns are scaled, so the derivatives by time can be used as they
are, however much the durations differ.

`rows` and `axes` are tuples of N and D entries: only their lengths count.
"""

from peakflight.kernels.jit import inner, kernel


@kernel
def solve(rows, axes, energy, waypoints, times, joints, factor, coupling, powers, data):
    """End data of the spline for given times.

    energy (N+1, N+1) of the r-th derivative, waypoints (K+1, D), times (K,); joints (K+1, b, D)
    holds the derivatives at both ends and gets those at the inner joints; factor and coupling
    (K+1, b, b) get the factorisation for `backsolve`; powers (2, N) is scratch; data (K, N, D).
    """
    b = len(rows) // 2
    count = times.size
    inverse_powers(rows, powers, 0, times[0])
    for k in range(1, count):
        inverse_powers(rows, powers, 1, times[k])
        for i in range(b):
            for j in range(i, b):
                e = 2 * b - 2 - i - j
                factor[k, i, j] = (
                    energy[b + 1 + i, b + 1 + j] * powers[0, e]
                    + energy[1 + i, 1 + j] * powers[1, e]
                )
            e = 2 * b - 1 - i
            before = energy[b + 1 + i, 0] * powers[0, e]
            after = energy[1 + i, 0] * powers[1, e]
            for d in range(len(axes)):
                joints[k, i, d] = -before * (waypoints[k, d] - waypoints[k - 1, d]) - after * (
                    waypoints[k + 1, d] - waypoints[k, d]
                )
            for j in range(b):
                coupling[k, i, j] = energy[1 + i, b + 1 + j] * powers[1, 2 * b - 2 - i - j]
        # eliminate the joint before
        for i in range(b):
            for m in range(b):
                u = energy[1 + m, b + 1 + i] * powers[0, 2 * b - 2 - i - m]
                if k > 1:
                    for j in range(i, b):
                        factor[k, i, j] -= u * coupling[k - 1, m, j]
                for d in range(len(axes)):
                    joints[k, i, d] -= u * joints[k - 1, m, d]
        # L D L' of the block; coupling and right-hand side are solved along with it
        for i in range(b):
            p = 1.0 / factor[k, i, i]
            factor[k, i, i] = p
            for j in range(i + 1, b):
                c = factor[k, i, j] * p
                for m in range(j, b):
                    factor[k, j, m] -= c * factor[k, i, m]
                for m in range(b):
                    coupling[k, j, m] -= c * coupling[k, i, m]
                for d in range(len(axes)):
                    joints[k, j, d] -= c * joints[k, i, d]
            for j in range(i + 1, b):
                factor[k, i, j] *= p
            for m in range(b):
                coupling[k, i, m] *= p
            for d in range(len(axes)):
                joints[k, i, d] *= p
        for i in range(b - 2, -1, -1):
            for j in range(i + 1, b):
                c = factor[k, i, j]
                for m in range(b):
                    coupling[k, i, m] -= c * coupling[k, j, m]
                for d in range(len(axes)):
                    joints[k, i, d] -= c * joints[k, j, d]
        for e in range(len(rows)):
            powers[0, e] = powers[1, e]
    for k in range(count - 1, 0, -1):
        for i in range(b):
            for j in range(b):
                c = coupling[k, i, j]
                for d in range(len(axes)):
                    joints[k, i, d] -= c * joints[k + 1, j, d]
    for k in range(count):
        for d in range(len(axes)):
            data[k, 0, d] = waypoints[k + 1, d] - waypoints[k, d]
        scale = 1.0
        for i in range(b):
            scale *= times[k]
            for d in range(len(axes)):
                data[k, 1 + i, d] = scale * joints[k, i, d]
                data[k, 1 + b + i, d] = scale * joints[k + 1, i, d]


@inner
def inverse_powers(rows, powers, row, time):
    """powers[row, e] = time^-(e+1)."""
    p = 1.0 / time
    powers[row, 0] = p
    for e in range(1, len(rows)):
        powers[row, e] = powers[row, e - 1] * p


@inner
def backsolve(rows, axes, factor, coupling, values):
    """Values (K+1, b, D) <- inverse of the matrix that `solve` has factorised, times values."""
    b = len(rows) // 2
    count = values.shape[0] - 1
    for k in range(2, count):
        for i in range(b):
            for j in range(b):
                c = coupling[k - 1, j, i]
                for d in range(len(axes)):
                    values[k, i, d] -= c * values[k - 1, j, d]
    for k in range(count - 1, 0, -1):
        for i in range(b):
            for j in range(i + 1, b):
                c = factor[k, i, j]
                for d in range(len(axes)):
                    values[k, j, d] -= c * values[k, i, d]
        for i in range(b):
            for d in range(len(axes)):
                values[k, i, d] *= factor[k, i, i]
        for i in range(b - 2, -1, -1):
            for j in range(i + 1, b):
                c = factor[k, i, j]
                for d in range(len(axes)):
                    values[k, i, d] -= c * values[k, j, d]
        if k < count - 1:
            for i in range(b):
                for j in range(b):
                    c = coupling[k, i, j]
                    for d in range(len(axes)):
                        values[k, i, d] -= c * values[k + 1, j, d]


@kernel
def adjoint(rows, axes, energy, times, factor, coupling, data, slope, multipliers, gradient):
    """Gradient (K,) += derivative by log times of a function with derivative `slope` by the data.

    slope (K, N, D) is dF/ddata of a function F that depends on times through the data alone;
    multipliers (K+1, b, D) is scratch.
    """
    b = len(rows) // 2
    count = times.size
    for i in range(b):
        for d in range(len(axes)):
            multipliers[0, i, d] = 0.0
            multipliers[count, i, d] = 0.0
    for k in range(1, count):
        before = 1.0
        after = 1.0
        for i in range(b):
            before *= times[k - 1]
            after *= times[k]
            for d in range(len(axes)):
                multipliers[k, i, d] = (
                    before * slope[k - 1, 1 + b + i, d] + after * slope[k, 1 + i, d]
                )
    backsolve(rows, axes, factor, coupling, multipliers)
    for k in range(count):
        total = 0.0
        scale = 1.0
        weight = 1.0 / times[k]
        for _ in range(2 * b):
            weight /= times[k]  # time^(1-2r), as N = 2b+1 = 2r-1
        for i in range(b):
            scale *= times[k]
            for d in range(len(axes)):
                total += (i + 1.0) * (
                    slope[k, 1 + i, d] * data[k, 1 + i, d]
                    + slope[k, 1 + b + i, d] * data[k, 1 + b + i, d]
                )
                left = 0.0
                right = 0.0
                for j in range(len(rows)):
                    order = 0.0 if j == 0 else (j - 1) % b + 1.0
                    rate = order + i - 2.0 * b  # o_i + o_j + 1 - 2r, with o_i = i+1, r = b+1
                    left += rate * energy[1 + i, j] * data[k, j, d]
                    right += rate * energy[1 + b + i, j] * data[k, j, d]
                total -= (weight * scale) * (
                    left * multipliers[k, i, d] + right * multipliers[k + 1, i, d]
                )
        gradient[k] += total
