"""Projection onto a polyhedron by a dual active-set method, compiled, for use inside other compiled code.

    minimize    1/2 |z - wish|^2
    subject to  R[:e] z = bounds[:e],   R[e:] z >= bounds[e:]

R is stored by compressed rows: row i has the columns ``column[start[i]:start[i + 1]]``, distinct and in any
order, and the values at the same places of ``value``. Rows may vanish, be repeated or depend on each other.
"""

import math
from typing import Any

import numpy as np

from solvers.absorbed import absorbed
from solvers.kept import kept
from solvers.native_factor import append, direction, refine, remove
from solvers.native_rows import SMALL, length, most_violated, residuals, scale

__all__ = ["project", "project_within", "residuals"]

SOLVED, INFEASIBLE, ITERATION_LIMIT, TOO_LARGE, FAILED = range(5)

ROUNDING = 16 * 2.0**-52  # violation of a row, relative to its terms, that rounding explains
DEPENDENT = 1e-10  # part of a row outside the span of the working rows, relative to the terms that cancel
PARALLEL = 1e-8  # the same; below it the error of a multiplier would exceed that of a gap within the tolerance
NOISE = 1e-13  # size of a coefficient, relative to the largest, that rounding explains
PATIENCE = 20  # rows that may enter on violations near rounding before such violations are ignored

FREE, WORKING, IGNORED = range(3)


@kept(nogil=True, error_model="numpy")
def project(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    tolerance: float,
    limit: int,
    max_iterations: int,
    z: np.ndarray,
    y: np.ndarray,
) -> tuple[int, int]:
    """Call `project_within` from Python."""
    return project_within(start, column, value, bounds, equalities, wish, tolerance, limit, max_iterations, z, y)


