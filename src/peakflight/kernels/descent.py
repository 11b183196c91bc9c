"""L-BFGS on the logarithms of the segment times, up a ladder of barriers."""

import numpy as np

from peakflight.kernels.barrier import BASE_POWER, evaluate, watch
from peakflight.kernels.jit import inner, kernel

ARMIJO = 1e-4
"""Sufficient decrease: this part of what the slope promises."""
WOLFE = 0.9
"""Sufficient progress: the slope falls below this part of what it was."""
LONGEST_STEP = 0.7
"""No segment time changes by more than a factor e^0.7 in one step (line search may double it)."""
FIRST_STEP = 0.1
"""Largest change of log t in the first step of all, a steepest descent."""
LINE_SEARCH = 30
"""Most evaluations in one line search."""
CURVATURE = 1e-15
"""Pairs with less curvature than this, relative to the last, are not kept."""
WATCH_EVERY = 16
"""Iterations after which it is looked up again which limits matter."""
REPEATS = 10
"""How often a stage begins again because a limit that did not matter is exceeded."""
PATIENCE = 5
"""A stage ends when so many iterations together gain less than its `decrease`."""


@kernel
def descend(
    rows, waypoints, simple, layered, times, limits, gravity, tables, dense, stages, memory, work,
    history,
):  # fmt: skip
    """Minimise the barrier functions of a ladder of stages, each from the last one's result.

    waypoints, simple and layered: see `barrier.solve_spline`; times (K,) is replaced; tables: one
    of `basis.sample_tables` a stage, dense: one more, of the most samples; work:
    `barrier.workspace`; stages (n, 3): doublings of the power, most iterations, relative decrease
    at which the stage ends; memory: pairs that L-BFGS keeps; history (rows, K) gets the times of
    the first iterations.

    Returns iterations and whether every stage met its own stopping rule.
    """
    count = times.size
    pairs = (
        np.zeros((memory, count)),
        np.zeros((memory, count)),
        np.zeros(memory),
        np.zeros(memory),
    )
    _steps, changes, inverses, _ = pairs
    x = np.log(times)
    gradient = np.zeros(count)
    direction = np.zeros(count)
    trial = np.zeros(count)
    trial_gradient = np.zeros(count)
    diagonal = np.zeros(count)
    watched = np.zeros((count, limits.size), dtype=np.bool_)
    none = np.int64(0)  # a bare 0 is a type of its own, for which callees compile once more
    kept = none  # pairs stored so far
    shrink = 0.0  # scale of the initial inverse Hessian, from the last pair
    power = 0.0
    iterations = 0
    converged = True
    for stage in range(stages.shape[0]):
        doublings = int(stages[stage, 0])
        longest = int(stages[stage, 1])
        decrease = stages[stage, 2]
        values = np.empty(longest + 1)
        # curvature grows with the power: so do the stored pairs
        growth = BASE_POWER * 2.0**doublings / power if power > 0.0 else 1.0
        power = BASE_POWER * 2.0**doublings
        shrink /= growth
        for i in range(memory):
            inverses[i] /= growth
            for k in range(count):
                changes[i, k] *= growth
        reference = 0.0
        for k in range(count):
            times[k] = np.exp(x[k])
            reference += times[k] / count
            trial[k] = x[k]
        for k in range(count):
            diagonal[k] = reference / times[k]
        for k in range(count):
            for kind in range(limits.size):
                watched[k, kind] = limits[kind] > 0.0
        iteration = -1  # of this stage; the first evaluation is accepted as it is
        value = np.inf
        slope = 0.0
        step = 0.0
        low = 0.0
        high = np.inf
        largest = 0.0
        searched = 0
        repeats = 0
        moved = True  # whether the last evaluation was taken
        while True:
            for k in range(count):
                times[k] = np.exp(trial[k])
            trial_value = evaluate(
                rows, waypoints, simple, layered, times, limits, gravity, tables[stage], watched,
                doublings, reference, work, trial_gradient,
            )  # fmt: skip
            if iteration >= 0:  # line search: halve or double until the weak Wolfe conditions hold
                searched += 1
                accepted = False
                if not trial_value <= value + ARMIJO * step * slope:
                    high = step
                else:
                    along = 0.0
                    for k in range(count):
                        along += trial_gradient[k] * direction[k]
                    accepted = along >= WOLFE * slope or step * largest >= LONGEST_STEP
                    low = step
                if not accepted and searched < LINE_SEARCH:
                    step = 0.5 * (low + high) if high < np.inf else 2.0 * step
                    for k in range(count):
                        trial[k] = x[k] + step * direction[k]
                    continue
                moved = trial_value < value
                if not moved:
                    if kept == 0:
                        break  # not even steepest descent finds anything lower
                    kept = none
                else:
                    shrink, kept = _remember(
                        pairs, kept, x, trial, gradient, trial_gradient, diagonal, shrink
                    )
                    value = trial_value
                    if iterations < history.shape[0]:
                        for k in range(count):
                            history[iterations, k] = times[k]
                    iterations += 1
                    iteration += 1
            else:
                moved = True
                if not trial_value < np.inf:
                    return iterations, False
                for k in range(count):
                    gradient[k] = trial_gradient[k]
                value = trial_value
                iteration = 0
            values[iteration] = value
            stopping = iteration == longest or (
                iteration >= PATIENCE and values[iteration - PATIENCE] - value < decrease * count
            )
            if moved and (stopping or iteration % WATCH_EVERY == 0):
                missed = watch(rows, times, limits, gravity, dense, doublings, work, watched)
                if missed > 0 and repeats < REPEATS:  # begin the stage again, from here
                    repeats += 1
                    iteration = -1
                    continue
            if stopping:
                converged = converged and iteration < longest and repeats < REPEATS
                break
            for attempt in range(2):
                if attempt > 0:
                    kept = none  # steepest descent, where L-BFGS does not lead down
                slope = _direction(pairs, kept, gradient, diagonal, shrink, direction)
                if slope < 0.0:
                    break
            if not slope < 0.0:
                break
            largest = 0.0
            for k in range(count):
                largest = max(largest, abs(direction[k]))
            step = min(1.0, LONGEST_STEP / largest)
            low = 0.0
            high = np.inf
            searched = 0
            for k in range(count):
                trial[k] = x[k] + step * direction[k]
        for k in range(count):
            times[k] = np.exp(x[k])
    return iterations, converged


