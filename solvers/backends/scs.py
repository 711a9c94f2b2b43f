"""SCS, an operator-splitting method."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scs
from scipy import sparse

from solvers import tolerances
from solvers.backends.base import Answer, Backend, refuse_unknown
from solvers.program import QuadraticProgram
from solvers.solution import Status

STATUS = {
    scs.SOLVED: Status.SOLVED,
    scs.SOLVED_INACCURATE: Status.INACCURATE,
    scs.INFEASIBLE: Status.INFEASIBLE,
    scs.INFEASIBLE_INACCURATE: Status.INFEASIBLE,
    scs.UNBOUNDED: Status.UNBOUNDED,
    scs.UNBOUNDED_INACCURATE: Status.UNBOUNDED,
}
OPTIONS = (
    "acceleration_interval", "acceleration_lookback", "adaptive_scale", "alpha", "eps_abs", "eps_infeas", "eps_rel",
    "max_iters", "normalize", "rho_x", "scale", "time_limit_secs", "verbose",
)  # fmt: skip


class SCS(Backend):
    """Adapter of ``scs.SCS``."""

    name = "scs"
    sparse = True
    warm_starts = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        refuse_unknown(self.name, options, OPTIONS)
        self._settings = {"verbose": False, **tolerances.settings(self.name, tolerance), **options}
        self._triangle, self._upper = program.quadratic.upper()
        self._matrix = program.matrix.to_sparse()
        self._cone = {"z": program.equalities, "l": program.rows - program.equalities}
        self._rowless = program.rows == 0
        if self._rowless:  # scs needs a row: 0 x <= 1
            self._matrix = sparse.csc_matrix((1, program.variables))
            self._cone = {"l": 1}
        self._solver: Any = None
        self._start: dict[str, np.ndarray] = {}

    def update(self) -> None:
        """Set the solver up anew."""
        program = self.program
        self._triangle.data = program.quadratic.entries()[self._upper]
        self._matrix.data = program.matrix.entries()
        upper = np.ones(1) if self._rowless else program.upper
        data = {"P": self._triangle, "A": self._matrix, "b": upper, "c": program.linear}
        self._solver, self._start = scs.SCS(data, self._cone, **self._settings), {}

    def begin(self, x: np.ndarray, y: np.ndarray) -> None:
        """Start the iteration at a point."""
        if not self._rowless:
            self._start = {"x": x, "y": y, "s": self.program.upper - self._matrix @ x}

    def solve(self) -> Answer:
        """Solve, and copy the answer out of the solver."""
        result = self._solver.solve(warm_start=bool(self._start), **self._start)
        info = result["info"]
        claimed = STATUS.get(info["status_val"], Status.FAILED)
        if claimed is Status.INACCURATE and info["iter"] >= self._settings["max_iters"]:
            claimed = Status.ITERATION_LIMIT
        y = np.zeros(0) if self._rowless else np.array(result["y"])
        return Answer(np.array(result["x"]), y, claimed, info["iter"], info["status"])
