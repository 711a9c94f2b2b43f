"""Proximal steps: a program with a semidefinite quadratic term is solved by a sequence of strictly convex programs."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse

from solvers.program import QuadraticProgram
from solvers.residuals import Residuals

SOLVED, ITERATION_LIMIT, TOO_LARGE, UNBOUNDED = 0, 2, 4, 6  # other codes are those of the strictly convex solves
FIRST, LAST = 0.1, 1e-8  # weights of the proximal term, relative to the program's own scales
PASSES = 10  # of equilibration: units of 1e12 are balanced to a factor 2
RECEDES = 1e-9  # products with a step that are smaller, relative to their largest possible terms, count as zero

Solve = Callable[..., tuple[int, int, float]]


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # numbers have any size; one that overflows is no answer
def minimize(
    program: QuadraticProgram, solve: Solve, tolerance: float, max_iterations: int, x: np.ndarray, y: np.ndarray
) -> tuple[int, int]:
    r"""Minimize by the proximal-point iteration (Rockafellar 1976).

    .. math:: x_{k+1} = \arg\min \tfrac12 x^T P x + q^T x + \tfrac{\rho_k}{2} |x - x_k|^2
              \quad \text{subject to} \quad A_e x = u_e, \quad A_i x \le u_i

    begins at 0, in units in which the largest entries of rows and columns are about 1. The multipliers balance the
    program up to the force :math:`\rho_k (x_k - x_{k+1})`, which vanishes after finitely many steps if P = 0. A minimum
    is a fixed point for every weight. Small weights reach far and large ones lose no digits; therefore the weights
    shrink by factors of ten, and begin anew at the largest. The program is unbounded if a step descends and neither the
    quadratic term nor a row ever stops it.

    The point is written into x, the multipliers into y. `solve` has the arguments and the result of the function that
    native compiles for strictly convex programs. The tolerance bounds the remaining force, relative to the others, and
    the residuals of the answer. Return a code (0 solved, 2 iteration limit, 4 numbers too large, 6 unbounded, or the
    code of a solve that failed) and the iterations of all solves, plus one for each solve.
    """
    P, A = sparse.csr_array(program.quadratic.to_sparse()), sparse.csr_array(program.matrix.to_sparse())
    P.eliminate_zeros()
    A.eliminate_zeros()
    columns, rows = _equilibrate(P, A)
    P = sparse.csr_array(P * columns * columns[:, np.newaxis])
    A = sparse.csr_array(A * columns * rows[:, np.newaxis])
    q, u, n = columns * program.linear, rows * program.upper, x.size
    weights = _weights(P.data, q, u[np.diff(A.indptr) > 0])  # rows of zeros have no unit
    if not all(np.isfinite(numbers).all() for numbers in (P.data, A.data, q, u, weights)):
        return TOO_LARGE, 0
    entries, own = P.tocoo(), np.arange(n)  # the entries of the diagonal come last, and replace earlier ones
    value = np.concatenate((entries.data, np.empty(n)))
    quadratic = (*(np.concatenate((index, own)) for index in entries.coords), np.arange(value.size), value)
    matrix = (A.indptr.astype(np.int64), A.indices.astype(np.int64), np.arange(A.nnz), A.data)
    diagonal, flat = P.diagonal(), bool(np.array_equal(*entries.coords))
    force, curvature = np.abs(q).max(initial=0.0), np.abs(P.data).max(initial=0.0)
    residuals = Residuals(program)
    before, point, multipliers, iterations = np.zeros(n), np.empty(n), np.empty(u.size), 0
    while iterations < max_iterations:
        for weight in weights:
            value[-n:] = diagonal + weight
            first = iterations == 0
            code, changes, _ = solve(
                *quadratic, flat, *matrix, q - weight * before, u, program.equalities,
                tolerance, max_iterations - iterations, point, multipliers,
            )  # fmt: skip
            iterations += 1 + changes
            if code not in (SOLVED, ITERATION_LIMIT) and not first:
                break  # too small a weight for double precision
            x[:], y[:] = columns * point, rows * multipliers
            if code != SOLVED:
                return code, iterations
            step = point - before
            left, reach = (np.abs(numbers).max(initial=0.0) for numbers in (weight * step, point))
            balanced = left <= tolerance * (force + curvature * reach or weight * reach)
            if balanced and residuals.compute(x, y) <= tolerance:
                return SOLVED, iterations
            if q @ step < 0.0 and _recedes(P, A, program.equalities, step):
                return UNBOUNDED, iterations
            before[:] = point
    return ITERATION_LIMIT, iterations


def _weights(curvatures: np.ndarray, forces: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """Return weights from below the largest of the program's scales down to far below the smallest."""
    curvature, force, bound = (np.abs(numbers).max(initial=0.0) for numbers in (curvatures, forces, bounds))
    scales = [scale for scale in (curvature, force / bound if bound else 0.0) if scale] or [force or 1.0]
    least, largest = np.log10(LAST * min(scales)), np.log10(FIRST * max(scales))
    bounded = np.isfinite(largest - least)
    return np.power(10.0, np.arange(largest, least - 0.5, -1.0)) if bounded else np.array([np.nan])


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
    bent, product = np.abs(P @ step), A @ step
    product[:equalities] = np.abs(product[:equalities])
    allowed = RECEDES * np.abs(step).max(initial=0.0)
    return bool(np.all(bent <= allowed * abs(P).sum(axis=1)) and np.all(product <= allowed * abs(A).sum(axis=1)))
