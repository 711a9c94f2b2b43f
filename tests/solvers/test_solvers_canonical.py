"""The affine map is cvxpy's, whatever the Parameters and Variables are."""

import cvxpy as cp
import numpy as np
import pytest
from scipy import sparse

import solvers
from solvers import canonical

# cvxpy warns about its own reading of sparse Parameters
pytestmark = pytest.mark.filterwarnings("ignore:.*sparse CVXPY expression:RuntimeWarning")


def projection(n=4, m=3, k=2, metric=None):
    v = cp.Variable(n, name="velocity")
    linear, bounds = cp.Parameter(n, name="linear"), cp.Parameter(m, name="bounds")
    gradients, equations = cp.Parameter((m, n), name="gradients"), cp.Parameter((k, n), name="equations")
    targets = cp.Parameter(k, name="targets")
    metric = np.diag(np.arange(1.0, n + 1)) if metric is None else metric
    objective = cp.Minimize(0.5 * cp.quad_form(v, metric) + linear @ v)
    return cp.Problem(objective, [gradients @ v >= bounds, equations @ v == targets])


def with_matrix_variable():
    x = cp.Variable((2, 3), name="x")
    y = cp.Variable(name="y")
    target, scale = cp.Parameter((2, 3), name="target"), cp.Parameter(name="scale", nonneg=True)
    right = cp.Parameter((2, 2), name="right")
    objective = cp.sum_squares(x) + scale * cp.square(y) - cp.sum(cp.multiply(target, x)) + y
    return cp.Problem(cp.Minimize(objective), [right @ x <= 1, cp.sum(x) + y == 2, y >= -3])


def with_diagonal_and_sparse_parameters():
    v = cp.Variable(3, name="v")
    diagonal = cp.Parameter((3, 3), diag=True, name="diagonal")
    pattern = cp.Parameter((2, 3), sparsity=[(0, 1, 1), (2, 0, 1)], name="pattern")
    symmetric = cp.Parameter((3, 3), symmetric=True, name="symmetric")
    return cp.Problem(cp.Minimize(cp.sum_squares(v)), [diagonal @ v >= -1, pattern @ v == 1, symmetric @ v <= 9])


def with_attributes_of_variables():
    positive = cp.Variable(2, nonneg=True, name="positive")
    matrix = cp.Variable((2, 2), symmetric=True, name="matrix")
    shift = cp.Parameter((2, 2), name="shift")
    return cp.Problem(cp.Minimize(cp.sum_squares(matrix - shift) + cp.sum_squares(positive - 1)), [matrix[0, 0] >= 0.5])


def maximized():
    v = cp.Variable(2, name="v")
    gain = cp.Parameter(2, name="gain")
    return cp.Problem(cp.Maximize(gain @ v - cp.sum_squares(v)), [cp.sum(v) <= 0.1])


def with_absolute_values():
    v = cp.Variable(3, name="v")
    centre = cp.Parameter(3, name="centre")
    return cp.Problem(cp.Minimize(cp.sum_squares(v) + cp.norm1(v - centre)), [v[0] == 0.25])


def without_rows():
    v = cp.Variable(2, name="v")
    linear = cp.Parameter(2, name="linear")
    return cp.Problem(
        cp.Minimize(cp.sum_squares(v) + linear @ v), [cp.Parameter((0, 2), name="none") @ v >= np.zeros(0)]
    )


def without_parameters():
    v = cp.Variable(2, name="v")
    return cp.Problem(cp.Minimize(cp.sum_squares(v - 1)), [v[0] >= 2, cp.sum(v) == 5])


MODELS = {
    "projection": projection,
    "positive semidefinite metric": lambda: projection(metric=cp.Parameter((4, 4), PSD=True, name="metric")),
    "matrix variable": with_matrix_variable,
    "reduced parameters": with_diagonal_and_sparse_parameters,
    "variables with attributes": with_attributes_of_variables,
    "maximized": maximized,
    "auxiliary variables": with_absolute_values,
    "constraint without rows": without_rows,
    "no parameters": without_parameters,
}


