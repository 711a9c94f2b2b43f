"""Recorded subproblems come back as cvxpy problems with their numbers and answers."""

import cvxpy as cp
import numpy as np
import pytest
from subproblem_cases import RUN, problems, simulate

import deli
from deli.recording.reading import read_subproblems


@RUN
def test_a_loaded_problem_is_the_model_with_its_numbers_and_answer(name, tmp_path):
    path = tmp_path / "run.nc"
    run = simulate(name, subproblems=True, output=path)
    known = list(problems(run))
    last = len(known) - 1
    kinds = {(int(one[-1]["subproblem"]), int(one[-1]["metric_entries"]) > 0): k for k, one in enumerate(known)}
    for index in {0, last, *kinds.values()}:
        _, matrix, linear, z, bounds, y, _, equalities, _ = known[index]
        problem = deli.load_subproblem(path, index)
        assert problem.is_dcp()
        (velocity,) = problem.variables()
        np.testing.assert_array_equal(velocity.value, z)
        values = {parameter.name(): parameter.value for parameter in problem.parameters()}
        np.testing.assert_array_equal(values["linear"], linear)
        if equalities < len(bounds):
            np.testing.assert_array_equal(values["gradients"], matrix[equalities:])
            np.testing.assert_array_equal(values["bounds"], bounds[equalities:])
        duals = [constraint.dual_value for constraint in problem.constraints]
        expected = ([y[equalities:]] if equalities < len(bounds) else []) + ([-y[:equalities]] if equalities else [])
        assert len(duals) == len(expected)
        assert all(map(np.array_equal, duals, expected))
        problem.solve(solver=cp.CLARABEL)
        np.testing.assert_allclose(velocity.value, z, rtol=0, atol=1e-4)
    problem = deli.load_subproblem(path, -1)
    np.testing.assert_array_equal(problem.variables()[0].value, known[last][3])


def test_a_large_problem_is_loaded_sparse(tmp_path):
    path = tmp_path / "run.nc"
    scene = deli.scenes.disc_pile(rows=8, columns=8)
    deli.simulate(scene, deli.GVI(), step_size=0.01, steps=1, subproblems=1, output=path)
    (posed_one,), _ = read_subproblems(path)
    problem = deli.load_subproblem(path, 0)
    (gradients,) = (parameter for parameter in problem.parameters() if parameter.name() == "gradients")
    assert gradients.attributes["sparsity"]
    assert abs(gradients.value_sparse - posed_one.matrix).max() == 0.0
    np.testing.assert_array_equal(problem.variables()[0].value, posed_one.z)


@pytest.mark.parametrize("index", [100_000, -100_000, 1.5, True, "0"])
def test_an_index_that_is_none_is_refused(tmp_path, index):
    path = tmp_path / "run.nc"
    simulate("cradle", subproblems=5, output=path)
    with pytest.raises(deli.InputError, match="holds subproblems 0 to 4"):
        deli.load_subproblem(path, index)


def test_files_without_subproblems_say_how_to_record_them(tmp_path):
    plain, free = tmp_path / "plain.nc", tmp_path / "free.nc"
    simulate("cradle", steps=2, output=plain)
    with pytest.raises(deli.InputError, match=r"record\.subproblems = true"):
        deli.load_subproblem(plain, 0)
    flying = deli.scenes.point_mass(position=1e6)
    deli.simulate(flying, deli.GVI(), step_size=0.1, steps=2, output=free, subproblems=True)
    with pytest.raises(deli.InputError, match="skip = false"):
        deli.load_subproblem(free, 0)
