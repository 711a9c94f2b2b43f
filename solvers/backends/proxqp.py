"""ProxQP, a proximal augmented Lagrangian method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from proxsuite import proxqp

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown, settings_of
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    "PROXQP_SOLVED": Status.SOLVED,
    "PROXQP_SOLVED_CLOSEST_PRIMAL_FEASIBLE": Status.INFEASIBLE,
    "PROXQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
    "PROXQP_DUAL_INFEASIBLE": Status.UNBOUNDED,
    "PROXQP_MAX_ITER_REACHED": Status.ITERATION_LIMIT,
}


class ProxQP(Backend):
    """Adapter of ``proxsuite.proxqp``."""

    name = "proxqp"

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        n, e, m = program.variables, program.equalities, program.rows
        self._solver: Any = proxqp.dense.QP(n, e, m - e)
        refuse_unknown(self.name, options, settings_of(self._solver.settings))
        self._chosen = {
            "verbose": False,
            "check_duality_gap": True,  # without it complementarity is not tested
            "initial_guess": proxqp.InitialGuess.EQUALITY_CONSTRAINED_INITIAL_GUESS,
            **tolerances.settings(self.name, tolerance),
            **options,
        }

    def update(self) -> None:
        """Set the solver up anew."""
        program, e = self.program, self.program.equalities
        P, A, u = program.quadratic.to_dense(), program.matrix.to_dense(), program.upper
        self._solver = proxqp.dense.QP(program.variables, e, program.rows - e)
        for name, value in self._chosen.items():
            setattr(self._solver.settings, name, value)
        self._solver.init(P, program.linear, A[:e], u[:e], A[e:], program.lower[e:], u[e:])

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        self._solver.solve()
        result = self._solver.results
        message = result.info.status.name
        y = np.concatenate((result.y, result.z))
        return Answer(np.array(result.x), y, STATUS.get(message, Status.FAILED), result.info.iter, message)