def random_values(problem, random):
    values = {}
    for parameter in problem.parameters():
        value = random.uniform(0.5, 1.5, parameter.shape)
        if parameter.attributes["PSD"]:
            root = random.normal(size=parameter.shape)
            value = root @ root.T + np.eye(len(root))
            value = (value + value.T) / 2
        elif parameter.attributes["symmetric"]:
            value = value + value.T
        elif parameter.attributes["diag"]:
            value = np.diag(np.diag(value))
        elif parameter.attributes["sparsity"]:
            kept = np.zeros(parameter.shape)
            kept[parameter.sparse_idx] = value[parameter.sparse_idx]
            value = kept
        values[parameter.name()] = value
    return values


def assign(problem, values):
    for parameter in problem.parameters():
        value = values[parameter.name()]
        if parameter.attributes["sparsity"]:
            parameter.value_sparse = sparse.coo_array((value[parameter.sparse_idx], parameter.sparse_idx), value.shape)
        else:
            parameter.value = value


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_the_program_is_what_cvxpy_hands_to_the_solver(model, storage):
    problem = model()
    compiled = solvers.compile(problem, "daqp")
    random = np.random.default_rng(1)
    for _ in range(3):
        values = random_values(problem, random)
        compiled.solve(**values)
        fresh = model()
        assign(fresh, values)
        data, _, _ = fresh.get_problem_data("OSQP")
        program = compiled.program
        assert (program.quadratic.dense is not None) == (storage == "dense")
        equal = {"rtol": 1e-13, "atol": 1e-13}
        np.testing.assert_allclose(program.quadratic.to_dense(), data["P"].toarray(), **equal)
        np.testing.assert_allclose(program.linear, data["q"], **equal)
        rows = np.vstack((data["A"].toarray(), data["F"].toarray()))
        np.testing.assert_allclose(program.matrix.to_dense(), rows, **equal)
        np.testing.assert_allclose(program.upper, np.concatenate((data["b"], data["G"])), **equal)
        np.testing.assert_array_equal(program.lower[: program.equalities], program.upper[: program.equalities])
        assert np.all(program.lower[program.equalities :] == -np.inf)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_answers_and_multipliers_come_back_as_from_cvxpy(model, storage):
    problem = model()
    compiled = solvers.compile(problem, "daqp")
    values = random_values(problem, np.random.default_rng(2))
    solution = compiled.solve(**values)
    assert solution.ok
    assign(problem, values)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
    assert set(solution.primal) == {variable.name() for variable in problem.variables()}
    for variable in problem.variables():
        assert solution.primal[variable.name()].shape == variable.shape
        np.testing.assert_allclose(solution.primal[variable.name()], variable.value, atol=2e-5)
    for multiplier, constraint in zip(solution.dual, problem.constraints, strict=True):
        assert multiplier.shape == constraint.shape
        np.testing.assert_allclose(multiplier, constraint.dual_value, atol=2e-5)


def test_views_write_into_the_program():
    problem = projection()
    values = random_values(problem, np.random.default_rng(3))
    by_name, by_view = solvers.compile(problem, "daqp"), solvers.compile(problem, "daqp")
    expected = by_name.solve(**values)
    for name, value in values.items():
        assert by_view.parameters[name].shape == value.shape
        for index in np.ndindex(value.shape):
            by_view.parameters[name][index] = value[index]
    np.testing.assert_array_equal(by_view.solve().primal["velocity"], expected.primal["velocity"])
    kept = by_view.solve(linear=2 * values["linear"])
    np.testing.assert_array_equal(kept.dual[1], by_name.solve(linear=2 * values["linear"]).dual[1])


def test_compiling_leaves_the_problem_as_it_was():
    problem = projection()
    problem.parameters()[0].value = problem.parameters()[0].value
    given = next(p for p in problem.parameters() if p.name() == "linear")
    given.value = np.arange(4.0)
    compiled = solvers.compile(problem, "daqp")
    assert [p.name() for p in problem.parameters() if p.value is not None] == ["linear"]
    assert all(variable.value is None for variable in problem.variables())
    np.testing.assert_array_equal(compiled.parameters["linear"], given.value)


