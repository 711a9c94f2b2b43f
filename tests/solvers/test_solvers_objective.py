"""The objective of a Solution is that of the problem as it was written."""

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from known_projections import INFEASIBLE, SOLVABLE

import solvers

NUMBERS = st.floats(-4.0, 4.0)


def value_at(problem, solution):
    """Evaluate cvxpy's expression at the recovered point."""
    for variable in problem.variables():
        variable.value = solution.primal[variable.name()]
    return problem.objective.value


@pytest.mark.parametrize("problem", SOLVABLE, ids=lambda problem: problem.name)
@pytest.mark.parametrize("polish", [False, True])
def test_it_is_that_of_the_known_answer(backend, storage, problem, polish):
    values = problem.values()
    solution = solvers.compile(problem.model(), backend, polish=polish).solve(**values)
    x = solution.primal["velocity"]
    expected = 0.5 * x @ problem.metric @ x + problem.linear @ x
    assert solution.objective == pytest.approx(expected, rel=1e-14, abs=1e-14)


@given(
    sense=st.sampled_from([cp.Minimize, cp.Maximize]),
    wish=arrays.arrays(float, 3, elements=NUMBERS),
    constant=NUMBERS,
    shift=NUMBERS,
)
@settings(max_examples=30, deadline=None, derandomize=True)
def test_constants_and_the_sense_count(sense, wish, constant, shift):
    """Constants of the model and of Parameters; squares have auxiliary variables, accurate to the residuals."""
    x, y = cp.Variable(3, name="x"), cp.Variable(name="y")
    target, offset = cp.Parameter(3, name="target"), cp.Parameter(name="offset")
    curved = cp.sum_squares(x - 1) + cp.square(y - 2 * offset) - target @ x + 2 * offset + shift
    problem = cp.Problem(sense(curved if sense is cp.Minimize else 3 - 2 * curved), [x <= 1, y >= -1])
    compiled = solvers.compile(problem, "daqp")
    for scale in (1.0, -2.0):
        target.value, offset.value = scale * wish, scale * constant
        solution = compiled.solve(target=target.value, offset=offset.value)
        assert solution.objective == pytest.approx(value_at(problem, solution), rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("sense", [cp.Minimize, cp.Maximize])
def test_auxiliary_variables_are_as_accurate_as_the_residuals(sense):
    x = cp.Variable(3, name="x")
    expression = cp.norm1(x - np.array([1.0, -2.0, 3.0])) + cp.max(x) + 5
    problem = cp.Problem(sense(expression if sense is cp.Minimize else -expression), [cp.sum(x) == 1])
    solution = solvers.compile(problem, "clarabel").solve()
    assert solution.ok
    assert solution.objective == pytest.approx(value_at(problem, solution), abs=1e-7)


def test_there_is_none_without_an_answer():
    problem = INFEASIBLE[0]
    assert np.isnan(solvers.compile(problem.model(), "daqp").solve(**problem.values()).objective)


def test_a_parameter_of_the_constant_has_to_be_given():
    x, offset = cp.Variable(name="x"), cp.Parameter(name="offset")
    compiled = solvers.compile(cp.Problem(cp.Minimize(cp.square(x) + offset)), "daqp")
    with pytest.raises(solvers.ParameterError, match="'offset' was never given"):
        compiled.solve()
    assert compiled.solve(offset=3.0).objective == 3.0
