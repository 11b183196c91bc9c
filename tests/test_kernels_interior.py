"""The kernels of `joint` against finite differences, dense algebra and plain formulas.

Everything that calls a kernel by hand stands first, in a few helpers.
"""

import numpy as np
import pytest

from peakflight.airframe import Airframe
from peakflight.kernels import band, basis, conditions, interior, pieces, rows, unknowns
from peakflight.kernels.jit import kernel
from peakflight.limits import GRAVITY, KINDS, limited_values
from peakflight.spline import coefficients_of
from peakflight.trajectory import Trajectory

pytestmark = pytest.mark.kernels

NAN = np.nan
LEANING = TURNING = np.ones(1)
AIRFRAME = Airframe(
    mass=0.85, inertia=1e-2, lever=0.106, yaw_inertia=1.5e-2, torque_per_thrust=0.02,
    inertia_difference=4e-3, drag=(0.2, 0.5),
)  # fmt: skip
"""Its reach makes turning count as much as thrust in the samples below; so does unequal inertia at
the faster ones, and its drag counts too."""
FIGURES = AIRFRAME.figures
NAMES = tuple(kind.name for kind in KINDS)
LIMITS = np.array([5.0, 15.5, 62.0, 800.0, 0.7, 8.0, 3.0, 25.0, 22.0, 8.0])
"""One for each kind; thrust in the samples below is around gravity."""
GRAVITY_OF_SAMPLES = np.zeros((3, 4, 1))
GRAVITY_OF_SAMPLES[2, 1] = GRAVITY
every_kind = pytest.mark.parametrize("kind", range(len(rows.KIND_TERMS)), ids=NAMES)


# ---- kernels --------------------------------------------------------------------------------


@kernel
def call_constrain(
    kind, leaning, turning, figures, samples, limits, gravity, values, r, first, slopes, bends
):  # fmt: skip
    return rows.constrain(
        kind, leaning, turning, figures, samples, limits, gravity, values, r, first, slopes, bends
    )


@kernel
def call_kappa(kind, leaning, turning, figures, samples, limit, gravity, out):
    rows.kappa(kind, leaning, turning, figures, samples, limit, gravity, out)


@kernel
def call_factors(time, orders, steps, powers, scales):
    pieces.factors(time, orders, steps, powers, scales)


@kernel
def call_sample(data, orders, steps, powers, scales, table, k, samples, rates):
    pieces.sample(data, orders, steps, powers, scales, table, k, samples, rates)


@kernel
def call_push(pulls, powers, scales, rates, table, k, out):
    return pieces.push(pulls, powers, scales, rates, table, k, out)


@kernel
def call_pull(steps, lengthening, powers, scales, rates, table, k, moves):
    pieces.pull(steps, lengthening, powers, scales, rates, table, k, moves)


@kernel
def call_curvature(
    weights, rates, k, powers, scales, table, pairs, count, products, sums, turned, columns, out
):
    pieces.curvature(
        weights, rates, k, powers, scales, table, pairs, count, products, sums, turned, columns, out
    )


@kernel
def call_band(matrix, damping, factor, values):
    positive = band.factorise(matrix, damping, factor)
    if positive:
        band.solve(factor, values)
    return positive


@kernel
def call_evaluate(layout, grid, limited, work, x, moved):
    return conditions.evaluate(layout, grid, limited, work, x, moved)


@kernel
def call_linear(layout, grid, limited, work, x, pulls, gradient, step, moves):
    conditions.gradient(layout, grid, limited, work, x, pulls, gradient)
    conditions.product(layout, grid, limited, work, x, step, moves)


@kernel
def call_assemble(layout, grid, limited, work, x):
    conditions.assemble(layout, grid, limited, work, x)


@kernel
def call_lower(layout, grid, limited, work, x, slowly):
    conditions.lower(layout, grid, limited, work, x, slowly)


def constrain(kind, samples, limits):
    """Values (S,), slopes (P, 3, S), bends (P, S) and the stretch of a kind at samples (3, 4, S).

    Neither the kind nor its terms come first, to see that they are put where they belong.
    """
    count, terms = samples.shape[2], len(rows.KIND_TERMS[kind])
    values, every = np.full((4, count), NAN), np.full((4, count), NAN)
    slopes, bends = np.full((terms + 2, 3, count), NAN), np.full((terms + 2, count), NAN)
    every[2] = limits
    stretch = call_constrain(
        kind, LEANING, TURNING, FIGURES, samples, every, GRAVITY, values, 2, 1, slopes, bends
    )
    for array in (slopes, bends):
        assert np.isnan(array[0]).all()
        assert np.isnan(array[-1]).all()
    assert np.isnan(values[[0, 1, 3]]).all()
    return values[2], slopes[1:-1], bends[1:-1], stretch


def kappa(kind, samples, limit):
    out = np.full(samples.shape[2], NAN)
    call_kappa(kind, LEANING, TURNING, FIGURES, samples, limit, GRAVITY, out)
    return out


# ---- tools ----------------------------------------------------------------------------------


def slope_of(function, x, step=1e-4):
    """Central differences along each number of x, exact for degree 4: (..., n)."""
    columns = []
    for i in range(x.size):
        moved = []
        for distance in (step, -step, 2 * step, -2 * step):
            other = x.copy()
            other.flat[i] += distance
            moved.append(function(other))
        near, far = moved[0] - moved[1], moved[2] - moved[3]
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=-1)


def random_samples(count, seed, scale=1.0):
    """(3, 4, S): every derivative around its limit times the scale; gravity is in the second."""
    rng = np.random.default_rng(seed)
    sizes = scale * np.array([3.0, 6.0, 36.0, 460.0])
    samples = rng.normal(size=(3, 4, count)) * sizes[:, None]
    samples[2, 1] += GRAVITY
    return samples


