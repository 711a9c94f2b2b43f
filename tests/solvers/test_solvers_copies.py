"""Copies of compiled problems solve the numbers that they are given, in this process and in others."""

import copy
import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.lin_ops.lin_utils import ID_COUNTER
from known_projections import SOLVABLE

import solvers

COPIES = {
    "pickle": lambda compiled: pickle.loads(pickle.dumps(compiled)),
    "deepcopy": copy.deepcopy,
    "copy": copy.copy,
}
B = np.array([1.0, -1.0])


def model():
    """With auxiliary variables, whose numbering is cvxpy's."""
    x, b = cp.Variable(2, name="x"), cp.Parameter(2, name="b")
    return cp.Problem(cp.Minimize(cp.sum_squares(x - b) + cp.norm1(x)), [x >= 0])


def same(mine, theirs):
    np.testing.assert_array_equal(mine.primal["x"], theirs.primal["x"])
    np.testing.assert_array_equal(mine.dual[0], theirs.dual[0])
    assert mine.status is theirs.status


def solved_by(compiled, value):
    return compiled.solve(b=value)


@pytest.mark.parametrize("make", COPIES.values(), ids=COPIES.keys())
@pytest.mark.parametrize("solved_before", [False, True], ids=["fresh", "after cvxpy solved it"])
def test_a_copy_is_a_compiled_problem_of_its_own(make, solved_before):
    problem = model()
    if solved_before:
        problem.parameters()[0].value = B
        problem.solve(solver="CLARABEL")
    compiled = solvers.compile(problem, "daqp")
    compiled.solve(b=np.array([5.0, 5.0]))
    copied = make(compiled)
    np.testing.assert_array_equal(copied.solve().primal["x"], [4.5, 4.5])  # the values go with it
    same(copied.solve(b=B), compiled.solve(b=B))
    np.testing.assert_allclose(copied.solve(b=-B).primal["x"], [0.0, 0.5], atol=1e-9)
    np.testing.assert_array_equal(compiled.parameters["b"], B)  # and no longer with the original


@pytest.mark.parametrize("make", COPIES.values(), ids=COPIES.keys())
def test_copies_work_with_every_backend(make, backend):
    known = next(problem for problem in SOLVABLE if problem.name == "mixed")
    compiled = solvers.compile(known.model(), backend)
    found, expected = make(compiled).solve(**known.values()), compiled.solve(**known.values())
    assert found.ok
    np.testing.assert_array_equal(found.primal["velocity"], expected.primal["velocity"])


def test_a_copy_keeps_the_keywords_it_was_compiled_with():
    compiled = solvers.compile(model(), "osqp", 1e-6, polish=True, check_parameters=False, warm_start=True, max_iter=77)
    copied = pickle.loads(pickle.dumps(compiled))
    assert (copied.backend, copied.tolerance) == ("osqp", 1e-6)
    assert copied._keywords == compiled._keywords
    chain = pickle.loads(pickle.dumps(solvers.compile(model(), daqp={"iter_limit": 77})))
    assert chain.solve(b=B).ok
    reference = pickle.loads(pickle.dumps(solvers.compile(cp.Problem(*_linear()), "cvxpy:CLARABEL")))
    assert reference.solve(b=B).ok


def _linear():
    x, b = cp.Variable(2, name="x"), cp.Parameter(2, name="b")
    return cp.Minimize(cp.sum(x)), [x >= b]


def test_a_parameter_that_was_never_given_stays_so():
    with pytest.raises(solvers.ParameterError, match="'b' was never given"):
        pickle.loads(pickle.dumps(solvers.compile(model(), "daqp"))).solve()


def test_names_of_another_process_are_not_given_again(monkeypatch):
    """cvxpy numbers what it makes, in each process from 1: auxiliary variables must not meet those that came along."""
    for first in range(1, 30):
        monkeypatch.setattr(ID_COUNTER, "count", first)
        compiled = solvers.compile(model(), "daqp")
        sent = pickle.dumps(compiled)
        monkeypatch.setattr(ID_COUNTER, "count", 1)  # as in a new process
        same(pickle.loads(sent).solve(b=B), compiled.solve(b=B))


def test_copies_work_in_spawned_processes():
    compiled = solvers.compile(model(), "daqp")
    values = [B, -B, 3 * B]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        for found, value in zip(pool.map(solved_by, [compiled] * 3, values), values, strict=True):
            same(found, compiled.solve(b=value))


def test_copies_work_in_joblib():
    joblib = pytest.importorskip("joblib")
    compiled = solvers.compile(model(), "daqp")
    run = joblib.delayed(lambda value: compiled.solve(b=value))  # a function that only cloudpickle can send
    for found, value in zip(joblib.Parallel(2)(run(value) for value in (B, -B)), (B, -B), strict=True):
        same(found, compiled.solve(b=value))


def test_copies_work_in_dask():
    dask = pytest.importorskip("dask")
    compiled = solvers.compile(model(), "daqp")
    found = dask.compute(*(dask.delayed(compiled.solve)(b=value) for value in (B, -B)), scheduler="processes")
    for mine, value in zip(found, (B, -B), strict=True):
        same(mine, compiled.solve(b=value))


def test_what_else_is_public_can_be_copied(storage):
    compiled = solvers.compile(model(), "daqp")
    solution = compiled.solve(b=B)
    for thing in (solution, solution.status, *solvers.backends(), solvers.ParameterError("no")):
        back = pickle.loads(pickle.dumps(thing))
        assert repr(back) == repr(thing)
    program = pickle.loads(pickle.dumps(compiled.program))
    np.testing.assert_array_equal(program.quadratic.to_dense(), compiled.program.quadratic.to_dense())
    for matrix in (program.matrix, copy.deepcopy(program.matrix)):  # its two forms share one storage
        matrix.values[:] = 7.0
        assert set(matrix.to_dense().ravel()) <= {0.0, 7.0}
        assert set(matrix.to_sparse().data) == {7.0}


def test_a_backend_by_itself_is_not_copied():
    compiled = solvers.compile(model(), "daqp")
    for make in (copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="'daqp' is attached to one program: copy the compiled problem"):
            make(compiled._solvers[0])
