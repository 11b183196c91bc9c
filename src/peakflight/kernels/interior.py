"""The complete problem (Eq. peak_opt_complete) by a primal-dual interior point.

    minimise    sum_k t_k + effort         over log t_k and the free end data of all pieces
    subject to  c_i + s_i = 0, s_i > 0     for every kind of limit at every sample (`rows`)

A step solves the perturbed optimality conditions with a Gauss-Newton matrix,

    H = diag(t) + sum_i z_i bend_i J_i' J_i + sum_i (z_i / s_i) grad c_i grad c_i',

banded because a piece shares unknowns with its neighbours only, by Mehrotra's predictor and
corrector. Three things make it safe from a plain start. The barrier does not run ahead of
feasibility: mu has a floor that falls with the stretch that the iterate still needs. Durations are
updated as 1/t: then the mean velocity of a leg is linear in the unknowns. And steps are halved that
make both the stretched time and the residual worse.

Between samples nothing is known: once the gap is small, the limit at a sample is lowered by how
much more than the sample its neighbourhood reaches, so that peaks keep the limit wherever they are.
"""

from typing import NamedTuple

import numpy as np

from peakflight.kernels import band, pieces, rows
from peakflight.kernels.jit import inner, kernel, vector, within

SHORTENING, LENGTHENING = 2.0, 0.5
"""Largest change of a duration in a step, relative: 1 / (1 + 2) and 1 / (1 - 0.5)."""
TO_BOUNDARY = 0.995
"""Part of the way to the nearest bound that a step may go."""
FLOOR = 0.03
"""mu is kept above this part of the time that the iterate would lose by stretching."""
TOLERATED = 1.02
"""Growth of stretched time and of the residual above which a step is halved, if both do."""
HALVINGS = 2
NEARNESS = 5e-3
"""Relative gap below which limits are lowered for what happens between samples."""
DEEPEST = 0.5
"""No limit is lowered below this part of itself."""
PATIENCE = 15
"""Iterations without gain after which a run ends: as solved if only the stretch is in the way, of
the best iterate up to ten times the tolerance; else as stalled."""
STRETCHES = 4
"""Stretches of a start; one does, save for kinds whose stretch is an estimate."""
STIFFNESS, STIFFEST = 10.0, 1e4
"""What the matrix has more than the objective's own curvature in the logarithms of the durations of
parts of a leg, at least and at most: where a leg is cut matters little, and steps along it would be
long."""
UNRULY, TAME = 0.5, 0.1
"""A piece whose residual exceeds what the step promised by more than this part of what it was is
stiffened; by less, loosened."""
NOTICED = 1e-3
"""Mean residual of a piece below which it counts as tame."""
STIFFER, LOOSER = 3.0, 0.5
GAIN = 1e-4
"""Relative fall of the objective that counts as a gain."""
SOLVED, LIMIT, STALLED = 0, 1, 2


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
    turning: np.ndarray | None
    """Some number if a kind has more than one term; None leaves out what such kinds need when
    kernels are compiled."""
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
    """(K,) of parts of legs, see `STIFFNESS`; 0 for whole legs."""
    marks: np.ndarray
    """(8,): see the constants below."""


GAP, LOWERED, BEST, STRETCH, REFERENCE, LAST, COUNT, DECREMENT = range(8)
MARKS = 8
"""Marks: complementarity gap over time; whether limits were lowered; the least stretched objective
and the stretch of its iterate; objective and iteration of the last gain; iterations; half the
squared Newton decrement over time: what the next step promises."""


class Begin(NamedTuple):
    """How a run begins."""

    margin: float
    """Uniform stretch beyond what the start needs to be feasible; 0 to begin where it is."""
    barrier: float
    """Weight of all constraints together, mu times their number, as a part of the total time."""
    slack: float
    """Least slack that a constraint starts with."""
    stiffness: float
    """Of whole legs, see `STIFFNESS`; parts of legs have it anyway."""
    slowly: float
    """Part of the way that lowered limits move in an iteration: all at once, some would swing."""
    kept: float
    """1 if work.dual holds multipliers of a similar problem, which are then kept where they are
    larger than mu over the slack; else 0."""


