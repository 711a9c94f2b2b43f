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
    """Adapter of ``proxsuite.proxqp.sparse``, set up anew for every solve.

    The last bits of the dense variant's answers depend on the addresses of its memory (20 of 300 repeated
    solves at n = 18 differed); those of the sparse variant do not.
    """

    name = "proxqp"
    sparse = True
    warm_starts = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._solver = self._new_solver()
        self._start: tuple[np.ndarray, ...] = ()
        refuse_unknown(self.name, options, settings_of(self._solver.settings))
        self._settings = {
            "verbose": False,
            "check_duality_gap": True,  # without it complementarity is not tested
            **tolerances.settings(self.name, tolerance),
            **options,
        }
        self._quadratic, self._matrix = program.quadratic.to_sparse(), program.matrix.to_sparse()

    def _new_solver(self) -> Any:
        program = self.program
        return proxqp.sparse.QP(program.variables, program.equalities, program.rows - program.equalities)

    def update(self) -> None:
        """Set the solver up anew."""
        program, e = self.program, self.program.equalities
        self._quadratic.data = program.quadratic.entries()
        self._matrix.data = program.matrix.entries()
        matrix = self._matrix.tocsr()
        equations, inequalities = matrix[:e].tocsc(), matrix[e:].tocsc()
        self._solver, self._start = self._new_solver(), ()
        for name, value in self._settings.items():
            setattr(self._solver.settings, name, value)
        u = program.upper
        self._solver.init(self._quadratic, program.linear, equations, u[:e], inequalities, program.lower[e:], u[e:])

    def begin(self, x: np.ndarray, y: np.ndarray) -> None:
        """Start the iteration at a point."""
        e = self.program.equalities
        self._solver.settings.initial_guess = proxqp.InitialGuess.WARM_START
        self._start = (x, y[:e], y[e:])

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        self._solver.solve(*self._start)
        result = self._solver.results
        message = result.info.status.name
        y = np.concatenate((result.y, result.z))
        return Answer(np.array(result.x), y, STATUS.get(message, Status.FAILED), result.info.iter, message)
