"""The compiled projection: optimality to rounding, whatever the rows are."""

import cvxpy as cp
import daqp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_projections import KINDS, cone, feasible, general, rank_deficient, repeated, unit, whole_numbers
from scipy import sparse
from scipy.optimize import linprog

import solvers
from solvers import native_sparse
from solvers.native import project, residuals
from solvers.program import Matrix, QuadraticProgram
from solvers.residuals import Residuals

SOLVED, INFEASIBLE, ITERATION_LIMIT, TOO_LARGE, FAILED = range(5)
EPSILON = np.finfo(float).eps


def by_rows(rows):
    matrix = sparse.csr_array(rows)
    return matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), matrix.data.astype(float)


def solve(rows, bounds, equalities, wish, tolerance=1e-9, limit=10**6):
    """Status, z, y and the largest KKT residual."""
    data = (*by_rows(rows), np.asarray(bounds, dtype=float), equalities, np.asarray(wish, dtype=float))
    z, y = np.full(len(wish), np.nan), np.full(len(bounds), np.nan)
    status, iterations = project(*data, tolerance, limit, 10_000, z, y)
    assert iterations >= 0
    return status, z, y, max(residuals(*data, z, y))


def reference(rows, bounds, equalities, wish):
    """The answer of daqp; None if it finds no feasible point."""
    if not len(bounds):
        return wish
    sense = np.zeros(len(bounds), dtype=np.intc)
    sense[:equalities] = 5
    upper = np.where(sense == 5, bounds, 1e30)
    x, _, flag, _ = daqp.solve(np.eye(len(wish)), -wish, rows, upper, bounds, sense, primal_tol=1e-10, dual_tol=1e-11)
    assert flag in (1, -1, -6), flag
    return x if flag == 1 else None


def is_feasible(rows, bounds, equalities):
    """Whether a linear program finds a point."""
    e = equalities
    free = np.zeros(rows.shape[1])
    found = linprog(free, -rows[e:], -bounds[e:], rows[:e], bounds[:e], bounds=(None, None), method="highs")
    return found.status == 0


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_random_problems_are_solved_to_rounding(make):
    random = np.random.default_rng(0)
    solved = 0
    for _ in range(1000):
        rows, bounds, equalities, wish = make(random)
        status, z, y, worst = solve(rows, bounds, equalities, wish)
        expected = reference(rows, bounds, equalities, wish)
        assert status == (INFEASIBLE if expected is None else SOLVED)
        if status == SOLVED:
            solved += 1
            assert worst <= 1e-12
            assert worst <= 64 * EPSILON * (1.0 + np.abs(y).max(initial=0.0))
            assert y[equalities:].min(initial=0.0) >= 0.0
            np.testing.assert_allclose(z, expected, rtol=0, atol=1e-7)
    assert solved >= 500


@pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-8])
def test_nearly_parallel_rows(angle):
    """A wedge that opens by the angle: multipliers grow as its inverse, and residuals no more than they must."""
    random = np.random.default_rng(0)
    for _ in range(200):
        n = int(random.integers(2, 7))
        first, second = np.linalg.qr(random.normal(size=(n, 2)))[0].T
        rows = np.vstack((first, unit((angle * second + random.choice([-1.0, 1.0]) * first)[None])))
        wish = random.normal(size=n)
        for equalities in (0, 1, 2):
            for bounds in (np.zeros(2), rows @ random.normal(size=n)):
                status, z, y, worst = solve(rows, bounds, equalities, wish)
                assert status == SOLVED
                assert worst <= max(4 * EPSILON * (1.0 + np.abs(y).max()), 4e-9 if angle < 1e-7 else 0.0)
                assert (rows @ z - bounds)[equalities:].min(initial=0.0) >= -1e-8


def test_wedge_by_hand():
    status, z, y, _ = solve(np.array([[1.0, 0.0], [-1.0, 1e-6]]), np.zeros(2), 0, [0.0, -1.0])
    assert status == SOLVED
    np.testing.assert_allclose(z, 0.0, atol=1e-15)
    np.testing.assert_allclose(y, 1e6, rtol=1e-9)


def test_a_multiplier_that_vanishes_is_not_negative():
    """Not by rounding either."""
    rows = np.array([[1.0, 0.0, -1.0], [-1.0, 1.0, 0.0], [-1.0, 1.0, 1.0]])
    status, _, y, _ = solve(rows, np.zeros(3), 1, [2.0, -3.0, -2.0])
    assert status == SOLVED
    assert y[1:].min() >= 0.0
    np.testing.assert_allclose(y, [1.0, 0.0, 3.0], atol=1e-15)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_any_small_problem_ends_in_optimality_or_infeasibility(data):
    n, m = data.draw(st.integers(1, 4)), data.draw(st.integers(0, 7))
    equalities = data.draw(st.integers(0, m))
    number = st.sampled_from([0.0, 0.0, 1.0, -1.0, 2.0, 0.5, 3.0, -1.0 / 3.0, 1e-3])
    rows = np.array(data.draw(st.lists(number, min_size=m * n, max_size=m * n))).reshape(m, n)
    bounds = np.array(data.draw(st.lists(number, min_size=m, max_size=m)))
    wish = np.array(data.draw(st.lists(number, min_size=n, max_size=n)))
    status, _, y, worst = solve(rows, bounds, equalities, wish)
    assert status in (SOLVED, INFEASIBLE)
    if status == SOLVED:
        assert worst <= 64 * EPSILON * (1.0 + np.abs(y).max(initial=0.0))
    else:
        assert not is_feasible(rows, bounds, equalities)