@absorbed
def project_within(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    tolerance: float,
    limit: int,
    max_iterations: int,
    z: np.ndarray,
    y: np.ndarray,
) -> tuple[int, int]:
    r"""Project a point onto a polyhedron.

    The dual method of Goldfarb and Idnani (1983): with W the working rows, the most violated row r enters along

    .. math:: d = r - R_W^T c, \qquad R_W R_W^T c = R_W r,

    while z moves by t d, the multipliers of W by -t c and the multiplier of r by t. The move ends when r holds, or when
    the multiplier of an inequality in W vanishes; that inequality then leaves W. If d = 0, either a row of W leaves or
    c proves that there is no feasible point. Every row that enters increases the dual objective, so that no working set
    comes back. A violation near rounding does not increase it; after many of them the threshold of a violation grows.

    Parameters
    ----------
    start, column, value : ndarray, shapes (m + 1,), (k,), (k,)
        R by compressed rows, with int64 indices.
    bounds : ndarray, shape (m,)
        Right-hand sides.
    equalities : int
        Number of equations, which are the first rows.
    wish : ndarray, shape (n,)
        The point to project.
    tolerance : float
        Size up to which contradictions between dependent rows, relative to their terms, are ignored.
    limit : int
        Largest working set.
    max_iterations : int
        Largest number of changes of the working set.
    z, y : ndarray, shapes (n,), (m,)
        Written: the point and the multipliers, with z - wish = R'y and y[e:] >= 0. If multipliers are so large
        that this equation loses digits, z satisfies the working rows instead.

    Returns
    -------
    status : int
        0 solved, 1 infeasible, 2 too many changes, 3 working set larger than `limit`, 4 not finite.
    iterations : int
        Changes of the working set.
    """
    m, n = bounds.size, wish.size
    room = min(m, n, max(limit, 0)) + 1
    factor, working, state = np.empty(min(36, room * (room + 1) // 2)), np.empty(room, np.int64), np.empty(m, np.int64)
    norm, reach, d, c = np.empty(m), np.empty(n), np.empty(n), np.empty(room)
    entry, work, more = np.empty(room), np.empty(room), np.empty(room)
    for i in range(m):
        y[i] = 0.0
        state[i] = FREE
    size = 0.0
    for j in range(n):
        z[j] = wish[j]
        size = max(size, abs(wish[j]))
    for j in range(n):
        reach[j] = max(abs(wish[j]), SMALL * size)
    zero: Any = np.int64(0)  # a literal would cause a second compilation of the functions that take it
    w = iterations = entered = idle = zero
    threshold = max(ROUNDING, 1e-6 * tolerance)
    refined = True
    while True:
        if entered < equalities:
            row = entered
            entered += 1
        else:
            row, excess = most_violated(
                start, column, value, bounds, equalities, z, reach, state, threshold, idle > PATIENCE
            )
            if row < 0:
                if refined:
                    break
                before = w
                w = refine(
                    start,
                    column,
                    value,
                    bounds,
                    equalities,
                    wish,
                    factor,
                    working,
                    w,
                    work,
                    more,
                    entry,
                    d,
                    state,
                    reach,
                    z,
                    y,
                )
                iterations += before - w
                refined = True
                continue
            if excess < 1e3:
                idle += 1
                if idle > PATIENCE:
                    threshold = max(threshold, min(2.0 * threshold, tolerance))
        refined = False
        while True:
            squared = direction(start, column, value, row, working, w, factor, d, c, entry, work)
            norm[row] = math.sqrt(length(start, value, row))
            gap = bounds[row]
            for k in range(start[row], start[row + 1]):
                gap -= value[k] * z[column[k]]
            terms, largest = norm[row], norm[row]
            for i in range(w):
                part = abs(c[i]) * norm[working[i]]
                terms += part
                largest = max(largest, part)
            if not math.isfinite(squared + gap + terms):
                return FAILED, iterations
            dependent = w >= n or squared <= (DEPENDENT * terms) ** 2
            leaving, step = zero - 1, math.inf
            for i in range(w):
                k = working[i]
                if k >= equalities and c[i] * norm[k] > NOISE * largest:
                    ratio = y[k] / c[i]
                    if ratio < step or (ratio == step and k < working[leaving]):
                        leaving, step = i, ratio
            if squared <= (PARALLEL * terms) ** 2 and (leaving < 0 or row < equalities):
                size = scale(start, column, value, bounds, reach, row)
                excess = abs(gap) if row < equalities else gap
                if excess <= tolerance * size:
                    state[row] = IGNORED
                    y[row] = 0.0
                    break
                if dependent:
                    for i in range(w):
                        size += abs(c[i]) * scale(start, column, value, bounds, reach, working[i])
                    return INFEASIBLE if excess > tolerance * size else FAILED, iterations
            if iterations >= max_iterations:
                return ITERATION_LIMIT, iterations
            iterations += 1
            enters = False
            if not dependent:
                whole = gap / squared if row < equalities else max(gap, 0.0) / squared
                enters = row < equalities or whole <= step
                if enters:
                    step = whole
                for j in range(n):
                    z[j] += step * d[j]
                    reach[j] = max(reach[j], abs(z[j]))
            for i in range(w):
                k = working[i]
                y[k] -= step * c[i]
                if k >= equalities:
                    y[k] = max(y[k], 0.0)
            y[row] += step
            if enters:
                if w >= limit:
                    return TOO_LARGE, iterations
                factor = append(factor, w, entry, math.sqrt(squared))
                working[w] = row
                state[row] = WORKING
                w += 1
                break
            y[working[leaving]] = 0.0
            w = remove(factor, working, w, leaving, work, more, entry, state)
    for i in range(m):
        if state[i] == IGNORED:
            gap = bounds[i]
            for k in range(start[i], start[i + 1]):
                gap -= value[k] * z[column[k]]
            excess = abs(gap) if i < equalities else gap
            if excess > tolerance * scale(start, column, value, bounds, reach, i):
                return FAILED, iterations
    for j in range(n):
        if not math.isfinite(z[j]):
            return FAILED, iterations
    return SOLVED, iterations