@kernel
def run(layout, grid, limited, work, anew, begin, tolerance, iterations):
    """Iterate on work.x; returns SOLVED, LIMIT or STALLED. The best iterate is in work.best.

    anew: whether to begin from x; otherwise the last run goes on. tolerance: relative gap, stretch
    and decrement at which a run ends as solved.
    """
    if anew:
        _begin(layout, grid, limited, work, begin)
    x, marks = work.x, work.marks
    values = work.values.reshape(-1)
    slack = work.slack.reshape(-1)
    dual = work.dual.reshape(-1)
    residual = np.empty_like(values)
    slack_step = np.empty_like(values)
    dual_step = np.empty_like(values)
    pulls = np.empty_like(values)
    trial = np.empty_like(x)
    step = np.empty_like(x)
    count = values.size
    needed, time, effort = _evaluate(layout, grid, limited, work, x)
    objective = time * needed + effort
    for _ in range(iterations):
        before = _residuals(values, slack, dual, residual, pulls)
        complementarity = _product_of(slack, dual)
        _assemble(layout, grid, limited, work, x)
        damping = 1e-14
        while not band.factorise(work.matrix, damping, work.factor):
            damping = max(1e-10, 10.0 * damping)
            if damping > 1e10:
                return STALLED
        primal, along = 1.0, 1.0
        for corrects in range(2):  # predictor: where the conditions lead without a barrier
            if corrects == 1:
                affine = _product_after(slack, dual, slack_step, dual_step, primal, along)
                centring = min(1.0, max((affine / complementarity) ** 3, 1e-3))
                behind = min(1.0, max(objective / (time + effort) - 1.0, 0.0))
                mu = max(centring * complementarity, max(1e-9, FLOOR * behind) * time) / count
                _correct(slack, dual, slack_step, dual_step, residual, mu, pulls)
            _gradient(layout, grid, limited, work, x, pulls, step)
            band.solve(work.factor, step)
            _product(layout, grid, limited, work, x, step, slack_step)
            _directions(slack, dual, residual, pulls, slack_step, dual_step)
            primal = _to_boundary(slack, slack_step)
            along = _to_boundary(dual, dual_step)
        for k in range(layout.clock.size):
            change = -step[layout.clock[k]]
            if change > 0.0:
                primal = min(primal, LENGTHENING / change)
            else:
                primal = min(primal, SHORTENING / (1e-300 - change))
        previous = objective
        for halving in range(HALVINGS + 1):
            for i in range(x.size):
                if layout.order[i] < 0:
                    trial[i] = x[i] - np.log(1.0 + primal * step[i])
                else:
                    trial[i] = x[i] - primal * step[i]
            needed, time, effort = _evaluate(layout, grid, limited, work, trial)
            objective = time * needed + effort
            after = _residual_after(values, slack, slack_step, primal)
            if objective <= TOLERATED * previous or after <= TOLERATED * before:
                break
            if halving < HALVINGS:
                primal *= 0.5
        _stiffen(layout, work, residual, slack_step, primal)
        for i in range(x.size):
            x[i] = trial[i]
        marks[COUNT] += 1.0
        if marks[GAP] < NEARNESS:
            _lower(layout, grid, limited, work, x, begin.slowly)
            needed, time, effort = _evaluate(layout, grid, limited, work, x)
            objective = time * needed + effort
            if marks[LOWERED] == 0.0:
                marks[LOWERED] = 1.0
                marks[BEST] = np.inf
                marks[REFERENCE] = np.inf
        _move(values, slack, dual, slack_step, dual_step, primal, along)
        marks[GAP] = _product_of(slack, dual) / time
        if objective < marks[BEST]:
            marks[BEST] = objective
            marks[STRETCH] = needed
            for i in range(x.size):
                work.best[i] = x[i]
        if marks[BEST] < marks[REFERENCE] * (1.0 - GAIN):
            marks[REFERENCE] = marks[BEST]
            marks[LAST] = marks[COUNT]
        closed = marks[LOWERED] > 0.0 and marks[GAP] < tolerance
        if closed:
            _gradient(layout, grid, limited, work, x, dual, step)
            for i in range(x.size):
                trial[i] = step[i]
            band.solve(work.factor, trial)
            marks[DECREMENT] = 0.5 * _product_of(trial, step) / (time + effort)
            closed = marks[DECREMENT] < tolerance
            if closed and needed < 1.0 + tolerance:
                return SOLVED
        if marks[GAP] < 10.0 * tolerance and marks[COUNT] - marks[LAST] >= PATIENCE:
            return SOLVED if closed and marks[STRETCH] < 1.0 + 10.0 * tolerance else STALLED
    return LIMIT


