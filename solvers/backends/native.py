"""The project's own dual active-set method (`solvers.native`), with proximal steps if curvature is missing."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from solvers import proximal, tolerances
from solvers.absorbed import absorbed
from solvers.backends.base import Answer, Backend, refuse_unknown
from solvers.curvature import SEMIDEFINITE
from solvers.kept import kept
from solvers.native import project_within
from solvers.program import Matrix, QuadraticProgram
from solvers.residuals import Residuals
from solvers.solution import Status

NOT_CONVEX = 5
DOUBTFUL = 1e-8  # pivot, relative to the diagonal, below which half of the digits may be lost
STATUS = {
    0: (Status.SOLVED, "optimal"),
    1: (Status.INFEASIBLE, "infeasible"),
    2: (Status.ITERATION_LIMIT, "iteration limit"),
    4: (Status.FAILED, "rows too close to dependent, or numbers too large, for double precision"),
    NOT_CONVEX: (Status.FAILED, "the quadratic term is not positive semidefinite at these parameter values"),
    proximal.UNBOUNDED: (Status.UNBOUNDED, "unbounded"),
}


class Native(Backend):
    r"""Adapter of `solvers.native.project_within`.

    With P = LL' the program is a projection in the coordinates z = L'x:

    .. math::

        \min \tfrac12 |z + L^{-1} q|^2 \quad \text{subject to} \quad S A L^{-T} z \le S u,

    where S scales rows to unit length; the multipliers are S times those of the projection. Rows stay sparse if P is
    diagonal. A program with a P that is not positive definite is solved in proximal steps (`solvers.proximal`).
    """

    name = "native"
    prefers_curvature = True

    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self.program = program
        self._tolerance = tolerance
        refuse_unknown(self.name, options, tolerances.LIMITS[self.name])
        settings = {**tolerances.settings(self.name, tolerance), **options}
        rows, columns, positions = _entries(program.quadratic)
        diagonal = bool(np.array_equal(rows, columns))
        quadratic = (rows, columns, positions, program.quadratic.values)
        rows, columns, positions = _entries(program.matrix)
        start = np.searchsorted(rows, np.arange(program.rows + 1)).astype(np.int64)
        matrix = (start, columns, positions, program.matrix.values)
        self._limits = (float(settings["tolerance"]), int(settings["max_iterations"]))
        self._arguments = (
            *quadratic, diagonal, *matrix, program.linear, program.upper, program.equalities, *self._limits,
        )  # fmt: skip
        _solve(*self._arguments, np.zeros(program.variables), np.zeros(program.rows))  # compiles before the first solve

    def update(self) -> None:
        """Do nothing, because the numbers are read in place."""

    def solve(self) -> Answer:
        """Solve from scratch."""
        x, y = np.empty(self.program.variables), np.empty(self.program.rows)
        code, iterations, pivot = _solve(*self._arguments, x, y)
        if code == NOT_CONVEX or (pivot < DOUBTFUL and self._is_inaccurate(code, x, y)):
            code, iterations = proximal.minimize(self.program, _solve, *self._limits, x, y)
        claimed, message = STATUS[code]
        return Answer(x, y, claimed, iterations, message)

    def _is_inaccurate(self, code: int, x: np.ndarray, y: np.ndarray) -> bool:
        return code != 0 or not Residuals(self.program).compute(x, y) <= self._tolerance


def _entries(matrix: Matrix) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return row and column of every entry of the pattern, row by row, and its place among the stored values."""
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
    places = np.arange(columns.size) if matrix.dense is None else matrix.indices * matrix.shape[1] + columns
    order = np.lexsort((columns, matrix.indices))
    return tuple(array[order].astype(np.int64) for array in (matrix.indices, columns, places))  # type: ignore[return-value]


@kept(nogil=True, error_model="numpy")
def _solve(
    P_row: np.ndarray,
    P_column: np.ndarray,
    P_place: np.ndarray,
    P_value: np.ndarray,
    diagonal: bool,
    A_start: np.ndarray,
    A_column: np.ndarray,
    A_place: np.ndarray,
    A_value: np.ndarray,
    q: np.ndarray,
    u: np.ndarray,
    equalities: int,
    tolerance: float,
    max_iterations: int,
    x: np.ndarray,
    y: np.ndarray,
) -> tuple[int, int, float]:
    """Write x and y; return a code, the iterations, and the smallest pivot of P relative to its diagonal."""
    m, n = u.size, q.size
    L = np.zeros((1, n) if diagonal else (n, n))  # for a diagonal P, the roots alone
    for k in range(P_row.size):
        if diagonal:
            L[0, P_row[k]] = P_value[P_place[k]]
        else:
            L[P_row[k], P_column[k]] = P_value[P_place[k]]
    for i in range(n):
        x[i] = math.nan
    for i in range(m):
        y[i] = math.nan
    least = 1.0
    for i in range(n):
        own = 0 if diagonal else i
        whole = L[own, i]
        for j in range(0 if diagonal else i):
            total = L[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / L[j, j]
            L[i, i] -= L[i, j] * L[i, j]
        if not L[own, i] > SEMIDEFINITE * whole:
            return NOT_CONVEX, 0, 0.0
        least = min(least, L[own, i] / whole)
        L[own, i] = math.sqrt(L[own, i])
    wish, z = np.empty(n), np.empty(n)
    for i in range(n):
        wish[i] = -q[i]
    _forward(L, diagonal, wish, 0)
    start = np.empty(m + 1, np.int64)
    start[0] = 0
    if diagonal:
        filled, column, value = 0, np.empty(A_column.size, np.int64), np.empty(A_column.size)
        for i in range(m):
            for k in range(A_start[i], A_start[i + 1]):
                entry = A_value[A_place[k]]
                if entry != 0.0:  # most entries of a pattern are zero if contacts are local
                    column[filled] = A_column[k]
                    value[filled] = -entry / L[0, A_column[k]]
                    filled += 1
            start[i + 1] = filled
    else:
        column, value = np.empty(m * n, np.int64), np.zeros(m * n)
        for i in range(m):
            for k in range(A_start[i], A_start[i + 1]):
                value[i * n + A_column[k]] = -A_value[A_place[k]]
            _forward(L, diagonal, value, i * n)
        for k in range(m * n):
            column[k] = k % n
        for i in range(m):
            start[i + 1] = (i + 1) * n
    bounds, size = np.empty(m), np.empty(m)
    for i in range(m):
        total = 0.0
        for k in range(start[i], start[i + 1]):
            total += value[k] * value[k]
        size[i] = math.sqrt(total) if total > 0.0 else 1.0
        for k in range(start[i], start[i + 1]):
            value[k] /= size[i]
        bounds[i] = -u[i] / size[i]
    status, iterations = project_within(
        start, column, value, bounds, equalities, wish, tolerance, m, max_iterations, z, y
    )
    for i in range(m):
        y[i] /= size[i]
    for i in range(n - 1, -1, -1):
        x[i] = z[i] / L[0 if diagonal else i, i]
        for j in range(0 if diagonal else i):
            z[j] -= L[i, j] * x[i]
    return status, iterations, least


@absorbed
def _forward(L: np.ndarray, diagonal: bool, right: np.ndarray, at: int) -> None:
    """Solve with L in place, for the part of `right` that begins at an offset."""
    for i in range(L.shape[1]):
        total = right[at + i]
        for j in range(0 if diagonal else i):
            total -= L[i, j] * right[at + j]
        right[at + i] = total / L[0 if diagonal else i, i]
