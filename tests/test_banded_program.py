import numpy as np
import pytest
from scipy import optimize, sparse

from peakflight.banded_program import Bounds, least_scale, least_squares


def random_task(seed, n=12):
    """Tracking of a random walk with bounded first and second differences."""
    rng = np.random.default_rng(seed)
    first = sparse.csr_array(sparse.diags_array((-1.0, 1.0), offsets=(0, 1), shape=(n - 1, n)))
    second = sparse.csr_array(first[:-1, :-1] @ first)
    rows = sparse.csr_array(sparse.vstack((first, second)))
    m = rows.shape[0]
    offset = 0.1 * rng.normal(size=m)
    fixed = np.abs(offset) + rng.uniform(0.1, 0.5, size=m)  # so that 0 is allowed
    bounds = Bounds(rows, offset, fixed, rng.uniform(0.5, 2.0, size=m))
    return sparse.csr_array(sparse.eye_array(n)), np.cumsum(rng.normal(size=n)), bounds


@pytest.mark.parametrize("seed", range(8))
def test_least_squares_agrees_with_a_dense_twin(seed):
    rows, target, bounds = random_task(seed)
    x = least_squares(rows, target, bounds)
    a = bounds.rows.toarray()
    twin = optimize.minimize(
        lambda v: 0.5 * ((v - target) ** 2).sum(),
        np.zeros(len(target)),
        jac=lambda v: v - target,
        method="SLSQP",
        constraints={
            "type": "ineq",
            "fun": lambda v: np.concatenate(
                (bounds.fixed - a @ v - bounds.offset, bounds.fixed + a @ v + bounds.offset)
            ),
            "jac": lambda v: np.concatenate((-a, a)),
        },
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert (np.abs(a @ x + bounds.offset) <= bounds.fixed + 1e-8).all()
    cost = 0.5 * ((x - target) ** 2).sum()
    assert cost == pytest.approx(twin.fun, rel=1e-6)
    np.testing.assert_allclose(x, twin.x, atol=1e-3)  # the root of the accuracy of the cost


@pytest.mark.parametrize("seed", range(8))
def test_least_scale_agrees_with_a_linear_program(seed):
    _, _, bounds = random_task(seed)
    bounds = bounds._replace(rows=bounds.rows[:, 1:], fixed=np.zeros(len(bounds.fixed)))
    a, g = bounds.rows.toarray(), bounds.growing[:, None]
    twin = optimize.linprog(
        np.append(np.zeros(a.shape[1]), 1.0),
        A_ub=np.block([[a, -g], [-a, -g]]),
        b_ub=np.concatenate((-bounds.offset, bounds.offset)),
        bounds=(None, None),
    )
    assert least_scale(bounds, enough=0.0) == pytest.approx(twin.fun, rel=1e-6)  # theirs 1e-7
    assert least_scale(bounds, enough=2.0 * twin.fun) <= 2.0 * twin.fun


def test_bounds_that_nothing_keeps_have_no_answer():
    rows, target, bounds = random_task(0)
    apart = bounds._replace(
        rows=sparse.csr_array(sparse.vstack((bounds.rows, bounds.rows))),
        offset=np.concatenate((bounds.offset, bounds.offset + 10.0)),
        fixed=np.concatenate((bounds.fixed, bounds.fixed)),
        growing=np.concatenate((bounds.growing, bounds.growing)),
    )
    assert least_squares(rows, target, apart) is None


def test_bounds_that_do_not_bind_cost_nothing():
    rows, target, bounds = random_task(1)
    wide = bounds._replace(fixed=np.full(len(bounds.fixed), 1e3))
    np.testing.assert_allclose(least_squares(rows, target, wide), target, atol=1e-12)
