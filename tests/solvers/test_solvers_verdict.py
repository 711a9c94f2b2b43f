"""What is reported does not depend on what a backend says about itself."""

import json
import subprocess
import sys

import numpy as np
import pytest
from known_projections import INFEASIBLE, SOLVABLE

import solvers
from solvers import Answer, Backend, Status, registry
from solvers.distribution import install_line

PROBLEM = next(problem for problem in SOLVABLE if problem.name == "mixed")


def answering(x, y, claimed=Status.SOLVED):
    class Fixed(Backend):
        name = "fixed"

        def __init__(self, program, tolerance, options):
            self.program = program

        def update(self):
            pass

        def solve(self):
            return Answer(np.array(x, dtype=float), np.array(y, dtype=float), claimed, 7, "as I please")

    return Fixed


def solved_with(registered, factory, problem=PROBLEM, **keywords):
    registered("fixed", factory)
    return solvers.compile(problem.model(), "fixed", **keywords).solve(**problem.values())


@pytest.mark.parametrize(
    ("x", "y", "at_fault"),
    [
        ([0.5, 0.5], [-0.5, 0.0], "primal_residual"),  # violates the row
        ([0.75, 0.3], [-0.3, 0.45], "primal_residual"),  # violates the equation
        ([0.75, 0.25], [0.0, 0.0], "dual_residual"),  # forces do not balance
        ([0.75, 0.25], [-0.25, 0.5 + 1e-6], "dual_residual"),
        ([2.0, -1.0], [1.0, 3.0], "complementarity"),  # an impulse without contact
    ],
)
def test_a_liar_is_reported_inaccurate(registered, x, y, at_fault):
    solution = solved_with(registered, answering(x, y))
    assert solution.status is Status.INACCURATE
    assert solution.claimed is Status.SOLVED
    assert not solution.ok
    residuals = {name: getattr(solution, name) for name in ("primal_residual", "dual_residual", "complementarity")}
    assert max(residuals, key=residuals.get) == at_fault
    assert residuals[at_fault] > 1e-7


def test_a_negative_multiplier_is_seen(registered):
    problem = next(problem for problem in SOLVABLE if problem.name == "redundant rows")
    # the forces balance and every product vanishes, but one row pulls
    solution = solved_with(registered, answering([1.0, 0.0], [2.0, -1.0, 0.0, 0.0]), problem)
    assert solution.status is Status.INACCURATE
    assert solution.dual_residual > 0.1


def test_an_honest_answer_is_solved_whatever_it_calls_itself(registered):
    solution = solved_with(registered, answering([0.75, 0.25], [-0.25, 0.5], Status.INACCURATE))
    assert solution.ok
    assert solution.claimed is Status.INACCURATE


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
@pytest.mark.parametrize("where", ["x", "y"])
@pytest.mark.parametrize("polish", [False, True])
def test_nan_and_overflow_are_failures(registered, bad, where, polish):
    x, y = [0.75, 0.25], [-0.25, 0.5]
    {"x": x, "y": y}[where][0] = bad
    solution = solved_with(registered, answering(x, y), polish=polish)
    assert solution.status in (
        (Status.FAILED,) if not np.isfinite(bad) else (Status.FAILED, Status.INACCURATE, Status.SOLVED)
    )
    assert solution.ok == (polish and bad == 1e300)


def test_a_limit_is_not_hidden(registered):
    solution = solved_with(registered, answering([0.75, 0.25], [-0.25, 0.5], Status.ITERATION_LIMIT))
    assert solution.status is Status.ITERATION_LIMIT


@pytest.mark.parametrize("claimed", [Status.FAILED, Status.ITERATION_LIMIT])
def test_polish_that_finds_an_answer_exact_needs_no_claim(registered, claimed):
    solution = solved_with(registered, answering([0.75, 0.25], [-0.25, 0.5], claimed), polish=True)
    assert solution.ok
    assert solution.claimed is claimed
    assert not solution.polished


def test_polish_rescues_an_answer_near_the_solution(registered):
    solution = solved_with(registered, answering([0.7501, 0.2499], [-0.2501, 0.4998]), polish=True)
    assert solution.ok
    assert solution.polished
    np.testing.assert_allclose(solution.primal["velocity"], [0.75, 0.25], rtol=0, atol=1e-15)


def test_polish_cannot_make_an_infeasible_problem_solved(registered):
    problem = INFEASIBLE[0]
    solution = solved_with(registered, answering([1.0, 0.0], [1.0, 1.0]), problem, polish=True)
    assert solution.status is Status.INACCURATE


def test_a_chain_goes_on_and_counts(registered, monkeypatch):
    registered("liar", answering([9.0, 9.0], [9.0, 9.0]))
    monkeypatch.setitem(registry.CHAINS, "auto", ("liar", "daqp"))
    compiled = solvers.compile(PROBLEM.model())
    solution = compiled.solve(**PROBLEM.values())
    assert solution.ok
    assert (solution.fallbacks, solution.backend, compiled.backend) == (1, "daqp", "auto")
    monkeypatch.setitem(registry.CHAINS, "auto", ("liar",))
    assert solvers.compile(PROBLEM.model()).solve(**PROBLEM.values()).status is Status.INACCURATE


@pytest.mark.parametrize("problem", SOLVABLE, ids=lambda problem: problem.name)
def test_auto_takes_native_for_known_problems_with_curvature(problem):
    solution = solvers.compile(problem.model()).solve(**problem.values())
    assert solution.ok
    assert (solution.fallbacks, solution.backend) == (0, "daqp" if problem.name == "semidefinite metric" else "native")


