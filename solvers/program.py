"""The standard form every backend sees.

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
    """A matrix with a fixed pattern whose values change in place.

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
        Which of the two storages is used.
    constant : bool
        Whether the values never change.
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
        """Pickle what makes a matrix, so that a copy's views share its storage."""
        pattern = sparse.csc_array((np.ones(self.indices.size), self.indices, self.indptr), shape=self.shape)
        return Matrix, (self.shape, pattern, self.values, self.dense is not None, self.constant)

    def entries(self) -> np.ndarray:
        """Values of the pattern, column by column (a copy only if the storage is dense)."""
        if self._position is None:
            return self.values
        return self.values.take(self._position)

    def columns(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Column starts, row indices and values of sparse storage, the values shared."""
        return self.indptr, self.indices, self.values

    def to_dense(self) -> np.ndarray:
        """All entries as a two-dimensional array (the storage itself if it is dense)."""
        if self.dense is not None:
            return self.dense
        return self.to_sparse().toarray()

    def to_sparse(self) -> sparse.csc_matrix:
        """A scipy matrix holding a copy of the values, with the fixed pattern."""
        return sparse.csc_matrix((self.entries().copy(), self.indices, self.indptr), shape=self.shape)

    def upper(self) -> tuple[sparse.csc_matrix, np.ndarray]:
        """Upper triangle, and the positions of its values among `entries`."""
        columns = np.repeat(np.arange(self.shape[1]), np.diff(self.indptr))
        positions = np.flatnonzero(self.indices <= columns)
        indptr = np.concatenate(([0], np.cumsum(np.bincount(columns[positions], minlength=self.shape[1]))))
        triangle = (self.entries()[positions], self.indices[positions], indptr.astype(np.int32))
        return sparse.csc_matrix(triangle, shape=self.shape), positions


@dataclass(slots=True, eq=False)
class QuadraticProgram:
    """One quadratic program whose numbers are rewritten in place at every solve.

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
    """

    variables: int
    rows: int
    equalities: int
    quadratic: Matrix
    linear: np.ndarray
    matrix: Matrix
    lower: np.ndarray
    upper: np.ndarray
