"""Derivatives by the segment times against central finite differences.

Everything that calls a kernel by hand stands first, in a few helpers.
"""

import numpy as np
import pytest

from peakflight import spline
from peakflight.kernels import barrier, basis, classical, general, measures
from peakflight.kernels.jit import kernel
from peakflight.limits import GRAVITY, KINDS, ROTORS
from peakflight.problem import SplineClass, fixed_state
from peakflight.spline import SplineTask

pytestmark = pytest.mark.kernels

NAN = np.nan
NAMES = [kind.name for kind in KINDS]
FIGURES = np.array([0.05, 0.4, -0.15, 0.08])
"""Of the airframe, m, 1/s, 1/s and m: turning counts as much as thrust in the samples below, and
drag a little."""


# ---- kernels --------------------------------------------------------------------------------


def end_data(task, times):
    """(K, N, D) end data of a spline; the workspaces of the task are left ready for `adjoint`."""
    times = np.array(times)
    data = np.empty((len(times), task.spline_class.degree, task.waypoints.shape[1]))
    if task.layered is None:
        axes, energy, joints, factor, coupling, powers, _ = task.simple
        classical.solve(
            task.rows, axes, energy, task.waypoints, times, joints, factor, coupling, powers, data
        )
        return data
    layout, cost, factors, values, starts = task.layered
    code = general.solve(layout, cost, task.waypoints, times, 3, factors, values, data, starts)
    assert code == 0
    return data


def adjoint(task, times, data, slope, gradient):
    """gradient (K,) += derivative by log times of what has derivative `slope` by the end data."""
    if task.layered is None:
        axes, energy, _, factor, coupling, _, multipliers = task.simple
        classical.adjoint(
            task.rows, axes, energy, times, factor, coupling, data, slope, multipliers, gradient
        )
    else:
        layout, cost, factors, values, _ = task.layered
        general.adjoint(layout, cost, task.waypoints, times, factors, values, slope, gradient)


@kernel
def call_evaluate(
    rows, waypoints, simple, layered, times, limits, gravity, tables, watched, doublings, reference,
    work, gradient,
):  # fmt: skip
    return barrier.evaluate(
        rows, waypoints, simple, layered, times, limits, gravity, tables, watched, doublings,
        reference, work, gradient,
    )  # fmt: skip


@kernel
def call_watch(
    rows, waypoints, simple, layered, times, limits, gravity, tables, doublings, work, watched
):
    barrier.solve_spline(rows, waypoints, simple, layered, times, work[0])
    barrier.watch(rows, times, limits, gravity, tables, doublings, work, watched)


@kernel
def call_measure(kind, samples, squares, count, row, limit, gravity, values, pulls, figures):
    measures.measure(kind, samples, squares, count, row, limit, gravity, values, pulls, figures)


def workspace(count, degree, limits):
    is_turning, is_rotors = (
        bool(np.isfinite(limits[kinds]).any())
        for kinds in (slice(measures.TURNING, measures.ROTORS), slice(measures.ROTORS, None))
    )
    return barrier.workspace(count, degree, is_turning, FIGURES if is_rotors else None)


def barrier_of(task, times, limits, *, doublings, samples, reference=1.0, watched=None):
    """The barrier function and its gradient (K,) by log times; limits (kinds,), NaN where none."""
    count, degree = len(times), task.spline_class.degree
    if watched is None:
        watched = np.repeat(np.isfinite(limits)[None], count, axis=0)
    gradient = np.full(count, NAN)
    value = call_evaluate(
        task.rows, task.waypoints, task.simple, task.layered, np.array(times), limits, GRAVITY,
        basis.sample_tables(degree, samples), watched, doublings, reference,
        workspace(count, degree, limits), gradient,
    )  # fmt: skip
    return value, gradient


def watched_by(task, times, limits, *, doublings):
    count, degree = len(times), task.spline_class.degree
    watched = np.zeros((count, len(KINDS)), dtype=np.bool_)
    call_watch(
        task.rows, task.waypoints, task.simple, task.layered, np.array(times), limits, GRAVITY,
        basis.sample_tables(degree, barrier.BATCH), doublings,
        workspace(count, degree, limits), watched,
    )  # fmt: skip
    return watched


