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
INFINITY = 1e30  # the C library's value for an absent bound


class OSQP(Backend):
    """Adapter of OSQP's extension module, set up anew for every solve.

    An update scales numbers that are already scaled, so that every answer depends on earlier ones. Without scaling,
    badly scaled projections at n = 18 take 8 times the iterations. A new ``osqp.OSQP`` costs 350 us, nearly all
    of it in Python; the extension's own class costs 15 us.
    """

    name = "osqp"
    sparse = True
    warm_starts = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._extension = osqp.OSQP(algebra="builtin").ext
        self._settings = self._extension.OSQPSettings()
        self._extension.osqp_set_default_settings(self._settings)
        refuse_unknown(self.name, options, settings_of(self._settings))
        chosen = {
            "verbose": False,
            "polishing": False,  # prints where no row is active; `solvers.polish` does it for all backends
            "warm_starting": False,
            "adaptive_rho": 1,  # by iterations, because the default depends on the clock
            "adaptive_rho_interval": 50,
        }
        for name, value in {**chosen, **tolerances.settings(self.name, tolerance), **options}.items():
            setattr(self._settings, name, value)
        self._triangle, self._upper = program.quadratic.upper()
        self._matrix = program.matrix.to_sparse()
        self._lower = np.full(program.rows, -INFINITY)
        self._status = {
            int(value): (STATUS.get(name, Status.FAILED), name) for name, value in osqp.SolverStatus.__members__.items()
        }
        self._solver: Any = None

    def update(self) -> None:
        """Set the solver up anew."""
        program, extension, e = self.program, self._extension, self.program.equalities
        self._triangle.data = program.quadratic.entries()[self._upper]
        self._matrix.data = program.matrix.entries()
        self._lower[:e] = program.upper[:e]
        P, A = extension.CSC(self._triangle), extension.CSC(self._matrix)
        self._solver = extension.OSQPSolver(
            P, program.linear, A, self._lower, program.upper, program.rows, program.variables, self._settings
        )

    def begin(self, x: np.ndarray, y: np.ndarray) -> None:
        """Start the iteration at a point."""
        self._solver.warm_start(x, y)

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        self._solver.solve()
        solution, info = self._solver.solution, self._solver.info
        claimed, message = self._status[info.status_val]
        return Answer(np.array(solution.x), np.array(solution.y), claimed, info.iter, message)