def plain_values(kind, samples):
    """What a kind limits at each sample, from its definition."""
    v, thrust, j, s = samples.transpose(1, 2, 0)
    a = thrust - np.array([0.0, 0.0, GRAVITY])
    if kind < 6:
        return limited_values([v, a, j, s])[NAMES[kind]]
    if kind > 7:  # with drag, which the derivatives of the thrust have too
        drag, along_drag = FIGURES[1:3]
        thrust, j, s = thrust + drag * v, j + drag * a, s + drag * j
    square = (thrust**2).sum(axis=1)
    rate = np.linalg.norm(np.cross(thrust, j), axis=1) / square
    if kind == 6:
        return rate
    turn = (thrust * j).sum(axis=1) / square
    swing = np.linalg.norm(np.cross(thrust, s - 2.0 * turn[:, None] * j), axis=1) / square
    if kind == 7:
        return swing
    rest, sign = (0.0, 1.0) if kind == 8 else (GRAVITY, -1.0)
    size = np.sqrt(square)
    size = size + along_drag * (thrust * v).sum(axis=1) / size
    uneven = AIRFRAME.inertia_difference / (AIRFRAME.torque_per_thrust * AIRFRAME.mass)
    return rest + sign * size + AIRFRAME.reach * swing + 0.5 * uneven * rate**2


def ratio_of(kind, values, limit):
    """Peak over limit: of the least rotor thrust, the values are how far it is below hovering."""
    return limit / values if kind == 5 else values / limit


# ---- rows: one kind of limit at samples -------------------------------------------------------


@every_kind
def test_a_row_is_at_most_zero_exactly_where_the_limit_is_kept(kind):
    samples = np.concatenate([random_samples(400, 1, x) for x in (0.3, 1.0, 2.0)], axis=2)
    limit = LIMITS[kind]
    values, _, _, _ = constrain(kind, samples, limit)
    found = plain_values(kind, samples)
    ratio = ratio_of(kind, found, limit)
    assert np.isfinite(values).all()
    assert 100 < (ratio <= 1.0).sum() < 1100
    if kind == 4:  # rounded by ROUNDNESS, to the safe side
        across = np.hypot(*samples[:2, 1])
        surely = (across + rows.ROUNDNESS * GRAVITY) / np.tan(limit) <= samples[2, 1]
        assert (values[surely] <= 0.0).all()
        assert (ratio[values <= 0.0] <= 1.0).all()
        assert (surely != (ratio <= 1.0)).sum() < 50
    elif kind > 7:  # likewise
        surely = (found + rows.ROUNDNESS * GRAVITY) / limit <= 1.0
        assert (values[surely] <= 0.0).all()
        assert (ratio[values <= 0.0] <= 1.0 + 1e-6).all()
        assert (surely != (ratio <= 1.0)).sum() < 50
    else:  # WEIGHTLESS is a part of 1e-8 g^2 / |F|^2 of kinds that turn
        clear = np.abs(ratio - 1.0) > 1e-6
        assert clear.sum() > 1150
        np.testing.assert_array_equal(values[clear] <= 0.0, ratio[clear] <= 1.0)


@every_kind
def test_limits_are_those_of_each_sample(kind):
    samples = random_samples(20, 2)
    limits = LIMITS[kind] * np.linspace(0.6, 1.0, 20)
    values, slopes, bends, _ = constrain(kind, samples, limits)
    for q, limit in enumerate(limits):
        alone = constrain(kind, samples[:, :, q : q + 1].copy(), limit)
        np.testing.assert_allclose(values[q], alone[0][0], rtol=1e-13, atol=1e-13)
        np.testing.assert_allclose(slopes[:, :, q], alone[1][:, :, 0], rtol=1e-13)
        np.testing.assert_allclose(bends[:, q], alone[2][:, 0], rtol=1e-13)


@every_kind
@pytest.mark.parametrize("scale", [0.02, 0.4, 1.0, 3.0])
def test_slopes_of_rows(kind, scale):
    """Far below a limit, near it, and above."""
    samples = random_samples(25, 3, scale)
    _, slopes, _, _ = constrain(kind, samples, LIMITS[kind])
    expected = np.zeros((4, 3, 25))
    for s in range(4):
        for d in range(3):
            step = 1e-5 * np.abs(samples[:, s]).max()
            around = []
            for distance in (step, -step, 2 * step, -2 * step):
                moved = samples.copy()
                moved[d, s] += distance
                around.append(constrain(kind, moved, LIMITS[kind])[0])
            near, far = around[0] - around[1], around[2] - around[3]
            expected[s, d] = (8.0 * near - far) / (12.0 * step)
    terms = [order - 1 for order in rows.KIND_TERMS[kind]]
    others = [s for s in range(4) if s not in terms]
    assert (expected[others] == 0.0).all()
    for slope, s in zip(slopes, terms, strict=True):
        # rounding of values around one, over the step
        size = np.abs(slope).max() + 1e-11 / (1e-5 * np.abs(samples[:, s]).max())
        np.testing.assert_allclose(slope, expected[s], rtol=0, atol=1e-6 * size)