def measure(name, derivatives, limit):
    """(S,) m of S samples of the derivatives 1 to 4 (4, S, 3)."""
    kind = NAMES.index(name)
    samples = np.ascontiguousarray(np.moveaxis(derivatives, 2, 0))
    count = samples.shape[2]
    values = np.empty(count)
    call_measure(
        kind, samples, (samples**2).sum(axis=0), count, KINDS[kind].order - 1, limit, GRAVITY,
        values, np.zeros(samples.shape) if kind >= measures.TURNING else None,
        FIGURES if kind >= measures.ROTORS else None,
    )  # fmt: skip
    return values


# ---- tools ----------------------------------------------------------------------------------


def central_differences(function, times, step):
    """(K,) derivative by log times, exact for polynomials of degree 4 in log t."""
    gradient = np.empty(len(times))
    for k in range(len(times)):

        def along(distance, k=k):
            moved = np.array(times)
            moved[k] *= np.exp(distance)
            return function(moved)

        near = along(step) - along(-step)
        far = along(2 * step) - along(-2 * step)
        gradient[k] = (8.0 * near - far) / (12.0 * step)
    return gradient


def make_task(legs, seed, *, axes=3, options=(), fixed=None, free=(), rest=True):
    rng = np.random.default_rng(seed)
    spline_class = SplineClass.of(*options)
    waypoints = np.cumsum(rng.normal(size=(legs + 1, axes)), axis=0)
    for waypoint, axis in free:
        waypoints[waypoint, axis] = NAN
    states = {}
    for waypoint, state in {0: None, legs: None, **(fixed or {})}.items():
        zeros = spline_class.end_orders if rest and waypoint in (0, legs) else 0
        states[waypoint] = fixed_state("state", state, axes, spline_class.degree, zeros=zeros)
    return SplineTask.of(waypoints, spline_class, states)


def check_adjoint(task, times, seed):
    rng = np.random.default_rng(seed)
    data = end_data(task, times)
    slope = rng.normal(size=data.shape) / np.abs(data).max(axis=(0, 2))[:, None].clip(1e-3)
    start = rng.normal(size=len(times))
    gradient = start.copy()
    adjoint(task, np.array(times), data, slope, gradient)
    expected = central_differences(lambda t: (slope * end_data(task, t)).sum(), times, 1e-3)
    # truncation 1e-12 and rounding 1e-16 * cond / step, of numbers the size of the largest
    np.testing.assert_allclose(
        gradient - start, expected, rtol=0, atol=1e-8 * np.abs(expected).max()
    )
    assert np.abs(expected).max() > 1e-3


# ---- adjoints of the spline -----------------------------------------------------------------


