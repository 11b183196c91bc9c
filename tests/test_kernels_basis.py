"""The tables of the bases against slow twins: rationals, and `numpy.polynomial`."""

from fractions import Fraction
from math import comb, factorial

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from peakflight.kernels import basis, bernstein, layout
from peakflight.problem import DEGREES

pytestmark = pytest.mark.kernels

every_degree = pytest.mark.parametrize("degree", DEGREES)


def as_fractions(table):
    """The rationals that a table was rounded from; their denominators are known to be small."""
    exact = np.array([Fraction(float(x)).limit_denominator(10**6) for x in np.ravel(table)])
    np.testing.assert_array_equal(exact.astype(float), np.ravel(table))
    return exact.reshape(np.shape(table))


def derive(coefficients, order):
    """Coefficients of a derivative, by the rule of one power at a time."""
    for _ in range(order):
        coefficients = [j * c for j, c in enumerate(coefficients)][1:] or [Fraction(0)]
    return coefficients


def evaluate(coefficients, u):
    return sum((c * u**j for j, c in enumerate(coefficients)), Fraction(0))


def integral_of_product(a, b):
    """Over [0, 1]."""
    terms = [(x * y, i + j + 1) for i, x in enumerate(a) for j, y in enumerate(b)]
    return sum((value / power for value, power in terms), Fraction(0))


def end_data(coefficients):
    """End data with the start in the last row, from the definition at the top of the module."""
    degree = len(coefficients) - 1
    left, right = degree // 2 + 1, (degree + 1) // 2
    start, end = evaluate(coefficients, 0), evaluate(coefficients, 1)
    data = [end - start]
    data += [evaluate(derive(coefficients, s), 0) for s in range(1, left)]
    data += [evaluate(derive(coefficients, s), 1) for s in range(1, right)]
    return [*data, start]


def monomial_columns(degree):
    """Coefficients of every basis function, as rationals, out of the table."""
    return [list(column) for column in as_fractions(basis.to_monomials(degree)).T]


@every_degree
def test_end_data_have_as_many_numbers_as_the_polynomial(degree):
    left, right = basis.counts(degree)
    assert left + right == degree + 1
    assert left - right == (degree + 1) % 2
    orders = basis.row_orders(degree)
    assert orders.shape == (degree + 1,)
    assert sorted(orders) == sorted([*range(left), *range(right)])


@every_degree
def test_to_monomials_inverts_the_definition_of_end_data(degree):
    for row, column in enumerate(monomial_columns(degree)):
        assert end_data(column) == [Fraction(i == row) for i in range(degree + 1)]


@every_degree
def test_row_orders_say_how_rows_scale_with_time(degree):
    """Polynomial q(t) = p(t/h): its derivative of order o by time is the one by u over h^o."""
    coefficients = [Fraction(3 * j + 1, j + 2) for j in range(degree + 1)]
    slow = [c / 2**j for j, c in enumerate(coefficients)]  # h = 2, to be evaluated at t = 2
    orders = basis.row_orders(degree)
    left, right = degree // 2 + 1, (degree + 1) // 2
    expected = end_data(coefficients)
    by_time = [evaluate(slow, 2) - evaluate(slow, 0)]
    by_time += [evaluate(derive(slow, s), 0) for s in range(1, left)]
    by_time += [evaluate(derive(slow, s), 2) for s in range(1, right)]
    by_time += [evaluate(slow, 0)]
    assert [value * 2 ** int(o) for value, o in zip(by_time, orders, strict=True)] == expected


@every_degree
def test_end_rows_are_derivatives_at_both_ends(degree):
    table = as_fractions(basis.end_rows(degree))
    assert table.shape == (2, degree + 1, degree)
    for row, column in enumerate(monomial_columns(degree)[:degree]):
        for order in range(degree + 1):
            derived = derive(column, order)
            for u in (0, 1):
                expected = evaluate(derived, u) - (evaluate(column, 0) if order == 0 else 0)
                assert table[u, order, row] == expected


@every_degree
def test_energy_is_the_integral_of_the_squared_derivative(degree):
    columns = monomial_columns(degree)
    for order in range(degree + 1):
        derived = [derive(column, order) for column in columns]
        exact = [[float(integral_of_product(a, b)) for b in derived] for a in derived]
        # rounded once from rationals: not one bit may differ
        np.testing.assert_array_equal(basis.energy(degree, order), exact)


