"""Violations and residuals of a point, by the rows of `solvers.native`."""

import math
from typing import Any

import numpy as np

from solvers.absorbed import absorbed
from solvers.kept import kept

SMALL = 1e-3  # coordinates smaller than this, relative to the largest, may hold the rounding errors of others


@absorbed
def length(start: np.ndarray, value: np.ndarray, row: int) -> float:
    """Return the squared length of a row."""
    total = 0.0
    for k in range(start[row], start[row + 1]):
        total += value[k] * value[k]
    return total


@absorbed
def scale(
    start: np.ndarray, column: np.ndarray, value: np.ndarray, bounds: np.ndarray, reach: np.ndarray, row: int
) -> float:
    """Return the size of the terms of a row's slack; of a row of zeros, the size of the point."""
    total = 0.0
    for k in range(start[row], start[row + 1]):
        total += abs(value[k]) * reach[column[k]]
    if total == 0.0:
        for j in range(reach.size):
            total = max(total, reach[j])
    return total + abs(bounds[row])


@absorbed
def most_violated(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    z: np.ndarray,
    reach: np.ndarray,
    state: np.ndarray,
    threshold: float,
    first: bool,
) -> tuple[int, float]:
    """Return the most violated inequality, or the first violated one, and its violation over the allowed one."""
    chosen: Any = np.int64(-1)  # a literal would cause a second compilation of the functions that take it
    excess = farthest = 0.0
    for i in range(equalities, bounds.size):
        if state[i] != 0:
            continue
        gap = bounds[i]
        for k in range(start[i], start[i + 1]):
            gap -= value[k] * z[column[k]]
        if gap > 0.0:
            distance = gap / math.sqrt(length(start, value, i))
            if distance <= farthest:
                continue
            allowed = threshold * scale(start, column, value, bounds, reach, i)
            if gap > allowed:
                chosen, excess, farthest = i, gap / allowed, distance
                if first:
                    break
    return chosen, excess


@kept(nogil=True, error_model="numpy")
def residuals(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    z: np.ndarray,
    y: np.ndarray,
) -> tuple[float, float, float]:
    """Call `residuals_within` from Python."""
    return residuals_within(start, column, value, bounds, equalities, wish, z, y, np.empty(wish.size))


@absorbed
def residuals_within(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    z: np.ndarray,
    y: np.ndarray,
    pull: np.ndarray,
) -> tuple[float, float, float]:
    """Return primal, dual and complementarity residual (`solvers.residuals.Residuals`); nan if a number is not finite.

    In the standard form P = I, q = -wish, A = -R, u = -bounds. `pull` is scratch, of shape (n,).
    """
    for j in range(wish.size):
        pull[j] = 0.0
    violated = reach = negative = product = 0.0
    total = 0.0  # finite exactly if all terms are
    for i in range(bounds.size):
        reached = largest = 0.0
        for k in range(start[i], start[i + 1]):
            reached += value[k] * z[column[k]]
            pull[column[k]] += value[k] * y[i]
            largest = max(largest, abs(value[k]))
        gap = bounds[i] - reached
        total += abs(gap) + abs(y[i])
        reach = max(reach, abs(reached), abs(bounds[i]))
        if i < equalities:
            violated = max(violated, abs(gap))
        else:
            violated = max(violated, gap)
            negative = max(negative, -y[i] * largest)
            product = max(product, abs(y[i] * gap))
    unbalanced = force = curvature = slope = 0.0
    for j in range(wish.size):
        balance = z[j] - wish[j] - pull[j]
        total += abs(balance)
        unbalanced = max(unbalanced, abs(balance))
        force = max(force, abs(z[j]), abs(wish[j]), abs(pull[j]))
        curvature += z[j] * z[j]
        slope += z[j] * wish[j]
    if not math.isfinite(total + product):
        return math.nan, math.nan, math.nan
    dual = max(unbalanced, negative) / (1.0 + force)
    return violated / (1.0 + reach), dual, product / (1.0 + max(curvature, abs(slope)))
