"""Problems that are no quadratic programs are refused by the part that is in the way; open bounds are no rows."""

import cvxpy as cp
import numpy as np
import pytest

import solvers
from solvers import Status

INF, NAN = np.inf, np.nan
x, X, i = cp.Variable(3, name="x"), cp.Variable((2, 2), name="X"), cp.Variable(2, integer=True, name="i")
p = cp.Parameter(3, name="p")
square, above = cp.Minimize(cp.sum_squares(x)), x >= 1
complicated = x * (1 + 1j) == 1

CONES = {
    "norm": (square, [above, cp.norm2(x) <= 1], r"constraint 1 \(Pnorm.* needs a second-order cone"),
    "quadratic constraint": (square, [cp.sum_squares(x) <= 1], "constraint 0 .* needs a second-order cone"),
    "cone": (square, [cp.SOC(x[0], x[1:])], r"constraint 0 \(SOC.* needs a second-order cone"),
    "norm in the objective": (cp.Minimize(cp.norm2(x)), [], "the objective .* needs a second-order cone"),
    "exponential": (cp.Minimize(cp.sum(cp.exp(x))), [], "the objective .* needs an exponential cone"),
    "relative entropy": (cp.Minimize(cp.sum(cp.kl_div(x, 1))), [], "the objective .* needs an exponential cone"),
    "cubic": (square, [cp.PowCone3D(x[0], x[1], x[2], 0.3)], "constraint 0 .* needs a power cone"),
    "semidefinite": (cp.Minimize(cp.sum_squares(X)), [X >> 0], "constraint 0 .* needs a semidefinite cone"),
    "determinant": (cp.Maximize(cp.log_det(X)), [], "needs a semidefinite cone and an exponential cone"),
    "integer": (cp.Minimize(cp.sum_squares(i)), [], "Variable 'i' has the attribute integer: only continuous"),
    "finite set": (square, [cp.constraints.FiniteSet(x, [1, 2])], "constraint 0 .* is a finite set, .* integer"),
    "complex": (square, [complicated], "constraint 0 .* is complex"),
}


@pytest.mark.parametrize("backend", ["auto", "clarabel", "native"])
@pytest.mark.parametrize(("objective", "constraints", "message"), CONES.values(), ids=CONES.keys())
def test_a_refusal_names_what_is_in_the_way(objective, constraints, message, backend):
    with pytest.raises(solvers.SolverError, match=message) as refusal:
        solvers.compile(cp.Problem(objective, constraints), backend)
    assert "OSQP" not in str(refusal.value)


def test_complex_constants_in_real_constraints_come_along():
    problem = cp.Problem(square, [cp.real(x * (1 + 1j)) >= [1, 2, 3]])
    found = solvers.compile(problem, "daqp").solve()
    np.testing.assert_allclose(found.primal["x"], [1, 2, 3], atol=1e-9)
    np.testing.assert_allclose(found.dual[0], [2, 4, 6], atol=1e-9)


def test_a_constraint_that_is_listed_twice_is_refused():
    same = "constraint 1 .* is the same object as constraint 0"
    with pytest.raises(solvers.SolverError, match=same):
        solvers.compile(cp.Problem(square, [above, above]), "daqp")
    solvers.register_solve_method()
    with pytest.raises(solvers.SolverError, match=same):
        cp.Problem(square, [above, above]).solve(method="compiled")


def test_stated_twice_a_constraint_has_two_multipliers():
    found = solvers.compile(cp.Problem(square, [x >= 1, x >= 1]), "clarabel").solve()
    np.testing.assert_allclose(found.dual[0] + found.dual[1], 2.0, atol=1e-7)


def test_problems_that_share_a_constraint_list_it_once_in_their_sum():
    total = cp.Problem(square, [above]) + cp.Problem(cp.Minimize(cp.sum(x)), [above, x <= 5])
    found = solvers.compile(total, "daqp").solve()
    assert len(found.dual) == len(total.constraints) == 2
    np.testing.assert_allclose(found.dual[0], 3.0, atol=1e-9)


def test_names_that_are_given_twice_are_refused_in_sums_of_problems():
    other = cp.Variable(3, name="x")
    with pytest.raises(solvers.SolverError, match="2 Variables are named 'x'"):
        solvers.compile(cp.Problem(square) + cp.Problem(cp.Minimize(cp.sum_squares(other))), "daqp")


