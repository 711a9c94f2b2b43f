"""Projection onto a polyhedron with many active rows: primal-dual active sets over sparse factorizations.

    minimize    1/2 |z - wish|^2
    subject to  R[:e] z = bounds[:e],   R[e:] z >= bounds[e:]

with rows of unit length. It is the program of `solvers.native`, for working sets too large for a dense factor.
"""

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import SuperLU, splu

SOLVED, UNSETTLED = 0, 1

SHIFT = 1e-10  # added to the diagonal of the Gram matrix, singular if rows are dependent; refinement removes it
REFINEMENTS = 30
ROUNDS = 200  # changes of the active set
SHARE = 0.3  # rows leave together whose multipliers are at least this share of the most negative one
NOISE = 1e-12  # size of a multiplier or violation, relative to the largest terms, that rounding explains


class SparseProjection:
    """A projection that keeps its last factorization for the next point with the same active rows.

    Parameters
    ----------
    warm_start : bool
        Begin with the rows that were active at the last point, if there are as many rows, instead of all rows.
    """

    def __init__(self, warm_start: bool = False) -> None:
        self._warm_start = warm_start
        self._last = np.zeros(0, dtype=bool)
        self._known: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None = None
        self._factor: SuperLU | None = None

    def project(
        self, rows: sparse.csr_array, bounds: np.ndarray, equalities: int, wish: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, int, int]:
        """Project `wish`.

        W is the active set, at first all rows or those of the last point. ``R_W R_W' y = bounds - R_W wish`` gives
        z = wish + R_W'y. Then rows with negative multipliers leave W and violated rows enter it, until there are none.

        Returns
        -------
        z, y : arrays
        iterations : int
            Number of active sets that were tried.
        status : int
            0 solved, 1 the active set did not settle.
        """
        every = np.ones(bounds.size, dtype=bool)
        first = self._last | (np.arange(bounds.size) < equalities) if self._last.size == bounds.size else every
        z, y, tried, status = self._settle(rows, bounds, equalities, wish, first)
        if status == UNSETTLED and not first.all():
            z, y, iterations, status = self._settle(rows, bounds, equalities, wish, every)
            tried += iterations
        return z, y, tried, status

    def _settle(
        self, rows: sparse.csr_array, bounds: np.ndarray, equalities: int, wish: np.ndarray, active: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, int, int]:
        equal = np.arange(bounds.size) < equalities
        seen: set[bytes] = set()
        y = np.zeros(bounds.size)
        for iteration in range(1, ROUNDS + 1):
            seen.add(active.tobytes())
            y[:] = 0.0
            z, y[active] = self._solve(rows, active, bounds, wish)
            size = max(1.0, float(np.abs(wish).max(initial=0.0)), float(np.abs(bounds).max(initial=0.0)))
            slack = rows @ z - bounds
            pulling = active & ~equal & (y < -NOISE * max(size, float(np.abs(y).max(initial=0.0))))
            violated = ~active & (slack < -NOISE * size)
            if not pulling.any() and not violated.any():
                y[~equal] = np.maximum(y[~equal], 0.0)
                if self._warm_start:
                    self._last = active
                return z, y, iteration, SOLVED
            # Of dependent rows only a few with negative multipliers leave; without all of them others are violated.
            pulling &= y <= SHARE * y.min(initial=0.0, where=~equal)
            active = (active & ~pulling) | violated
            if active.tobytes() in seen:
                break
        return z, y, iteration, UNSETTLED

    def _solve(
        self, rows: sparse.csr_array, active: np.ndarray, bounds: np.ndarray, wish: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        if not active.any():
            return wish.copy(), np.zeros(0)
        working = rows[active]
        transposed = working.T.tocsr()
        factor = self._factorize(rows, active, working, transposed)
        target = bounds[active]
        y = np.zeros(target.size)
        z, least = wish.copy(), np.inf
        best = (z, y)
        for _ in range(REFINEMENTS):
            y = y + factor.solve(target - working @ z)
            z = wish + transposed @ y
            apart = float(np.abs(target - working @ z).max())
            if not apart < 0.5 * least:
                break
            best, least = (z, y), apart
        return best

    def _factorize(
        self, rows: sparse.csr_array, active: np.ndarray, working: sparse.csr_array, transposed: sparse.csr_array
    ) -> SuperLU:
        key = (rows.indptr, rows.indices, rows.data, active)
        if self._factor is None or not all(map(np.array_equal, key, self._known or ())):
            gram = (working @ transposed + SHIFT * sparse.eye_array(working.shape[0], format="csr")).tocsc()
            self._factor = splu(
                gram, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
            )
            self._known = tuple(part.copy() for part in key)  # type: ignore[assignment]
        return self._factor
