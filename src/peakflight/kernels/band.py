"""Factors of symmetric band matrices, and solutions with them.

A matrix of n rows and half-bandwidth w - 1 is an array (n, w): entry [i, b] is A[i, i + b].
"""

import numpy as np

from peakflight.kernels.jit import inner

SMALLEST_PIVOT = 1e-13
"""Relative to the diagonal entry that it began as; below, the matrix counts as singular."""


@inner
def factorise(matrix, damping, factor):
    """Factor (n, w) <- L D L' of matrix + damping * diagonal; False if it is not positive definite.

    Row i of the factor holds D[i], and D[i] times column i of L below it.
    """
    size, width = matrix.shape
    for i in range(size):
        for b in range(width):
            factor[i, b] = matrix[i, b]
        factor[i, 0] *= 1.0 + damping
    for i in range(size):
        pivot = factor[i, 0]
        if not SMALLEST_PIVOT * matrix[i, 0] < pivot < np.inf:
            return False
        reach = min(width, size - i)
        for a in range(1, reach):
            ratio = factor[i, a] / pivot
            if ratio != 0.0:
                row = factor[i + a]
                for b in range(a, reach):
                    row[b - a] -= ratio * factor[i, b]
    return True


@inner
def solve(factor, values):
    """Values (n,) <- inverse of the factorised matrix times values."""
    size, width = factor.shape
    for i in range(size):
        value = values[i] / factor[i, 0]
        for a in range(1, min(width, size - i)):
            values[i + a] -= factor[i, a] * value
    for i in range(size - 1, -1, -1):
        total = values[i]
        for a in range(1, min(width, size - i)):
            total -= factor[i, a] * values[i + a]
        values[i] = total / factor[i, 0]
