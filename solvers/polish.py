"""Polish: refinement of an answer by the linear system of its active set."""

from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, lstsq
from scipy.linalg.blas import dtrsm
from scipy.optimize import nnls

from solvers.polish_sparse import ROUNDOFF, SparseSystem
from solvers.program import QuadraticProgram
from solvers.residuals import Residuals

FILLED = 0.1  # share of nonzero entries of P and A above which they are treated as dense
ROUNDS = 10  # corrections of the active set; a solver's answer needs one or two


class Polish:
    r"""Active-set polish of answers to one program.

    An inequality row is guessed active where its multiplier exceeds its slack. With W the equality rows and the
    rows guessed active, the point and the multipliers of least norm that solve

    .. math:: P x + q + A_W^T y_W = 0, \qquad A_W x = u_W

    are found through a singular value decomposition, because the rows may be dependent. If a multiplier of
    least norm is negative, nonnegative least squares looks for a nonnegative representation of the same force.
    Violated rows then enter W and the row with the most negative multiplier leaves it, for a few rounds. A result is
    accepted only if it lowers the natural residual, `solvers.residuals`. Where multiplier and slack both vanish,
    interior-point methods leave an error of the square root of the tolerance. The natural residual sees that error;
    products of multiplier and slack do not.

    The linear algebra is dense, and its time grows with the cube of variables and active rows. If the patterns of P and
    A leave most entries out, it is sparse: a factorization of the same system, shifted, with refinement that removes
    the shift, gives the solution nearest to the answer. Nearness keeps multipliers of dependent rows nonnegative where
    those of the answer are well inside.
    """

    def __init__(self, program: QuadraticProgram) -> None:
        self.program = program

    def improve(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Return a better (x, y), or None if none was found."""
        program = self.program
        entries = program.quadratic.indices.size + program.matrix.indices.size
        filled = entries > FILLED * program.variables * (program.variables + program.rows)
        system = _System(program) if filled or program.matrix.dense is not None else SparseSystem(program)
        best, lowest = None, system.natural_residual(x, y)
        equal = np.arange(program.rows) < program.equalities
        active = equal | (y > program.upper - system.A @ x)
        tried = set()
        for _ in range(ROUNDS):
            tried.add(active.tobytes())
            try:
                point, multipliers = system.solve(active, x, y)
            except np.linalg.LinAlgError:  # a decomposition did not converge: the best point so far is the result
                break
            residual = system.natural_residual(point, multipliers)
            if residual < lowest:
                best, lowest = (point, multipliers), residual
            slack = program.upper - system.A @ point
            size = 1.0 + np.abs(program.upper).max(initial=0.0)
            entering = ~active & (slack < -ROUNDOFF * size)
            releasable = np.where(active & ~equal, multipliers, 0.0)
            active = active | entering
            if releasable.min(initial=0.0) < 0.0:
                active[np.argmin(releasable)] = False
            if active.tobytes() in tried:
                break
        return best


class _System:
    """The linear algebra of one program's numbers."""

    def __init__(self, program: QuadraticProgram) -> None:
        self.equalities = program.equalities
        self.residuals = Residuals(program)
        self.q, self.u = program.linear, program.upper
        self.P, self.A = program.quadratic.to_dense(), program.matrix.to_dense()

    @cached_property
    def factor(self) -> np.ndarray | None:
        """Lower Cholesky factor of P; None if P is only semidefinite."""
        try:
            factor: np.ndarray = np.tril(cho_factor(self.P, lower=True)[0])
        except np.linalg.LinAlgError:
            return None
        diagonal = factor.diagonal()
        return None if diagonal.min() < 1e-7 * diagonal.max() else factor

    def natural_residual(self, x: np.ndarray, y: np.ndarray) -> float:
        self.residuals.compute(x, y)
        return self.residuals.natural

    def solve(self, active: np.ndarray, near: np.ndarray, _: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve the equality-constrained program; of several solutions, return the nearest to `near`."""
        rows, target = self.A[active], self.u[active]
        if self.factor is None:
            x, multipliers = self._solve_whole(rows, target, near)
        else:
            x, multipliers = self._solve_projected(self.factor, rows, target)
        free = np.flatnonzero(active) < self.equalities
        if np.any(multipliers[~free] < 0.0):
            multipliers = self._nonnegative(rows, x, multipliers, free)
        y = np.zeros(self.u.size)
        y[active] = multipliers
        return x, y

    def _solve_projected(self, L: np.ndarray, rows: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Solve by projection: in coordinates z = L'x, with P = LL', -L^-1 q is projected onto an affine space."""
        z = -_solve_lower(L, self.q)
        multipliers = np.zeros(target.size)
        if target.size:
            U, sigma, Vt = np.linalg.svd(_solve_lower(L, rows.T), full_matrices=False)
            kept = sigma > 1e-13 * max(sigma[0], np.finfo(float).tiny)
            U, sigma, Vt = U[:, kept], sigma[kept], Vt[kept]
            for _ in range(2):  # the second pass removes the rounding error of the first
                x = _solve_lower(L, z, transposed=True)
                step = (Vt @ (target - rows @ x)) / sigma
                z = z + U @ step
                multipliers = multipliers - Vt.T @ (step / sigma)
        x = _solve_lower(L, z, transposed=True)
        if target.size:  # the multipliers have to balance the forces at the rounded point, not at the exact one
            unbalanced = -(self.P @ x + self.q) - rows.T @ multipliers
            multipliers = multipliers + Vt.T @ ((U.T @ _solve_lower(L, unbalanced)) / sigma)
        return x, multipliers

    def _solve_whole(self, rows: np.ndarray, target: np.ndarray, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n, w = self.q.size, target.size
        system = np.block([[self.P, rows.T], [rows, np.zeros((w, w))]])
        right = np.concatenate((-(self.P @ near + self.q), target - rows @ near))
        answer = lstsq(system, right, cond=1e-13)[0]
        answer = answer + lstsq(system, right - system @ answer, cond=1e-13)[0]
        return near + answer[:n], answer[n:]

    def _nonnegative(self, rows: np.ndarray, x: np.ndarray, multipliers: np.ndarray, free: np.ndarray) -> np.ndarray:
        """Represent the force of the multipliers with nonnegative ones on inequality rows, if that is possible."""
        force = -(self.P @ x + self.q)
        columns = np.hstack((rows.T, -rows.T[:, free]))
        try:
            parts, _ = nnls(columns, force)
        except RuntimeError:  # no convergence; the representation is optional
            return multipliers
        represented = parts[: free.size].copy()
        represented[free] -= parts[free.size :]
        size = 1.0 + np.abs(force).max()
        if np.abs(rows.T @ represented - force).max() <= ROUNDOFF * size:
            return represented
        return multipliers


def _solve_lower(L: np.ndarray, right: np.ndarray, transposed: bool = False) -> np.ndarray:
    """Solve with a lower triangle by BLAS, which starts no threads for small systems as LAPACK's trtrs does."""
    columns = right.reshape(len(L), -1)
    answer: np.ndarray = dtrsm(1.0, L, columns, lower=1, trans_a=int(transposed)).reshape(right.shape)
    return answer
