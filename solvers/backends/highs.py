"""HiGHS, an active-set method."""

from collections.abc import Mapping
from typing import Any

import highspy
import numpy as np

from solvers import tolerances
from solvers.backends.base import Answer, Backend
from solvers.errors import SolverError
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    "kOptimal": Status.SOLVED,
    "kInfeasible": Status.INFEASIBLE,
    "kUnbounded": Status.UNBOUNDED,
    "kUnboundedOrInfeasible": Status.FAILED,
    "kIterationLimit": Status.ITERATION_LIMIT,
    "kTimeLimit": Status.TIME_LIMIT,
}


class _QuietHighs(highspy.Highs):
    def enableCallbacks(self) -> None:
        """Turn the output off before the constructor prints its banner; callbacks are not used."""
        self.silent()


class HiGHS(Backend):
    """Adapter of ``highspy.Highs``, whose multipliers have the opposite sign.

    Its method for quadratic programs is serial. The number of threads is left alone: the threads are shared by the
    whole process, and after another user of HiGHS asked for a different number, no solve would start.
    """

    name = "highs"
    sparse = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._settings = {**tolerances.settings(self.name, tolerance), **options}
        self._triangle, self._upper = program.quadratic.upper()
        self._matrix = program.matrix.to_sparse()
        self._solver: Any = None
        self._new_solver()

    def _new_solver(self) -> None:
        self._solver = _QuietHighs()
        for name, value in self._settings.items():
            if self._solver.setOptionValue(name, value) != highspy.HighsStatus.kOk:
                raise SolverError(f"highs has no option {name!r} that takes {value!r}; see the list of HiGHS options")

    def update(self) -> None:
        """Set the solver up anew."""
        program = self.program
        self._matrix.data = program.matrix.entries()
        self._triangle.data = program.quadratic.entries()[self._upper]
        model = highspy.HighsModel()
        lp, hessian = model.lp_, model.hessian_
        lp.num_col_, lp.num_row_ = program.variables, program.rows
        lp.col_cost_ = program.linear
        lp.col_lower_ = np.full(program.variables, -highspy.kHighsInf)
        lp.col_upper_ = np.full(program.variables, highspy.kHighsInf)
        lp.row_lower_, lp.row_upper_ = program.lower, program.upper
        lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
        lp.a_matrix_.start_, lp.a_matrix_.index_ = self._matrix.indptr, self._matrix.indices
        lp.a_matrix_.value_ = self._matrix.data
        lower = self._triangle.T.tocsc()
        hessian.dim_, hessian.format_ = program.variables, highspy.HessianFormat.kTriangular
        hessian.start_, hessian.index_, hessian.value_ = lower.indptr, lower.indices, lower.data
        self._new_solver()
        self._solver.passModel(model)

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        self._solver.run()
        solution, info = self._solver.getSolution(), self._solver.getInfo()
        message = self._solver.getModelStatus().name
        x, y = np.array(solution.col_value), -np.array(solution.row_dual)
        return Answer(x, y, STATUS.get(message, Status.FAILED), max(info.qp_iteration_count, 0), message)