@pytest.mark.parametrize("degree", [3, 5, 7, 9, 11])
@pytest.mark.parametrize("legs", [1, 2, 5])
def test_adjoint_of_the_classical_spline(degree, legs):
    moving = {
        0: {1: [1.0, 0.0, -2.0]},
        legs: {s: [0.5 * s, -1.0, 0.0] for s in range(1, degree // 2 + 1)},
    }
    task = make_task(legs, degree, options=({(degree + 1) // 2: 1.0},), fixed=moving)
    assert task.layered is None
    times = np.exp(np.random.default_rng(legs).uniform(-1.0, 1.0, size=legs))
    if legs == 1 and degree == 3:
        assert (end_data(task, times) != 0).any()
    check_adjoint(task, times, seed=degree)


GENERAL = {
    "snap, degree 5, C3": {"options": ("snap", 5, 3)},
    "snap, degree 6, C2": {"options": ("snap", 6, 2)},
    "jerk, degree 4, C3": {"options": ("jerk", 4, 3)},
    "acceleration, degree 3, C1, free ends": {
        "options": ("acceleration", 3, 1), "fixed": {0: {1: [NAN]}, 4: {1: [NAN]}}, "axes": 1,
    },
    "jerk, degree 8, C6": {"options": ("jerk", 8, 6)},
    "crackle, degree 11, C5": {"options": ({5: 1.0}, 11, 5)},
    "jerk and snap, degree 5": {"options": ({3: 1.0, 4: 0.05}, 5, 3)},
    "velocity to snap, degree 7, C5": {"options": ({1: 1.0, 2: 0.5, 3: 0.2, 4: 0.1}, 7, 5)},
    "position and jerk": {"options": ({0: 5.0, 3: 1.0}, 5, 4)},
    "position and jerk, free positions": {
        "options": ({0: 5.0, 3: 1.0}, 5, 4), "free": ((0, 0), (2, 0), (2, 1), (4, 2)),
    },
    "free positions": {"options": ("snap", 5, 3), "free": ((1, 2), (4, 0))},
    "inner velocity, one axis": {
        "options": ("jerk", 5, 2), "fixed": {2: {1: [NAN, 1.5, NAN]}},
    },
    "inner order beyond the end data": {
        "options": ("jerk", 5, 2), "fixed": {1: {4: [3.0, NAN, 0.0]}, 3: {3: [1.0, 1.0, 1.0]}},
    },
    "inner jerk, degree 7, C4": {
        "options": ("snap", 7, 2), "fixed": {1: {1: [1, 0, 0], 3: [NAN, 4.0, NAN]}},
    },
    "orders beyond the end data at both ends": {
        "options": ("jerk", 5, 3), "fixed": {0: {3: [2, 0, 1]}, 4: {2: [1, 0, 0], 4: [0, 9, 1]}},
    },
    "moving and free ends, degree 6": {
        "options": ("snap", 6, 3), "fixed": {0: {1: [2, NAN, 0], 2: [0, 0, 1]}, 4: {2: [NAN] * 3}},
    },
}  # fmt: skip


@pytest.mark.parametrize("name", GENERAL)
def test_adjoint_of_the_general_spline(name):
    task = make_task(4, seed=len(name), **GENERAL[name])
    assert task.simple is None
    times = np.exp(np.random.default_rng(len(name)).uniform(-1.0, 1.0, size=4))
    check_adjoint(task, times, seed=1)


def test_adjoints_of_both_kernels_agree(monkeypatch):
    times = np.array([0.3, 1.2, 0.8, 0.5])
    plain = make_task(4, seed=2)
    monkeypatch.setattr(spline, "is_plain", lambda *_: False)
    layered = make_task(4, seed=2)
    assert layered.simple is None
    slope = np.random.default_rng(0).normal(size=(4, 5, 3))
    gradients = np.zeros((2, 4))
    for gradient, task in zip(gradients, (plain, layered), strict=True):
        adjoint(task, times, end_data(task, times), slope, gradient)
    # two factorisations of the same equations
    np.testing.assert_allclose(*gradients, rtol=1e-10, atol=1e-10 * np.abs(gradients).max())


# ---- measures: what the optimiser takes for a limit -----------------------------------------


def keeps(name, derivatives, limit):
    """(S,) by how much samples (4, S, 3) exceed a limit, from its definition."""
    _, a, j, s = derivatives
    thrust = a + np.array([0.0, 0.0, GRAVITY])
    size = np.linalg.norm(thrust, axis=1)
    if name == "thrust_acceleration":
        return size / limit
    if name == "least_thrust_acceleration":
        return limit / size
    if name == "tilt":
        return np.arctan2(np.linalg.norm(thrust[:, :2], axis=1), thrust[:, 2]) / limit
    if name in ROTORS:  # room: what hovering leaves
        reach, drag, along_drag, crossed = FIGURES
        velocity = derivatives[0]
        carried = derivatives.copy()
        carried[1:] += drag * derivatives[:-1]
        thrust = carried[1] + np.array([0.0, 0.0, GRAVITY])
        size = np.linalg.norm(thrust, axis=1)
        size = size + along_drag * (thrust * velocity).sum(axis=1) / size
        turn = reach * keeps("angular_acceleration", carried, 1.0)
        turn = turn + crossed * keeps("body_rate", carried, 1.0) ** 2
        if name == "rotor_thrust":
            return (size + turn) / limit
        return (GRAVITY - size + turn) / limit
    if name in TURNS:  # derivatives of the unit vector n = F / |F|
        size, n = size[:, None], thrust / size[:, None]
        grows = (n * j).sum(axis=1, keepdims=True)
        rate = (j - n * grows) / size
        if name == "body_rate":
            return np.linalg.norm(rate, axis=1) / limit
        grows_more = (rate * j + n * s).sum(axis=1, keepdims=True)
        second = (s - 2.0 * rate * grows - n * grows_more) / size
        return np.linalg.norm(np.cross(n, second), axis=1) / limit
    return np.linalg.norm(derivatives[KINDS[NAMES.index(name)].order - 1], axis=1) / limit


TURNS = ("body_rate", "angular_acceleration")
LIMITS = {
    "speed": 5.0,
    "thrust_acceleration": 15.5,
    "jerk": 62.0,
    "snap": 800.0,
    "tilt": 0.8,
    "least_thrust_acceleration": 4.0,
    "body_rate": 8.0,
    "angular_acceleration": 80.0,
    "rotor_thrust": 20.0,
    "least_rotor_thrust": 9.0,
}


def motions(rng, count):
    """(4, S, 3) derivatives 1 to 4 of the sizes that they have in flight."""
    return rng.normal(size=(4, count, 3)) * np.array([5.0, 9.0, 60.0, 800.0])[:, None, None]


@pytest.mark.parametrize("name", NAMES)
def test_a_measure_is_at_most_one_exactly_where_the_limit_is_kept(name):
    derivatives = motions(np.random.default_rng(0), 5000)
    if name == "least_thrust_acceleration":
        derivatives[1, :, 2] -= GRAVITY  # around free fall
        derivatives[1, :, :2] *= 0.3
    ratio = keeps(name, derivatives, LIMITS[name])
    values = measure(name, derivatives, LIMITS[name])
    assert np.isfinite(values).all()
    assert (values >= 0.0).all()
    # tilt is smoothed by SOFTNESS, which moves its border by a part of 2.5e-7 of gravity; GUARD
    # moves what turning is by the square of GUARD g over the thrust, where the thrust is small
    rounded = 0.01 if name in ROTORS else 1e-5 if name in ("tilt", *TURNS) else 1e-12
    clear = np.abs(ratio - 1.0) > rounded  # EASE of rotors
    if name in (*TURNS, *ROTORS):
        pull = FIGURES[1] * derivatives[0] if name in ROTORS else 0.0
        clear &= np.linalg.norm(derivatives[1] + pull + [0.0, 0.0, GRAVITY], axis=1) > 4.0
    np.testing.assert_array_equal(values[clear] <= 1.0, ratio[clear] <= 1.0)
    assert 500 < (ratio <= 1.0).sum() < 4500


@pytest.mark.parametrize(
    "name", [name for name in NAMES if not (name.startswith("least") or name in (*TURNS, *ROTORS))]
)
def test_root_of_a_measure_is_the_uniform_stretch_that_is_needed(name):
    rng = np.random.default_rng(1)
    kind = NAMES.index(name)
    derivatives = rng.normal(size=(4, 1000, 3)) * LIMITS[name] * (10.0 if name == "tilt" else 1.0)
    stretch = measure(name, derivatives, LIMITS[name]) ** (1.0 / measures.EXPONENTS[kind])
    real = stretch > (0.1 if name == "tilt" else 0.0)  # below, smoothing bends it
    slowed = derivatives[:, real] / stretch[real, None] ** KINDS[kind].order
    ratio = keeps(name, slowed, LIMITS[name])
    # (SOFTNESS / stretch^2)^2 is the relative error that smoothing leaves
    np.testing.assert_allclose(ratio, 1.0, rtol=0, atol=1e-2 if name == "tilt" else 1e-10)
    assert real.sum() > 400


@pytest.mark.parametrize("name", TURNS)
def test_root_of_turning_is_the_stretch_once_gravity_dominates(name):
    derivatives = motions(np.random.default_rng(1), 1000) * 1e-4
    values = measure(name, derivatives, LIMITS[name])
    stretch = values ** (1.0 / measures.EXPONENTS[NAMES.index(name)])
    slowed = np.array([d / stretch[:, None] ** s for s, d in enumerate(derivatives, start=1)])
    ratio = keeps(name, slowed, LIMITS[name])
    assert (stretch < 0.3).all()
    # acceleration / stretch^2 is not small against gravity for all of them
    np.testing.assert_allclose(np.median(ratio), 1.0, rtol=0, atol=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_measures_at_rest_are_finite_and_within_the_limit(name):
    values = measure(name, np.zeros((4, 3, 3)), LIMITS[name])
    assert (values >= 0.0).all()
    assert (values < 1.0).all()


@pytest.mark.parametrize("name", TURNS)
def test_turning_in_free_fall_is_finite_and_far_too_fast(name):
    derivatives = motions(np.random.default_rng(2), 100)
    derivatives[1] = [0.0, 0.0, -GRAVITY]
    values = measure(name, derivatives, LIMITS[name])
    assert np.isfinite(values).all()
    assert (values > 1e3).all()


# ---- the barrier function -------------------------------------------------------------------


def sampled(task, times, samples):
    """(4, K S, 3) derivatives 1 to 4 at even points of each piece, without kernels' help."""
    trajectory = task.solve(times)
    return np.array([trajectory.sample(samples, order).reshape(-1, 3) for order in range(1, 5)])


def limits_for(names, derivatives, stretch):
    """(kinds,) limits at which the largest m^(1/e) of all samples is `stretch`."""
    limits = np.full(len(KINDS), NAN)
    for index, kind in enumerate(KINDS):
        if kind.name not in names:
            continue
        slowed = derivatives / stretch**kind.order
        ratio = 1.0
        if kind.name in ROTORS:  # no limit at or below gravity
            limits[index] = np.nanmax(keeps(kind.name, slowed, 1.0))
            limits[index] = max(limits[index], 1.2 * GRAVITY if kind.name == ROTORS[0] else 1.0)
            continue
        if kind.name.startswith("least") or kind.name in TURNS:  # m is a ratio squared
            slowed, ratio = derivatives, stretch ** (measures.EXPONENTS[index] / 2)
        unit = np.nanmax(keeps(kind.name, slowed, 1.0))
        limits[index] = ratio / unit if kind.name.startswith("least") else unit / ratio
    return limits


def slow_barrier(task, times, limits, *, doublings, samples, reference):
    """The barrier function from its definition at the top of `kernels.barrier`."""
    power = barrier.BASE_POWER * 2.0**doublings
    derivatives = sampled(task, times, samples)
    total = np.sum(times) / reference
    for index, kind in enumerate(KINDS):
        if np.isnan(limits[index]):
            continue
        exponent = measures.EXPONENTS[index]
        m = measure(kind.name, derivatives, limits[index])
        with np.errstate(divide="ignore"):
            x = power / exponent * np.log(m)
        excess = np.maximum(x - barrier.CAP, 0.0)
        terms = np.exp(np.minimum(x, barrier.CAP)) * (1.0 + excess + 0.5 * excess**2)
        total += terms.sum() / power
    return total


COMBINATIONS = [(name,) for name in NAMES] + [
    ("speed", "thrust_acceleration", "jerk", "snap"),
    tuple(NAMES),
]
every_combination = pytest.mark.parametrize(
    "names", COMBINATIONS, ids=lambda names: "all" if names == tuple(NAMES) else "+".join(names)
)
# x is the logarithm of the largest term: below CAP = 2 the power itself, above it the parabola
both_sides = pytest.mark.parametrize("x", [1.0, 6.0], ids=["power", "parabola"])
every_power = pytest.mark.parametrize(
    ("doublings", "samples"), [(-2, 8), (0, 8), (2, 16), (5, 32), (8, 64)]
)
TIMES = np.array([0.62, 0.45, 0.8, 0.51, 0.7])


def barrier_case(names, doublings, samples, x, options=()):
    task = make_task(5, seed=11, options=options)
    power = barrier.BASE_POWER * 2.0**doublings
    limits = limits_for(names, sampled(task, TIMES, samples), np.exp(x / power))
    return task, limits


@every_combination
@every_power
@both_sides
def test_barrier_is_what_it_says(names, doublings, samples, x):
    task, limits = barrier_case(names, doublings, samples, x)
    options = {"doublings": doublings, "samples": samples, "reference": 0.37}
    value, _ = barrier_of(task, TIMES, limits, **options)
    expected = slow_barrier(task, TIMES, limits, **options)
    power = barrier.BASE_POWER * 2.0**doublings
    passed_over = np.exp(barrier.NEGLIGIBLE) * samples * len(TIMES) * len(names) / power
    # a relative error of 1e-13 in a sample is one of p * 1e-13 in its term
    assert value == pytest.approx(expected, rel=1e-13 * power + 1e-12, abs=passed_over)
    alone = barrier_of(task, TIMES, np.full(len(KINDS), NAN), **options)[0]
    assert alone == pytest.approx(TIMES.sum() / 0.37, rel=1e-14)
    assert value - alone >= 0.9 * np.exp(min(x, barrier.CAP)) / power  # the limits do count


@every_combination
@every_power
@both_sides
def test_gradient_of_the_barrier(names, doublings, samples, x):
    task, limits = barrier_case(names, doublings, samples, x)
    options = {"doublings": doublings, "samples": samples, "reference": 0.37}
    value, gradient = barrier_of(task, TIMES, limits, **options)
    assert np.isfinite(value)
    power = barrier.BASE_POWER * 2.0**doublings
    # terms change by factors of e within 1/p of log t, so the step is a small part of that
    expected = central_differences(
        lambda times: barrier_of(task, times, limits, **options)[0], TIMES, 0.01 / power
    )
    # truncation (0.01)^4 and rounding 1e-14 / step; second derivatives jump where parabolas begin
    tolerance = 1e-6 + 1e-12 * power
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=tolerance * np.abs(expected).max())
    bare = TIMES / 0.37
    assert np.abs(gradient - bare).max() > 1e-2 * bare.max()  # the limits do pull


@pytest.mark.parametrize("options", [("snap",), ("snap", 5, 3)], ids=["degree 7", "general"])
@both_sides
def test_gradient_of_the_barrier_for_other_splines(options, x):
    names = tuple(NAMES)
    task, limits = barrier_case(names, 1, 16, x, options)
    call = {"doublings": 1, "samples": 16, "reference": 1.0}
    _, gradient = barrier_of(task, TIMES, limits, **call)
    expected = central_differences(
        lambda times: barrier_of(task, times, limits, **call)[0], TIMES, 2e-4
    )
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("aside", [0.0, 1e-14, 1e-12, 1e-9, 1e-3])
def test_gradient_of_tilt_where_it_vanishes(aside):
    """Straight up and down, or all but: the tilt has a kink at zero, the measure must not."""
    waypoints = np.array([[0, 0, 0], [aside, 0, 2.0], [0, 0, 0.5], [0, aside, 3.0]])
    spline_class = SplineClass.of("jerk")
    rest = {k: fixed_state("state", None, 3, 5, zeros=2) for k in (0, 3)}
    task = SplineTask.of(waypoints, spline_class, rest)
    times = np.array([0.9, 0.8, 1.0])
    limits = np.full(len(KINDS), NAN)
    limits[NAMES.index("tilt")] = 1.2
    call = {"doublings": 0, "samples": 16}
    _, gradient = barrier_of(task, times, limits, **call)
    expected = central_differences(
        lambda times: barrier_of(task, times, limits, **call)[0], times, 1e-4
    )
    assert np.abs(expected).max() > 1.0  # falling faster than gravity: the limit pulls
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("doublings", [-2, 2, 8])
def test_what_is_not_watched_would_not_have_mattered(doublings):
    task, limits = barrier_case(tuple(NAMES), doublings, 16, 1.0)
    watched = watched_by(task, TIMES, limits, doublings=doublings)
    options = {"doublings": doublings, "samples": 16}
    value, gradient = barrier_of(task, TIMES, limits, watched=watched, **options)
    expected, full = barrier_of(task, TIMES, limits, **options)
    assert value == pytest.approx(expected, rel=1e-8)
    np.testing.assert_allclose(gradient, full, rtol=0, atol=1e-7 * np.abs(full).max())
    if doublings == 8:
        assert not watched.all()
    limits[NAMES.index("jerk")] = NAN
    assert not watched_by(task, TIMES, limits, doublings=doublings)[:, NAMES.index("jerk")].any()


@pytest.mark.parametrize("shorter", [[1, 1, 1e-20, 1, 1], [1e-80] * 5])
def test_barrier_is_infinite_where_it_cannot_be_computed(shorter):
    """A NaN that is taken for a low value would be the best of all steps."""
    task, limits = barrier_case(("speed", "snap"), 8, 8, 1.0)
    with np.errstate(all="ignore"):  # without compilation, NumPy would warn
        value, _ = barrier_of(task, TIMES * shorter, limits, doublings=8, samples=8)
    assert value == np.inf
