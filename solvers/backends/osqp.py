"""OSQP, an operator-splitting method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import osqp

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown, settings_of
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    "OSQP_SOLVED": Status.SOLVED,
    "OSQP_SOLVED_INACCURATE": Status.INACCURATE,
    "OSQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
    "OSQP_PRIMAL_INFEASIBLE_INACCURATE": Status.INFEASIBLE,
    "OSQP_DUAL_INFEASIBLE": Status.UNBOUNDED,
    "OSQP_DUAL_INFEASIBLE_INACCURATE": Status.UNBOUNDED,
    "OSQP_MAX_ITER_REACHED": Status.ITERATION_LIMIT,
    "OSQP_TIME_LIMIT_REACHED": Status.TIME_LIMIT,
}


class OSQP(Backend):
    """Adapter of ``osqp.OSQP``."""

    name = "osqp"

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        extension = osqp.OSQP(algebra="builtin").ext
        refuse_unknown(self.name, options, settings_of(extension.OSQPSettings()))
        chosen = {
            "verbose": False,
            "polishing": False,  # prints to stdout where no row is active; `solvers.polish` does it for all
            "warm_starting": False,
            "adaptive_rho": 1,  # by iterations; the default follows the clock
            "adaptive_rho_interval": 50,
        }
        self._settings = {**chosen, **tolerances.settings(self.name, tolerance), **options}
        self._triangle, self._upper = program.quadratic.upper()
        self._matrix = program.matrix.to_sparse()
        self._status = {
            int(value): STATUS.get(name, Status.FAILED) for name, value in osqp.SolverStatus.__members__.items()
        }
        self._solver: Any = None

    def update(self) -> None:
        """Set the solver up anew."""
        program = self.program
        self._triangle.data = program.quadratic.entries()[self._upper]
        self._matrix.data = program.matrix.entries()
        self._solver = osqp.OSQP(algebra="builtin")
        self._solver.setup(self._triangle, program.linear, self._matrix, program.lower, program.upper, **self._settings)

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        result = self._solver.solve(raise_error=False)
        info = result.info
        return Answer(np.array(result.x), np.array(result.y), self._status[info.status_val], info.iter, info.status)
