"""Shared parts of the subproblems' models: a metric, and rows that are dense or of a given pattern."""

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    import cvxpy as cp

Pattern = tuple[np.ndarray, np.ndarray] | None
"""Rows and columns of the entries that can be nonzero; None if all entries can."""

Patterns = tuple[Pattern, Pattern]
"""Patterns of the inequality rows and of the bilateral rows."""

LARGEST_DENSE = 150  # rows beyond which a sparse solve is faster than a dense one

DENSE: Patterns = (None, None)


def constant_metric(mass: np.ndarray) -> sparse.dia_array:
    """Return the diagonal matrix of the masses."""
    return sparse.diags_array(mass)


def matrix(name: str, rows: int, dof: int, pattern: Pattern) -> "cp.Parameter":
    """Return a Parameter for a matrix of rows."""
    import cvxpy as cp

    return cp.Parameter((rows, dof), sparsity=pattern or False, name=name)


def find_patterns(start: np.ndarray, column: np.ndarray, equalities: int) -> tuple[np.ndarray, Patterns]:
    """Return the patterns of compressed rows, of which the first are equalities.

    Returns
    -------
    order : array
        Order of the entries in sparse Parameters: row by row, and column by column in each row.
    patterns : Patterns
    """
    rows, split = start.size - 1, start[equalities]
    row = np.repeat(np.arange(rows), np.diff(start))
    order = np.lexsort((column, row))
    column = column[order]
    free = (row[split:] - equalities, column[split:]) if rows > equalities else None
    return order, (free, (row[:split], column[:split]) if equalities else None)
