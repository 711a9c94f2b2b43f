"""The linear algebra of `solvers.polish` for large programs of few entries."""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from solvers.program import QuadraticProgram
from solvers.residuals import Residuals

ROUNDOFF = 1e-13  # relative size below which a multiplier or slack of the wrong sign is taken for zero
SHIFT = 1e-10  # added to the diagonal of the system, which is singular if rows are dependent
REFINEMENTS = 30


class SparseSystem:
    """The sparse linear algebra of one program's numbers."""

    def __init__(self, program: QuadraticProgram) -> None:
        self.equalities = program.equalities
        self.residuals = Residuals(program)
        self.q, self.u = program.linear, program.upper
        self.P, self.A = program.quadratic.to_sparse(), program.matrix.to_sparse().tocsr()

    def natural_residual(self, x: np.ndarray, y: np.ndarray) -> float:
        """Return the natural residual of `solvers.residuals`."""
        self.residuals.compute(x, y)
        return self.residuals.natural

    def solve(self, active: np.ndarray, near: np.ndarray, pressing: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve the equality-constrained program; return the point and multipliers nearest to the given ones.

        Raises
        ------
        numpy.linalg.LinAlgError
            If the shifted system is singular to rounding.
        """
        n, rows, target = self.q.size, self.A[active], self.u[active]
        shift = SHIFT * sparse.eye_array(n), -SHIFT * sparse.eye_array(target.size)
        system = sparse.block_array([[self.P + shift[0], rows.T], [rows, shift[1]]], format="csc")
        try:
            factor = splu(system, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise np.linalg.LinAlgError(str(error)) from error
        x, multipliers = near, pressing[active]
        best, least = (x, multipliers), np.inf
        for _ in range(REFINEMENTS):
            wrong = np.concatenate((-(self.P @ x + self.q + rows.T @ multipliers), target - rows @ x))
            apart = float(np.abs(wrong).max())
            if not apart < 0.5 * least:
                break
            best, least = (x, multipliers), apart
            step = factor.solve(wrong)
            x, multipliers = x + step[:n], multipliers + step[n:]
        x, multipliers = best
        y = np.zeros(self.u.size)
        y[active] = multipliers
        size = np.abs(multipliers).max(initial=0.0)
        y[self.equalities :][np.abs(y[self.equalities :]) <= ROUNDOFF * size] = 0.0
        return x, y
