"""Claims that a problem has no answer are proved or called failed, whoever makes them."""

from functools import cache

import cvxpy as cp
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from known_projections import INFEASIBLE, SOLVABLE, UNBOUNDED, known

import solvers
from solvers import Answer, Backend, Status, registry

CLAIMS = (Status.INFEASIBLE, Status.UNBOUNDED)
EXAMPLES = settings(max_examples=60, deadline=None, derandomize=True)
SOME = settings(EXAMPLES, max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])


class Claimant(Backend):
    """Says what it was told to, with vectors that prove nothing."""

    name = "claimant"
    says = Status.INFEASIBLE

    def __init__(self, program, tolerance, options):
        self.program = program

    def update(self):
        pass

    def solve(self):
        rows, variables = np.ones(self.program.rows), np.full(self.program.variables, -1e20)
        return Answer(variables, rows, Claimant.says, 1, "take my word")


@pytest.fixture(scope="module", autouse=True)
def _registered():
    registry.register("claimant", Claimant)
    yield
    registry.unregister("claimant")


def claim(model, says, backend="claimant", **keywords):
    Claimant.says = says
    values = keywords.pop("values", {})
    return solvers.compile(model, backend, **keywords).solve(**values)


def assert_refused(solution, says):
    assert (solution.status, solution.claimed) == (Status.FAILED, says)
    assert solution.message == f"claims {says}, not verified (take my word)"


@pytest.mark.parametrize("says", CLAIMS)
class TestClaims:
    @pytest.mark.parametrize("problem", SOLVABLE, ids=lambda problem: problem.name)
    def test_false_ones_are_failures_that_say_so(self, says, problem, storage):
        assert_refused(claim(problem.model(), says, values=problem.values()), says)

    @pytest.mark.parametrize("problem", SOLVABLE, ids=lambda problem: problem.name)
    def test_a_chain_goes_on_behind_false_ones(self, says, problem, monkeypatch):
        monkeypatch.setitem(registry.CHAINS, "auto", ("claimant", "daqp"))
        solution = claim(problem.model(), says, "auto", values=problem.values())
        assert (solution.ok, solution.backend, solution.fallbacks) == (True, "daqp", 1)

    @pytest.mark.parametrize(
        ("problem", "truth"), [*((p, Status.INFEASIBLE) for p in INFEASIBLE), (UNBOUNDED[0], Status.UNBOUNDED)]
    )
    def test_what_is_proved_is_reported(self, says, problem, truth, storage):
        """Also where the other of the two was claimed."""
        solution = claim(problem.model(), says, values=problem.values(), polish=True)
        assert (solution.status, solution.claimed, solution.message) == (truth, says, "take my word")
        assert np.isnan([solution.objective, solution.primal_residual, *solution.primal["velocity"]]).all()
        assert all(np.isnan(multiplier).all() for multiplier in solution.dual)

    def test_a_point_is_needed_where_no_ray_ends(self, says):
        x = cp.Variable(2, name="x")
        contradiction = [x[0] <= 0, x[0] >= 1]
        assert claim(cp.Problem(cp.Minimize(x[1]), contradiction), says).status is Status.INFEASIBLE
        assert claim(cp.Problem(cp.Minimize(x[1]), [x[0] <= 0]), says).status is Status.UNBOUNDED

    def test_a_contradiction_within_the_tolerance_is_none(self, says):
        x = cp.Variable(name="x")
        for gap, tolerance, proved in ((1e-8, 1e-9, True), (1e-10, 1e-9, False), (1e-8, 1e-7, False)):
            problem = cp.Problem(cp.Minimize(x**2), [x <= 1, x >= 1 + gap])
            assert (claim(problem, says, tolerance=tolerance).status is Status.INFEASIBLE) == proved

    def test_a_slope_within_the_tolerance_is_none(self, says):
        x, slope = cp.Variable(name="x"), cp.Parameter(name="slope")
        for value, proved in ((1e-8, True), (1e-10, False)):
            problem = cp.Problem(cp.Minimize(slope * x))
            assert (claim(problem, says, values={"slope": value}).status is Status.UNBOUNDED) == proved

    @pytest.mark.parametrize("angle", [1e-3, 1e-6, 1e-9, 1e-11])
    def test_rows_that_meet_far_away_meet(self, says, angle):
        x = cp.Variable(2, name="x")
        assert_refused(claim(cp.Problem(cp.Minimize(0), [x[0] <= x[1], x[0] >= (1 - angle) * x[1] + 1]), says), says)

    @pytest.mark.parametrize("size", [1e-320, 1e-300, 1e150])
    def test_numbers_of_any_size_can_be_handed_over(self, says, size):
        x = cp.Variable(2, name="x")
        row, bound = cp.Parameter(2, name="row"), cp.Parameter(name="bound")
        problem = cp.Problem(cp.Minimize(cp.sum(x)), [row @ x <= bound, x >= -1])
        for values in ({"row": [size, 1.0], "bound": 1e150}, {"row": [size, size], "bound": 1.0}):
            assert claim(problem, says, values=values).status is Status.FAILED
        assert claim(problem, says, values={"row": [0, 0], "bound": -1e150}).status is Status.INFEASIBLE

    @pytest.mark.parametrize("curvature", [1.0, 1e-9, 1e-14])
    def test_nothing_is_unbounded_that_curves(self, says, curvature):
        x = cp.Variable(3, name="x")
        matrix = curvature * np.diag([1.0, 1e-3, 1e3])
        problem = cp.Problem(cp.Minimize(0.5 * cp.quad_form(x, matrix) - cp.sum(x)), [x[0] <= 3])
        assert_refused(claim(problem, says), says)

    def test_polish_may_find_the_answer(self, says):
        problem = next(problem for problem in SOLVABLE if problem.name == "mixed")
        x, y = np.array([0.75, 0.25]), np.array([-0.25, 0.5])

        class Modest(Claimant):
            def solve(self):
                return Answer(x, y, says, 1, "take my word")

        registry.register("modest", Modest)
        try:
            assert_refused(claim(problem.model(), says, "modest", values=problem.values()), says)
            assert claim(problem.model(), says, "modest", values=problem.values(), polish=True).ok
        finally:
            registry.unregister("modest")


