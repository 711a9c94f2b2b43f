"""The compiled path offered to people who call problem.solve."""

import gc
import weakref

import cvxpy as cp
import numpy as np
import pytest
from known_projections import INFEASIBLE, SOLVABLE, UNBOUNDED

import solvers

PROBLEM = next(problem for problem in SOLVABLE if problem.name == "mixed")


@pytest.fixture(autouse=True)
def _method(monkeypatch):
    monkeypatch.setattr(cp.Problem, "REGISTERED_SOLVE_METHODS", dict(cp.Problem.REGISTERED_SOLVE_METHODS))
    solvers.register_solve_method()


def assign(model, problem):
    for parameter in model.parameters():
        parameter.value = problem.values()[parameter.name()]


def test_values_multipliers_and_status_are_written_back():
    model = PROBLEM.model()
    assign(model, PROBLEM)
    value = model.solve(method="compiled", backend="daqp")
    assert model.status == cp.OPTIMAL
    np.testing.assert_allclose(model.variables()[0].value, PROBLEM.velocity, atol=1e-14)
    np.testing.assert_allclose(model.constraints[0].dual_value, PROBLEM.impulse, atol=1e-14)
    np.testing.assert_allclose(model.constraints[1].dual_value, PROBLEM.reaction, atol=1e-14)
    assert value == model.value == model.objective.value == pytest.approx(0.5 * (0.75**2 + 0.25**2))


def test_the_problem_is_compiled_once(monkeypatch):
    model = PROBLEM.model()
    assign(model, PROBLEM)
    model.solve(method="compiled", backend="daqp")
    monkeypatch.setattr("solvers.method.compile", None)
    bounds = next(parameter for parameter in model.parameters() if parameter.name() == "bounds")
    bounds.value = np.array([0.875])
    model.solve(method="compiled", backend="daqp")
    np.testing.assert_allclose(model.variables()[0].value, [0.875, 0.125], atol=1e-14)


def test_maximization_has_its_own_sign():
    v, gain = cp.Variable(2, name="v"), cp.Parameter(2, name="gain", value=[1.0, 2.0])
    model = cp.Problem(cp.Maximize(gain @ v - cp.sum_squares(v)), [cp.sum(v) <= 0.5])
    expected = model.solve(solver="CLARABEL")
    dual = model.constraints[0].dual_value
    assert model.solve(method="compiled") == pytest.approx(expected, abs=1e-7)
    assert model.constraints[0].dual_value == pytest.approx(dual, abs=1e-6)


@pytest.mark.parametrize(
    ("problem", "status", "value"),
    [(INFEASIBLE[0], cp.INFEASIBLE, np.inf), (UNBOUNDED[0], cp.UNBOUNDED, -np.inf)],
)
def test_problems_without_answer(problem, status, value):
    model = problem.model()
    assign(model, problem)
    assert model.solve(method="compiled", backend="clarabel") == value
    assert model.status == status
    assert model.variables()[0].value is None


def test_failures_are_raised_as_cvxpy_does():
    model = PROBLEM.model()
    with pytest.raises(solvers.ParameterError, match="has no value"):
        model.solve(method="compiled")
    assign(model, PROBLEM)
    with pytest.raises(cp.SolverError, match="daqp ended with iteration_limit"):
        model.solve(method="compiled", backend="daqp", iter_limit=1)


def test_stats_are_those_of_the_solver_used():
    model = PROBLEM.model()
    assign(model, PROBLEM)
    model.solve(solver="CLARABEL")
    for backend in ("daqp", "osqp", "auto"):
        model.solve(method="compiled", backend=backend)
        stats, solution = model.solver_stats, model.solver_stats.extra_stats
        assert stats.solver_name == solution.backend == ("native" if backend == "auto" else backend)
        assert (stats.solve_time, stats.setup_time) == (solution.solve_time, solution.setup_time)
        assert stats.num_iters == solution.iterations
        assert stats.solve_time > 0.0
        assert model.value == pytest.approx(solution.objective, abs=1e-12)
    model.solve(solver="OSQP")
    assert model.solver_stats.solver_name == "OSQP"


@pytest.mark.parametrize("backend", ["auto", "daqp", "clarabel", "cvxpy:OSQP"])
def test_problems_are_freed_with_all_that_was_compiled(backend, monkeypatch):
    compiled = []

    def compile_and_look(*arguments, **keywords):
        found = solvers.compile(*arguments, **keywords)
        compiled.append(weakref.ref(found._map.theta))
        return found

    monkeypatch.setattr("solvers.method.compile", compile_and_look)
    problems = []
    for _ in range(3):
        model = PROBLEM.model()
        assign(model, PROBLEM)
        model.solve(method="compiled", backend=backend)
        problems.append(weakref.ref(model))
    del model
    gc.collect()
    assert [ref() for ref in (*problems, *compiled)] == [None] * 6
