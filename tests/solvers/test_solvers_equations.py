"""Projection onto the solutions of equations: the answers of the active-set method and of numpy, or none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_projections import unit
from scipy import sparse

from solvers.native import project, residuals
from solvers.native_equations import INDEPENDENT, project_onto

EPSILON = np.finfo(float).eps


def by_rows(rows):
    matrix = sparse.csr_array(rows)
    return matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), matrix.data.astype(float)


def solve(rows, bounds, wish, equalities=None):
    """The residual, z and y."""
    bounds, wish = np.asarray(bounds, dtype=float), np.asarray(wish, dtype=float)
    equalities = len(bounds) if equalities is None else equalities
    z, y = np.full(len(wish), np.nan), np.full(len(bounds), np.nan)
    return project_onto(*by_rows(rows), bounds, equalities, wish, z, y), z, y


def general(rows, bounds, wish, equalities=None):
    """The same by the active-set method."""
    bounds, wish = np.asarray(bounds, dtype=float), np.asarray(wish, dtype=float)
    data = (*by_rows(rows), bounds, len(bounds) if equalities is None else equalities, wish)
    z, y = np.empty(len(wish)), np.empty(len(bounds))
    status, _ = project(*data, 1e-9, 10**6, 10_000, z, y)
    return status, z, y, max(residuals(*data, z, y))


def rods(random, m):
    """Rows of a chain of m rods in the plane, each on two bodies, in any order."""
    rows = np.zeros((m, 2 * (m + 1)))
    for i, direction in enumerate(unit(random.normal(size=(m, 2)))):
        rows[i, 2 * i : 2 * i + 2], rows[i, 2 * i + 2 : 2 * i + 4] = direction, -direction
    return unit(random.permutation(rows) / np.sqrt(random.uniform(0.5, 2.0, 2 * (m + 1))))


def dense(random, m):
    return unit(random.normal(size=(m, m + int(random.integers(2, 9)))))


def largest_angle(rows):
    """Square of the smallest part of a unit row outside the span of those before it."""
    return np.min(np.abs(np.diag(np.linalg.qr(rows.T)[1])) ** 2)


@pytest.mark.parametrize("make", [dense, rods])
@pytest.mark.parametrize("m", [1, 2, 3, 5, 12, 40])
def test_the_answer_is_that_of_numpy_and_of_the_active_set_method(make, m):
    random, answered = np.random.default_rng(m), 0
    for _ in range(100):
        rows = make(random, m)
        wish, bounds = random.normal(size=rows.shape[1]), random.normal(size=m)
        residual, z, y = solve(rows, bounds, wish)
        if np.isnan(residual):
            assert largest_angle(rows) < 10.0 * INDEPENDENT
            continue
        answered += 1
        size = 1.0 + np.abs(y).max()
        condition = np.linalg.cond(rows)
        multipliers = np.linalg.lstsq(rows.T, z - wish, rcond=None)[0]
        np.testing.assert_allclose(y, multipliers, rtol=0, atol=64 * EPSILON * condition * size)
        np.testing.assert_allclose(rows @ z, bounds, rtol=0, atol=64 * EPSILON * size)
        np.testing.assert_allclose(
            z, wish + np.linalg.pinv(rows) @ (bounds - rows @ wish), rtol=0, atol=64 * EPSILON * condition * size
        )
        status, other, others, worst = general(rows, bounds, wish)
        assert status == 0
        np.testing.assert_allclose(z, other, rtol=0, atol=64 * EPSILON * condition * size)
        np.testing.assert_allclose(y, others, rtol=0, atol=64 * EPSILON * condition**2 * size)
        assert residual <= max(worst, 16 * EPSILON * size)
    assert answered >= 95


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-4])
def test_rows_that_nearly_depend_on_each_other_are_declined(angle):
    random = np.random.default_rng(0)
    for m in (2, 3, 8):
        for _ in range(20):
            rows = dense(random, m)
            rows[-1] = unit((random.normal(size=m - 1) @ rows[:-1])[None])[0]
            rows[-1] += angle * np.linalg.qr(rows.T)[0][:, -1]
            assert np.isnan(solve(rows, rows @ random.normal(size=rows.shape[1]), random.normal(size=rows.shape[1]))[0])


@pytest.mark.parametrize("angle", [1e-2, 2e-3])
def test_rows_that_make_a_small_angle_have_an_answer_to_rounding(angle):
    """The error of the factor, as large as rounding over the squared angle, is gone."""
    random = np.random.default_rng(0)
    for _ in range(200):
        first, second = np.linalg.qr(random.normal(size=(5, 2)))[0].T
        rows = np.vstack((first, np.cos(angle) * first + np.sin(angle) * second))
        inside, wish = random.normal(size=5), random.normal(size=5)
        residual, z, y = solve(rows, rows @ inside, wish)
        assert residual <= 64 * EPSILON * max(1.0, np.abs(y).max())
        assert np.abs(rows @ z - rows @ inside).max() <= 64 * EPSILON * (1.0 + np.abs(rows @ inside).max())
        known = wish + np.vstack((first, second)).T @ (np.vstack((first, second)) @ (inside - wish))
        np.testing.assert_allclose(z, known, rtol=0, atol=64 * EPSILON / angle)


def test_an_answer_that_misses_rows_is_declined():
    """Each row leaves those before it by a large angle, and yet all together they nearly depend on each other."""
    m = 24
    rows = unit(np.eye(m) - np.tril(np.ones((m, m)), -1))
    assert largest_angle(rows) > 1e4 * INDEPENDENT
    assert np.linalg.cond(rows) > 1e7
    residual, z, _ = solve(rows, np.ones(m), np.zeros(m))
    assert np.isnan(residual)
    assert np.abs(rows @ z - 1.0).max() > 1e-9
    status, _, _, worst = general(rows, np.ones(m), np.zeros(m))
    assert status == 0
    assert worst <= 1e-9


@pytest.mark.parametrize("place", [0, 2, 4])
def test_rows_that_vanish_are_declined(place):
    random = np.random.default_rng(0)
    rows = dense(random, 5)
    rows[place] = 0.0
    assert np.isnan(solve(rows, np.zeros(5), random.normal(size=rows.shape[1]))[0])
    assert np.isnan(solve(np.zeros((1, 3)), [0.0], np.ones(3))[0])
    assert np.isnan(solve(np.zeros((1, 3)), [1.0], np.ones(3))[0])


def test_more_rows_than_unknowns_are_declined():
    rows = unit(np.random.default_rng(0).normal(size=(4, 3)))
    assert np.isnan(solve(rows, rows @ np.ones(3), np.zeros(3))[0])


@pytest.mark.parametrize("m", [1, 3])
def test_inequalities_are_answered_where_all_press(m):
    random, pressing = np.random.default_rng(0), 0
    for _ in range(200):
        rows = dense(random, m)
        bounds, wish = random.normal(size=m), random.normal(size=rows.shape[1])
        residual, z, y = solve(rows, bounds, wish, equalities=m - 1)
        _, other, others, _ = general(rows, bounds, wish, equalities=m - 1)
        if others[-1] > 0.0:
            pressing += 1
            np.testing.assert_allclose(z, other, rtol=0, atol=1e-12)
            assert y[-1] >= 0.0
        else:
            assert np.isnan(residual)
    assert 50 <= pressing <= 150


@pytest.mark.parametrize("m", [1, 3])
def test_a_multiplier_that_is_negative_by_rounding_is_negative(m):
    wish = np.ones(4)
    for bound, answered in ((1.0 - EPSILON, False), (1.0, True), (1.0 + EPSILON, True)):
        residual = solve(np.eye(m, 4), [*np.full(m - 1, 2.0), bound], wish, equalities=m - 1)[0]
        assert np.isnan(residual) != answered


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_any_small_problem_has_the_answer_of_the_active_set_method_or_none(data):
    m, n = data.draw(st.integers(0, 4)), data.draw(st.integers(1, 4))
    number = st.sampled_from([0.0, 0.0, 1.0, -1.0, 0.5, -1.0 / 3.0, 1e-3, 1e-9])
    rows = np.array(data.draw(st.lists(number, min_size=m * n, max_size=m * n))).reshape(m, n)
    bounds = np.array(data.draw(st.lists(number, min_size=m, max_size=m)))
    wish = np.array(data.draw(st.lists(number, min_size=n, max_size=n)))
    residual, z, y = solve(rows, bounds, wish)
    independent = m == 0 or np.linalg.matrix_rank(rows) == m
    if np.isnan(residual):
        assert not independent or np.linalg.cond(rows) > 10.0
        return
    assert independent
    status, other, _, _ = general(rows, bounds, wish)
    assert status == 0
    np.testing.assert_allclose(z, other, rtol=0, atol=1e-9 * (1.0 + np.abs(y).max(initial=0.0)))
    np.testing.assert_allclose(z - wish, rows.T @ y, rtol=0, atol=64 * EPSILON * (1.0 + np.abs(y).max(initial=0.0)))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("m", [1, 2])
def test_numbers_that_are_not_finite_have_no_answer(bad, m):
    for place in range(3):
        for entry in (0, -1):
            data = [np.eye(m, 3), np.ones(m), np.zeros(3)]
            data[place].flat[entry] = bad
            assert np.isnan(solve(*data)[0])


def test_columns_may_be_in_any_order():
    random = np.random.default_rng(0)
    for m in (1, 6):
        rows = dense(random, m)
        bounds, wish = random.normal(size=m), random.normal(size=rows.shape[1])
        start, column, value = by_rows(rows)
        backwards = np.concatenate([np.arange(start[i + 1] - 1, start[i] - 1, -1) for i in range(m)])
        z, y = np.empty(len(wish)), np.empty(m)
        project_onto(start, column[backwards], value[backwards], bounds, m, wish, z, y)
        np.testing.assert_allclose(z, solve(rows, bounds, wish)[1], rtol=0, atol=1e-14)