def test_values_are_checked():
    problem = projection(metric=cp.Parameter((4, 4), PSD=True, name="metric"))
    compiled = solvers.compile(problem, "daqp")
    values = random_values(problem, np.random.default_rng(4))
    with pytest.raises(solvers.ParameterError, match="'targets' was never given"):
        compiled.solve(**{name: value for name, value in values.items() if name != "targets"})
    with pytest.raises(solvers.ParameterError, match=r"unknown parameter 'linaer'; allowed: .*linear"):
        compiled.solve(**values, linaer=0)
    with pytest.raises(solvers.ParameterError, match=r"'bounds' has shape \(4,\); allowed: \(3,\)"):
        compiled.solve(**values | {"bounds": np.zeros(4)})
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(solvers.ParameterError, match=r"'linear' .* nan or inf"):
            compiled.solve(**values | {"linear": np.array([0.0, bad, 0.0, 1.0])})
    with pytest.raises(solvers.ParameterError, match="'metric' is declared positive semidefinite"):
        compiled.solve(**values | {"metric": np.diag([1.0, 1.0, 1.0, -1.0])})
    with pytest.raises(solvers.ParameterError, match="'metric' is declared symmetric"):
        compiled.solve(**values | {"metric": np.eye(4) + np.eye(4, k=1)})
    assert compiled.solve(**values).ok


@pytest.mark.parametrize(
    ("model", "name", "value", "message"),
    [
        (with_matrix_variable, "scale", np.array(-1.0), "declared nonnegative"),
        (with_diagonal_and_sparse_parameters, "diagonal", np.ones((3, 3)), "outside the pattern"),
        (with_diagonal_and_sparse_parameters, "pattern", np.ones((2, 3)), "outside the pattern"),
    ],
)
def test_declared_attributes_are_checked(model, name, value, message):
    problem = model()
    compiled = solvers.compile(problem, "daqp")
    values = random_values(problem, np.random.default_rng(5))
    assert compiled.solve(**values).ok
    with pytest.raises(solvers.ParameterError, match=message):
        compiled.solve(**values | {name: value})


def test_sparse_values_are_taken():
    problem = projection()
    values = random_values(problem, np.random.default_rng(6))
    dense = solvers.compile(problem, "daqp").solve(**values)
    values["gradients"] = sparse.csr_array(values["gradients"])
    np.testing.assert_array_equal(solvers.compile(problem, "daqp").solve(**values).dual[0], dense.dual[0])


def refused():
    v = cp.Variable(2, name="v")
    p = cp.Parameter(2, name="p")
    square = cp.Minimize(cp.sum_squares(v))
    yield "not DPP", cp.Problem(cp.Minimize(cp.quad_form(v - p, np.eye(2))), []), "parametrized quadratic program"
    yield "cone", cp.Problem(cp.Minimize(cp.norm2(v)), []), "second-order cone"
    yield "not convex", cp.Problem(cp.Maximize(cp.sum_squares(v)), []), "parametrized quadratic program"
    yield "integer", cp.Problem(cp.Minimize(cp.Variable(name="i", integer=True)), []), "."
    twice = [v >= cp.Parameter(2, name="p"), v <= p]
    yield "names", cp.Problem(square, twice), "2 Parameters are named 'p'"
    yield "attribute", cp.Problem(square, [v >= cp.Parameter(2, integer=True, name="i")]), "attribute integer"


@pytest.mark.parametrize(("problem", "message"), [case[1:] for case in refused()], ids=[case[0] for case in refused()])
def test_other_problems_are_refused(problem, message):
    with pytest.raises(solvers.SolverError, match=message):
        solvers.compile(problem, "daqp")


def test_a_change_of_cvxpys_layout_is_noticed(monkeypatch):
    class Wrong(canonical.AffineMap):
        def apply(self):
            super().apply()
            self.program.upper[0] *= -1.0

    monkeypatch.setattr(canonical, "AffineMap", Wrong)
    with pytest.raises(solvers.SolverError, match="another layout of u"):
        solvers.compile(projection(), "daqp")
