"""Convex programs whose quadratic term is only semidefinite, by a sequence of strictly convex ones."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

from solvers.program import QuadraticProgram
from solvers.residuals import Residuals

SOLVED, ITERATION_LIMIT, UNBOUNDED = 0, 2, 6  # the others are those of the strictly convex solves
FIRST, LAST, SHRINK = 0.1, 1e-8, 0.1  # weights of the proximal term, relative to the program's own scales
PASSES = 10  # of equilibration: units of 1e12 are balanced to a factor 2
RECEDES = 1e-9  # terms that cancel to this part of their magnitudes leave a ray free

Solve = Callable[..., tuple[int, int, float]]


def minimize(
    program: QuadraticProgram, solve: Solve, tolerance: float, max_iterations: int, x: np.ndarray, y: np.ndarray
) -> tuple[int, int]:
    r"""Minimize by the proximal-point iteration (Rockafellar 1976).

    .. math:: x_{k+1} = \arg\min \tfrac12 x^T P x + q^T x + \tfrac{\rho_k}{2} |x - x_k|^2
              \quad \text{subject to} \quad A_e x = u_e, \quad A_i x \le u_i

    begins at 0, in units in which the largest entries of rows and columns are about 1. The multipliers balance the
    program up to the force :math:`\rho_k (x_k - x_{k+1})`, which vanishes after finitely many steps if P = 0. A minimum
    is a fixed point whatever the weight: small ones reach far, large ones lose no digits, and the weights take turns.
    A step along which nothing ever stops the descent shows that the program is unbounded.

    Parameters
    ----------
    program : QuadraticProgram
        Its numbers are only read.
    solve : callable
        ``solve(P_row, P_column, P_place, P_value, diagonal, A_start, A_column, A_place, A_value, q, u, equalities,
        tolerance, max_iterations, x, y)`` writes x and y and returns a code, 0 where solved, its iterations, and one
        number more.
    tolerance : float
        Bound on the force that is left, relative to the others, and on the residuals of the answer.
    max_iterations : int
        Bound on the iterations of all solves, each of which counts for one more.
    x, y : ndarray, shapes (variables,), (rows,)
        Written: point and multipliers.

    Returns
    -------
    code : int
        0 solved, 2 too many iterations, 6 unbounded, or the code of the solve that failed.
    iterations : int
    """
    P, A = sparse.csr_array(program.quadratic.to_sparse()), sparse.csr_array(program.matrix.to_sparse())
    P.eliminate_zeros()
    columns, rows = _equilibrate(P, A)
    P = sparse.csr_array(P * columns * columns[:, np.newaxis])
    A = sparse.csr_array(A * columns * rows[:, np.newaxis])
    q, u, n = columns * program.linear, rows * program.upper, x.size
    curvature, force, reach = (np.abs(numbers).max(initial=0.0) for numbers in (P.data, q, u))
    scales = [scale for scale in (curvature, force / reach if reach else 0.0) if scale] or [force or 1.0]
    steps = int(np.log(LAST / FIRST * min(scales) / max(scales)) / np.log(SHRINK))
    entries, own = P.tocoo(), np.arange(n)  # entries of the diagonal come last, and are those that count
    value = np.concatenate((entries.data, np.empty(n)))
    quadratic = (*(np.concatenate((index, own)) for index in entries.coords), np.arange(value.size), value)
    matrix = (A.indptr.astype(np.int64), A.indices.astype(np.int64), np.arange(A.nnz), A.data)
    diagonal, flat = P.diagonal(), bool(np.array_equal(*entries.coords))
    residuals = Residuals(program)
    before, point, iterations = np.zeros(n), np.empty(n), 0
    while True:
        for weight in FIRST * max(scales) * SHRINK ** np.arange(steps + 1):
            value[-n:] = diagonal + weight
            code, changes, _ = solve(
                *quadratic, flat, *matrix, q - weight * before, u, program.equalities,
                tolerance, max_iterations - iterations, point, y,
            )  # fmt: skip
            first = iterations == 0
            iterations += 1 + changes
            if code not in (SOLVED, ITERATION_LIMIT) and not first:
                break  # too small a weight for double precision
            x[:] = columns * point
            y *= rows
            if code != SOLVED:
                return code, iterations
            step = point - before
            left, reached = weight * np.abs(step).max(initial=0.0), np.abs(point).max(initial=0.0)
            balanced = left <= tolerance * (force + curvature * reached or weight * reached)
            if balanced and residuals.compute(x, y) <= tolerance:
                return SOLVED, iterations
            if q @ step < 0.0 and _recedes(P, A, program.equalities, step):
                return UNBOUNDED, iterations
            if iterations >= max_iterations:
                return ITERATION_LIMIT, iterations
            before[:] = point


def _equilibrate(P: Any, A: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return powers of two, which scale without rounding, for the variables and for the rows of A (Ruiz 2001)."""
    stack = sparse.vstack((P, A)).tocoo()
    size = np.abs(stack.data)
    rows = 1.0 / _largest(size, stack.row, stack.shape[0])  # those of P have the objective's unit
    columns = 1.0 / _largest(size * rows[stack.row], stack.col, stack.shape[1])
    for _ in range(PASSES):
        scaled = size * rows[stack.row] * columns[stack.col]
        rows /= np.sqrt(_largest(scaled, stack.row, rows.size))
        columns /= np.sqrt(_largest(scaled, stack.col, columns.size))
    return tuple(np.exp2(np.round(np.log2(factor))) for factor in (columns, rows[stack.shape[1] :]))  # type: ignore[return-value]


def _largest(size: np.ndarray, index: np.ndarray, lines: int) -> np.ndarray:
    largest = np.zeros(lines)
    np.maximum.at(largest, index, size)
    return np.where(largest > 0.0, largest, 1.0)


def _recedes(P: sparse.csr_array, A: sparse.csr_array, equalities: int, step: np.ndarray) -> bool:
    """Say whether neither the quadratic term nor any row ever stops a step."""
    size, product = np.abs(step), A @ step
    product[:equalities] = np.abs(product[:equalities])
    return bool(np.all(np.abs(P @ step) <= RECEDES * (abs(P) @ size)) and np.all(product <= RECEDES * (abs(A) @ size)))
