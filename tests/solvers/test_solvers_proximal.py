"""Programs without full curvature, which native solves by proximal steps, against answers known by construction."""

from functools import cache

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import solvers
from solvers import Status

EXAMPLES = settings(max_examples=60, deadline=None, derandomize=True)
UNITS = (1e-6, 1.0, 1e6)
NONE = {"objective": 1.0, "rows": 1.0, "variables": 1.0}
SCALED = [NONE | {name: unit} for name in NONE for unit in UNITS[::2]] + [dict.fromkeys(NONE, unit) for unit in UNITS]


@cache
def compiled(n, m, e, polish=False):
    """P = B'B, and m rows of which e are equations, all of them Parameters."""
    x = cp.Variable(n, name="x")
    A, u = cp.Parameter((m, n), name="A"), cp.Parameter(m, name="u")
    P, q = cp.Parameter((n, n), PSD=True, name="P"), cp.Parameter(n, name="q")
    rows = [A[:e] @ x == u[:e]] if e else []
    return solvers.compile(
        cp.Problem(cp.Minimize(0.5 * cp.quad_form(x, P) + q @ x), [*rows, A[e:] @ x <= u[e:]]),
        "native", polish=polish, check_parameters=False,
    )  # fmt: skip


def in_units(values, objective, rows, variables):
    return {
        "P": objective * variables**2 * values["P"],
        "q": objective * variables * values["q"],
        "A": rows * variables * values["A"],
        "u": rows * values["u"],
    }


class Made:
    """A program whose answer is x with the multipliers y; several rows may touch that carry nothing."""

    def __init__(self, seed, linear, whole):
        random = np.random.default_rng(seed)

        def draw(*shape):
            return random.integers(-3, 4, shape).astype(float) if whole else random.normal(size=shape)

        n, m = int(random.integers(2, 7)), int(random.integers(3, 11))
        self.sizes = n, m, int(random.integers(0, 3))
        e = self.sizes[2]
        B, A, self.x = draw(0 if linear else int(random.integers(1, n)), n), draw(m, n), draw(n)
        touching = (random.uniform(size=m) < 0.6) | (np.arange(m) < e)
        self.y = np.where(touching, np.abs(draw(m)), 0.0)
        self.y[:e] *= -1.0
        P, u = B.T @ B, A @ self.x + np.where(touching, 0.0, np.abs(draw(m)))
        self.values = {"P": P, "q": -(P @ self.x + A.T @ self.y), "A": A, "u": u}

    def objective(self, x):
        return 0.5 * x @ self.values["P"] @ x + self.values["q"] @ x

    def terms(self):
        x = np.abs(self.x)
        return 1.0 + x @ np.abs(self.values["P"]) @ x + np.abs(self.values["q"]) @ x


@pytest.mark.parametrize("units", SCALED, ids=str)
@pytest.mark.parametrize("linear", [True, False], ids=["linear", "semidefinite"])
@given(seed=st.integers(0, 2**32 - 1), whole=st.booleans())
@settings(EXAMPLES, max_examples=20)
def test_answers_made_beforehand_are_found_in_any_units(units, linear, seed, whole):
    made = Made(seed, linear, whole)
    solution = compiled(*made.sizes).solve(**in_units(made.values, **units))
    assert solution.ok, solution
    assert solution.claimed is Status.SOLVED
    assert solution.backend == "native"
    assert max(solution.primal_residual, solution.dual_residual, solution.complementarity) <= 1e-9
    # The point may be another one, the objective may not: it is off by what is left of forces and products.
    x = units["variables"] * solution.primal["x"]
    assert made.objective(x) == pytest.approx(made.objective(made.x), abs=1e-8 * made.terms())


@given(
    seed=st.integers(0, 2**32 - 1),
    exponents=st.lists(st.integers(-3, 3), min_size=6, max_size=6),
    tens=st.lists(st.integers(-6, 6), min_size=10, max_size=10),
)
@EXAMPLES
def test_every_row_and_variable_may_have_its_own_unit(seed, exponents, tens):
    made = Made(seed, False, True)
    n, m, _ = made.sizes
    columns, rows = 10.0 ** np.array(exponents[:n]), 10.0 ** np.array(tens[:m])
    values = made.values
    solution = compiled(*made.sizes).solve(
        P=values["P"] * np.outer(columns, columns),
        q=values["q"] * columns,
        A=values["A"] * np.outer(rows, columns),
        u=values["u"] * rows,
    )
    assert solution.ok, solution


