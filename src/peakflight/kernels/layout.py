"""Where the unknowns of a general spline are, as plain arrays for `kernels.general`."""

from typing import NamedTuple

import numpy as np

from peakflight.kernels import basis
from peakflight.kernels.general import AT_END, AT_START, JUMP


class Cost(NamedTuple):
    """What is minimised: sum over s of weights[s] times the integral of the squared derivative."""

    orders: np.ndarray
    """(S,) int, ascending."""
    weights: np.ndarray
    """(S,) positive."""
    energies: np.ndarray
    """(S, N+1, N+1) in full end data by normalised time."""


class Layout(NamedTuple):
    """Which unknown of which node is what."""

    slot: np.ndarray
    """(N+1,) int: slot of each row of the full end data; -1 for positions when all are fixed."""
    order: np.ndarray
    """(slots,) int: derivative that a slot holds; -1 for a multiplier."""
    kind: np.ndarray
    """(slots,) int: kind of the constraint of a multiplier; -1 for a derivative."""
    constraints: np.ndarray
    """(M, 3) int: slot, derivative order and kind."""
    ends: np.ndarray
    """(2, N+1, N+1): derivatives by u at both ends of a piece from its full end data."""
    free: np.ndarray
    """(A, K+1, slots) bool: whether a slot is unknown, for each distinct pattern A."""
    pattern: np.ndarray
    """(D,) int: the pattern of each axis."""
    known: np.ndarray
    """(K+1, slots, D): fixed derivatives, and the values of constraints."""


def make_cost(degree: int, weights: tuple[float, ...]) -> Cost:
    """The cost of Eq. minfuncP with weights c_0..c_N."""
    orders = [order for order, weight in enumerate(weights) if weight > 0.0]
    fold = _fold(degree)
    energies = [fold.T @ basis.energy(degree, order) @ fold for order in orders]
    return Cost(np.array(orders), np.array([weights[o] for o in orders]), np.array(energies))


def make_layout(degree: int, continuity: int, fixed: np.ndarray) -> Layout:
    """Lay out the unknowns.

    Parameters
    ----------
    degree, continuity
        Of the spline.
    fixed
        (K+1, N, D) value of each derivative 0..N-1 at each waypoint, NaN where it is free; only
        whether positions are fixed counts, their values come with the waypoints.
    """
    count, _, axes = fixed.shape
    left, right = basis.counts(degree)
    given = ~np.isnan(fixed)
    first = 0 if not given[:, 0].all() else 1
    shared = list(range(first, min(continuity + 1, right)))
    after = [o for o in range(first, left) if o not in shared]  # starts of pieces only
    before = [o for o in range(first, right) if o not in shared]  # ends of pieces only
    order = [*shared, *after, *before]
    slot_after = {o: i for i, o in enumerate([*shared, *after])}
    slot_before = {o: order.index(o) for o in shared}
    slot_before |= {o: len(shared) + len(after) + i for i, o in enumerate(before)}
    slot = [slot_after.get(o, -1) for o in range(left)]
    slot += [slot_before.get(o, -1) for o in range(right)]

    # what end data cannot carry becomes a constraint with a multiplier
    constraints = [(o, JUMP) for o in range(len(shared) + first, continuity + 1)]
    highest = int(np.flatnonzero(given.any(axis=(0, 2)))[-1]) if given.any() else 0
    constraints += [(o, AT_START) for o in range(left, highest + 1)]
    constraints += [(o, AT_END) for o in range(right, highest + 1)]
    slots = len(order) + len(constraints)

    free = np.zeros((axes, count, slots), dtype=bool)
    known = np.zeros((count, slots, axes))
    middle = slice(1, count - 1)
    sides = [("both", i) for i in range(len(shared))]
    sides += [("after", i) for i in range(len(shared), len(shared) + len(after))]
    sides += [("before", i) for i in range(len(shared) + len(after), len(order))]
    for side, i in sides:
        there = np.ones(count, dtype=bool)
        there[-1 if side == "after" else 0] = side == "both"
        free[:, :, i] = (there[:, None] & ~given[:, order[i]]).T
        known[:, i] = np.where(given[:, order[i]], fixed[:, order[i]], 0.0)
        if order[i] == 0:
            known[:, i] = 0.0  # positions are measured from the waypoints
    for i, (o, kind) in enumerate(constraints, start=len(order)):
        if kind == JUMP:
            free[:, middle, i] = True
            continue
        nodes = slice(0, count - 1) if kind == AT_START else slice(1, count)
        wanted = given[nodes, o].copy()
        if kind == AT_END and o <= continuity:
            wanted[:-1] = False  # continuity carries what the start of the next piece has
        free[:, nodes, i] = wanted.T
        known[nodes, i] = np.where(wanted, fixed[nodes, o], 0.0)
    patterns, pattern = np.unique(free, axis=0, return_inverse=True)
    rows = [(len(order) + i, o, kind) for i, (o, kind) in enumerate(constraints)]
    kinds = [-1] * len(order) + [kind for _, kind in constraints]
    return Layout(
        slot=np.array(slot),
        order=np.array(order + [-1] * len(constraints)),
        kind=np.array(kinds),
        constraints=np.array(rows, dtype=int).reshape(-1, 3),
        ends=basis.end_rows(degree) @ _fold(degree)[:degree],
        free=np.ascontiguousarray(patterns),
        pattern=np.ravel(pattern).astype(int),
        known=known,
    )


def _fold(degree: int) -> np.ndarray:
    """(N+1, N+1): end data with the start in the last row, from full end data."""
    left, _ = basis.counts(degree)
    size = degree + 1
    fold = np.zeros((size, size))
    fold[0, 0], fold[0, left], fold[degree, 0] = -1.0, 1.0, 1.0
    rows = [i for i in range(size) if i not in (0, left)]
    fold[np.arange(1, degree), rows] = 1.0
    return fold
