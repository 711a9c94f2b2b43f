"""QOCO, an interior-point method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import qoco

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown, settings_of
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    "QOCO_SOLVED": Status.SOLVED,
    "QOCO_SOLVED_INACCURATE": Status.INACCURATE,
    "QOCO_MAX_ITER": Status.ITERATION_LIMIT,
}


class QOCO(Backend):
    """Adapter of ``qoco.QOCO``, which does not detect infeasible problems; set up anew for every solve.

    At n = 4 an update takes 20 us and a new object 470 us. But an update keeps a trace of earlier numbers: on
    nearly degenerate projections its answers differ from those of a new object, and differ much after a failed solve.
    """

    name = "qoco"
    sparse = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        extension = qoco.QOCO(algebra="builtin").ext
        refuse_unknown(self.name, options, settings_of(extension.QOCOSettings()))
        self._settings = {"verbose": 0, **tolerances.settings(self.name, tolerance), **options}
        self._solver: Any = None

    def update(self) -> None:
        """Set the solver up."""
        program = self.program
        n, m, e, u = program.variables, program.rows, program.equalities, program.upper
        matrix = program.matrix.to_sparse().tocsr()
        first = (matrix[:e].tocsc(), u[:e]) if e else (None, None)
        second = (matrix[e:].tocsc(), u[e:]) if m > e else (None, None)
        self._solver = qoco.QOCO(algebra="builtin")
        self._solver.setup(
            n, m - e, e, program.quadratic.to_sparse(), program.linear, *first, *second, m - e, 0, None,
            **self._settings,
        )  # fmt: skip

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        result = self._solver.solve()
        y = np.concatenate((result.y, result.z))
        return Answer(np.array(result.x), y, STATUS.get(result.status, Status.FAILED), result.iters, result.status)
