"""PIQP, a proximal interior-point method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import piqp

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
    """Adapter of ``piqp.DenseSolver``, or of ``piqp.SparseSolver`` if the program is stored sparse.

    The solver is set up anew for every solve, which costs 7 us. An update would scale from the previous scaling, so
    that the last bits of the answer depend on earlier numbers (140 of 200 repeated solves at n = 18 differed).
    """

    name = "piqp"
    sparse = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._dense = program.quadratic.dense is not None
        self._new_solver = piqp.DenseSolver if self._dense else piqp.SparseSolver
        self._solver: Any = self._new_solver()
        refuse_unknown(self.name, options, settings_of(self._solver.settings))
        self._settings = {"num_threads": 1, **tolerances.settings(self.name, tolerance), **options}

    def update(self) -> None:
        """Set the solver up anew."""
        program, e = self.program, self.program.equalities
        P: Any
        A: Any
        if self._dense:
            P = program.quadratic.to_dense().T  # symmetric, transposed because the solver needs Fortran order
            A = program.matrix.to_dense()
            equations, inequalities = np.asfortranarray(A[:e]), np.asfortranarray(A[e:])
        else:
            P = program.quadratic.to_sparse()
            A = program.matrix.to_sparse().tocsr()
            equations, inequalities = A[:e].tocsc(), A[e:].tocsc()
        self._solver = self._new_solver()
        settings = self._solver.settings
        for name, value in self._settings.items():
            setattr(settings, name, value)
        u = program.upper
        self._solver.setup(P, program.linear, equations, u[:e], inequalities, None, u[e:])

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        message = self._solver.solve().name
        result = self._solver.result
        y = np.concatenate((result.y, result.z_u))
        return Answer(np.array(result.x), y, STATUS.get(message, Status.FAILED), result.info.iter, message)
