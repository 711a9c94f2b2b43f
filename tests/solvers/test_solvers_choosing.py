"""What "auto" asks first follows from the patterns of a program, and all that it may ask agree."""

import cvxpy as cp
import numpy as np
import pytest
from scipy import sparse

import solvers
from solvers import choosing, registry

SMALL = registry.CHAINS["auto"]


def bounded(n, m, metric, per_row, seed=0):
    """A program in a polytope around the origin, with a metric that is only semidefinite if it says so."""
    random = np.random.default_rng(seed)
    x, q = cp.Variable(n, name="x"), cp.Parameter(n, name="q", value=random.normal(size=n))
    rows = sparse.random_array(
        (m, n), density=per_row / n, rng=random, data_sampler=lambda size: random.normal(size=size)
    )
    box = [x <= 1, x >= -1] if np.ndim(metric) == 0 or not np.all(metric.diagonal()) else []
    cost = q @ x if np.ndim(metric) == 0 else 0.5 * cp.quad_form(x, sparse.csc_array(metric), assume_PSD=True) + q @ x
    return cp.Problem(cp.Minimize(cost), [rows.tocsr() @ x <= np.ones(m), *box])


def bands(n):
    return sparse.diags_array([np.full(n - 1, -1.0), np.full(n, 2.5), np.full(n - 1, -1.0)], offsets=[-1, 0, 1])


def control(states, inputs, horizon):
    """Predictive control, in which some variables have no curvature."""
    random = np.random.default_rng(0)
    x, u = cp.Variable((states, horizon + 1), name="x"), cp.Variable((inputs, horizon), name="u")
    system, steering = (
        np.eye(states) + 0.05 * random.normal(size=(states, states)),
        random.normal(size=(states, inputs)),
    )
    start = cp.Parameter(states, name="start", value=random.uniform(-1, 1, states))
    cost = cp.sum_squares(x[: states // 2, 1:]) + 0.1 * cp.sum_squares(u)
    motion = x[:, 1:] == system @ x[:, :-1] + steering @ u
    return cp.Problem(cp.Minimize(cost), [x[:, 0] == start, motion, cp.abs(u) <= 1, cp.abs(x) <= 10])


FLAT = sparse.diags_array(np.arange(160) % 2.0)
CASES = {
    "small": (lambda: bounded(10, 15, sparse.eye_array(10), 10), SMALL),
    "small, bands": (lambda: bounded(10, 15, bands(10), 4), SMALL),
    "small, half flat": (lambda: bounded(10, 15, sparse.diags_array(np.arange(10) % 2.0), 10), SMALL[1:]),
    "small, linear": (lambda: bounded(10, 15, 0.0, 10), SMALL[1:]),
    "small control": (lambda: control(2, 1, 4), SMALL[1:]),
    "large, few entries": (lambda: bounded(160, 200, sparse.eye_array(160), 4), ("native", *choosing.SPARSE)),
    "large, bands": (lambda: bounded(160, 200, bands(160), 4), choosing.SPARSE),
    "large, half flat": (lambda: bounded(160, 200, FLAT, 4), choosing.SPARSE),
    "large, linear": (lambda: bounded(160, 200, 0.0, 4), choosing.SPARSE),
    "large control": (lambda: control(4, 2, 12), choosing.SPARSE),
    "large, filled": (lambda: bounded(90, 60, sparse.eye_array(90), 90), choosing.FILLED),
    "large, half filled": (lambda: bounded(160, 60, FLAT, 80), choosing.FILLED),
}


@pytest.mark.parametrize("name", CASES)
def test_the_chain_suits_the_program(name):
    build, chain = CASES[name]
    problem = build()
    compiled = solvers.compile(problem)
    assert choosing.choose(compiled.program) == chain
    solution = compiled.solve()
    assert (solution.ok, solution.backend, solution.fallbacks) == (True, chain[0], 0)
    for member in chain[1:]:
        other = solvers.compile(problem, member).solve()
        assert other.ok
        assert solution.objective == pytest.approx(other.objective, rel=1e-7, abs=1e-7)


def test_the_choice_is_made_of_patterns_and_not_of_numbers():
    x, metric = cp.Variable(3, name="x"), cp.Parameter((3, 3), PSD=True, name="metric")
    compiled = solvers.compile(cp.Problem(cp.Minimize(cp.quad_form(x, metric) - x[0]), [x <= 1, x >= -1]))
    assert choosing.choose(compiled.program) == SMALL
    assert compiled.solve(metric=np.eye(3)).backend == "native"
    flat = compiled.solve(metric=np.diag([1.0, 0.0, 0.0]))
    assert (flat.ok, flat.backend, flat.fallbacks) == (True, "native", 0)


def test_a_large_program_goes_on_behind_a_member_that_fails():
    problem = CASES["large control"][0]()
    solution = solvers.compile(problem, clarabel={"max_iter": 1}).solve()
    assert (solution.ok, solution.backend, solution.fallbacks) == (True, "piqp", 1)
    with pytest.raises(solvers.SolverError, match="one mapping for native, daqp, piqp, clarabel"):
        solvers.compile(problem, osqp={"max_iter": 1})
