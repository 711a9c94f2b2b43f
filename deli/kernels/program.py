"""The metric projection that a subproblem poses, and its rows by themselves."""

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
        b, and the lengths that the rows had.
    wish, z : (dof,) arrays
    y : (rows,) array
    metric, factor : (dof, dof) arrays
        A where it is not the identity, and its Cholesky factor; empty where the scene needs none.
    white_start, white_column, white_value : arrays
        R in coordinates in which A is the identity; empty likewise.
    gram, begins : (k (k + 1) / 2,), (k,) arrays
        Cholesky factor of R Rᵀ of up to k rows, as `solvers.native_equations.factorize` writes it.
    factored : (1,) int64 array
        How many rows that factor is of; 0 where rows have been written since.
    right, pull : (k,), (dof,) arrays
        Scratch.
    report : (4,) array
        What the last native solve took: iterations, primal, dual and complementarity residual.
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
