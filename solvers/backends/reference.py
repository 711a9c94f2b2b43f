"""The solvers of cvxpy, through ``problem.solve``: slow, and independent of the compiled path."""

import warnings
from collections.abc import Mapping
from typing import Any

import cvxpy as cp
import numpy as np

from solvers import tolerances
from solvers.backends.base import Answer, Backend
from solvers.canonical import Canonical
from solvers.errors import NotInstalledError, SolverError, UnknownBackendError
from solvers.leaves import assign, kept_values
from solvers.solution import Status
from solvers.threads import CVXPY

STATUS = {
    cp.OPTIMAL: Status.SOLVED,
    cp.OPTIMAL_INACCURATE: Status.INACCURATE,
    cp.INFEASIBLE: Status.INFEASIBLE,
    cp.INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    cp.UNBOUNDED: Status.UNBOUNDED,
    cp.UNBOUNDED_INACCURATE: Status.UNBOUNDED,
    cp.USER_LIMIT: Status.ITERATION_LIMIT,
}
KNOWN = tuple(cp.settings.SOLVERS)
# cvxpy loses OSQP's own polishing after the first solve, and OSQP prints a line if there is nothing to polish.
CHOSEN: dict[str, dict[str, Any]] = {"OSQP": {"polishing": False}}


def require(backend: str) -> str:
    """Return cvxpy's name of the solver behind a name with the prefix ``cvxpy:``.

    Raises
    ------
    UnknownBackendError
        If cvxpy has no such solver.
    NotInstalledError
        If cvxpy does not find the solver installed.
    """
    solver = backend.partition(":")[2].upper()
    if solver not in KNOWN:
        raise UnknownBackendError(f"unknown backend {backend!r}; allowed: cvxpy: and one of {', '.join(KNOWN)}")
    if solver not in cp.installed_solvers():
        raise NotInstalledError(
            f"cvxpy has no solver {solver} installed; installed: {', '.join(cp.installed_solvers())}"
        )
    return solver


class Reference(Backend):
    """Adapter of ``cvxpy.Problem.solve``.

    Each solve builds a new Problem. A Problem that is solved again keeps a warm start, fails in cvxpy's interface to
    ProxQP when its parameters change, and caches its last solver.
    """

    name = "cvxpy"

    def __init__(self, canonical: Canonical, backend: str, tolerance: float, options: Mapping[str, Any]) -> None:
        self.canonical = canonical
        self.solver = require(backend)
        table = self.solver.lower()
        known = tolerances.settings(table, tolerance) if table in tolerances.TOLERANCES else {}
        self._settings = {**known, **CHOSEN.get(self.solver, {}), **options}
        program = canonical.map.program
        for what, places, size in (
            ("variables that are none of the problem's", [place for _, place in canonical.primal], program.variables),
            ("rows that are none of its constraints", canonical.dual, program.rows),
        ):
            if np.unique(np.concatenate([np.zeros(0), *(place.places() for place in places)])).size < size:
                raise SolverError(
                    f"{backend} cannot be verified on this problem, whose standard form has {what}: "
                    "use a backend without the prefix cvxpy:"
                )

    def update(self) -> None:
        """Do nothing, because the values are handed over with the problem."""

    def solve(self) -> Answer:
        """Build a problem with the current values and solve it through cvxpy."""
        problem = self.canonical.problem
        program = self.canonical.map.program
        x, y = np.full(program.variables, np.nan), np.full(program.rows, np.nan)
        with CVXPY, kept_values(problem), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for parameter in problem.parameters():
                assign(parameter, self.canonical.views[parameter.name()].copy())
            fresh = cp.Problem(problem.objective, problem.constraints)
            try:
                fresh.solve(solver=self.solver, warm_start=False, **self._settings)
            except cp.SolverError as error:
                return Answer(x, y, Status.FAILED, 0, str(error))
            claimed = STATUS.get(fresh.status, Status.FAILED)
            if claimed in (Status.SOLVED, Status.INACCURATE):
                for variable, (_, place) in zip(problem.variables(), self.canonical.primal, strict=True):
                    place.put(x, variable.value)
                for constraint, place in zip(problem.constraints, self.canonical.dual, strict=True):
                    place.put(y, constraint.dual_value)
            iterations = fresh.solver_stats.num_iters
        return Answer(x, y, claimed, int(iterations or 0), fresh.status)