@inner
def _remember(pairs, kept, x, trial, gradient, trial_gradient, diagonal, shrink):
    """Move to the trial point and store the step; returns scale of the Hessian and count."""
    steps, changes, inverses, _ = pairs
    slot = kept % steps.shape[0]
    product = 0.0
    size = 0.0
    for k in range(x.size):
        steps[slot, k] = trial[k] - x[k]
        changes[slot, k] = trial_gradient[k] - gradient[k]
        product += steps[slot, k] * changes[slot, k]
        size += changes[slot, k] * changes[slot, k] * diagonal[k]
        x[k] = trial[k]
        gradient[k] = trial_gradient[k]
    if product > 0.0 and product > CURVATURE * size * shrink:
        inverses[slot] = 1.0 / product
        return product / size, kept + 1
    return shrink, kept


@inner
def _direction(pairs, kept, gradient, diagonal, shrink, direction):
    """Direction <- minus the L-BFGS inverse Hessian times the gradient; returns their product."""
    steps, changes, inverses, weights = pairs
    memory, count = steps.shape
    used = min(kept, memory)
    for k in range(count):
        direction[k] = -gradient[k]
    for i in range(used):
        slot = (kept - 1 - i) % memory
        total = 0.0
        for k in range(count):
            total += steps[slot, k] * direction[k]
        weights[slot] = total * inverses[slot]
        for k in range(count):
            direction[k] -= weights[slot] * changes[slot, k]
    scale = shrink
    if kept == 0:
        largest = 1e-300
        for k in range(count):
            largest = max(largest, abs(diagonal[k] * gradient[k]))
        scale = FIRST_STEP / largest
    for k in range(count):
        direction[k] *= scale * diagonal[k]
    for i in range(used - 1, -1, -1):
        slot = (kept - 1 - i) % memory
        total = 0.0
        for k in range(count):
            total += changes[slot, k] * direction[k]
        weight = weights[slot] - total * inverses[slot]
        for k in range(count):
            direction[k] += weight * steps[slot, k]
    product = 0.0
    for k in range(count):
        product += gradient[k] * direction[k]
    return product
