"""The compiled arithmetic of each solve: numba compiles it at first use and keeps the result on disk."""

import math

import numpy as np

from solvers.kept import kept


@kept()
def dense_residuals(
    P: np.ndarray, A: np.ndarray, q: np.ndarray, u: np.ndarray, equalities: int, x: np.ndarray, y: np.ndarray
) -> tuple[float, float, float, float, float]:
    """Return primal, dual, complementarity, natural residual, and objective (`solvers.residuals.Residuals`), dense."""
    n, rows = q.size, u.size
    Px, Ax, Aty = np.zeros(n), np.empty(rows), np.zeros(n)
    pull = 0.0
    for i in range(n):
        for j in range(n):
            Px[j] += P[i, j] * x[i]  # P is symmetric, and a sum of its rows needs no reduction
    for i in range(rows):
        reached = 0.0
        for j in range(n):
            reached += A[i, j] * x[j]
        Ax[i] = reached
        for j in range(n):
            Aty[j] += A[i, j] * y[i]
            if i >= equalities:
                pull = max(pull, -y[i] * abs(A[i, j]))
    return _scaled(Px, Ax, Aty, pull, q, u, equalities, x, y)


@kept()
def sparse_residuals(
    P_start: np.ndarray,
    P_row: np.ndarray,
    P_value: np.ndarray,
    A_start: np.ndarray,
    A_row: np.ndarray,
    A_value: np.ndarray,
    q: np.ndarray,
    u: np.ndarray,
    equalities: int,
    x: np.ndarray,
    y: np.ndarray,
) -> tuple[float, float, float, float, float]:
    """Return the numbers of `dense_residuals` for matrices stored by compressed columns."""
    n, rows = q.size, u.size
    Px, Ax, Aty = np.zeros(n), np.zeros(rows), np.zeros(n)
    pull = 0.0
    for j in range(n):
        for k in range(P_start[j], P_start[j + 1]):
            Px[P_row[k]] += P_value[k] * x[j]
        for k in range(A_start[j], A_start[j + 1]):
            Ax[A_row[k]] += A_value[k] * x[j]
            Aty[j] += A_value[k] * y[A_row[k]]
            if A_row[k] >= equalities:
                pull = max(pull, -y[A_row[k]] * abs(A_value[k]))
    return _scaled(Px, Ax, Aty, pull, q, u, equalities, x, y)


@kept()
def _scaled(
    Px: np.ndarray,
    Ax: np.ndarray,
    Aty: np.ndarray,
    pull: float,
    q: np.ndarray,
    u: np.ndarray,
    equalities: int,
    x: np.ndarray,
    y: np.ndarray,
) -> tuple[float, float, float, float, float]:
    unbalanced = force = curvature = slope = 0.0
    total = 0.0  # finite exactly if all terms are
    for j in range(q.size):
        balance = Px[j] + q[j] + Aty[j]
        total += abs(balance)
        unbalanced = max(unbalanced, abs(balance))
        force = max(force, abs(Px[j]), abs(q[j]), abs(Aty[j]))
        curvature += x[j] * Px[j]
        slope += x[j] * q[j]
    violated = reach = product = apart = 0.0
    for i in range(u.size):
        excess = Ax[i] - u[i]
        total += abs(excess) + abs(y[i])
        reach = max(reach, abs(Ax[i]), abs(u[i]))
        if i < equalities:
            violated = max(violated, abs(excess))
            apart = max(apart, abs(excess))
        else:
            violated = max(violated, excess)
            product = max(product, abs(y[i] * excess))
            apart = max(apart, abs(min(y[i], -excess)))
    if not math.isfinite(total + product):
        return math.nan, math.nan, math.nan, math.nan, math.nan
    stationarity = unbalanced / (1.0 + force)
    dual = max(stationarity, pull / (1.0 + force))
    complementarity = product / (1.0 + max(abs(curvature), abs(slope)))
    natural = max(stationarity, apart / (1.0 + reach))
    return violated / (1.0 + reach), dual, complementarity, natural, 0.5 * curvature + slope