@pytest.mark.parametrize("backend", ["auto", "clarabel", "native", "daqp"])
def test_problems_without_variables_are_solved(backend):
    bound = cp.Parameter(name="bound", value=0.5)
    for problem, status in (
        (cp.Problem(cp.Minimize(3), [cp.Constant(0) <= 1]), Status.SOLVED),
        (cp.Problem(cp.Maximize(bound), [bound <= 1]), Status.SOLVED),
        (cp.Problem(cp.Maximize(bound), [bound <= 0]), Status.INFEASIBLE),
        (cp.Problem(cp.Maximize(0), [cp.Constant(0) == 1]), Status.INFEASIBLE),
        (cp.Problem(cp.Minimize(0)), Status.SOLVED),
    ):
        found = solvers.compile(problem, backend).solve()
        assert (found.status, found.primal) == (status, {})
        assert len(found.dual) == len(problem.constraints)


OPEN = {
    "above": [x <= np.array([1.0, INF, 2.0])],
    "below": [x >= np.array([1.0, -INF, 2.0]), x <= 4],
    "all": [x <= INF, x <= 2],
    "in front of others": [x <= np.array([INF, INF, 1.0]), cp.sum(x) == 2.5, x >= np.array([-INF, 1.5, -INF])],
    "within": [cp.abs(x) <= np.array([INF, 1.0, INF])],
    "matrix": [cp.reshape(cp.hstack([x, x[0]]), (2, 2), order="F") <= np.array([[INF, 1.0], [2.0, INF]])],
}


@pytest.mark.parametrize("constraints", OPEN.values(), ids=OPEN.keys())
@pytest.mark.parametrize("far", [-3.0, 3.0])
def test_an_open_bound_is_no_row_and_has_no_multiplier(constraints, far, storage):
    problem = cp.Problem(cp.Minimize(cp.sum_squares(x - far)), constraints)
    problem.solve(solver="CLARABEL", tol_gap_abs=1e-11, tol_gap_rel=1e-11, tol_feas=1e-11)
    expected = x.value
    found = solvers.compile(problem, "clarabel").solve()
    assert found.ok
    np.testing.assert_allclose(found.primal["x"], expected, atol=1e-6)
    for multiplier, constraint in zip(found.dual, constraints, strict=True):
        assert multiplier.shape == constraint.shape
        np.testing.assert_allclose(multiplier, np.nan_to_num(constraint.dual_value), atol=1e-5)
        slack = np.broadcast_to(-constraint.expr.value if constraint.args else 0.0, constraint.shape)
        np.testing.assert_array_equal(multiplier[np.isposinf(slack)], 0.0)


def test_an_open_bound_stays_open_whatever_is_added_to_it():
    compiled = solvers.compile(cp.Problem(cp.Minimize(cp.sum_squares(x - 9)), [x <= p + np.array([INF, 0, 1])]), "daqp")
    for value in (np.zeros(3), np.ones(3)):
        found = compiled.solve(p=value)
        np.testing.assert_allclose(found.primal["x"], [9, value[1], value[2] + 1], atol=1e-9)
        assert found.dual[0][0] == 0.0


NUMBERS = {
    "nan in the objective": (
        cp.Minimize(cp.sum_squares(x - np.array([1, NAN, 1]))),
        [above],
        "the objective holds nan",
    ),
    "inf in the objective": (cp.Minimize(cp.sum(x) + np.array([INF, 1, 1]) @ x), [above], "the objective holds inf"),
    "inf added": (cp.Minimize(cp.sum_squares(x) + INF), [above], "the objective holds inf"),
    "nan in a bound": (square, [x <= INF, above, x >= np.array([1, NAN, 1])], "constraint 2 holds nan"),
    "nan in a row": (square, [x <= INF, np.array([NAN, 1, 1]) @ x <= 1], "constraint 1 holds nan"),
    "nan within": (square, [cp.abs(x - NAN) <= 1], "constraint 0 holds nan"),
    "inf in a row": (square, [x <= INF, np.array([INF, 1, 1]) @ x <= 1], "constraint 1 holds inf"),
    "inf in an equation": (square, [x <= INF, x == INF], "constraint 1 holds inf"),
    "no room": (square, [x <= -INF], "constraint 0 holds inf"),
    "inf times a parameter": (square, [x <= cp.multiply(np.array([INF, 1, 1]), p)], "constraint 0 holds inf"),
}


@pytest.mark.parametrize(("objective", "constraints", "message"), NUMBERS.values(), ids=NUMBERS.keys())
def test_constants_that_are_no_numbers_are_refused_where_they_are(objective, constraints, message):
    with pytest.raises(solvers.SolverError, match=message):
        solvers.compile(cp.Problem(objective, constraints), "daqp")
