"""The standard form of the programs that backends solve.

    minimize    1/2 x'Px + q'x
    subject to  l <= Ax <= u

Equality rows come first and have l = u; inequality rows have l = -inf. The multipliers y satisfy
Px + q + A'y = 0, with y >= 0 on inequality rows.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse


class Matrix:
    """A matrix with a fixed pattern, and with values that change in place.

    Parameters
    ----------
    shape : tuple of int
        Rows and columns.
    pattern : scipy.sparse.csc_array
        Entries that can be nonzero.
    values : ndarray
        Storage shared with the compiled problem: all entries row by row if `is_dense`, else those of the
        pattern column by column.
    is_dense : bool
        Whether the storage is dense.
    constant : bool
        Whether the values never change.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x = cp.Variable(2, name="x")
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x[0] + 2 * x[1] <= 1])
    >>> matrix = solvers.compile(problem).program.matrix
    >>> matrix.shape, matrix.constant
    ((1, 2), True)
    >>> matrix.to_dense()
    array([[1., 2.]])
    """

    __slots__ = ("_position", "constant", "dense", "indices", "indptr", "shape", "values")

    def __init__(
        self, shape: tuple[int, int], pattern: sparse.csc_array, values: np.ndarray, is_dense: bool, constant: bool
    ) -> None:
        self.shape = shape
        self.constant = constant
        self.values = values
        self.indptr = pattern.indptr.astype(np.int32)
        self.indices = pattern.indices.astype(np.int32)
        self.dense = values.reshape(shape) if is_dense else None
        columns = np.repeat(np.arange(shape[1]), np.diff(self.indptr))
        self._position = self.indices * shape[1] + columns if is_dense else None

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments of a matrix, so that the views of a copy share the copy's storage."""
        pattern = sparse.csc_array((np.ones(self.indices.size), self.indices, self.indptr), shape=self.shape)
        return Matrix, (self.shape, pattern, self.values, self.dense is not None, self.constant)

    def entries(self) -> np.ndarray:
        """Return the values of the pattern, column by column (a copy only if the storage is dense)."""
        if self._position is None:
            return self.values
        return self.values.take(self._position)

    def columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return column starts, row indices and values of sparse storage, the values shared."""
        return self.indptr, self.indices, self.values

    def to_dense(self) -> np.ndarray:
        """Return all entries as a two-dimensional array (the storage itself if it is dense)."""
        if self.dense is not None:
            return self.dense
        return self.to_sparse().toarray()

    def to_sparse(self) -> sparse.csc_matrix:
        """Return a scipy matrix with the fixed pattern and a copy of the values."""
        return sparse.csc_matrix((self.entries().copy(), self.indices, self.indptr), shape=self.shape)

    def upper(self) -> tuple[sparse.csc_matrix, np.ndarray]:
        """Return the upper triangle, and the positions of its values among `entries`."""
        columns = np.repeat(np.arange(self.shape[1]), np.diff(self.indptr))
        positions = np.flatnonzero(self.indices <= columns)
        indptr = np.concatenate(([0], np.cumsum(np.bincount(columns[positions], minlength=self.shape[1]))))
        triangle = (self.entries()[positions], self.indices[positions], indptr.astype(np.int32))
        return sparse.csc_matrix(triangle, shape=self.shape), positions


@dataclass(slots=True, eq=False)
class QuadraticProgram:
    """A quadratic program with numbers that each solve rewrites in place.

    Attributes
    ----------
    variables, rows, equalities : int
        Sizes; the first `equalities` rows are equations.
    quadratic : Matrix
        P, symmetric positive semidefinite, both triangles stored.
    linear : ndarray, shape (variables,)
        q.
    matrix : Matrix
        A.
    lower, upper : ndarray, shape (rows,)
        l and u.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x, b = cp.Variable(2, name="x"), cp.Parameter(name="b")
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x[0] + x[1] == 3, x[0] - x[1] <= b])
    >>> compiled = solvers.compile(problem)
    >>> solution = compiled.solve(b=-1.0)
    >>> program = compiled.program
    >>> program.variables, program.rows, program.equalities
    (2, 2, 1)
    >>> program.lower, program.upper
    (array([  3., -inf]), array([ 3., -1.]))
    """

    variables: int
    rows: int
    equalities: int
    quadratic: Matrix
    linear: np.ndarray
    matrix: Matrix
    lower: np.ndarray
    upper: np.ndarray
