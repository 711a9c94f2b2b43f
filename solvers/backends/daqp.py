"""DAQP, a dual active-set method for small dense problems."""

from collections.abc import Mapping
from typing import Any

import daqp
import numpy as np

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    1: (Status.SOLVED, "optimal"),
    2: (Status.SOLVED, "optimal with soft constraints"),
    -1: (Status.INFEASIBLE, "infeasible"),
    -2: (Status.FAILED, "cycling detected"),
    -3: (Status.UNBOUNDED, "unbounded"),
    -4: (Status.ITERATION_LIMIT, "iteration limit"),
    -5: (Status.FAILED, "nonconvex"),
    -6: (Status.FAILED, "initial working set overdetermined"),
    -7: (Status.TIME_LIMIT, "time limit"),
}
EQUALITY = 5


class DAQP(Backend):
    """Adapter of ``daqp.solve``.

    The stateless call takes no longer than updating a ``daqp.Model`` (4.0 against 4.7 us at n = 4, 7.7 against
    7.8 us at n = 18), whose answers can differ in the last bits from those of a new one.
    """

    name = "daqp"

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        refuse_unknown(self.name, options, daqp.Model().settings)
        self._settings = {**tolerances.settings(self.name, tolerance), **options}
        self._sense = np.zeros(program.rows, dtype=np.intc)
        self._sense[: program.equalities] = EQUALITY
        self._quadratic = program.quadratic.to_dense()
        self._matrix = program.matrix.to_dense()

    def update(self) -> None:
        """Copy the matrices if they are stored sparse; dense ones are shared."""
        if self.program.quadratic.dense is None:
            self._quadratic = self.program.quadratic.to_dense()
            self._matrix = self.program.matrix.to_dense()

    def solve(self) -> Answer:
        """Solve from scratch."""
        program = self.program
        x, _, flag, info = daqp.solve(
            self._quadratic,
            program.linear,
            self._matrix,
            program.upper,
            program.lower,
            self._sense,
            **self._settings,
        )
        claimed, message = STATUS.get(flag, (Status.FAILED, f"exit flag {flag}"))
        return Answer(x, info["lam"], claimed, info["iterations"], message)