def test_without_rows_and_without_violations_the_wish_is_the_answer():
    wish = np.array([1.0, -2.0, 3.0])
    for rows, bounds in (
        (np.zeros((0, 3)), np.zeros(0)),
        (np.eye(3), [-9.0, -9.0, 3.0]),
        (np.zeros((2, 3)), [-1.0, 0.0]),
    ):
        status, z, y, worst = solve(rows, bounds, 0, wish)
        assert (status, worst) == (SOLVED, 0.0)
        np.testing.assert_array_equal(z, wish)
        np.testing.assert_array_equal(y, 0.0)


@pytest.mark.parametrize(
    ("rows", "bounds", "equalities"),
    [
        ([[1, 0], [-1, 0]], [1, 0], 0),
        ([[1, 0], [1, 0]], [0, 1], 2),
        ([[1, 0], [1, 0]], [0, 1], 1),
        ([[0, 0]], [1], 0),
        ([[0, 0]], [-1], 1),
        ([[1, 0], [-1, 1], [-1, -1]], [0, 1, 1], 0),
        ([[1, 0], [-1, 0]], [0, 1e-6], 0),
    ],
)
def test_contradictions_are_recognized(rows, bounds, equalities):
    assert solve(np.array(rows, dtype=float), bounds, equalities, [0.5, -3.0])[0] == INFEASIBLE


def test_contradictions_of_dependent_rows_below_the_tolerance_are_none():
    rows = np.array([[1.0, 0.0], [-1.0, 0.0]])
    status, z, _, worst = solve(rows, [0.0, 1e-12], 0, [1.0, 2.0])
    assert status == SOLVED
    assert worst <= 1e-12
    np.testing.assert_allclose(z, [0.0, 2.0], atol=1e-12)


def chain(m, random):
    """Neighbours that keep their distance, of which a few are pressed together."""
    rows = sparse.diags_array([-np.ones(m), np.ones(m)], offsets=[0, 1], shape=(m, m + 1)) / np.sqrt(2.0)
    wish = np.arange(m + 1.0)
    pressed = random.choice(m, 40, replace=False)
    wish[pressed] += 1.5
    return sparse.csr_array(rows), np.zeros(m), wish


def test_many_rows_few_of_them_active():
    rows, bounds, wish = chain(20_000, np.random.default_rng(0))
    status, z, y, worst = solve(rows, bounds, 0, wish)
    assert status == SOLVED
    assert worst <= 1e-15
    assert 40 <= np.count_nonzero(y) <= 80
    assert (rows @ z).min() >= -1e-11
    few = solve(rows, bounds, 0, wish, limit=10)
    assert few[0] == TOO_LARGE


def test_all_rows_active_and_leaving_again():
    """Isotonic regression, whose blocks of equal values grow and merge."""
    random = np.random.default_rng(0)
    m = 150
    rows, bounds, _ = chain(m, random)
    status, _, _, worst = solve(rows, bounds, 0, random.normal(size=m + 1))
    assert status == SOLVED
    assert worst <= 1e-14
    falling = solve(rows, bounds, 0, -np.arange(m + 1.0))
    assert falling[0] == SOLVED
    np.testing.assert_allclose(falling[1], -m / 2, rtol=1e-12)


def test_limits():
    data = (*by_rows(np.eye(3)), np.ones(3), 0, np.zeros(3), 1e-9)
    z, y = np.empty(3), np.empty(3)
    assert project(*data, 3, 100, z, y) == (SOLVED, 3)
    assert project(*data, 2, 100, z, y)[0] == TOO_LARGE
    assert project(*data, 0, 100, z, y)[0] == TOO_LARGE
    assert project(*data, 3, 3, z, y) == (SOLVED, 3)
    assert project(*data, 3, 2, z, y) == (ITERATION_LIMIT, 2)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_never_called_solved_to_a_residual(bad):
    for place in range(3):
        data = [np.eye(2), np.ones(2), np.zeros(2)]
        data[place] = data[place].copy()
        data[place].flat[0] = bad
        rows, bounds, wish = data
        status, _, _, worst = solve(rows, bounds, 0, wish)
        assert status != SOLVED or np.isnan(worst)


