"""The active-set polish finds the answer from a rough guess, and never makes one worse."""

import cvxpy as cp
import numpy as np
import pytest
from known_projections import SOLVABLE
from test_solvers_backends import random_projection

import solvers
from solvers.polish import Polish, _System


def natural_residual(program, x, y):
    return _System(program).natural_residual(x, y)


@pytest.mark.parametrize("noise", [1e-8, 1e-5, 1e-3])
def test_a_perturbed_answer_is_restored(noise):
    random = np.random.default_rng(0)
    for _ in range(20):
        problem = random_projection(random)
        compiled = solvers.compile(problem.model(), "daqp")
        solution = compiled.solve(**problem.values())
        impulse, reaction = solution.dual
        y = np.concatenate((reaction, impulse)) + noise * random.normal(size=impulse.size + reaction.size)
        x = solution.primal["velocity"] + noise * random.normal(size=problem.linear.size)
        better = Polish(compiled.program).improve(x, np.where(np.arange(y.size) < reaction.size, y, np.abs(y)))
        assert better is not None
        np.testing.assert_allclose(better[0], solution.primal["velocity"], rtol=0, atol=1e-13)
        assert natural_residual(compiled.program, *better) <= 1e-14


def test_a_far_guess_is_never_made_worse():
    random = np.random.default_rng(1)
    accepted = 0
    for _ in range(50):
        problem = random_projection(random)
        compiled = solvers.compile(problem.model(), "daqp")
        compiled.solve(**problem.values())
        program = compiled.program
        x, y = random.normal(size=program.variables), np.abs(random.normal(size=program.rows))
        better = Polish(program).improve(x, y)
        if better is not None:
            accepted += 1
            assert natural_residual(program, *better) < natural_residual(program, x, y)
    assert accepted > 25


def test_inputs_are_left_alone():
    problem = next(problem for problem in SOLVABLE if problem.name == "redundant rows")
    compiled = solvers.compile(problem.model(), "clarabel")
    compiled.solve(**problem.values())
    x, y = np.array([1.0, 1e-9]), np.array([0.3, 0.3, 0.2, 1e-9])
    kept = x.copy(), y.copy()
    assert Polish(compiled.program).improve(x, y) is not None
    np.testing.assert_array_equal(x, kept[0])
    np.testing.assert_array_equal(y, kept[1])


def test_multipliers_of_dependent_rows_do_not_pull():
    problem = next(problem for problem in SOLVABLE if problem.name == "rank-deficient gradients")
    compiled = solvers.compile(problem.model(), "clarabel", polish=True)
    # with this wish the multipliers of least norm have both signs, and others do not
    values = problem.values() | {"linear": np.array([-1.0, 3.0, -2.0])}
    solution = compiled.solve(**values)
    assert solution.ok
    assert solution.dual[0].min() >= 0.0
    assert natural_residual(compiled.program, solution.primal["velocity"], solution.dual[0]) <= 1e-14


@pytest.mark.parametrize("noise", [1e-10, 1e-7, 1e-4])
def test_a_sparse_program_is_polished_like_a_dense_one(noise, monkeypatch):
    random = np.random.default_rng(4)
    n, rows, equations = 90, 60, 20
    matrix = np.zeros((rows + equations, n))
    for row in matrix:
        row[random.choice(n, 4, replace=False)] = random.normal(size=4)
    matrix[rows + 10 :] = matrix[rows : rows + 10]  # repeated equations
    row, column = np.nonzero(matrix)
    split = np.searchsorted(row, rows)
    v = cp.Variable(n, name="velocity")
    gradients = cp.Parameter((rows, n), sparsity=(row[:split], column[:split]), name="gradients")
    tangents = cp.Parameter((equations, n), sparsity=(row[split:] - rows, column[split:]), name="tangents")
    bounds = cp.Parameter(rows, name="bounds")
    objective = 0.5 * cp.sum_squares(v) + cp.Parameter(n, name="linear") @ v
    compiled = solvers.compile(cp.Problem(cp.Minimize(objective), [gradients @ v >= bounds, tangents @ v == 0]), "piqp")
    values = {"gradients": matrix[:rows], "tangents": matrix[rows:], "linear": random.normal(size=n)}
    solution = compiled.solve(**values, bounds=-0.1 * random.uniform(size=rows))
    assert solution.ok
    program = compiled.program
    x = solution.primal["velocity"] + noise * random.normal(size=n)
    y = np.concatenate((solution.dual[1], solution.dual[0])) * (1.0 + noise * random.normal(size=rows + equations))
    better = Polish(program).improve(x, y)
    assert natural_residual(program, *better) <= 1e-14
    monkeypatch.setattr("solvers.polish.FILLED", 0.0)
    dense = Polish(program).improve(x, y)
    np.testing.assert_allclose(better[0], dense[0], rtol=0, atol=1e-13)