@pytest.mark.parametrize("kind", range(6), ids=NAMES[:6])
@pytest.mark.parametrize("scale", [0.1, 1.0, 3.0])
def test_bends_are_the_largest_curvature_of_rows(kind, scale):
    """Of what depends on one derivative; what curves downwards has none."""
    samples = random_samples(10, 4, scale)
    (row,) = (order - 1 for order in rows.KIND_TERMS[kind])
    _, _, bends, _ = constrain(kind, samples, LIMITS[kind])
    for q in range(10):

        def slope(d, q=q):
            moved = samples[:, :, q : q + 1].copy()
            moved[:, row, 0] = d
            return constrain(kind, moved, LIMITS[kind])[1][0, :, 0]

        d = samples[:, row, q]
        hessian = slope_of(slope, d, 1e-4 * np.abs(d).max())
        largest = np.linalg.eigvalsh(hessian + hessian.T)[-1] / 2.0
        assert max(largest, 0.0) == pytest.approx(bends[0, q], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("kind", range(6, 10), ids=NAMES[6:])
def test_bends_of_kinds_that_turn_are_positive(kind):
    for scale in (0.1, 1.0, 3.0):
        bends = constrain(kind, random_samples(200, 5, scale), LIMITS[kind])[2]
        assert (bends > 0.0).all()


@every_kind
def test_kappa_is_peak_over_limit(kind):
    samples = random_samples(300, 6, 1.5)
    found = plain_values(kind, samples)
    limit = LIMITS[kind]
    expected = ratio_of(kind, found, limit)
    error = np.abs(kappa(kind, samples, limit) ** 2 - expected**2)
    tolerance = 1e-12 * expected**2
    if kind > 5:  # WEIGHTLESS leaves a part of what should cancel
        carried = samples[:, 1:].copy()
        if kind > 7:
            carried += FIGURES[1] * (samples[:, :-1] - GRAVITY_OF_SAMPLES[:, :-1])
            speed = np.abs(FIGURES[2]) * np.sqrt((samples[:, 0] ** 2).sum(axis=0))
        force, jerk, snap = np.sqrt((carried**2).sum(axis=0))
        whole = jerk if kind == 6 else snap + 2.0 * jerk**2 / force
        if kind > 7:
            whole = AIRFRAME.reach * whole + GRAVITY + speed
            tolerance += rows.WEIGHTLESS * (1.0 + (GRAVITY / force) ** 2 * whole / limit) ** 2
        tolerance += 4.0 * rows.WEIGHTLESS * (GRAVITY / force * whole / force / limit) ** 2
    assert (error <= tolerance).all()


@pytest.mark.parametrize("kind", range(6), ids=NAMES[:6])
def test_rows_return_the_exact_stretch(kind):
    """The least one from which on every longer stretch keeps the limit, by bisection."""
    limit, needed = LIMITS[kind], 0
    for seed in range(100):
        samples = random_samples(1, seed, 1.5)
        *_, stretch = constrain(kind, samples, limit)

        def is_kept(factors, samples=samples):
            powers = np.arange(1.0, 5.0)[:, None]
            slowed = samples - GRAVITY_OF_SAMPLES
            slowed = slowed / np.atleast_1d(factors) ** powers + GRAVITY_OF_SAMPLES
            value = plain_values(kind, slowed)
            return value >= limit if kind == 5 else value <= limit

        trials = np.geomspace(20.0, 0.02, 4000)
        kept = is_kept(trials)
        assert kept[0]
        if kept.all():
            assert kind in {4, 5}
            assert stretch**2 <= (rows.ROUNDNESS / np.tan(limit) if kind == 4 else 0.0)
            continue
        needed += 1
        first = int(kept.argmin())
        high, low = trials[first - 1], trials[first]
        for _ in range(60):
            middle = 0.5 * (high + low)
            high, low = (middle, low) if is_kept(middle)[0] else (high, middle)
        if kind == 4:  # linear in the square; ROUNDNESS adds to it, to the safe side
            assert high**2 * (1.0 - 1e-12) <= stretch**2
            assert stretch**2 <= high**2 + rows.ROUNDNESS / np.tan(limit)
        else:
            assert stretch == pytest.approx(high, rel=1e-9)
    assert needed >= 15


@every_kind
def test_the_stretch_of_a_piece_is_that_of_its_worst_sample(kind):
    samples = random_samples(30, 7, 1.2)
    alone = [constrain(kind, samples[:, :, q : q + 1].copy(), LIMITS[kind])[3] for q in range(30)]
    *_, stretch = constrain(kind, samples, LIMITS[kind])
    assert stretch == pytest.approx(max(alone), rel=1e-14)


@every_kind
def test_rows_at_rest_and_in_free_fall_are_finite(kind):
    samples = np.zeros((3, 4, 2))
    samples[2, 1, 0] = GRAVITY
    values, slopes, bends, stretch = constrain(kind, samples, LIMITS[kind])
    assert values[0] < 0.0
    for array in (values, slopes, bends, kappa(kind, samples, LIMITS[kind])[:1], stretch):
        assert np.isfinite(array).all()


# ---- pieces: between samples and end data -----------------------------------------------------


def random_piece(degree, seed, samples=7):
    """End data by time (N, 3), duration and tables; also orders of rows."""
    rng = np.random.default_rng(seed)
    grid = unknowns.make_grid(degree, samples)
    return rng.normal(size=(degree, 3)), float(rng.uniform(0.4, 1.6)), grid


def factors(time, grid):
    """What powers of the duration do to rows of end data (N,) and to samples (4 S,)."""
    powers, scales = np.full(len(grid.orders), NAN), np.full(grid.table.shape[1], NAN)
    call_factors(time, grid.orders, grid.steps, powers, scales)
    return powers, scales


def sample(data, time, grid):
    """Samples, without gravity, and rates (3, 4, S).

    The piece does not come first, to see that they are put where they belong.
    """
    samples, rates = (np.full((3, 3, grid.table.shape[1]), NAN) for _ in range(2))
    call_sample(
        data.copy(), grid.orders, grid.steps, *factors(time, grid), grid.table, 1, samples, rates
    )
    for array in (samples, rates):
        assert np.isnan(array[[0, 2]]).all()
    return samples[1].reshape(3, 4, -1), rates[1].reshape(3, 4, -1)


def pull(steps, lengthening, rates, time, grid):
    moves = np.full((1, 3, grid.table.shape[1]), NAN)
    call_pull(
        steps, lengthening, *factors(time, grid), rates.reshape(1, 3, -1), grid.table, 0, moves
    )
    return moves.reshape(rates.shape)


def trajectory_of(data, starts, times):
    """From end data by time (K, N, 3), positions (K, 3), (K,) s."""
    orders = basis.row_orders(data.shape[1])[:-1]
    return Trajectory(
        coefficients_of(data * times[:, None, None] ** orders[:, None], starts, times), times
    )


def sizes_of(data, starts, times):
    """As `trajectory_of`, with every term of every sum positive: what is rounded has this size."""
    orders = basis.row_orders(data.shape[1])[:-1]
    table = np.abs(basis.to_monomials(data.shape[1]))[:, :-1]
    coefficients = table @ np.abs(data * times[:, None, None] ** orders[:, None])
    coefficients *= times[:, None, None] ** -np.arange(coefficients.shape[1])[:, None]
    coefficients[:, 0] += np.abs(starts)
    return Trajectory(coefficients, times)


some_degrees = pytest.mark.parametrize("degree", [3, 5, 6, 7, 11])


@some_degrees
def test_samples_are_derivatives_of_the_trajectory(degree):
    data, time, grid = random_piece(degree, degree)
    samples, _ = sample(data, time, grid)
    alone = data[None], np.zeros((1, 3)), np.array([time])
    trajectory, sizes = trajectory_of(*alone), sizes_of(*alone)
    u = (1.0 - np.cos(np.pi * np.arange(7) / 6)) / 2.0
    for order in range(1, 5):
        expected = trajectory.at(0, u * time, order)
        size = sizes.at(0, u * time, order)
        assert (np.abs(samples[:, order - 1].T - expected) <= 1e-14 * size).all()


@some_degrees
def test_rates_are_derivatives_by_log_time(degree):
    data, time, grid = random_piece(degree, degree)
    samples, rates = sample(data, time, grid)
    expected = slope_of(lambda x: sample(data, time * np.exp(x[0]), grid)[0], np.zeros(1), 1e-3)
    np.testing.assert_allclose(
        rates, expected[..., 0], rtol=0, atol=1e-8 * np.abs(samples).max(axis=(0, 2))[:, None].max()
    )


@some_degrees
def test_pull_is_the_derivative_of_samples(degree):
    data, time, grid = random_piece(degree, degree)
    samples, rates = sample(data, time, grid)
    rng = np.random.default_rng(1)
    steps, lengthening = rng.normal(size=data.shape), 0.3
    expected = slope_of(
        lambda x: sample(data + x[0] * steps, time * np.exp(x[0] * lengthening), grid)[0],
        np.zeros(1),
        1e-3,
    )[..., 0]
    moves = pull(steps, lengthening, rates, time, grid)
    np.testing.assert_allclose(moves, expected, rtol=0, atol=1e-8 * np.abs(samples).max())


@some_degrees
def test_push_is_the_transpose_of_pull(degree):
    data, time, grid = random_piece(degree, degree)
    _, rates = sample(data, time, grid)
    rng = np.random.default_rng(2)
    steps, lengthening = rng.normal(size=data.shape), 0.7
    pulls = rng.normal(size=rates.shape)
    moves = pull(steps, lengthening, rates, time, grid)
    carried = np.full(data.shape, NAN)
    along = call_push(
        pulls.reshape(1, 3, -1).copy(), *factors(time, grid), rates.reshape(1, 3, -1),
        grid.table, 0, carried,
    )  # fmt: skip
    size = (np.abs(pulls) * np.abs(moves)).sum()
    assert (carried * steps).sum() + along * lengthening == pytest.approx(
        (pulls * moves).sum(), rel=0, abs=1e-12 * size
    )


@some_degrees
@pytest.mark.parametrize("steps", [True, False], ids=["all rows", "without the step"])
def test_curvature_is_the_dense_product(degree, steps):
    data, time, grid = random_piece(degree, degree)
    _, rates = sample(data, time, grid)
    rng = np.random.default_rng(3)
    six = rng.normal(size=(4, 6, rates.shape[2]))
    form = np.empty((4, 3, 3, rates.shape[2]))
    for entry, (a, b) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
        form[:, a, b] = form[:, b, a] = six[:, entry]
    columns = [pull(unit.reshape(-1, 3), 0.0, rates, time, grid) for unit in np.eye(3 * degree)]
    columns.append(rates)
    expected = np.einsum("idsq,sdeq,jesq->ij", columns, form, columns)
    size = 3 * degree + 1
    out = np.zeros((size, size))
    wanted = len(grid.pairs) if steps else int(grid.still[0])
    call_curvature(
        six.transpose(1, 0, 2).reshape(1, 6, -1), rates.reshape(1, 3, -1), 0, *factors(time, grid),
        grid.table, grid.pairs, wanted, grid.products, np.empty((6, grid.products.shape[1])),
        np.empty((1, 3, grid.table.shape[1])), np.empty((degree, 3)), out,
    )  # fmt: skip
    filled = np.zeros((size, size), dtype=bool)
    for i in range(degree):
        for j in range(i, degree):
            filled[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = steps or i > 0
    filled[:, -1] = True
    assert (out[~filled] == 0.0).all()
    scale = np.sqrt(np.abs(np.einsum("idsq,idsq->i", columns, columns)))
    error = np.abs(out - expected) / np.outer(scale, scale)
    assert error[filled].max() < 1e-12 * np.abs(six).max()


# ---- band -------------------------------------------------------------------------------------


def dense_of(matrix):
    """(n, n) symmetric, from band storage (n, w)."""
    size, width = matrix.shape
    dense = np.zeros((size, size))
    for i in range(size):
        for b in range(min(width, size - i)):
            dense[i, i + b] = dense[i + b, i] = matrix[i, b]
    return dense


@pytest.mark.parametrize("width", [1, 2, 5, 12])
@pytest.mark.parametrize("damping", [0.0, 1e-2])
def test_band_solutions(width, damping):
    rng = np.random.default_rng(width)
    matrix = rng.normal(size=(12, width))
    for i in range(12):
        matrix[i, 12 - i :] = NAN  # beyond the matrix: must not be read into it
    matrix[:, 0] = 0.5
    dense = dense_of(matrix)
    matrix[:, 0] += np.abs(np.linalg.eigvalsh(dense)).max()
    dense = dense_of(matrix)
    values = rng.normal(size=12)
    expected = np.linalg.solve(dense + damping * np.diag(np.diag(dense)), values)
    factor = np.empty_like(matrix)
    before = matrix.copy()
    assert call_band(matrix, damping, factor, values)
    np.testing.assert_allclose(values, expected, rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(matrix, before)
    lower = np.eye(12)
    for i in range(12):
        for b in range(1, min(width, 12 - i)):
            lower[i + b, i] = factor[i, b] / factor[i, 0]
    again = lower @ np.diag(factor[:, 0]) @ lower.T
    np.testing.assert_allclose(
        again, dense + damping * np.diag(np.diag(dense)), rtol=0, atol=1e-12 * np.abs(dense).max()
    )


@pytest.mark.parametrize("width", [2, 5])
def test_an_indefinite_band_is_refused(width):
    rng = np.random.default_rng(width)
    matrix = rng.normal(size=(12, width))
    matrix[:, 0] = 0.1
    assert np.linalg.eigvalsh(dense_of(matrix))[0] < 0.0
    values = np.ones(12)
    factor = np.empty_like(matrix)
    assert not call_band(matrix, 0.0, factor, values)
    assert call_band(matrix, 1e4, factor, values)
    matrix[:, 0] = 50.0
    matrix[7, 0] = NAN
    assert not call_band(matrix, 0.0, factor, values)


def test_a_singular_band_is_refused():
    matrix = np.array([[1.0, 1.0], [1.0, 0.0]])
    assert not call_band(matrix, 0.0, np.empty_like(matrix), np.ones(2))


# ---- unknowns ---------------------------------------------------------------------------------

REST = {0: np.zeros((2, 3)), -1: np.zeros((2, 3))}
STILL = {0: np.zeros((3, 3)), -1: np.zeros((3, 3))}
MOVING = {0: np.full((3, 3), 0.5), 1: np.array([[1.0, 0.0, 0.0]]), -1: np.full((2, 3), 0.7)}
LAYOUTS = {
    "degree 7, C3": {"degree": 7, "continuity": 3, "fixed": STILL},
    "degree 5, C2": {"degree": 5, "continuity": 2, "fixed": REST},
    "degree 7, C3, pieces": {"degree": 7, "continuity": 3, "pieces": (2, 1, 3), "fixed": REST},
    "degree 7, C2": {"degree": 7, "continuity": 2, "fixed": REST},
    "degree 9, C2, pieces": {"degree": 9, "continuity": 2, "pieces": (1, 2, 1), "fixed": REST},
    "degree 6, C2": {"degree": 6, "continuity": 2, "fixed": REST},
    "degree 6, C1, pieces": {"degree": 6, "continuity": 1, "pieces": (2, 1, 1), "fixed": REST},
    "degree 4, C1": {"degree": 4, "continuity": 1, "fixed": {0: STILL[0][:1]}},
    "degree 5, C0": {"degree": 5, "continuity": 0, "fixed": {}},
    "partly fixed": {
        "degree": 7, "continuity": 3, "pieces": (1, 2, 1),
        "fixed": {
            0: np.array([[1.0, NAN, -2.0], [0.0, 0.5, NAN]]), 1: np.array([[NAN, 1.5, NAN]]),
            2: np.array([[NAN] * 3, [0.0, NAN, 0.3], [0.2] * 3]), -1: np.array([[NAN, 0.0, 1.0]]),
        },
    },
    "fixed at degree 6": {
        "degree": 6, "continuity": 2, "pieces": (2, 2, 1), "fixed": MOVING,
    },
}  # fmt: skip
every_layout = pytest.mark.parametrize("name", LAYOUTS)
WAYPOINTS = np.array([[0.3, 0.1, 1.0], [1.2, -0.4, 1.5], [1.6, 0.9, 0.8], [0.2, 1.1, 1.3]])


def make_layout(name):
    options = LAYOUTS[name]
    counts = np.array(options.get("pieces", (1, 1, 1)))
    fixed = {index % len(WAYPOINTS): state for index, state in options["fixed"].items()}
    layout = unknowns.make_layout(
        WAYPOINTS, counts, options["degree"], options["continuity"], fixed
    )
    return layout, counts, fixed


def random_unknowns(layout, seed):
    rng = np.random.default_rng(seed)
    x = 0.3 * rng.normal(size=len(layout.order))
    x[layout.clock] = np.log(rng.uniform(0.3, 0.6, size=len(layout.clock)))
    return x


@every_layout
def test_every_unknown_describes_a_trajectory_of_the_class(name):
    layout, counts, fixed = make_layout(name)
    continuity = LAYOUTS[name]["continuity"]
    data, starts, times = unknowns.get_data(layout, random_unknowns(layout, 1))
    leg = np.repeat(np.arange(3), counts)
    ends = np.concatenate(([0], np.cumsum(counts)))
    positions = WAYPOINTS[leg] + starts
    trajectory, sizes = trajectory_of(data, positions, times), sizes_of(data, positions, times)
    np.testing.assert_array_equal(starts[ends[:-1]], 0.0)
    at = [trajectory.sample(2, order) for order in range(LAYOUTS[name]["degree"] + 1)]
    np.testing.assert_allclose(at[0][ends[:-1], 0], WAYPOINTS[:-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(at[0][ends[1:] - 1, 1], WAYPOINTS[1:], rtol=0, atol=1e-12)
    for order in range(continuity + 2):
        size = np.abs(at[order]).max()
        jumps = np.abs(at[order][1:, 0] - at[order][:-1, 1])
        if order <= continuity:
            rounded = sizes.sample(2, order)
            assert (jumps <= 1e-14 * (rounded[1:, 0] + rounded[:-1, 1])).all()
        else:  # and no smoother than was asked
            assert jumps.max(axis=1).min() > 1e-3 * size
    for waypoint, state in fixed.items():
        piece, side = (len(times) - 1, 1) if waypoint == 3 else (ends[waypoint], 0)
        for order, wanted in enumerate(state, start=1):
            found = at[order][piece, side]
            known = np.isfinite(wanted)
            size = sizes.at(piece, side * times[piece], order)
            assert (np.abs(found - wanted) <= 1e-14 * size)[known].all()
            assert (np.abs(found[~known]) > 1e-6).all()


@every_layout
def test_unknowns_come_back(name):
    layout, _, _ = make_layout(name)
    x = random_unknowns(layout, 2)
    data, starts, times = unknowns.get_data(layout, x)
    again = np.full(x.shape, NAN)
    unknowns.set_unknowns(layout, data, starts, times, again)
    np.testing.assert_allclose(again, x, rtol=1e-13, atol=1e-13)


@every_layout
def test_there_are_as_many_unknowns_as_there_is_freedom(name):
    """Counted: what each piece has, less what joints, waypoints and fixed motion take."""
    layout, counts, fixed = make_layout(name)
    degree, continuity = LAYOUTS[name]["degree"], LAYOUTS[name]["continuity"]
    total = counts.sum()
    free = 3 * total * (degree + 1) + total  # coefficients and durations
    free -= 3 * (total - 1) * (continuity + 1)  # joints
    free -= 3 * (len(counts) + 1)  # waypoints
    for waypoint, state in fixed.items():
        for order, wanted in enumerate(state, start=1):
            both = order > continuity and 0 < waypoint < 3  # holds before and after
            free -= np.isfinite(wanted).sum() * (2 if both else 1)
    assert len(layout.order) == free
    assert (layout.order == -1).sum() == total
    assert (np.diff(layout.clock) > 0).all()


@every_layout
def test_orders_say_how_unknowns_scale_with_time(name):
    layout, _, _ = make_layout(name)
    x = random_unknowns(layout, 3)
    data, starts, times = unknowns.get_data(layout, x)
    orders = basis.row_orders(LAYOUTS[name]["degree"])[:-1]
    slower = np.empty_like(x)
    unknowns.set_unknowns(layout, data / 2.0 ** orders[:, None], starts, 2.0 * times, slower)
    is_time = layout.order < 0
    expected = np.where(is_time, x + np.log(2.0), x / 2.0 ** np.maximum(layout.order, 0))
    np.testing.assert_allclose(slower, expected, rtol=1e-13, atol=1e-13)


@every_layout
def test_pieces_meet_within_the_band(name):
    layout, _, _ = make_layout(name)
    width = unknowns.band_width(layout)
    for k, size in enumerate(layout.size):
        own = layout.unknown[k, :size]
        seen = {*layout.place[k].ravel().tolist(), int(layout.clock[k])} - {-1}
        assert own.tolist() == sorted(seen)
        assert own[-1] - own[0] < width
    assert layout.steps.tolist() == [bool((place[[0, -1]] >= 0).any()) for place in layout.place]


@pytest.mark.parametrize("samples", [5, 8, 14, 16])
def test_quadrature_is_exact_for_polynomials(samples):
    grid = unknowns.make_grid(7, samples)
    u = (1.0 - np.cos(np.pi * np.arange(samples) / (samples - 1))) / 2.0
    for power in range(samples):
        assert grid.quadrature @ u**power == pytest.approx(1.0 / (power + 1), rel=1e-12)
    assert (grid.quadrature > 0.0).all()


@pytest.mark.parametrize("degree", range(3, 12))
def test_from_monomials_is_the_inverse_of_to_monomials(degree):
    there = basis.to_monomials(degree)
    back = basis.from_monomials(degree, degree)
    np.testing.assert_allclose(
        back @ there[:, :degree], np.eye(degree), rtol=0, atol=1e-10 * np.abs(there).max()
    )
    rng = np.random.default_rng(degree)
    for given in range(degree + 1):  # lower degrees are elevated
        coefficients = rng.normal(size=given + 1)
        data = basis.from_monomials(degree, given) @ coefficients
        again = there @ np.append(data, coefficients[0])
        np.testing.assert_allclose(
            again, np.pad(coefficients, (0, degree - given)), rtol=0,
            atol=1e-13 * np.abs(there).max() * np.abs(data).max(),
        )  # fmt: skip


# ---- interior: all of it ----------------------------------------------------------------------


class Case:
    """A layout with limits of some kinds, at a random point."""

    def __init__(self, name, kinds, effort=None, samples=7, seed=0):
        self.layout, _, _ = make_layout(name)
        self.grid = unknowns.make_grid(LAYOUTS[name]["degree"], samples)
        limits = np.full(len(LIMITS), NAN)
        limits[list(kinds)] = LIMITS[list(kinds)]
        figures = FIGURES if np.isfinite(limits[rows.ROTORS :]).any() else None
        self.limited = unknowns.make_limited(limits, effort, GRAVITY, figures=figures)
        self.work = unknowns.make_work(self.layout, self.grid, self.limited)
        self.rng = np.random.default_rng(seed)
        self.x = random_unknowns(self.layout, seed)
        shape = self.work.limits.shape
        self.work.limits[:] = self.limited.values[:, None] * self.rng.uniform(0.8, 1.0, size=shape)
        self.work.slack[:] = self.rng.uniform(0.1, 1.0, size=shape)
        self.work.dual[:] = self.rng.uniform(0.1, 1.0, size=shape)
        self.work.stiffness[:] = self.rng.uniform(0.0, 20.0, size=shape[0])

    def evaluate(self, x):
        return call_evaluate(self.layout, self.grid, self.limited, self.work, x, True)

    def values(self, x):
        self.evaluate(x)
        return self.work.values.copy()

    def samples(self, x):
        """(K, 3, 4, S) without gravity."""
        self.evaluate(x)
        samples = self.work.samples.copy()
        samples[:, 2, 1] -= GRAVITY
        return samples

    def objective(self, x):
        _, time, effort = self.evaluate(x)
        return time + effort

    def linear(self, pulls, step):
        """Gradient (n,) of the Lagrangian, and gradients of constraints times a step (K R S,)."""
        gradient, moves = np.full(self.x.shape, NAN), np.full(self.work.values.size, NAN)
        self.evaluate(self.x)
        call_linear(
            self.layout, self.grid, self.limited, self.work, self.x, pulls.ravel().copy(),
            gradient, step, moves,
        )  # fmt: skip
        return gradient, moves.reshape(self.work.values.shape)


EFFORT = np.array([0.0, 2e-3, 1e-4, 1e-7])
CASES = {
    "speed": (("degree 7, C3", (0,)), {}),
    "norms and thrust": (("degree 7, C3", (0, 1, 2, 3)), {}),
    "norms and thrust, degree 5": (("degree 5, C2", (0, 1, 2, 3)), {}),
    "free positions": (("degree 7, C3, pieces", (0, 1, 2, 3)), {}),
    "tilt and least thrust": (("degree 7, C2", (1, 4, 5)), {}),
    "even degree, pieces": (("degree 6, C1, pieces", (0, 1, 4)), {}),
    "partly fixed": (("partly fixed", (0, 1, 2, 3)), {}),
    "body rate": (("degree 7, C3", (6,)), {}),
    "angular acceleration, free positions": (("degree 7, C3, pieces", (7,)), {}),
    "all kinds": (("degree 7, C3, pieces", range(len(KINDS))), {}),
    "effort": (("degree 7, C3", (0, 1, 2, 3)), {"effort": EFFORT}),
    "effort, free positions": (("partly fixed", (0, 1, 5)), {"effort": EFFORT}),
    "effort of jerk, degree 5": (("degree 5, C2", (2,)), {"effort": np.array([0, 0, 1e-3, 0])}),
    "all kinds and effort": (("degree 6, C2", range(len(KINDS))), {"effort": EFFORT}),
}
every_case = pytest.mark.parametrize("name", CASES)


def make_case(name, **options):
    arguments, others = CASES[name]
    return Case(*arguments, **others, **options)


@every_case
def test_gradient_of_the_lagrangian(name):
    """In every unknown: durations, derivatives at joints, positions inside legs."""
    case = make_case(name)
    pulls = case.rng.normal(size=case.work.values.shape)
    gradient, _ = case.linear(pulls, np.zeros_like(case.x))
    expected = slope_of(lambda x: case.objective(x) + (pulls * case.values(x)).sum(), case.x)
    # rounding of a sum of some hundred numbers around one, over the step
    size = np.abs(expected).max()
    np.testing.assert_allclose(gradient, expected, rtol=0, atol=1e-7 * size)
    assert (np.abs(expected) > 1e-6 * size).mean() > 0.9  # there is something to see


@every_case
def test_product_with_the_gradients_of_constraints(name):
    case = make_case(name)
    step = case.rng.normal(size=case.x.shape)
    _, moves = case.linear(np.zeros(case.work.values.shape), step)
    expected = slope_of(lambda along: case.values(case.x + along[0] * step), np.zeros(1), 1e-5)
    for r in range(moves.shape[1]):
        size = np.abs(moves[:, r]).max()
        np.testing.assert_allclose(moves[:, r], expected[:, r, :, 0], rtol=0, atol=1e-6 * size)


@every_case
def test_assembled_matrix_is_the_one_of_the_definition(name):
    """The sum at the top of `kernels.interior`, densely, with Jacobians by finite differences."""
    case = make_case(name)
    layout, limited, work = case.layout, case.limited, case.work
    moves = slope_of(case.samples, case.x)  # (K, 3, 4, S, n)
    samples = case.samples(case.x)
    times = np.exp(case.x[layout.clock])
    expected = np.zeros((case.x.size, case.x.size))
    expected[layout.clock, layout.clock] = times * (1.0 + work.stiffness)
    for r in range(len(limited.kinds)):
        gradient = np.zeros((*work.values[:, r].shape, case.x.size))
        for p in range(limited.first[r], limited.first[r + 1]):
            along = moves[:, :, limited.orders[p]]  # (K, 3, S, n)
            gradient += np.einsum("kdq,kdqn->kqn", work.slopes[:, p], along)
            weight = work.dual[:, r] * work.bends[:, p]
            expected += np.einsum("kq,kdqn,kdqm->nm", weight, along, along)
        ratio = work.dual[:, r] / work.slack[:, r]
        expected += np.einsum("kq,kqn,kqm->nm", ratio, gradient, gradient)
    if limited.effort is not None:  # residuals sqrt(t) d
        residual = moves.copy()
        for k, clock in enumerate(layout.clock):
            residual[k, ..., clock] += 0.5 * samples[k]
        expected += np.einsum(
            "s,q,k,kdsqn,kdsqm->nm",
            2.0 * limited.effort, case.grid.quadrature, times, residual, residual, optimize=True,
        )  # fmt: skip
    call_assemble(layout, case.grid, limited, work, case.x)
    found = dense_of(work.matrix)
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=0, atol=1e-6
    )
    assert np.linalg.eigvalsh(found)[0] > -1e-10 * np.abs(found).max()


@pytest.mark.parametrize("name", [name for name in CASES if "effort" in name])
def test_effort_is_the_weighed_integral_of_squares(name):
    """Samples are of degree 10 at most and few: the integral is that of the interpolant squared."""
    case = make_case(name, samples=16)  # exact for the square of any derivative
    _, time, effort = case.evaluate(case.x)
    data, starts, times = unknowns.get_data(case.layout, case.x)
    trajectory = trajectory_of(data, starts, times)
    u, weights = np.polynomial.legendre.leggauss(12)
    expected = 0.0
    for k, duration in enumerate(times):
        for s in range(4):
            d = trajectory.at(k, 0.5 * (u + 1.0) * duration, s + 1)
            expected += case.limited.effort[s] * 0.5 * duration * weights @ (d**2).sum(axis=1)
    assert time == pytest.approx(times.sum(), rel=1e-14)
    assert effort == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("slowly", [1.0, 0.3])
def test_limits_are_lowered_by_what_happens_between_samples(slowly):
    """At a lowered limit a sample is as near to it as its cell's peak is to the limit itself."""
    case = make_case("all kinds", samples=9)
    case.evaluate(case.x)
    before = case.work.limits.copy()
    call_lower(case.layout, case.grid, case.limited, case.work, case.x, slowly)
    data, starts, times = unknowns.get_data(case.layout, case.x)
    trajectory = trajectory_of(data, starts, times)
    u = (1.0 - np.cos(np.pi * np.arange(9) / 8)) / 2.0
    borders = np.concatenate(([0.0], (u[1:] + u[:-1]) / 2.0, [1.0]))
    inner = 0
    for k, duration in enumerate(times):
        for q in range(9):
            near = np.append(np.linspace(borders[q], borders[q + 1], unknowns.CELL), u[q])
            motion = [trajectory.at(k, near * duration, order).T for order in range(1, 5)]
            samples = np.stack(motion, axis=1) + GRAVITY_OF_SAMPLES
            for r, kind in enumerate(case.limited.kinds):
                *around, there = plain_values(kind, samples) ** (-1.0 if kind == 5 else 1.0)
                peak = max(around)
                top = around.index(peak)
                if 0 < top < len(around) - 1:  # the vertex of a parabola through three points
                    fit = np.polynomial.Polynomial.fit([-1, 0, 1], around[top - 1 : top + 2], 2)
                    peak = fit(fit.deriv().roots()[0])
                    inner += 1
                peak = max(peak, 1e-300)  # of the least rotor thrust, it may be negative
                ratio = min(max(there / peak, conditions.DEEPEST), 1.0)
                wanted = case.limited.values[r] * (1.0 / ratio if kind == 5 else ratio)
                part_way = before[k, r, q] + slowly * (wanted - before[k, r, q])
                assert case.work.limits[k, r, q] == pytest.approx(part_way, rel=1e-5)
    assert inner > 50


def test_a_solved_run_is_optimal_to_first_order():
    """Stationary, feasible, complementary, by finite differences."""
    case = make_case("norms and thrust, degree 5", samples=12)
    begin = interior.Begin(
        margin=1.05, barrier=0.3, slack=1e-3, stiffness=0.0, slowly=1.0, kept=0.0
    )
    case.work.x[:] = case.x
    code = interior.run(
        case.layout, case.grid, case.limited, case.work, True, begin, 1e-5, 150
    )  # fmt: skip
    assert code == interior.SOLVED
    work, x = case.work, case.work.x.copy()
    slope = slope_of(lambda y: case.objective(y) + (work.dual * case.values(y)).sum(), x)
    time = np.exp(x[case.layout.clock]).sum()
    values = case.values(x)
    # what a Newton step would still gain, in the metric of the matrix
    call_assemble(case.layout, case.grid, case.limited, work, x)
    gain = 0.5 * slope @ np.linalg.solve(dense_of(work.matrix), slope)
    assert gain < 2e-5 * time
    assert values.max() < 1e-4
    assert (work.dual > 0.0).all()
    assert (work.dual * work.slack).sum() < 1e-5 * time
    assert np.abs(values + work.slack)[work.dual > 1e-3].max() < 1e-4
