"""Proofs that a quadratic program has no answer, found and checked independently of a solver's claim."""

from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import linprog

from solvers.program import QuadraticProgram
from solvers.residuals import Residuals
from solvers.solution import Status

ROUNDOFF = 1e-12  # a sum of this size, relative to the sum of its terms' magnitudes, is zero
NOISE = 1e-9  # a component of this size, of a vector in the unit box, is taken for zero
OPTIONS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10, "maxiter": 100_000}


@np.errstate(over="ignore", invalid="ignore")  # numbers have any size; one that overflows proves nothing
def prove(program: QuadraticProgram, residuals: Residuals, tolerance: float) -> Status | None:
    r"""Return ``INFEASIBLE`` or ``UNBOUNDED`` if that is proved, else None.

    With e over equality and i over inequality rows, a program is infeasible if there is a Farkas vector y,

    .. math:: A^T y = 0, \qquad y_i \ge 0, \qquad -u^T y > \tau \sum_k |y_k| (1 + |u_k|):

    no point satisfies its rows to the tolerance :math:`\tau`. It is unbounded if it has a feasible point and a ray d,

    .. math:: P d = 0, \qquad A_e d = 0, \qquad A_i d \le 0, \qquad -q^T d > \tau \sum_j |d_j| (1 + |q_j|):

    no multipliers balance the forces to the tolerance. A positive definite P has no ray. Linear programs (HiGHS) find
    the vectors and the point, which are then checked in the program's own numbers. A component counts as zero, in any
    units, if its terms cancel to `ROUNDOFF` of their magnitudes. A point is feasible if its primal residual
    (`solvers.residuals`) is within the tolerance.
    """
    P, A = sparse.csr_array(program.quadratic.to_sparse()), sparse.csr_array(program.matrix.to_sparse())
    q, u, e = program.linear, program.upper, program.equalities
    if _is_farkas(A, u, e, _find_farkas(A, u, e), tolerance):
        return Status.INFEASIBLE
    if _is_ray(P, q, A, e, _find_ray(P, q, A, e), tolerance):
        residuals.compute(_find_point(A, u, e), np.zeros(u.size))
        if residuals.primal <= tolerance:
            return Status.UNBOUNDED
    return None


def _find_farkas(A: sparse.csr_array, u: np.ndarray, e: int) -> np.ndarray:
    """Minimize u'y in a box over the vectors with A'y = 0 and y_i >= 0."""
    rows, size = _unit(A)
    lower = np.where(np.arange(u.size) < e, -1.0, 0.0)
    return _minimize(u / size, A_eq=_unit(rows.T)[0], bounds=(lower, 1.0)) / size


def _is_farkas(A: sparse.csr_array, u: np.ndarray, e: int, y: np.ndarray, tolerance: float) -> bool:
    reach = tolerance * (np.abs(y) @ (1.0 + np.abs(u)))
    return bool(-(u @ y) > reach and np.all(y[e:] >= 0.0) and np.all(_vanishes(A.T, y)))


def _find_ray(P: sparse.csr_array, q: np.ndarray, A: sparse.csr_array, e: int) -> np.ndarray:
    """Minimize q'd in a box over the directions with P d = 0, A_e d = 0 and A_i d <= 0."""
    columns, size = _unit(_unit(sparse.vstack((P, A)))[0].T)
    rows = columns.T.tocsr()
    fixed = q.size + e
    return _minimize(q / size, A_eq=rows[:fixed], A_ub=rows[fixed:], bounds=(-1.0, 1.0)) / size


def _is_ray(P: sparse.csr_array, q: np.ndarray, A: sparse.csr_array, e: int, d: np.ndarray, tolerance: float) -> bool:
    reach = tolerance * (np.abs(d) @ (1.0 + np.abs(q)))
    recedes = _vanishes(A, d)
    recedes[e:] |= A[e:] @ d <= 0.0
    return bool(-(q @ d) > reach and np.all(_vanishes(P, d)) and np.all(recedes))


def _find_point(A: sparse.csr_array, u: np.ndarray, e: int) -> np.ndarray:
    """Return a point that satisfies the rows, nan if none is found."""
    rows, size = _unit(A)
    right, nothing = u / size, np.zeros(A.shape[1])
    return _minimize(nothing, A_eq=rows[:e], b_eq=right[:e], A_ub=rows[e:], b_ub=right[e:], bounds=(-np.inf, np.inf))


def _minimize(cost: np.ndarray, bounds: tuple[Any, Any], **rows: Any) -> np.ndarray:
    """Minimize cost'x within bounds and rows, whose right sides are zero unless given; nan if that fails."""
    for kind in {"eq", "ub"} & {name[-2:] for name in rows}:
        rows.setdefault(f"b_{kind}", np.zeros(rows[f"A_{kind}"].shape[0]))
    box = np.column_stack(np.broadcast_arrays(*bounds, cost)[:2])
    scale = np.abs(cost).max(initial=0.0) or 1.0
    found = None
    if cost.size and all(np.isfinite(numbers).all() for numbers in (cost, rows["b_eq"], rows.get("b_ub", 0.0))):
        found = linprog(cost / scale, bounds=box, method="highs", options=OPTIONS, **rows).x
    return np.full(cost.size, np.nan) if found is None else np.where(np.abs(found) > NOISE, found, 0.0)


def _unit(matrix: Any) -> tuple[sparse.csr_array, np.ndarray]:
    """Scale rows to unit maximum norm, and return the rows and their norms, one for a row of zeros."""
    entries = matrix.tocoo()
    size = np.zeros(matrix.shape[0])
    np.maximum.at(size, entries.row, np.abs(entries.data))
    size[size == 0.0] = 1.0
    scaled = sparse.coo_array((entries.data / size[entries.row], (entries.row, entries.col)), shape=matrix.shape)
    return scaled.tocsr(), size


def _vanishes(matrix: Any, vector: np.ndarray) -> np.ndarray:
    """Return for each component of a product whether its terms cancel."""
    cancelled: np.ndarray = np.abs(matrix @ vector) <= ROUNDOFF * (abs(matrix) @ np.abs(vector))
    return cancelled
