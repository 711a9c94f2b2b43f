"""Problems that a backend cannot take are refused when they are compiled, or fail with a message."""

import cvxpy as cp
import numpy as np
import pytest

import solvers
from solvers import Status

x, X = cp.Variable(3, name="x"), cp.Variable((2, 2), name="X")
b = cp.Parameter(3, name="b")

KINDS = {  # objective, constraints, and what native misses
    "linear": (cp.Minimize(cp.sum(x)), [x >= b], r"none in x\[0\], x\[1\], x\[2\]"),
    "one without": (cp.Minimize(cp.sum_squares(x[:2]) + x[2]), [x >= b], r"none in x\[0\]"),
    "no objective": (cp.Minimize(0), [x == b], r"none in x\[0\], x\[1\], x\[2\]"),
    "many": (cp.Minimize(cp.sum(cp.hstack([x, cp.vec(X, order="F")]))), [x >= b, X >= 1, X <= 2], "and 1 more"),
    "matrix": (
        cp.Minimize(cp.quad_form(x, np.eye(3)) + X[0, 1]),
        [x >= b, X >= 1, X <= 2],
        r"none in X\[0, 0\], X\[1, 0\]",
    ),
    "difference": (
        cp.Minimize(cp.quad_form(x, np.array([[1.0, -1, 0], [-1, 1, 0], [0, 0, 1]])) + x[0]),
        [x >= b],
        "that of this problem is singular",
    ),
    "absolute": (cp.Minimize(cp.quad_form(x, np.eye(3)) + cp.norm1(x)), [x >= b], "auxiliary variables of the model"),
}


@pytest.mark.parametrize(("objective", "constraints", "lacking"), KINDS.values(), ids=KINDS.keys())
def test_a_backend_takes_a_problem_or_says_what_is_missing(objective, constraints, lacking, backend):
    problem = cp.Problem(objective, constraints)
    if backend == "native":
        with pytest.raises(solvers.SolverError, match=f"native needs a positive definite .*{lacking}.*daqp"):
            solvers.compile(problem, backend)
        return
    found = solvers.compile(problem, backend, tolerance=1e-6).solve(b=np.ones(3))
    assert found.ok, found


def test_auto_begins_with_a_member_that_can_take_the_problem():
    for objective, constraints, _ in KINDS.values():
        found = solvers.compile(cp.Problem(objective, constraints)).solve(b=np.ones(3))
        assert found.ok
        assert (found.backend, found.fallbacks) == ("daqp", 0)


def test_curvature_that_depends_on_a_value_fails_with_a_message():
    scale = cp.Parameter(name="scale", nonneg=True)
    problem = cp.Problem(cp.Minimize(scale * cp.sum_squares(x)), [x >= b])
    compiled = solvers.compile(problem, "native")
    assert compiled.solve(b=np.ones(3), scale=1.0).ok
    found = compiled.solve(scale=0.0)
    assert found.status is Status.FAILED
    assert "not positive definite at these parameter values" in found.message
    assert compiled.solve(scale=2.0).ok
    assert solvers.compile(problem).solve(b=np.ones(3), scale=0.0).ok  # a chain goes on


def test_backends_of_users_declare_it_too(registered):
    class Picky(solvers.Backend):
        name = "picky"
        strictly_convex = True

        def __init__(self, program, tolerance, options):
            raise AssertionError("must not be asked")

        def update(self): ...

        def solve(self): ...

    registered("picky", Picky)
    with pytest.raises(solvers.SolverError, match="picky needs a positive definite quadratic term"):
        solvers.compile(cp.Problem(cp.Minimize(cp.sum(x)), [x >= b]), "picky")
