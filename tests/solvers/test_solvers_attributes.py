"""Attributes of Variables come along or are refused by name: what is returned is cvxpy's answer."""

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import sparse

import solvers

# cvxpy warns about its own reading of sparse Variables
pytestmark = pytest.mark.filterwarnings("ignore:.*sparse CVXPY expression:RuntimeWarning")

SHAPE = (2, 2)
PATTERN = [(0, 1), (1, 0)]
WISH = np.array([[-1.0, 2.0], [0.5, -3.0]])

TAKEN = {
    "nonneg": [True],
    "nonpos": [True],
    "pos": [True],
    "neg": [True],
    "symmetric": [True],
    "diag": [True],
    "sparsity": [PATTERN],
    "bounds": [
        [0, 1],
        [None, 1],
        [-1, None],
        [-1, 1],
        [1, 2],
        [0, 10],
        [np.array([[0.0, -np.inf], [-1.0, -2.0]]), np.array([[2.0, 1.0], [np.inf, 0.0]])],
        [cp.Parameter(name="low", value=-0.5), cp.Parameter(SHAPE, name="high", value=np.array([[0, 1], [2, 3]]))],
    ],
}
REFUSED = {
    "complex": [True],
    "imag": [True],
    "hermitian": [True],
    "boolean": [True, [(0, 1), (1, 1)]],
    "integer": [True, [(0, 1), (1, 1)]],
    "PSD": [True],
    "NSD": [True],
}
USES = {
    "direct": lambda X: cp.sum_squares(X) - 2 * cp.sum(cp.multiply(WISH, X)),
    "auxiliary": lambda X: cp.sum_squares(X - WISH),
    "linear": lambda X: cp.sum(cp.multiply(np.array([[1.0, -2.0], [0.5, -0.25]]), X)),
}


def posed(X, use):
    return cp.Problem(cp.Minimize(USES[use](X)), [X >= -3, X <= 4, cp.sum(X) <= 4.5])


def dense(value):
    return value.toarray() if sparse.issparse(value) else np.asarray(value)


def agrees_with_cvxpy(X, use, backend="daqp"):
    problem = posed(X, use)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
    if problem.status == cp.INFEASIBLE:
        assert not solvers.compile(problem, backend).solve().ok
        return
    expected, cost, multipliers = dense(X.value), problem.value, [c.dual_value for c in problem.constraints]
    found = solvers.compile(problem, backend).solve()
    assert found.ok, found
    np.testing.assert_allclose(found.primal["X"], expected, atol=2e-5)
    for mine, theirs in zip(found.dual, multipliers, strict=True):
        assert mine.shape == np.shape(theirs)
    solvers.register_solve_method("compiled here")
    assert problem.solve(method="compiled here", backend=backend) == pytest.approx(cost, abs=1e-6)
    np.testing.assert_allclose(dense(X.value), expected, atol=2e-5)


@pytest.fixture(autouse=True)
def _methods(monkeypatch):
    monkeypatch.setattr(cp.Problem, "REGISTERED_SOLVE_METHODS", dict(cp.Problem.REGISTERED_SOLVE_METHODS))


def test_every_attribute_that_cvxpy_knows_is_tried_here():
    assert set(cp.Variable(SHAPE).attributes) == {*TAKEN, *REFUSED}


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize(
    ("name", "value"), [pytest.param(name, value, id=name) for name, values in TAKEN.items() for value in values]
)
def test_an_attribute_comes_along(name, value, use):
    agrees_with_cvxpy(cp.Variable(SHAPE, name="X", **{name: value}), use)


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize(
    ("name", "value"), [pytest.param(name, value, id=name) for name, values in REFUSED.items() for value in values]
)
def test_an_attribute_is_refused_by_name(name, value, use):
    X = cp.Variable(SHAPE, name="X", **{name: value})
    whole = cp.real(X) + cp.imag(X) if X.is_complex() else X
    with pytest.raises(solvers.SolverError, match=f"Variable 'X' has the attribute {name}: "):
        solvers.compile(posed(whole, use), "daqp")


