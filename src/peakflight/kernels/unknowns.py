"""Where the unknowns of `interior` stand, and the tables and arrays that it works with."""

from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise

import numpy as np

from peakflight.kernels import basis
from peakflight.kernels.conditions import Grid, Layout, Limited, Work
from peakflight.kernels.interior import MARKS
from peakflight.kernels.pieces import VECTOR
from peakflight.kernels.rows import KIND_TERMS, LEANING, TURNING

CELL = 5
"""Points at which the neighbourhood of a sample is looked at."""


def make_layout(
    waypoints: np.ndarray,
    pieces: np.ndarray,
    degree: int,
    continuity: int,
    fixed: Mapping[int, np.ndarray],
) -> Layout:
    """Lay out the unknowns along the course: node, duration, node, duration, ...

    Parameters
    ----------
    waypoints
        (legs+1, 3) m.
    pieces
        (legs,) number of pieces in each leg.
    degree, continuity
        Of the trajectory; continuity up to what end data hold on both sides.
    fixed
        Waypoint index to fixed derivatives (n, 3) from velocity on, NaN where free.
    """
    most = max(basis.counts(degree))
    ends = np.concatenate(([0], np.cumsum(pieces)))  # nodes that are waypoints
    given = np.full((ends[-1] + 1, most, 3), np.nan)
    given[ends, 0] = 0.0
    for waypoint, state in fixed.items():
        given[ends[waypoint], 1 : len(state) + 1] = state[: most - 1]
    layout = _structure(len(given), degree, continuity, np.isnan(given).tobytes())
    left = basis.counts(degree)[0]
    orders = basis.row_orders(degree)[:-1]
    values = np.where(np.isnan(given), 0.0, given)
    known = np.empty((len(given) - 1, degree, 3))
    known[:, :left] = values[:-1, orders[:left]]
    known[:, left:] = values[1:, orders[left:]]
    known[ends[1:] - 1, 0] = waypoints[1:] - waypoints[:-1]
    return layout._replace(known=known)


@lru_cache(maxsize=16)
def _structure(nodes: int, degree: int, continuity: int, free_bytes: bytes) -> Layout:
    """A layout without what is known; free_bytes: which (nodes, orders, 3) are unknown."""
    left, right = basis.counts(degree)
    given_free = np.frombuffer(free_bytes, dtype=bool).reshape(nodes, max(left, right), 3)
    count = nodes - 1
    # slots of a node, in this order: (first order, one past the last, the side they belong to)
    shared = min(continuity + 1, right)
    spans = (
        (0, 1, "both"),
        (shared, right, "before"),
        (1, shared, "both"),
        (shared, left, "after"),
    )
    slots = [(order, side) for first, last, side in spans for order in range(first, last)]
    free = np.zeros((nodes, 3 * len(slots) + 1), dtype=bool)
    for i, (order, side) in enumerate(slots):
        free[:, 3 * i : 3 * i + 3] = given_free[:, order]
        if side != "both":  # the first node has nothing before it, the last nothing after
            free[0 if side == "before" else -1, 3 * i : 3 * i + 3] = False
    free[:-1, -1] = True
    number = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
    unknown = number[:, :-1].reshape(nodes, len(slots), 3)
    at_start = {order: i for i, (order, side) in enumerate(slots) if side != "before"}
    at_end = {order: i for i, (order, side) in enumerate(slots) if side != "after"}
    place = np.empty((count, degree + 1, 3), dtype=np.int64)
    place[:, degree] = unknown[:-1, 0]
    for row, order in enumerate(basis.row_orders(degree)[:degree]):
        place[:, row] = (
            unknown[:-1, at_start[order]] if 0 < row < left else unknown[1:, at_end[order]]
        )
    clock = number[:-1, -1].copy()
    by_slot = np.append(np.repeat([order for order, _ in slots], 3), -1)
    candidates = np.concatenate((place.reshape(count, -1), clock[:, None]), axis=1)
    source = np.concatenate((np.arange(3 * degree), np.arange(3), [3 * degree]))
    sign = np.ones(len(source))
    sign[3 * degree : 3 * degree + 3] = -1.0
    ranked = np.argsort(np.where(candidates < 0, free.size, candidates), axis=1, kind="stable")
    return Layout(
        place=place,
        known=np.empty((0, degree, 3)),
        clock=clock,
        order=np.broadcast_to(by_slot, free.shape)[free],
        unknown=np.take_along_axis(candidates, ranked, axis=1),
        source=source[ranked],
        sign=sign[ranked],
        size=(candidates >= 0).sum(axis=1),
        steps=np.asarray((place[:, [0, degree]] >= 0).any(axis=(1, 2))),
    )


def band_width(layout: Layout) -> int:
    """How many diagonals, from the main one on, a matrix of these unknowns has."""
    last = layout.unknown[np.arange(len(layout.size)), layout.size - 1]
    return int((last - layout.unknown[:, 0]).max()) + 1


