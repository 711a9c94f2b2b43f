"""The residuals are what their docstring says."""

import math

import numpy as np
import pytest
from known_projections import known

import solvers
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
