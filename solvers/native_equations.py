"""Projection onto the solutions of equations, compiled: a closed form for one, a Cholesky factor for several.

    minimize    1/2 |z - wish|^2
    subject to  R z = bounds

R is stored as in `solvers.native`. Programs that these functions decline go to the method of that file.
"""

import math

import numpy as np

from solvers.absorbed import absorbed, inlined
from solvers.kept import kept
from solvers.native_rows import residuals_within

INDEPENDENT = 1e-6  # squared part of a row outside the span of the rows before it, relative to the square of the row
ROUNDING = 64 * 2.0**-52  # primal residual that rounding explains


@kept(nogil=True, error_model="numpy")
def project_onto(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    z: np.ndarray,
    y: np.ndarray,
) -> float:
    """Call `project_onto_row` or `factorize` and `project_onto_within` from Python."""
    m, n = bounds.size, wish.size
    if m == 1:
        return project_onto_row(start, column, value, bounds, equalities, wish, z, y)
    factor, begins, right, pull = np.empty(m * (m + 1) // 2), np.empty(m, np.int64), np.empty(m), np.empty(n)
    if not factorize(start, column, value, m, pull, begins, factor):
        return math.nan
    return project_onto_within(start, column, value, bounds, equalities, wish, begins, factor, right, pull, z, y)


@inlined
def project_onto_row(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    z: np.ndarray,
    y: np.ndarray,
) -> float:
    r"""Project onto the plane of a single row r, as `project_onto_within` does.

    .. math:: z = \mathrm{wish} + y\,r, \qquad y = (b - r \cdot \mathrm{wish}) / |r|^2
    """
    square, gap = 0.0, bounds[0]
    total = 0.0  # finite exactly if all terms are
    for j in range(wish.size):
        z[j] = wish[j]
        total += abs(wish[j])
    for k in range(start[0], start[1]):
        square += value[k] * value[k]
        gap -= value[k] * wish[column[k]]
    y[0] = gap / square
    gap = bounds[0]
    for k in range(start[0], start[1]):
        z[column[k]] += y[0] * value[k]
        gap -= value[k] * z[column[k]]
    residual = abs(gap) / (1.0 + abs(bounds[0]))
    good = residual <= ROUNDING and math.isfinite(total + y[0])
    return residual if good and (equalities > 0 or y[0] >= 0.0) else math.nan


@absorbed
def factorize(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    m: int,
    row: np.ndarray,
    begins: np.ndarray,
    factor: np.ndarray,
) -> bool:
    """Write the Cholesky factor L of R R'; return False if a row of R nearly depends on the rows before it.

    L is stored row by row up to its diagonal, which holds the inverses of its entries. Row i of L is zero before column
    ``begins[i]``, as row i of R R' is; its cost grows with the entries in between. `row` is scratch, of shape (n,).
    """
    for j in range(row.size):
        row[j] = 0.0
    for i in range(m):
        place, begin = i * (i + 1) // 2, i
        for k in range(start[i], start[i + 1]):
            row[column[k]] = value[k]
        for j in range(i, -1, -1):
            total = 0.0
            for k in range(start[j], start[j + 1]):
                total += value[k] * row[column[k]]
            factor[place + j] = total
            if total != 0.0:
                begin = j
        for k in range(start[i], start[i + 1]):
            row[column[k]] = 0.0
        begins[i] = begin
        square = factor[place + i]
        for j in range(begin, i + 1):
            above, total = j * (j + 1) // 2, factor[place + j]
            for k in range(max(begin, begins[j]), j):
                total -= factor[place + k] * factor[above + k]
            if j < i:
                factor[place + j] = total * factor[above + j]
            elif total > INDEPENDENT * square:
                factor[place + i] = 1.0 / math.sqrt(total)
            else:
                return False
    return True


@inlined
def project_onto_within(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    begins: np.ndarray,
    factor: np.ndarray,
    right: np.ndarray,
    pull: np.ndarray,
    z: np.ndarray,
    y: np.ndarray,
) -> float:
    r"""Project a point onto the plane where all rows, also inequalities, hold as equations; numbers are of order one.

    .. math:: z = \mathrm{wish} + R^T y, \qquad R R^T y = \mathrm{bounds} - R\,\mathrm{wish};

    y is refined once, with the residual of z in place of the right-hand side.

    Parameters
    ----------
    start, column, value, bounds, equalities, wish
        As for `solvers.native.project_within`.
    begins, factor : ndarray
        Output of `factorize`.
    right, pull : ndarray, shapes (m,), (n,)
        Scratch.
    z, y : ndarray, shapes (n,), (m,)
        Written: the point and the multipliers, with z - wish = R'y.

    Returns
    -------
    residual : float
        Largest residual of `solvers.native.residuals`; nan if z is not the answer, because an inequality has a negative
        multiplier or the primal residual is larger than rounding explains.
    """
    m = bounds.size
    for j in range(wish.size):
        z[j] = wish[j]
    for i in range(m):
        y[i] = 0.0
    for _ in range(2):
        for i in range(m):
            right[i] = bounds[i]
            for k in range(start[i], start[i + 1]):
                right[i] -= value[k] * z[column[k]]
        _solve(begins, factor, m, right)
        for i in range(m):
            y[i] += right[i]
            for k in range(start[i], start[i + 1]):
                z[column[k]] += value[k] * right[i]
    for i in range(equalities, m):
        if not y[i] >= 0.0:
            return math.nan
    primal, dual, product = residuals_within(start, column, value, bounds, equalities, wish, z, y, pull)
    return max(primal, dual, product) if primal <= ROUNDING else math.nan


@inlined
def _solve(begins: np.ndarray, factor: np.ndarray, m: int, right: np.ndarray) -> None:
    """Solve L L'x = right in place."""
    for i in range(m):
        place, total = i * (i + 1) // 2, right[i]
        for j in range(begins[i], i):
            total -= factor[place + j] * right[j]
        right[i] = total * factor[place + i]
    for i in range(m - 1, -1, -1):
        place = i * (i + 1) // 2
        right[i] *= factor[place + i]
        for j in range(begins[i], i):
            right[j] -= factor[place + j] * right[i]