def test_columns_may_be_in_any_order():
    random = np.random.default_rng(0)
    rows, bounds, equalities, wish = general(random)
    start, column, value = by_rows(rows)
    backwards = np.concatenate([np.arange(start[i + 1] - 1, start[i] - 1, -1) for i in range(len(bounds))])
    z, y = np.empty(len(wish)), np.empty(len(bounds))
    project(start, column[backwards], value[backwards], bounds, equalities, wish, 1e-9, 100, 100, z, y)
    np.testing.assert_allclose(z, solve(rows, bounds, equalities, wish)[1], atol=1e-14)


def test_the_same_bits_every_time():
    random = np.random.default_rng(0)
    problems = [make(random) for make in (cone, rank_deficient, whole_numbers) for _ in range(100)]
    first = [solve(*problem)[:3] for problem in problems]
    for problem, (status, z, y) in reversed(list(zip(problems, first, strict=True))):
        again = solve(*problem)
        assert again[0] == status
        np.testing.assert_array_equal(again[1], z)
        np.testing.assert_array_equal(again[2], y)


@pytest.mark.parametrize("exponent", [-90, 90])
def test_problems_of_another_size_have_the_same_answer_to_the_bit(exponent):
    random = np.random.default_rng(0)
    for make in (general, repeated, rank_deficient):
        for _ in range(50):
            rows, bounds, equalities, wish = make(random)
            status, z, y, _ = solve(rows, bounds, equalities, wish)
            other = solve(rows, np.ldexp(bounds, exponent), equalities, np.ldexp(wish, exponent))
            assert other[0] == status == SOLVED
            np.testing.assert_array_equal(other[1], np.ldexp(z, exponent))
            np.testing.assert_array_equal(other[2], np.ldexp(y, exponent))


def test_a_guess_that_does_not_settle_is_replaced(monkeypatch):
    """Of the sparse method; where only one set is tried, all rows are the right one to try."""
    rows, projection = sparse.csr_array(np.eye(3)), native_sparse.SparseProjection(warm_start=True)
    z, _, _, status = projection.project(rows, np.zeros(3), 0, np.ones(3))
    np.testing.assert_array_equal(z, 1.0)
    monkeypatch.setattr(native_sparse, "ROUNDS", 1)
    z, y, tried, status = projection.project(rows, np.zeros(3), 0, -np.ones(3))
    assert (status, tried) == (native_sparse.SOLVED, 2)
    np.testing.assert_allclose(z, 0.0, atol=1e-15)
    np.testing.assert_allclose(y, 1.0, rtol=1e-15)


def stored(dense):
    return Matrix(dense.shape, sparse.csc_array(np.ones(dense.shape)), np.ascontiguousarray(dense).ravel(), True, True)


def test_residuals_are_those_of_every_backend():
    random = np.random.default_rng(0)
    for make in (general, whole_numbers, rank_deficient):
        for _ in range(20):
            rows, bounds, equalities, wish = make(random)
            m, n = rows.shape
            z, y = random.normal(size=n), random.normal(size=m)
            lower = np.full(m, -np.inf)
            program = QuadraticProgram(n, m, equalities, stored(np.eye(n)), -wish, stored(-rows), lower, -bounds)
            known = Residuals(program)
            known.compute(z, y)
            found = residuals(*by_rows(rows), bounds, equalities, wish, z, y)
            np.testing.assert_allclose(
                found, (known.primal, known.dual, known.complementarity), rtol=1e-13, atol=4 * EPSILON
            )
            z[0] = np.nan
            assert np.isnan(residuals(*by_rows(rows), bounds, equalities, wish, z, y)).all()


@pytest.mark.parametrize("metric", ["diagonal", "full"])
def test_a_cvxpy_model_has_the_same_answer_as_with_daqp(metric, storage):
    random = np.random.default_rng(0)
    n, m = 6, 9
    root = random.normal(size=(n, n))
    P = np.diag(random.uniform(0.5, 2.0, n)) if metric == "diagonal" else root @ root.T + np.eye(n)
    v = cp.Variable(n, name="v")
    wish, rows, bounds = cp.Parameter(n, name="wish"), cp.Parameter((m, n), name="rows"), cp.Parameter(m, name="bounds")
    model = cp.Problem(
        cp.Minimize(0.5 * cp.quad_form(v, P) + wish @ v), [rows[2:] @ v >= bounds[2:], rows[:2] @ v == bounds[:2]]
    )
    native, daqp = (solvers.compile(model, name, tolerance=1e-12) for name in ("native", "daqp"))
    for _ in range(30):
        numbers = random.normal(size=(m, n))
        values = {"rows": numbers, "bounds": feasible(random, numbers, 2), "wish": 3.0 * random.normal(size=n)}
        mine, theirs = native.solve(**values), daqp.solve(**values)
        assert mine.ok, mine
        assert max(mine.primal_residual, mine.dual_residual, mine.complementarity) <= 1e-13
        np.testing.assert_allclose(mine.primal["v"], theirs.primal["v"], atol=1e-9)
        for one, other in zip(mine.dual, theirs.dual, strict=True):
            np.testing.assert_allclose(one, other, atol=1e-8)
