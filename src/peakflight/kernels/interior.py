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

from peakflight.kernels import band, conditions
from peakflight.kernels.jit import inner, kernel, vector, within

SHORTENING, LENGTHENING = 2.0, 0.5
"""Largest change of a duration in a step, relative: 1 / (1 + 2) and 1 / (1 - 0.5)."""
TO_BOUNDARY = 0.995
"""Part of the way to the nearest bound that a step may go."""
FLOOR = 0.03
"""mu is kept above this part of the time that the iterate would lose by stretching."""
LOCALLY = 10.0
"""Where legs are whole, mu is kept for no more than this times what the pieces would lose if each
were stretched for itself: one bad leg of a thousand need not hold up the others."""
TOLERATED = 1.02
"""Growth of stretched time and of the residual above which a step is halved, if both do."""
HALVINGS = 2
NEARNESS = 5e-3
"""Relative gap below which limits are lowered for what happens between samples."""
PATIENCE = 15
"""Iterations without gain after which a run ends: as solved if only the stretch is in the way, of
the best iterate up to ten times the tolerance; else as stalled."""
CLOSER, NEARLY, ENOUGH = 0.1, 1e-3, 5
"""If the gap is below the first part of the tolerance and the stretch of the best iterate below the
second, so many are enough: one bad leg of thousands is then all that is in the way."""
STRETCHES, EXACT = 3, 1e-9
"""Most stretches of a start, and how close they come; one does, save for kinds whose stretch is an
estimate."""
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


GAP, LOWERED, BEST, STRETCH, REFERENCE, LAST, COUNT, DECREMENT = range(8)
MARKS = 9
"""Marks: complementarity gap over time; whether limits were lowered; the least stretched objective
and the stretch of its iterate; objective and iteration of the last gain; iterations; half the
squared Newton decrement over time: what the next step promises; and `conditions.LOST`."""


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
    needed, time, effort = _begin(layout, grid, limited, work, anew, begin)
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
    moved, stays = np.bool_(True), np.bool_(False)  # literals would compile `evaluate` twice
    whole = not layout.steps.any()
    objective = time * needed + effort
    for _ in range(iterations):
        before = _residuals(values, slack, dual, residual, pulls)
        complementarity = _product_of(slack, dual)
        conditions.assemble(layout, grid, limited, work, x)
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
                if whole:
                    behind = min(behind, LOCALLY * marks[conditions.LOST] / time)
                mu = max(centring * complementarity, max(1e-9, FLOOR * behind) * time) / count
                _correct(slack, dual, slack_step, dual_step, residual, mu, pulls)
            conditions.gradient(layout, grid, limited, work, x, pulls, step)
            band.solve(work.factor, step)
            conditions.product(layout, grid, limited, work, x, step, slack_step)
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
            needed, time, effort = conditions.evaluate(layout, grid, limited, work, trial, moved)
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
            conditions.lower(layout, grid, limited, work, x, begin.slowly)
            needed, time, effort = conditions.evaluate(layout, grid, limited, work, x, stays)
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
            conditions.gradient(layout, grid, limited, work, x, dual, step)
            for i in range(x.size):
                trial[i] = step[i]
            band.solve(work.factor, trial)
            marks[DECREMENT] = 0.5 * _product_of(trial, step) / (time + effort)
            closed = marks[DECREMENT] < tolerance
            if closed and needed < 1.0 + tolerance:
                return SOLVED
        idle = marks[COUNT] - marks[LAST]
        nearly = marks[GAP] < CLOSER * tolerance and marks[STRETCH] < 1.0 + NEARLY
        if closed and nearly and idle >= ENOUGH:
            return SOLVED
        if marks[GAP] < 10.0 * tolerance and idle >= PATIENCE:
            return SOLVED if closed and marks[STRETCH] < 1.0 + 10.0 * tolerance else STALLED
    return LIMIT


@within
def _begin(layout, grid, limited, work, anew, begin):
    """Evaluate x; if it is a new start, make it strictly feasible by a uniform stretch, and start
    slacks and multipliers.

    Returns the stretch that is needed, total time and effort.
    """
    if anew:
        for r in range(limited.kinds.size):
            for k in range(work.limits.shape[0]):
                for q in range(work.limits.shape[2]):
                    work.limits[k, r, q] = limited.values[r]
    needed, time, effort = 0.0, 0.0, 0.0
    moved = np.bool_(True)
    for attempt in range(STRETCHES + 1):
        needed, time, effort = conditions.evaluate(layout, grid, limited, work, work.x, moved)
        factor = max(needed * begin.margin, 1e-3)
        enough = begin.margin == 0.0 or attempt == STRETCHES or abs(factor - 1.0) < EXACT
        if enough or not anew:
            break
        for i in range(work.x.size):
            if layout.order[i] < 0:
                work.x[i] += np.log(factor)
            else:
                work.x[i] /= factor ** layout.order[i]
    if not anew:
        return needed, time, effort
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
    return needed, time, effort


@inner
def _stiffen(layout, work, residual, slack_step, primal):
    """Stiffen pieces whose constraints do not go where the step was to lead them; loosen others.

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
def _to_boundary(values, steps):
    """Longest step of at most 1 that keeps a part of every value."""
    length = 1.0
    for i in range(values.size):
        if TO_BOUNDARY * values[i] < -length * steps[i]:
            length = -TO_BOUNDARY * values[i] / steps[i]
    return length