@within
def _begin(layout, grid, limited, work, begin):
    """Make x strictly feasible by a uniform stretch, and start slacks and multipliers."""
    for r in range(limited.kinds.size):
        for k in range(work.limits.shape[0]):
            for q in range(work.limits.shape[2]):
                work.limits[k, r, q] = limited.values[r]
    needed, time, effort = 0.0, 0.0, 0.0
    for attempt in range(STRETCHES):
        needed, time, effort = _evaluate(layout, grid, limited, work, work.x)
        if begin.margin > 0.0 and attempt < STRETCHES - 1:
            factor = max(needed * begin.margin, 1e-3)
            for i in range(work.x.size):
                if layout.order[i] < 0:
                    work.x[i] += np.log(factor)
                else:
                    work.x[i] /= factor ** layout.order[i]
    values = work.values.reshape(-1)
    slack = work.slack.reshape(-1)
    dual = work.dual.reshape(-1)
    for i in range(values.size):
        slack[i] = max(-values[i], begin.slack)
        central = begin.barrier * time / (values.size * slack[i])
        dual[i] = max(central, begin.kept * dual[i])
    for k in range(layout.clock.size):
        work.stiffness[k] = STIFFNESS if layout.steps[k] else begin.stiffness
    marks = work.marks
    for i in range(marks.size):
        marks[i] = 0.0
    marks[GAP] = 1.0
    marks[BEST] = time * needed + effort
    marks[STRETCH] = needed
    marks[REFERENCE] = np.inf
    marks[DECREMENT] = np.inf
    for i in range(work.x.size):
        work.best[i] = work.x[i]


@inner
def _stiffen(layout, work, residual, slack_step, primal):
    """Stiffen parts of legs whose constraints do not go where the step was to lead them.

    Snap in a short piece changes with the fourth power of its duration: there the linear picture
    that a step is made with fails first, and steps that are too long would fail again and again.
    """
    values = work.values.reshape(-1)
    slack = work.slack.reshape(-1)
    count = residual.size // layout.clock.size
    for k in range(layout.clock.size):
        if work.stiffness[k] == 0.0:
            continue
        before = 0.0
        after = 0.0
        for i in range(k * count, (k + 1) * count):
            before += abs(residual[i])
            after += abs(values[i] + slack[i] + primal * slack_step[i])
        excess = after - (1.0 - primal) * before
        if excess > UNRULY * before and after > NOTICED * count:
            work.stiffness[k] = min(STIFFER * work.stiffness[k], STIFFEST)
        elif excess < TAME * before or after < NOTICED * count:
            work.stiffness[k] = max(LOOSER * work.stiffness[k], STIFFNESS)


@vector
def _residuals(values, slack, dual, residual, pulls):
    """Residual <- c + s, pulls <- z/s times it; returns the sum of its sizes."""
    total = 0.0
    for i in range(values.size):
        residual[i] = values[i] + slack[i]
    for i in range(values.size):
        total += abs(residual[i])
    for i in range(values.size):
        pulls[i] = dual[i] / slack[i] * residual[i]
    return total


@vector
def _product_of(one, other):
    total = 0.0
    for i in range(one.size):
        total += one[i] * other[i]
    return total