@every_degree
def test_energy_of_polynomials_of_low_degree_is_zero(degree):
    """The r-th derivative of u^j vanishes for j < r, and its energy is known for j = r."""
    for order in range(1, degree + 1):
        energy = basis.energy(degree, order)
        for power in range(order + 1):
            monomial = [Fraction(int(j == power)) for j in range(degree + 1)]
            y = np.array([float(value) for value in end_data(monomial)])
            expected = float(factorial(order)) ** 2 if power == order else 0.0
            # sums of terms of size up to max|M| |y|^2 that cancel
            size = np.abs(energy).max() * max(np.abs(y).sum() ** 2, 1.0)
            assert abs(y @ energy @ y - expected) <= 1e-14 * size


@every_degree
@pytest.mark.parametrize("count", [8, 64])
def test_sample_tables_are_derivatives_at_even_points(degree, count):
    tables = basis.sample_tables(degree, count)
    assert tables.shape == (degree, 4, count)
    assert tables.flags.c_contiguous
    assert tables.dtype == float
    u = np.arange(count) / (count - 1)
    for row in range(degree):
        polynomial = Polynomial(basis.to_monomials(degree)[:, row])
        for order in range(1, 5):
            derived = polynomial.deriv(order)
            # both sum the same terms in other orders: a few roundings of the largest of them
            size = np.abs(derived.coef).sum() + 1e-300
            np.testing.assert_allclose(
                tables[row, order - 1], derived(u), rtol=0, atol=1e-14 * size
            )


@every_degree
def test_full_end_data_fold_into_those_with_the_start_last(degree):
    """What `make_cost` and `make_layout` hand to the general kernel, from the definition."""
    coefficients = [Fraction(2 * j - 3, j + 1) for j in range(degree + 1)]
    left, right = degree // 2 + 1, (degree + 1) // 2
    full = [evaluate(derive(coefficients, s), 0) for s in range(left)]
    full += [evaluate(derive(coefficients, s), 1) for s in range(right)]
    full = np.array([float(x) for x in full])
    weights = tuple(float(s % 3) for s in range(degree + 1))
    cost = layout.make_cost(degree, weights)
    assert {int(s): w for s, w in zip(cost.orders, cost.weights, strict=True)} == {
        s: w for s, w in enumerate(weights) if w > 0.0
    }
    for order, energy in zip(cost.orders, cost.energies, strict=True):
        derived = derive(coefficients, order)
        expected = float(integral_of_product(derived, derived))
        size = np.abs(full) @ np.abs(energy) @ np.abs(full)
        assert abs(full @ energy @ full - expected) <= 1e-14 * size
    rows = layout.make_layout(degree, 2, np.zeros((3, degree, 1))).ends
    for order in range(1, degree + 1):
        for u in (0, 1):
            size = np.abs(rows[u, order]) @ np.abs(full)
            expected = float(evaluate(derive(coefficients, order), u))
            assert abs(rows[u, order] @ full - expected) <= 1e-14 * size


@every_degree
def test_bernstein_tables_convert_and_multiply(degree):
    convert, product = bernstein.bernstein_tables(degree)

    def basis_function(n, i):
        return [
            Fraction((-1) ** (j - i) * comb(n, j) * comb(j, i)) if j >= i else Fraction(0)
            for j in range(n + 1)
        ]

    for n in range(degree + 1):
        for power in range(n + 1):  # u^power from control points convert[n, :, power]
            points = [Fraction(float(x)).limit_denominator(10**6) for x in convert[n, :, power]]
            columns = [basis_function(n, i) for i in range(n + 1)]
            total = [sum(p * c[j] for p, c in zip(points, columns, strict=False))
                     for j in range(n + 1)]  # fmt: skip
            assert total == [Fraction(j == power) for j in range(n + 1)]
        for i in range(n + 1):
            for j in range(n + 1):
                exact = Fraction(comb(n, i) * comb(n, j), comb(2 * n, i + j))
                assert product[n, i, j] == float(exact)
    for table in (convert, product):  # nothing beyond the triangle that kernels read
        for n in range(degree):
            assert not table[n, n + 1 :].any()
            assert not table[n, :, n + 1 :].any()


@every_degree
def test_falling_factorials_are_the_factors_of_derivatives(degree):
    table = bernstein.falling_factorials(degree)
    assert table.shape == (max(degree, 4) + 1, degree + 1)
    for power in range(degree + 1):
        monomial = Polynomial([0] * power + [1])
        for order in range(len(table)):
            assert table[order, power] == (monomial.deriv(order)(1) if order else 1)


def test_falling_factorials_reach_snap_at_low_degrees():
    np.testing.assert_array_equal(bernstein.falling_factorials(1), [[1, 1], [0, 1]] + [[0, 0]] * 3)
