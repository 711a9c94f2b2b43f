"""The metric projection of a subproblem, and its rows by themselves."""

from typing import NamedTuple

from deli.kernels.arrays import Matrix, Numbers, Vector
from deli.kernels.record import RecordType


class Program(NamedTuple):
    """The metric projection at hand, in z = √M v over a speed, with rows of unit length; equalities first.

    ``minimize ½ zᵀA z − wishᵀz  subject to  R z = b (equalities), R z >= b``, so that ``A z − wish = Rᵀ y``.

    Attributes
    ----------
    start, column, value : arrays
        R by compressed rows.
    bounds, lengths : (rows,) arrays
        b, and the original lengths of the rows.
    wish, z : (dof,) arrays
    y : (rows,) array
    metric, factor : (dof, dof) arrays
        A unless it is the identity, and its Cholesky factor; empty if the scene needs none.
    white_start, white_column, white_value : arrays
        R in coordinates in which A is the identity; empty if the scene needs none.
    gram, begins : (k (k + 1) / 2,), (k,) arrays
        Cholesky factor of R Rᵀ of up to k rows, as `solvers.native_equations.factorize` writes it.
    factored : (1,) int64 array
        Number of rows of that factor; 0 if rows have been written since.
    right, pull : (k,), (dof,) arrays
        Working arrays.
    report : (4,) array
        Iterations, and primal, dual and complementarity residual, of the last native solve.
    """

    start: Numbers
    column: Numbers
    value: Vector
    bounds: Vector
    lengths: Vector
    wish: Vector
    z: Vector
    y: Vector
    metric: Matrix
    factor: Matrix
    white_start: Numbers
    white_column: Numbers
    white_value: Vector
    gram: Vector
    begins: Numbers
    factored: Numbers
    right: Vector
    pull: Vector
    report: Vector


class Export(NamedTuple):
    """The rows of a program by themselves.

    Attributes
    ----------
    dense : (rows, dof) array
    kept : (rows,) int64 array
        Their numbers in the program.
    """

    dense: Matrix
    kept: Numbers


PROGRAM = RecordType(Program)
EXPORT = RecordType(Export)
