"""The residuals are what their docstring says."""

import math

import numpy as np
import pytest
from known_projections import known
from scipy import sparse

import solvers
from solvers.native_rows import residuals as native_residuals
from solvers.residuals import Residuals

SIZES = [(3, 0, 0), (3, 0, 2), (3, 2, 0), (2, 5, 1), (5, 1, 2), (4, 4, 0), (1, 1, 1)]


@pytest.mark.parametrize("parametric", [False, True])
@pytest.mark.parametrize("sizes", SIZES)
def test_definition(sizes, parametric, storage):
    n, m, k = sizes
    random = np.random.default_rng(0)
    for _ in range(5):
        problem = known(
            "any",
            random.uniform(1, 2, n),
            random.normal(size=n),
            random.normal(size=(m, n)),
            random.normal(size=m),
            random.normal(size=(k, n)),
            random.normal(size=k),
        )
        compiled = solvers.compile(problem.model(parametric), "daqp")
        compiled.solve(**problem.values(parametric))
        residuals = Residuals(compiled.program)
        x, y = random.normal(size=n), random.normal(size=m + k)
        worst = residuals.compute(x, y)

        P, q = problem.metric, problem.linear
        A, u = np.vstack((problem.equations, -problem.gradients)), np.concatenate((problem.targets, -problem.bounds))
        slack, inequality = u - A @ x, np.arange(m + k) >= k

        def largest(*arrays):
            return max(np.abs(array).max(initial=0.0) for array in arrays)

        violated = np.where(inequality, np.maximum(-slack, 0), slack)
        primal = largest(violated) / (1 + largest(A @ x, u))
        pull = largest(np.minimum(y[inequality], 0)[:, np.newaxis] * A[inequality])
        force = 1 + largest(P @ x, q, A.T @ y)
        stationarity = largest(P @ x + q + A.T @ y) / force
        dual = max(stationarity, pull / force)
        products = largest((y * slack)[inequality]) / (1 + max(abs(x @ P @ x), abs(q @ x)))
        apart = np.where(inequality, np.minimum(y, slack), slack)
        natural = max(stationarity, largest(apart) / (1 + largest(A @ x, u)))
        assert residuals.primal == pytest.approx(primal, rel=1e-12)
        assert residuals.dual == pytest.approx(dual, rel=1e-12)
        assert residuals.complementarity == pytest.approx(products, rel=1e-12)
        assert residuals.natural == pytest.approx(natural, rel=1e-12)
        assert worst == max(residuals.primal, residuals.dual, residuals.complementarity)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("sizes", SIZES)
def test_nan_never_passes(sizes, bad, storage):
    n, m, k = sizes
    problem = known("any", np.ones(n), np.ones(n), np.zeros((m, n)), -np.ones(m), np.zeros((k, n)), np.zeros(k))
    compiled = solvers.compile(problem.model(), "clarabel")
    compiled.solve(**problem.values())
    residuals = Residuals(compiled.program)
    for spoil in range(n + m + k):
        answer = np.zeros(n + m + k)
        answer[spoil] = bad
        assert math.isnan(residuals.compute(answer[:n], answer[n:]))


@pytest.mark.parametrize("sizes", [(3, 4, 0), (5, 0, 2), (6, 5, 3)], ids=str)
def test_the_native_solver_measures_by_the_same_definition(sizes):
    """At points that solve nothing, where every term counts: P = I, q = -wish, A = -R, u = -bounds."""
    n, inequalities, equalities = sizes
    rows = inequalities + equalities
    for seed in range(40):
        random = np.random.default_rng(seed)
        R, bounds = random.normal(size=(rows, n)) * (random.random((rows, n)) < 0.7), random.normal(size=rows)
        wish, z = (random.normal(size=n) * 10.0 ** random.uniform(-3, 3) for _ in range(2))
        y = random.normal(size=rows) * 10.0 ** random.uniform(-3, 3)
        stored = sparse.csr_array(R)
        numbers = (stored.indptr.astype(np.int64), stored.indices.astype(np.int64), stored.data)
        found = native_residuals(*numbers, bounds, equalities, wish, z, y)

        pull, slack = R.T @ y, R @ z - bounds
        force = 1.0 + np.abs(np.concatenate((z, wish, pull))).max()
        worst = np.abs(z - wish - pull).max()
        if inequalities:
            worst = max(worst, (np.maximum(-y, 0.0)[equalities:, None] * np.abs(R[equalities:])).max())
        short = np.concatenate((np.abs(slack[:equalities]), np.maximum(-slack[equalities:], 0.0)))
        product = np.abs(y * slack)[equalities:].max(initial=0.0)
        expected = (
            short.max() / (1.0 + max(np.abs(R @ z).max(), np.abs(bounds).max())),
            worst / force,
            product / (1.0 + max(z @ z, abs(z @ wish))),
        )
        np.testing.assert_allclose(found, expected, rtol=1e-12)
