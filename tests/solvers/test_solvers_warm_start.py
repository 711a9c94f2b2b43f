"""A warm start changes how long a solve takes, not what it finds."""

import numpy as np
import pytest
from known_projections import SOLVABLE
from test_solvers_backends import random_projection

import solvers

WARM = pytest.mark.parametrize("backend", solvers.able("warm_starts"))


@WARM
@pytest.mark.parametrize("problem", SOLVABLE, ids=lambda problem: problem.name)
def test_beginning_at_the_answer_takes_no_more_iterations(problem, backend, storage):
    compiled = solvers.compile(problem.model(), backend, polish=True, warm_start=True)
    first, second = (compiled.solve(**problem.values()) for _ in range(2))
    assert first.ok
    assert second.ok
    assert second.iterations <= first.iterations
    np.testing.assert_allclose(second.primal["velocity"], problem.velocity, rtol=0, atol=1e-14)


@WARM
def test_answers_from_afar_agree(backend):
    random = np.random.default_rng(0)
    first = random_projection(random)
    compiled = solvers.compile(first.model(), backend, polish=True, warm_start=True)
    for _ in range(8):
        # The metric is the first problem's: only numbers that are Parameters change.
        values = random_projection(random).values()
        warm = compiled.solve(**values)
        cold = solvers.compile(first.model(), backend, polish=True).solve(**values)
        assert warm.ok
        np.testing.assert_allclose(warm.primal["velocity"], cold.primal["velocity"], rtol=0, atol=1e-9)


@WARM
def test_nothing_begins_at_what_was_no_answer(backend):
    """After an infeasible program the next solve is that of a new object, bit for bit."""
    problem = random_projection(np.random.default_rng(1))
    values = problem.values()
    impossible = values | {"gradients": np.vstack((np.eye(6)[0], -np.eye(6)[0], np.zeros((3, 6))))}
    impossible["bounds"] = np.array([1.0, 1.0, -1.0, -1.0, -1.0])
    compiled = solvers.compile(problem.model(), backend, warm_start=True)
    compiled.solve(**values)
    assert not compiled.solve(**impossible).ok
    fresh = solvers.compile(problem.model(), backend).solve(**values)
    np.testing.assert_array_equal(compiled.solve(**values).primal["velocity"], fresh.primal["velocity"])


def test_an_answer_is_its_callers():
    problem = random_projection(np.random.default_rng(2))
    answers = []
    for _ in range(2):
        compiled = solvers.compile(problem.model(), "osqp", warm_start=True)
        found = compiled.solve(**problem.values()).primal["velocity"]
        if answers:
            found[:] = 1e3
        answers.append(compiled.solve(**problem.values()).primal["velocity"])
    np.testing.assert_array_equal(*answers)


@pytest.mark.parametrize("backend", ["native", "auto", "daqp", "piqp", "cvxpy:OSQP"])
def test_backends_without_refuse(backend):
    with pytest.raises(solvers.SolverError, match=f"{backend} has no warm start; allowed with it: osqp, proxqp"):
        solvers.compile(SOLVABLE[0].model(), backend, warm_start=True)