def test_an_attribute_of_a_newer_cvxpy_is_refused_by_name():
    X = cp.Variable(SHAPE, name="X")
    X.attributes["unitary"] = True
    with pytest.raises(solvers.SolverError, match="Variable 'X' has the attribute unitary: state it as a constraint"):
        solvers.compile(posed(X, "direct"), "daqp")
    p = cp.Parameter(name="p")
    p.attributes["prime"] = True
    with pytest.raises(solvers.SolverError, match="Parameter 'p' has the attribute prime"):
        solvers.compile(cp.Problem(cp.Minimize(p * cp.Variable(name="x"))), "daqp")


numbers = st.floats(-3.0, 3.0).map(lambda number: round(number, 2))


@st.composite
def attributes(draw):
    names = draw(st.sets(st.sampled_from([name for name in TAKEN if name != "bounds"]), max_size=2))
    chosen = {name: TAKEN[name][0] for name in names}
    if draw(st.booleans()):
        low, high = sorted((draw(numbers), draw(numbers)))
        width = draw(st.lists(st.floats(0.0, 2.0), min_size=4, max_size=4))
        chosen["bounds"] = draw(
            st.sampled_from(
                ([low, high], [low, None], [None, high], [low, high + np.reshape(width, SHAPE)], [-np.inf, high])
            )
        )
    return chosen


@settings(deadline=None, max_examples=60)
@given(attributes(), st.sampled_from(sorted(USES)))
def test_attributes_come_along_together(chosen, use):
    try:
        X = cp.Variable(SHAPE, name="X", **chosen)
    except ValueError:  # cvxpy does not take them together
        assume(False)
    agrees_with_cvxpy(X, use)


@pytest.mark.parametrize("backend", ["clarabel", "piqp", "osqp"])
@pytest.mark.parametrize("name", ["diag", "sparsity", "bounds"])
def test_every_kind_of_place_works_with_other_backends(name, backend, storage):
    agrees_with_cvxpy(cp.Variable(SHAPE, name="X", **{name: TAKEN[name][0]}), "auxiliary", backend)


def test_entries_off_a_pattern_are_zero_where_there_is_no_answer():
    X = cp.Variable(SHAPE, name="X", diag=True)
    found = solvers.compile(
        cp.Problem(cp.Minimize(cp.sum_squares(X)), [X[0, 0] >= 1, X[0, 0] <= 0]), "clarabel"
    ).solve()
    assert found.status is solvers.Status.INFEASIBLE
    np.testing.assert_array_equal(found.primal["X"], [[np.nan, 0.0], [0.0, np.nan]])


def test_stacked_symmetric_matrices_come_along():
    X = cp.Variable((2, 3, 3), symmetric=True, name="X")
    wish = np.arange(18.0).reshape(2, 3, 3)
    found = solvers.compile(cp.Problem(cp.Minimize(cp.sum_squares(X - wish))), "daqp").solve()
    np.testing.assert_allclose(found.primal["X"], (wish + np.swapaxes(wish, 1, 2)) / 2, atol=1e-9)


def test_the_reference_takes_matrices_with_fewer_entries():
    X = cp.Variable(SHAPE, name="X", diag=True)
    found = solvers.compile(cp.Problem(cp.Minimize(cp.trace(X)), [np.diag([1.0, -2.0]) <= X]), "cvxpy:CLARABEL").solve()
    assert found.ok, found
    np.testing.assert_allclose(found.primal["X"], np.diag([1.0, -2.0]), atol=1e-8)


@pytest.mark.parametrize("name", ["nonneg", "bounds"])
def test_the_reference_says_that_it_cannot_verify_rows_of_attributes(name):
    X = cp.Variable(SHAPE, name="X", **{name: TAKEN[name][0]})
    with pytest.raises(solvers.SolverError, match=r"cvxpy:CLARABEL .* rows that are none of its constraints"):
        solvers.compile(cp.Problem(cp.Minimize(cp.trace(X)), [cp.sum(X) >= 1]), "cvxpy:CLARABEL")
