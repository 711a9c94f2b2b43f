"""QPALM, a proximal augmented Lagrangian method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import qpalm

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown, settings_of
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    qpalm.Info.SOLVED: Status.SOLVED,
    qpalm.Info.DUAL_TERMINATED: Status.FAILED,
    qpalm.Info.PRIMAL_INFEASIBLE: Status.INFEASIBLE,
    qpalm.Info.DUAL_INFEASIBLE: Status.UNBOUNDED,
    qpalm.Info.MAX_ITER_REACHED: Status.ITERATION_LIMIT,
    qpalm.Info.TIME_LIMIT_REACHED: Status.TIME_LIMIT,
}


class QPALM(Backend):
    """Adapter of ``qpalm.Solver``, set up once and updated, which leaves no trace of earlier numbers."""

    name = "qpalm"
    sparse = True
    warm_starts = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._settings = qpalm.Settings()
        refuse_unknown(self.name, options, settings_of(self._settings))
        for name, value in {"verbose": 0, **tolerances.settings(self.name, tolerance), **options}.items():
            setattr(self._settings, name, value)
        self._triangle, self._upper = program.quadratic.upper()
        self._solver: Any = None

    def update(self) -> None:
        """Set the solver up, or rewrite its numbers."""
        program = self.program
        triangle = program.quadratic.entries()[self._upper]
        if self._solver is None:
            data = qpalm.Data(program.variables, program.rows)
            self._triangle.data = triangle
            data.Q, data.q, data.A = self._triangle, program.linear, program.matrix.to_sparse()
            data.bmin, data.bmax = program.lower, program.upper
            self._solver = qpalm.Solver(data, self._settings)
            return
        self._solver.update_Q_A(triangle, program.matrix.entries())
        self._solver.update_q(program.linear)
        self._solver.update_bounds(program.lower, program.upper)

    def begin(self, x: np.ndarray, y: np.ndarray) -> None:
        """Start the iteration at a point."""
        self._solver.warm_start(x, y)

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        self._solver.solve(asynchronous=False)
        info, solution = self._solver.info, self._solver.solution
        claimed = STATUS.get(info.status_val, Status.FAILED)
        return Answer(np.array(solution.x), np.array(solution.y), claimed, info.iter, info.status)
