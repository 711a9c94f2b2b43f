"""Problems without full curvature are solved, or refused when they are compiled for a backend that needs it."""

import cvxpy as cp
import numpy as np
import pytest

import solvers
from solvers import Status

x, X = cp.Variable(3, name="x"), cp.Variable((2, 2), name="X")
b = cp.Parameter(3, name="b")

KINDS = {  # objective, constraints, and what is missing
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
def test_every_backend_of_deli_takes_them(objective, constraints, lacking, backend):
    found = solvers.compile(cp.Problem(objective, constraints), backend, tolerance=1e-6).solve(b=np.ones(3))
    assert found.ok, found


@pytest.mark.parametrize(("objective", "constraints", "lacking"), KINDS.values(), ids=KINDS.keys())
def test_a_backend_that_needs_curvature_says_what_is_missing(objective, constraints, lacking, picky):
    with pytest.raises(solvers.SolverError, match=f"picky needs a positive definite .*{lacking}.*daqp.*native"):
        solvers.compile(cp.Problem(objective, constraints), "picky")


def test_a_chain_goes_on_behind_a_backend_that_needs_curvature(picky, monkeypatch):
    monkeypatch.setattr("solvers.choosing.choose", lambda program: ("picky", "daqp"))
    for objective, constraints, _ in KINDS.values():
        found = solvers.compile(cp.Problem(objective, constraints)).solve(b=np.ones(3))
        assert (found.ok, found.backend, found.fallbacks) == (True, "daqp", 0)


def test_auto_begins_with_a_member_that_is_fast_without_curvature():
    for objective, constraints, _ in KINDS.values():
        found = solvers.compile(cp.Problem(objective, constraints)).solve(b=np.ones(3))
        assert found.ok
        assert (found.backend, found.fallbacks) == ("daqp", 0)


def test_curvature_may_depend_on_a_value():
    scale = cp.Parameter(name="scale", nonneg=True)
    problem = cp.Problem(cp.Minimize(scale * cp.sum_squares(x)), [x >= b])
    compiled = solvers.compile(problem, "native")
    assert compiled.solve(b=np.ones(3), scale=1.0).ok
    assert compiled.solve(scale=0.0).ok
    assert compiled.solve(scale=2.0).ok
    found = solvers.compile(problem).solve(b=np.ones(3), scale=0.0)
    assert (found.ok, found.backend, found.fallbacks) == (True, "native", 0)


def test_a_matrix_that_bends_downwards_fails_with_a_message():
    metric = cp.Parameter((3, 3), PSD=True, name="metric")
    problem = cp.Problem(cp.Minimize(cp.quad_form(x, metric)), [x >= b])
    compiled = solvers.compile(problem, "native", check_parameters=False)
    found = compiled.solve(b=np.ones(3), metric=np.diag([1.0, 1.0, -1.0]))
    assert found.status is Status.FAILED
    assert "not positive semidefinite at these parameter values" in found.message


@pytest.fixture
def picky(registered):
    """Register a backend that declares that it needs curvature."""

    class Picky(solvers.Backend):
        name = "picky"
        strictly_convex = True

        def __init__(self, program, tolerance, options):
            raise AssertionError("must not be asked")

        def update(self): ...

        def solve(self): ...

    registered("picky", Picky)
