"""What the models of the subproblems share: a metric and rows, dense or of a given pattern."""

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    import cvxpy as cp

Pattern = tuple[np.ndarray, np.ndarray] | None
"""Row and column of every entry that can be nonzero; None where all can."""

Patterns = tuple[Pattern, Pattern]
"""Of the inequality rows and of the bilateral ones."""

LARGEST_DENSE = 150  # rows beyond which a sparse solve is faster than a dense one

DENSE: Patterns = (None, None)


def constant_metric(mass: np.ndarray) -> sparse.dia_array:
    """The masses on a diagonal."""
    return sparse.diags_array(mass)


def matrix(name: str, rows: int, dof: int, pattern: Pattern) -> "cp.Parameter":
    """Rows as a Parameter."""
    import cvxpy as cp

    return cp.Parameter((rows, dof), sparsity=pattern or False, name=name)


def find_patterns(start: np.ndarray, column: np.ndarray, equalities: int) -> tuple[np.ndarray, Patterns]:
    """Patterns of compressed rows, the first of which are equalities.

    Returns
    -------
    order : array
        Of their entries, as sparse Parameters hold them: row by row, column by column.
    patterns : Patterns
    """
    rows, split = start.size - 1, start[equalities]
    row = np.repeat(np.arange(rows), np.diff(start))
    order = np.lexsort((column, row))
    column = column[order]
    free = (row[split:] - equalities, column[split:]) if rows > equalities else None
    return order, (free, (row[:split], column[:split]) if equalities else None)
