"""Compiled problems and the solve method, used by several threads at once."""

import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import cvxpy as cp
import numpy as np
import pytest

import solvers
from solvers import registry

THREADS = 8


@pytest.fixture(autouse=True)
def _switching():
    """Switch threads as often as can be."""
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(interval)


def model():
    random = np.random.default_rng(0)
    x, b = cp.Variable(12, name="x"), cp.Parameter(12, name="b")
    rows = random.normal(size=(20, 12))
    problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(x) - b @ x), [rows @ x <= 1])
    return problem, [5 * random.normal(size=12) for _ in range(100)]


def at_once(function, arguments):
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(function, arguments))


@pytest.mark.parametrize("polish", [False, True])
def test_each_call_gets_the_answer_to_its_own_values(backend, polish):
    problem, wishes = model()
    compiled = solvers.compile(problem, backend, polish=polish)
    alone = [compiled.solve(b=wish) for wish in wishes]
    for one, other in zip(alone, at_once(lambda wish: compiled.solve(b=wish), wishes), strict=True):
        np.testing.assert_array_equal(other.primal["x"], one.primal["x"])
        np.testing.assert_array_equal(other.dual[0], one.dual[0])
        assert (other.status, other.iterations, other.objective) == (one.status, one.iterations, one.objective)
        assert other.primal_residual == one.primal_residual


@pytest.mark.parametrize("backend", [name for name in solvers.able("warm_starts")])
def test_warm_starts_begin_at_whole_answers(backend):
    problem, wishes = model()
    compiled = solvers.compile(problem, backend, warm_start=True)
    cold = solvers.compile(problem, backend)
    for wish, solution in zip(wishes, at_once(lambda wish: compiled.solve(b=wish), wishes), strict=True):
        assert solution.ok
        np.testing.assert_allclose(solution.primal["x"], cold.solve(b=wish).primal["x"], atol=1e-4)


def test_a_call_that_raises_lets_the_next_one_in():
    problem, wishes = model()
    compiled = solvers.compile(problem, "daqp")

    def ask(number):
        if number % 2:
            with pytest.raises(solvers.ParameterError, match="has shape"):
                compiled.solve(b=np.zeros(3))
            return True
        return compiled.solve(b=wishes[number]).ok

    assert all(at_once(ask, range(50)))


def test_no_two_threads_are_inside_a_backend():
    inside, most = [], []

    class Watched(registry.factory("daqp")):
        def update(self):
            inside.append(threading.get_ident())
            time.sleep(1e-3)  # long enough for every other thread to come in
            super().update()

        def solve(self):
            most.append(len(inside))
            answer = super().solve()
            inside.clear()
            return answer

    solvers.register("watched", Watched)
    try:
        problem, wishes = model()
        compiled = solvers.compile(problem, "watched")
        at_once(lambda wish: compiled.solve(b=wish), wishes[:20])
    finally:
        solvers.unregister("watched")
    assert most == [1] * 20


def test_threads_solve_problems_of_their_own_by_the_method(monkeypatch):
    monkeypatch.setattr(cp.Problem, "REGISTERED_SOLVE_METHODS", dict(cp.Problem.REGISTERED_SOLVE_METHODS))
    solvers.register_solve_method()

    def solve(number):
        problem, wishes = model()
        b, x = problem.parameters()[0], problem.variables()[0]
        found = []
        for wish in wishes[number :: 2 * THREADS]:
            b.value = wish
            value = problem.solve(method="compiled", backend="daqp")
            found.append((wish, value, x.value))
        return found

    problem, _ = model()
    compiled = solvers.compile(problem, "daqp")
    for found in at_once(solve, range(THREADS)):
        for wish, value, x in found:
            np.testing.assert_array_equal(x, compiled.solve(b=wish).primal["x"])
            assert value == pytest.approx(0.5 * x @ x - wish @ x)