@vector
def _product_after(slack, dual, slack_step, dual_step, primal, along):
    total = 0.0
    for i in range(slack.size):
        total += (slack[i] + primal * slack_step[i]) * (dual[i] + along * dual_step[i])
    return total


@vector
def _residual_after(values, slack, slack_step, primal):
    total = 0.0
    for i in range(slack.size):
        total += abs(values[i] + slack[i] + primal * slack_step[i])
    return total


@vector
def _correct(slack, dual, slack_step, dual_step, residual, mu, pulls):
    """Pulls <- what the corrector's right-hand side weighs the gradients of constraints by."""
    for i in range(slack.size):
        pulls[i] = (mu - slack_step[i] * dual_step[i] + dual[i] * residual[i]) / slack[i]


@vector
def _directions(slack, dual, residual, pulls, slack_step, dual_step):
    """Steps of slacks and duals; slack_step holds the gradients of constraints times the step."""
    for i in range(slack.size):
        slack_step[i] -= residual[i]
    for i in range(slack.size):
        ratio = dual[i] / slack[i]
        dual_step[i] = pulls[i] - ratio * (residual[i] + slack_step[i]) - dual[i]


@vector
def _move(values, slack, dual, slack_step, dual_step, primal, along):
    """Take the step; a slack that a constraint leaves behind follows it."""
    for i in range(slack.size):
        slack[i] = max(slack[i] + primal * slack_step[i], -values[i])
    for i in range(slack.size):
        dual[i] += along * dual_step[i]


@inner
def _evaluate(layout, grid, limited, work, x):
    """Samples and constraints at x; returns the stretch that they need, total time and effort."""
    count = grid.table.shape[2]
    data = np.empty((grid.orders.size, 3))
    needed = limited.least[0]
    total = 0.0
    effort = 0.0
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        total += time
        pieces.end_data(layout.place, layout.known, x, k, data)
        pieces.sample(
            data, grid.orders, time, limited.gravity[0], grid.table, work.samples[k], work.rates[k]
        )
        for r in range(limited.kinds.size):
            needed = max(
                needed,
                rows.constrain(
                    limited.kinds[r], limited.turning, work.samples[k], count, work.limits[k, r],
                    limited.gravity[0], work.values[k, r], limited.first[r], work.slopes[k],
                    work.bends[k],
                ),
            )  # fmt: skip
        effort += _effort(limited.effort, grid, limited, work.samples[k], time)
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
def _gradient(layout, grid, limited, work, x, flat_pulls, out):
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
def _product(layout, grid, limited, work, x, step, flat):
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
def _assemble(layout, grid, limited, work, x):
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
        _add_outer(limited.turning, grid, limited, work, k, time, local)
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
def _add_outer(turning, grid, limited, work, k, time, local):
    """Local += z/s times the outer products of gradients in several derivatives at once."""
    if turning is None:
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
def _lower(layout, grid, limited, work, x, slowly):
    """Lower the limit of each sample by how much more than the sample its cell reaches."""
    count = grid.table.shape[2]
    cells = grid.dense.shape[2] // count
    data = np.empty((grid.orders.size, 3))
    near = np.empty((3, 4, count * cells))
    around = np.empty(count * cells)
    there = np.empty(count)
    for k in range(layout.clock.size):
        time = np.exp(x[layout.clock[k]])
        pieces.end_data(layout.place, layout.known, x, k, data)
        pieces.derivatives(data, grid.orders, time, limited.gravity[0], grid.dense, near)
        for r in range(limited.kinds.size):
            kind, limit = limited.kinds[r], limited.values[r]
            rows.kappa(
                kind, limited.turning, near, count * cells, limit, limited.gravity[0], around
            )
            rows.kappa(
                kind, limited.turning, work.samples[k], count, limit, limited.gravity[0], there
            )
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


LEAST = 5
"""The kind that is limited from below."""


@inner
def _to_boundary(values, steps):
    """Longest step of at most 1 that keeps a part of every value."""
    length = 1.0
    for i in range(values.size):
        if TO_BOUNDARY * values[i] < -length * steps[i]:
            length = -TO_BOUNDARY * values[i] / steps[i]
    return length
