"""Layout of a parametrized program: a sparse matrix that maps the parameters to all numbers of the standard form."""

import math
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.linalg.blas import ddot

# The compiled kernel behind scipy's ``@``. The checks of ``@`` cost four times the product at a few hundred entries.
from scipy.sparse import _sparsetools

from solvers.program import Matrix, QuadraticProgram

DENSE_LIMIT = 9000  # entries of A and P together; numpy's BLAS starts threads above some 9200, for milliseconds


@dataclass(slots=True, eq=False)
class Tensors:
    """The tensors of a modelling layer, each a matrix with one column per entry of theta.

    Attributes
    ----------
    variables, rows, equalities : int
        Sizes; the first `equalities` rows say Ax + b = 0, the others Ax + b >= 0.
    linear : scipy.sparse.coo_array, shape (variables + 1, size of theta)
        q, then the objective's constant.
    matrix : scipy.sparse.coo_array, shape (rows * (variables + 1), size of theta)
        [A b] flattened column by column.
    quadratic : scipy.sparse.coo_array, shape (variables ** 2, size of theta)
        P flattened column by column.
    """

    variables: int
    rows: int
    equalities: int
    linear: sparse.coo_array
    matrix: sparse.coo_array
    quadratic: sparse.coo_array


@dataclass(slots=True)
class _Block:
    """The entries of the map for one part of the program."""

    position: np.ndarray
    parameter: np.ndarray
    value: np.ndarray
    length: int

    def varies(self, last: int) -> bool:
        return bool(np.any(self.parameter != last))


class AffineMap:
    """The map from theta (whose last entry is one) to a quadratic program, and the storage of that program.

    In the image the parts that depend on the parameters come first; the other parts are computed once. The objective's
    constant is an array of one number, `constant`.
    """

    __slots__ = ("_data", "_indices", "_indptr", "_lent", "_numbers", "_varying", "constant", "program", "theta")

    def __init__(self, theta: np.ndarray, tensors: Tensors) -> None:
        n, rows, equalities = tensors.variables, tensors.rows, tensors.equalities
        last = theta.size - 1
        dense = (n + rows) * n <= DENSE_LIMIT
        sign = np.where(np.arange(rows) < equalities, 1.0, -1.0)

        q, a, p = tensors.linear, tensors.matrix, tensors.quadratic
        in_q = q.row < n
        in_a = a.row < rows * n
        b_row = a.row[~in_a] - rows * n
        a_row, a_column = a.row[in_a] % max(rows, 1), a.row[in_a] // max(rows, 1)
        a_target, a_length, a_pattern = _storage(a_row, a_column, (rows, n), dense)
        p_target, p_length, p_pattern = _storage(p.row % n, p.row // n, (n, n), dense)
        blocks = {
            "q": _Block(q.row[in_q], q.col[in_q], q.data[in_q], n),
            "constant": _Block(q.row[~in_q] - n, q.col[~in_q], q.data[~in_q], 1),
            "u": _Block(b_row, a.col[~in_a], -sign[b_row] * a.data[~in_a], rows),
            "A": _Block(a_target, a.col[in_a], sign[a_row] * a.data[in_a], a_length),
            "P": _Block(p_target, p.col, p.data, p_length),
        }
        varies = {name: block.varies(last) for name, block in blocks.items()}
        order = sorted(blocks, key=lambda name: not varies[name])
        ends = np.cumsum([blocks[name].length for name in order])
        start = {name: int(end) - blocks[name].length for name, end in zip(order, ends, strict=True)}
        self._varying = sum(blocks[name].length for name in order if varies[name])

        row = np.concatenate([blocks[name].position + start[name] for name in order])
        column = np.concatenate([blocks[name].parameter for name in order])
        value = np.concatenate([blocks[name].value for name in order])
        full = sparse.csr_array((value, (row, column)), shape=(int(ends[-1]), theta.size))
        full.sum_duplicates()
        self.theta = theta
        self._indptr, self._indices, self._data = full.indptr, full.indices, full.data
        self._numbers = full @ theta
        part = {name: self._numbers[start[name] : start[name] + blocks[name].length] for name in order}
        self.program = QuadraticProgram(
            variables=n,
            rows=rows,
            equalities=equalities,
            quadratic=Matrix((n, n), p_pattern, part["P"], dense, not varies["P"]),
            linear=part["q"],
            matrix=Matrix((rows, n), a_pattern, part["A"], dense, not varies["A"]),
            lower=np.full(rows, -np.inf),
            upper=part["u"],
        )
        self.constant = part["constant"]
        matrices = () if dense else (self.program.quadratic, self.program.matrix)
        patterns = (array for matrix in matrices for array in (matrix.indptr, matrix.indices))
        self._lent = (self._numbers, self.program.lower, *patterns)
        self.apply()

    def apply(self) -> bool:
        """Rewrite the program's numbers for the current theta, one sparse product; return whether they are finite."""
        varying, program = self._varying, self.program
        finite = True
        if varying:
            image = self._numbers[:varying]
            image.fill(0.0)
            _sparsetools.csr_matvec(
                varying, self.theta.size, self._indptr, self._indices, self._data, self.theta, image
            )
            small = varying <= DENSE_LIMIT  # a longer product of vectors would start threads, for milliseconds
            finite = math.isfinite(ddot(image, image)) if small else bool(np.isfinite(image).all())
        if program.equalities:
            program.lower[: program.equalities] = program.upper[: program.equalities]
        return finite

    def is_finite(self) -> bool:
        """Return whether all numbers of the program are finite."""
        return bool(np.isfinite(self._numbers).all())

    def lend(self) -> list[bytes]:
        """Return the content of the program, for `take_back`, before a backend borrows it."""
        return [array.tobytes() for array in self._lent]

    def take_back(self, known: list[bytes]) -> None:
        """Restore the numbers that a backend has changed, because they decide about its answer."""
        for array, kept in zip(self._lent, known, strict=True):
            if array.tobytes() != kept:
                array[:] = np.frombuffer(kept, dtype=array.dtype)


def _storage(
    row: np.ndarray, column: np.ndarray, shape: tuple[int, int], dense: bool
) -> tuple[np.ndarray, int, sparse.csc_array]:
    """Return the positions of entries in a matrix's storage, the storage's length, and the pattern."""
    pattern = sparse.csc_array((np.ones(row.size), (row, column)), shape=shape)
    pattern.sum_duplicates()
    if dense:
        return row * shape[1] + column, shape[0] * shape[1], pattern
    known = np.repeat(np.arange(shape[1]), np.diff(pattern.indptr)) * shape[0] + pattern.indices
    return np.searchsorted(known, column * shape[0] + row), pattern.nnz, pattern
