"""PIQP, a proximal interior-point method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import piqp
from scipy import sparse

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown, settings_of
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    "PIQP_SOLVED": Status.SOLVED,
    "PIQP_PRIMAL_INFEASIBLE": Status.INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": Status.UNBOUNDED,
    "PIQP_MAX_ITER_REACHED": Status.ITERATION_LIMIT,
}


class PIQP(Backend):
    """Adapter of ``piqp.DenseSolver``, or ``piqp.SparseSolver`` where the program is stored sparse."""

    name = "piqp"

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._dense = program.quadratic.dense is not None
        self._solver: Any = piqp.DenseSolver() if self._dense else piqp.SparseSolver()
        refuse_unknown(self.name, options, settings_of(self._solver.settings))
        chosen = {"verbose": False, "num_threads": 1}
        for name, value in {**chosen, **tolerances.settings(self.name, tolerance), **options}.items():
            setattr(self._solver.settings, name, value)
        self._started = False

    def update(self) -> None:
        """Hand over all numbers; the solver scales them anew."""
        program, e = self.program, self.program.equalities
        P: Any
        A: Any
        if self._dense:
            P = program.quadratic.to_dense().T  # symmetric, and the solver wants Fortran order
            A = program.matrix.to_dense()
            equations, inequalities = np.asfortranarray(A[:e]), np.asfortranarray(A[e:])
        else:
            P = program.quadratic.to_sparse()
            A = program.matrix.to_sparse()
            equations, inequalities = sparse.csc_matrix(A[:e]), sparse.csc_matrix(A[e:])
        u = program.upper
        hand_over = self._solver.update if self._started else self._solver.setup
        hand_over(P, program.linear, equations, u[:e], inequalities, None, u[e:])
        self._started = True

    def solve(self) -> Answer:
        """Solve from scratch."""
        message = self._solver.solve().name
        result = self._solver.result
        y = np.concatenate((result.y, result.z_u))
        return Answer(np.array(result.x), y, STATUS.get(message, Status.FAILED), result.info.iter, message)
