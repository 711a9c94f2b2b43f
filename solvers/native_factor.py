"""The linear algebra of `solvers.native`: a Cholesky factor of the working rows' Gram matrix, and solves with it."""

import math
from typing import Any

import numpy as np

from solvers.absorbed import absorbed
from solvers.native_rows import SMALL

EPSILON = 2.0**-52
ROUNDS = 3  # corrections at the end; only nearly parallel rows need the third


@absorbed
def dots(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    working: np.ndarray,
    w: int,
    vector: np.ndarray,
    right: np.ndarray,
) -> None:
    """Write R_W vector."""
    for i in range(w):
        total = 0.0
        for k in range(start[working[i]], start[working[i] + 1]):
            total += value[k] * vector[column[k]]
        right[i] = total


@absorbed
def forward(factor: np.ndarray, w: int, right: np.ndarray) -> None:
    """Solve L x = right in place; L is stored row by row without its zeros."""
    place = 0
    for i in range(w):
        total = right[i]
        for j in range(i):
            total -= factor[place + j] * right[j]
        right[i] = total / factor[place + i]
        place += i + 1


@absorbed
def backward(factor: np.ndarray, w: int, right: np.ndarray) -> None:
    """Solve L'x = right in place."""
    for i in range(w - 1, -1, -1):
        place = i * (i + 1) // 2
        right[i] /= factor[place + i]
        for j in range(i):
            right[j] -= factor[place + j] * right[i]


@absorbed
def direction(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    row: int,
    working: np.ndarray,
    w: int,
    factor: np.ndarray,
    d: np.ndarray,
    c: np.ndarray,
    entry: np.ndarray,
    work: np.ndarray,
) -> float:
    """Split a row into R_W'c + d with R_W d = 0; write also its entries in L, and return |d|^2.

    The factor of a Gram matrix has lost half the digits. As in a Gram-Schmidt step done twice, the remainder of R_W d
    is removed again, so that |d| is as exact as from an orthogonal factorization.
    """
    for j in range(d.size):
        d[j] = 0.0
    whole = 0.0
    for k in range(start[row], start[row + 1]):
        d[column[k]] = value[k]
        whole += value[k] * value[k]
    for i in range(w):
        c[i] = entry[i] = 0.0
    squared = whole
    for again in range(3 if w else 0):
        if again == 2 and squared > 1e-4 * whole:
            break
        dots(start, column, value, working, w, d, work)
        forward(factor, w, work)
        for i in range(w):
            entry[i] += work[i]
        backward(factor, w, work)
        for i in range(w):
            c[i] += work[i]
            for k in range(start[working[i]], start[working[i] + 1]):
                d[column[k]] -= work[i] * value[k]
        squared = 0.0
        for j in range(d.size):
            squared += d[j] * d[j]
    return squared


@absorbed
def append(factor: np.ndarray, w: int, entry: np.ndarray, pivot: float) -> np.ndarray:
    """Append a row to L, in a storage twice as large if the old one is full."""
    place = w * (w + 1) // 2
    if place + w >= factor.size:
        grown = np.empty(2 * (place + w + 1))
        for k in range(place):
            grown[k] = factor[k]
        factor = grown
    for i in range(w):
        factor[place + i] = entry[i]
    factor[place + w] = pivot
    return factor


@absorbed
def remove(
    factor: np.ndarray,
    working: np.ndarray,
    w: int,
    at: int,
    cosine: np.ndarray,
    sine: np.ndarray,
    entry: np.ndarray,
    state: np.ndarray,
) -> int:
    """Remove a row from the working set; rotations make L triangular again, and ignored rows become free again."""
    state[working[at]] = 0
    for i in range(state.size):
        if state[i] == 2:
            state[i] = 0
    for i in range(at, w - 1):
        working[i] = working[i + 1]
        old, new = (i + 1) * (i + 2) // 2, i * (i + 1) // 2
        for j in range(i + 2):
            entry[j] = factor[old + j]
        for j in range(at, i):
            a, b = entry[j], entry[j + 1]
            entry[j] = cosine[j] * a + sine[j] * b
            entry[j + 1] = cosine[j] * b - sine[j] * a
        pivot = math.hypot(entry[i], entry[i + 1])
        cosine[i], sine[i] = entry[i] / pivot, entry[i + 1] / pivot
        entry[i] = pivot
        for j in range(i + 1):
            factor[new + j] = entry[j]
    return w - 1


@absorbed
def refine(
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    bounds: np.ndarray,
    equalities: int,
    wish: np.ndarray,
    factor: np.ndarray,
    working: np.ndarray,
    w: int,
    cosine: np.ndarray,
    sine: np.ndarray,
    right: np.ndarray,
    g: np.ndarray,
    state: np.ndarray,
    reach: np.ndarray,
    z: np.ndarray,
    y: np.ndarray,
) -> int:
    """Refine z and y on the working set, remove rows with negative multipliers from it, and return its size.

    With g = wish + R_W'y - z and R_W R_W'e = b_W - R_W (z + g), a round adds e to y, and g + R_W'e to z. It removes the
    residuals of both equations, so that digits lost in one do not spoil the other.
    """
    while True:
        for again in range(ROUNDS):
            change = largest = 0.0
            for j in range(wish.size):
                g[j] = wish[j] - z[j]
                reach[j] = 0.0
            for i in range(w):
                for k in range(start[working[i]], start[working[i] + 1]):
                    part = value[k] * y[working[i]]
                    g[column[k]] += part
                    reach[column[k]] += abs(part)
            for i in range(w):
                right[i] = bounds[working[i]]
                for k in range(start[working[i]], start[working[i] + 1]):
                    right[i] -= value[k] * z[column[k]] + value[k] * g[column[k]]
            forward(factor, w, right)
            backward(factor, w, right)
            for i in range(w):
                change, largest = max(change, abs(right[i])), max(largest, abs(y[working[i]]))
                y[working[i]] += right[i]
                for k in range(start[working[i]], start[working[i] + 1]):
                    g[column[k]] += value[k] * right[i]
            for j in range(wish.size):
                z[j] += g[j]
            if again > 0 and change <= EPSILON * largest:
                break
        at: Any = np.int64(-1)
        for i in range(w):
            if working[i] >= equalities and y[working[i]] < (0.0 if at < 0 else y[working[at]]):
                at = i
        if at < 0:
            break
        y[working[at]] = 0.0
        w = remove(factor, working, w, at, cosine, sine, right, state)
    size = 0.0
    for j in range(wish.size):
        size = max(size, abs(wish[j]) + abs(z[j]))
    for j in range(wish.size):
        reach[j] = max(abs(wish[j]) + abs(z[j]) + min(reach[j], size), SMALL * size)
    return w