@given(seed=st.integers(0, 2**32 - 1), linear=st.booleans())
@settings(EXAMPLES, max_examples=20)
def test_polish_takes_them_to_the_last_digits(seed, linear):
    made = Made(seed, linear, True)
    solution = compiled(*made.sizes, polish=True).solve(**made.values)
    assert solution.ok
    assert made.objective(solution.primal["x"]) == pytest.approx(made.objective(made.x), abs=1e-12 * made.terms())


@st.composite
def nowhere(draw):
    """Rows of which the last contradicts the sum of the others."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, m = int(random.integers(2, 7)), int(random.integers(3, 11))
    A, u = random.integers(-3, 4, (m, n)).astype(float), random.integers(-3, 4, m).astype(float)
    A[~A.any(axis=1), 0] = 1.0
    weights = np.abs(random.integers(-3, 4, m - 1))
    A[-1], u[-1] = -weights @ A[:-1], -weights @ u[:-1] - 1.0
    return (n, m, 0), {"P": np.zeros((n, n)), "q": random.integers(-3, 4, n).astype(float), "A": A, "u": u}


@st.composite
def without_end(draw):
    """All forces along a direction that no row and no curvature opposes, from a feasible point."""
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, m = int(random.integers(2, 7)), int(random.integers(3, 11))
    d = random.integers(1, 4, n) * random.choice([-1.0, 1.0], n)
    B, A, q = (random.integers(-3, 4, shape).astype(float) for shape in ((n, n), (m, n), n))
    B = B * (d @ d) - np.outer(B @ d, d)
    A *= -np.sign(A @ d + 0.5)[:, np.newaxis]
    q = q if q @ d < 0 else -q if q @ d else -d
    u = A @ random.integers(-3, 4, n) + np.abs(random.integers(-3, 4, m))
    return (n, m, 0), {"P": B.T @ B, "q": q, "A": A, "u": u}


@pytest.mark.parametrize(
    ("kind", "status"),
    [(nowhere(), Status.INFEASIBLE), (without_end(), Status.UNBOUNDED)],
    ids=["infeasible", "unbounded"],
)
@pytest.mark.parametrize("unit", UNITS)
@given(data=st.data())
@settings(EXAMPLES, max_examples=20)
def test_that_there_is_no_answer_is_noticed_in_any_units(kind, status, unit, data):
    sizes, values = data.draw(kind)
    solution = compiled(*sizes).solve(**in_units(values, 1.0, unit, unit))
    assert (solution.status, solution.claimed) == (status, status)


def test_a_flat_minimum_far_away_is_no_ray():
    x = cp.Variable(2, name="x")
    far = cp.Problem(cp.Minimize(cp.square(x[0]) - x[1]), [x[0] + 1e-6 * x[1] <= 1.0, x[0] >= 0.0])
    solution = solvers.compile(far, "native").solve()
    assert solution.ok
    np.testing.assert_allclose(solution.primal["x"], [0.0, 1e6], rtol=1e-9, atol=1e-6)


def test_a_matrix_that_rounding_makes_definite_is_solved_as_well():
    """Rank 2 of 3, with a last pivot of rounding errors alone: its inverse is made of noise."""
    random = np.random.default_rng(4)
    for _ in range(50):
        B = random.normal(size=(2, 3))
        made = {"P": B.T @ B, "q": B.T @ random.normal(size=2), "A": np.eye(3), "u": random.normal(size=3)}
        assert compiled(3, 3, 0).solve(**made).ok


@pytest.mark.parametrize("size", [1e-320, 1e-300, 1e150, 1e300])
def test_numbers_of_any_size_fail_with_a_message(size):
    values = {"P": np.zeros((2, 2)), "q": np.ones(2), "A": -np.eye(2), "u": np.array([size, 1.0])}
    for changed in ({}, {"A": np.array([[-size, -1.0], [0.0, -1.0]])}, {"q": np.array([size, 1.0])}):
        solution = compiled(2, 2, 0).solve(**values | changed)
        assert solution.ok or solution.message


def test_the_limit_on_iterations_holds_for_all_steps_together():
    made = Made(1, True, True)
    x = cp.Variable(made.sizes[0], name="x")
    problem = cp.Problem(cp.Minimize(made.values["q"] @ x), [made.values["A"] @ x <= made.values["u"]])
    solution = solvers.compile(problem, "native", max_iterations=3).solve()
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations <= 4