@cache
def compiled(backend):
    """3 variables, 2 inequality rows, a curvature and an equation, all of them Parameters."""
    x = cp.Variable(3, name="x")
    problem = cp.Problem(
        cp.Minimize(0.5 * cp.quad_form(x, cp.Parameter((3, 3), PSD=True, name="P")) + cp.Parameter(3, name="q") @ x),
        [cp.Parameter((3, 3), name="A") @ x <= cp.Parameter(3, name="u"), cp.Parameter(3, name="F") @ x == 0],
    )
    return solvers.compile(problem, backend)


WHOLE = st.integers(-3, 3)
VECTOR, MATRIX = arrays.arrays(float, 3, elements=WHOLE), arrays.arrays(float, (3, 3), elements=WHOLE)
SCALES = arrays.arrays(float, 3, elements=st.sampled_from([1.0, 1e-4, 1e4]))


def scaled(values, rows, variables):
    """The same problem in other units of its rows and variables."""
    return {
        "P": values["P"] * np.outer(variables, variables),
        "q": values["q"] * variables,
        "A": values["A"] * np.outer(rows, variables),
        "u": values["u"] * rows,
        "F": values["F"] * variables,
    }


@st.composite
def solvable(draw):
    """Stationary at x, with multipliers y of the rows that touch it."""
    B, A, F, x = draw(MATRIX), draw(MATRIX), draw(VECTOR), draw(VECTOR)
    F = F @ F * x - (F @ x) * F if x.any() else F
    F = np.cross(x, F) if (F @ x) else F
    P, y = B @ B.T, np.abs(draw(VECTOR))
    free = draw(arrays.arrays(bool, 3))
    slack = np.where(free, np.abs(draw(VECTOR)), 0.0)
    force = P @ x + A.T @ np.where(free, 0.0, y) + draw(WHOLE) * F
    return {"P": P, "q": -force, "A": A, "u": A @ x + slack, "F": F}


@st.composite
def infeasible(draw):
    """The last row contradicts a sum of the others and the equation."""
    B, A, u, F, y = draw(MATRIX), draw(MATRIX), draw(VECTOR), draw(VECTOR), np.abs(draw(VECTOR))
    A[2] = -(y[:2] @ A[:2]) + draw(WHOLE) * F
    u[2] = -(y[:2] @ u[:2]) - draw(st.integers(1, 3))
    return {"P": B @ B.T, "q": draw(VECTOR), "A": A, "u": u, "F": F}