@lru_cache
def make_grid(degree: int, samples: int) -> Grid:
    """Tables at Chebyshev-Lobatto points of the unit interval, and at their cells."""
    u = (1.0 - np.cos(np.pi * np.arange(samples) / (samples - 1))) / 2.0
    borders = np.concatenate(([0.0], (u[1:] + u[:-1]) / 2.0, [1.0]))
    cells = np.array([np.linspace(a, b, CELL) for a, b in pairwise(borders)])
    table = basis.derivative_tables(degree, u)
    pairs = [(i, j) for i in range(degree) for j in range(i, degree)]
    pairs.sort(key=lambda pair: pair[0] == 0)
    rows, columns = np.array(pairs).T
    products = np.zeros((4, samples, -(-len(pairs) // VECTOR) * VECTOR))
    products[:, :, : len(pairs)] = (table[rows] * table[columns]).transpose(1, 2, 0)
    dense = basis.derivative_tables(degree, cells.T.ravel())
    # Clenshaw-Curtis: integrates the polynomial through the samples
    moments = [1.0 / (1.0 - n * n) if n % 2 == 0 else 0.0 for n in range(samples)]
    cosines = np.cos(np.pi * np.outer(np.arange(samples), np.arange(samples)) / (samples - 1))
    return Grid(
        orders=basis.row_orders(degree)[:degree].astype(np.int64),
        table=table.reshape(degree, -1),
        dense=dense.reshape(degree, -1),
        pairs=np.array(pairs, dtype=np.int64),
        still=np.array([sum(i != 0 for i, _ in pairs)]),
        products=products.reshape(4 * samples, -1),
        steps=np.repeat(np.arange(1.0, 5.0), samples),
        dense_steps=np.repeat(np.arange(1.0, 5.0), samples * CELL),
        quadrature=np.linalg.solve(cosines, moments),
    )


def set_unknowns(
    layout: Layout, data: np.ndarray, starts: np.ndarray, times: np.ndarray, x: np.ndarray
) -> None:
    """X (n,) <- end data by time (K, N, 3), starts (K, 3) from the leg's first waypoint, (K,) s."""
    rows = np.concatenate((data, starts[:, None]), axis=1)
    rows[:, 0] += starts  # where a piece ends, seen from the leg's first waypoint
    free = layout.place >= 0
    x[layout.place[free]] = rows[free]
    x[layout.clock] = np.log(times)


def get_data(layout: Layout, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """End data by time (K, N, 3), starts (K, 3) from the leg's first waypoint, times (K,)."""
    values = np.where(layout.place >= 0, x[layout.place], 0.0)
    data = layout.known + values[:, :-1]
    starts = values[:, -1]
    data[:, 0] -= starts
    return data, starts, np.exp(x[layout.clock])


def make_limited(
    limits: np.ndarray,
    effort: np.ndarray | None,
    gravity: float,
    least: float = 0.0,
    figures: np.ndarray | None = None,
) -> Limited:
    """What is limited, from `Limits.as_array` and weights (4,) of integrals of squares, or None.

    least: smallest stretch of interest, figures: of `Limits`, see `Limited`.
    """
    kinds = np.flatnonzero(np.isfinite(limits))
    terms = [KIND_TERMS[kind] for kind in kinds]
    return Limited(
        kinds=kinds,
        values=limits[kinds],
        first=np.cumsum([0, *map(len, terms)]),
        orders=np.array([order - 1 for term in terms for order in term]),
        leaning=np.ones(1) if LEANING.intersection(kinds) else None,
        turning=np.ones(1) if TURNING.intersection(kinds) else None,
        figures=figures,
        several=np.ones(1) if any(len(term) > 1 for term in terms) else None,
        effort=effort,
        gravity=np.array([gravity]),
        least=np.array([least]),
    )


def make_work(layout: Layout, grid: Grid, limited: Limited) -> Work:
    """Arrays to work in."""
    pieces, unknowns = len(layout.clock), len(layout.order)
    samples = len(grid.quadrature)
    kinds, terms = len(limited.kinds), len(limited.orders)
    width = band_width(layout)
    rows = (pieces, kinds, samples)
    return Work(
        x=np.empty(unknowns),
        best=np.empty(unknowns),
        samples=np.empty((pieces, 3, 4, samples)),
        rates=np.empty((pieces, 3, 4 * samples)),
        values=np.empty(rows),
        slopes=np.empty((pieces, terms, 3, samples)),
        bends=np.empty((pieces, terms, samples)),
        limits=np.empty(rows),
        slack=np.empty(rows),
        dual=np.zeros(rows),
        matrix=np.empty((unknowns, width)),
        factor=np.empty((unknowns, width)),
        stiffness=np.zeros(pieces),
        marks=np.zeros(MARKS),
    )