@pytest.mark.parametrize("problem", INFEASIBLE, ids=lambda problem: problem.name)
def test_a_claim_that_is_proved_ends_a_chain(problem):
    solution = solvers.compile(problem.model()).solve(**problem.values())
    assert (solution.status, solution.fallbacks, solution.backend) == (Status.INFEASIBLE, 0, "native")


def test_options_of_a_chain_are_given_by_member():
    compiled = solvers.compile(PROBLEM.model(), "auto", native={"max_iterations": 1})
    solution = compiled.solve(**PROBLEM.values())
    assert solution.ok
    assert solution.backend == "daqp"
    with pytest.raises(solvers.SolverError, match="one mapping for native, daqp, piqp"):
        solvers.compile(PROBLEM.model(), "auto", iter_limit=1)


def test_unknown_backends_are_refused_with_the_known_ones():
    with pytest.raises(solvers.UnknownBackendError, match="unknown backend 'gurobbi'; allowed: auto, clarabel, daqp"):
        solvers.compile(PROBLEM.model(), "gurobbi")
    with pytest.raises(solvers.UnknownBackendError, match="cvxpy: and one of"):
        solvers.compile(PROBLEM.model(), "cvxpy:GURBI")


def test_a_missing_package_is_named_with_the_remedy(monkeypatch):
    monkeypatch.setitem(registry.BUILTIN, "qpalm", ("QPALM", "a_package_nobody_has"))
    with pytest.raises(solvers.NotInstalledError, match=r"'a_package_nobody_has'.*pip install '\.\[solvers\]'"):
        solvers.compile(PROBLEM.model(), "qpalm")
    assert "qpalm" not in solvers.available()
    (info,) = (info for info in solvers.backends() if info.name == "qpalm")
    assert not info.installed
    assert info.install == install_line("solvers")


def test_a_solver_cvxpy_lacks_is_not_installed():
    import cvxpy as cp

    missing = next(name for name in cp.settings.SOLVERS if name not in cp.installed_solvers())
    with pytest.raises(solvers.NotInstalledError, match=f"no solver {missing} installed"):
        solvers.compile(PROBLEM.model(), f"cvxpy:{missing}")


def test_names_can_be_taken_only_once(registered):
    registered("fixed", answering([0, 0], [0, 0]))
    for name in ("fixed", "daqp", "auto", "cvxpy:ANY"):
        with pytest.raises(solvers.SolverError, match="is taken"):
            solvers.register(name, answering([0, 0], [0, 0]))
    assert "fixed" in solvers.available()


def test_other_packages_offer_backends_through_entry_points(monkeypatch):
    class Point:
        name = "theirs"

        def load(self):
            return answering([0.75, 0.25], [-0.25, 0.5])

    registry._offered.cache_clear()
    monkeypatch.setattr(registry, "entry_points", lambda group: [Point()] if group == "deli.solvers" else [])
    assert "theirs" in solvers.available()
    solution = solvers.compile(PROBLEM.model(), "theirs").solve(**PROBLEM.values())
    assert (solution.ok, solution.backend) == (True, "theirs")
    monkeypatch.undo()
    registry._offered.cache_clear()


@pytest.mark.parametrize("tolerance", [0.0, -1e-9, 1.0, float("nan")])
def test_tolerances_are_checked(tolerance):
    with pytest.raises(solvers.SolverError, match="tolerance is"):
        solvers.compile(PROBLEM.model(), "daqp", tolerance=tolerance)


def test_importing_solvers_imports_no_solver():
    packages = sorted({package for _, package in registry.BUILTIN.values()} | {"cvxpy"})
    code = (
        "import sys, json, solvers; solvers.available(); "
        f"print(json.dumps([p for p in {packages} if p in sys.modules]))"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(loaded.stdout) == []


REFERENCES = ["CLARABEL", "OSQP", "PROXQP", "DAQP", "PIQP"]


@pytest.mark.parametrize("solver", REFERENCES)
def test_the_reference_solves_through_cvxpy(solver):
    import cvxpy as cp

    if solver not in cp.installed_solvers():
        pytest.skip(f"cvxpy has no solver {solver} installed")
    problem = PROBLEM.model()
    compiled = solvers.compile(problem, f"cvxpy:{solver}")
    direct = solvers.compile(problem, "daqp")
    for factor in (1.0, 2.0, 1.0):
        values = PROBLEM.values() | {"bounds": factor * PROBLEM.bounds}
        solution = compiled.solve(**values)
        assert solution.ok, solution
        np.testing.assert_allclose(solution.primal["velocity"], direct.solve(**values).primal["velocity"], atol=1e-8)
        for mine, theirs in zip(solution.dual, direct.solve(**values).dual, strict=True):
            np.testing.assert_allclose(mine, theirs, atol=1e-8)
    assert all(parameter.value is None for parameter in problem.parameters())
    assert all(variable.value is None for variable in problem.variables())


def test_the_reference_reports_infeasible_problems():
    problem = INFEASIBLE[0]
    solution = solvers.compile(problem.model(), "cvxpy:CLARABEL").solve(**problem.values())
    assert solution.status is Status.INFEASIBLE


def test_highs_works_after_cvxpy_used_it():
    pytest.importorskip("highspy")
    code = (
        "import cvxpy as cp, solvers; x = cp.Variable(2, name='x');"
        "problem = cp.Problem(cp.Minimize(cp.sum_squares(x - 1)), [x <= 0]);"
        "problem.solve(solver='HIGHS'); assert solvers.compile(problem, 'highs').solve().ok"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