@st.composite
def unbounded(draw):
    """All forces along a direction that no row and no curvature opposes, from a feasible point."""
    d = draw(VECTOR.filter(np.any))

    def across(vectors):
        return vectors * (d @ d) - np.multiply.outer(vectors @ d, d)

    B, A, q = across(draw(MATRIX)), draw(MATRIX), draw(VECTOR)
    A *= -np.sign(A @ d + 0.5)[:, np.newaxis]
    q = q if q @ d < 0 else -q if q @ d else -d
    F = across(draw(VECTOR))
    return {"P": B.T @ B, "q": q, "A": A, "u": np.abs(draw(VECTOR)), "F": F}


TRUTH = {"solvable": (solvable(), None), "infeasible": (infeasible(), CLAIMS[0]), "unbounded": (unbounded(), CLAIMS[1])}


@pytest.mark.parametrize("kind", TRUTH)
@given(data=st.data())
@EXAMPLES
def test_what_is_proved_is_true_and_what_is_true_is_proved(kind, data):
    problems, truth = TRUTH[kind]
    values = scaled(data.draw(problems), data.draw(SCALES), data.draw(SCALES))
    Claimant.says = data.draw(st.sampled_from(CLAIMS))
    solution = compiled("claimant").solve(**values)
    assert solution.status is (truth or Status.FAILED)


@pytest.mark.parametrize("kind", TRUTH)
@given(data=st.data())
@SOME
def test_no_backend_passes_on_a_false_claim(backend, kind, data):
    """Each is asked; the statuses that it may end with are the truth, and failures."""
    problems, truth = TRUTH[kind]
    solution = compiled(backend).solve(**data.draw(problems))
    if truth is None:
        assert solution.status not in CLAIMS
    else:
        assert solution.status not in {Status.SOLVED, *CLAIMS} - {truth}
        assert (solution.status is truth) == (solution.claimed in CLAIMS)


def least_weights():
    """Strictly convex, in small numbers, which some take for none."""
    x = cp.Variable(10, name="x")
    wish = np.array([4.0, 2, -2, 3, 3, 7, 3, 11, 10, 14])
    square = cp.quad_form(x, np.diag(np.arange(1.0, 11.0)))
    return cp.Problem(cp.Minimize((0.5 * square - wish @ x) / 2e5), [x[:-1] <= x[1:]])


def largest_minimum():
    y = cp.Variable(3, name="y")
    return cp.Problem(cp.Maximize(cp.min(y)), [y <= np.array([3.0, 2.0, 5.0]), cp.sum(y) <= 4])


def klee_minty():
    z = cp.Variable(6, name="z")
    rows = [sum(2.0 ** (i - j + 1) * z[j] for j in range(i)) + z[i] <= 5.0 ** (i + 1) for i in range(6)]
    return cp.Problem(cp.Maximize(2.0 ** np.arange(5, -1, -1) @ z), [*rows, z >= 0])


@pytest.mark.parametrize("model", [least_weights, largest_minimum, klee_minty])
def test_problems_that_backends_misjudge(backend, model):
    assert solvers.compile(model(), backend).solve().status not in CLAIMS
    assert solvers.compile(model(), "auto").solve().ok


def test_claims_are_judged_behind_the_solve_method_as_well(monkeypatch):
    monkeypatch.setattr(cp.Problem, "REGISTERED_SOLVE_METHODS", dict(cp.Problem.REGISTERED_SOLVE_METHODS))
    solvers.register_solve_method()
    Claimant.says = Status.UNBOUNDED
    problem = largest_minimum()
    with pytest.raises(cp.SolverError, match=r"claimant ended with failed \(claims unbounded, not verified"):
        problem.solve(method="compiled", backend="claimant")
    assert problem.status is None
    none = known("nowhere", [1, 1], [0, 0], [[1, 0], [-1, 0]], [1, 0])
    model = none.model()
    for parameter in model.parameters():
        parameter.value = none.values()[parameter.name()]
    assert model.solve(method="compiled", backend="claimant") == np.inf
    assert model.status == cp.INFEASIBLE
