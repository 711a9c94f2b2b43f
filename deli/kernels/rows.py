"""Values and gradients of constraint rows."""

import math

import numpy as np

from deli.kernels.compiled import inner_kernel, kernel
from deli.mechanics.tables import OTHER, PAIR, PLANE, Rows


@inner_kernel
def separation(rows: Rows, row: int, q: np.ndarray, axis: int) -> float:
    """One component of x, see `Rows`."""
    dimension = rows.vector.shape[1]
    here = q[rows.first[row] * dimension + axis]
    if rows.kind[row] != PAIR:
        return here - rows.vector[row, axis]
    x = here - q[rows.second[row] * dimension + axis]
    period = rows.period[axis]
    if period > 0.0:
        x -= period * np.round(x / period)
    return x


@inner_kernel
def value(rows: Rows, row: int, q: np.ndarray, others: np.ndarray) -> float:
    """Value of a row at q, given the values of those that are functions of the user's."""
    kind = rows.kind[row]
    if kind == OTHER:
        return others[rows.first[row]]
    dimension = rows.vector.shape[1]
    total = 0.0
    if kind == PLANE:
        body = rows.first[row] * dimension
        for axis in range(dimension):
            total += rows.vector[row, axis] * q[body + axis]
        return total - rows.target[row]
    for axis in range(dimension):
        x = separation(rows, row, q, axis)
        total += x * x
    return rows.sign[row] * (math.sqrt(total) - rows.target[row])


@kernel
def values(rows: Rows, q: np.ndarray, others: np.ndarray, out: np.ndarray) -> None:
    """Values of all rows."""
    for row in range(rows.kind.size):
        out[row] = value(rows, row, q, others)


@kernel
def normal(rows: Rows, row: int, q: np.ndarray, normals: np.ndarray) -> None:
    """Write the row's gradient at its first body to `normals`; at the second it is the opposite."""
    kind = rows.kind[row]
    dimension = rows.vector.shape[1]
    if kind == OTHER:
        return
    if kind == PLANE:
        for axis in range(dimension):
            normals[row, axis] = rows.vector[row, axis]
        return
    square = 0.0
    for axis in range(dimension):
        x = separation(rows, row, q, axis)
        normals[row, axis] = x
        square += x * x
    scale = rows.sign[row] / math.sqrt(square) if square > 0.0 else 0.0
    for axis in range(dimension):
        normals[row, axis] *= scale


@kernel
def rate(rows: Rows, row: int, normals: np.ndarray, gradients: np.ndarray, p: np.ndarray, inverse: np.ndarray) -> float:
    """The row's gradient times M⁻¹p."""
    total = 0.0
    if rows.kind[row] == OTHER:
        gradient = rows.first[row]
        for k in range(p.size):
            total += gradients[gradient, k] * p[k] * inverse[k]
        return total
    dimension = normals.shape[1]
    body = rows.first[row] * dimension
    for axis in range(dimension):
        total += normals[row, axis] * p[body + axis] * inverse[body + axis]
    if rows.second[row] >= 0:
        body = rows.second[row] * dimension
        for axis in range(dimension):
            total -= normals[row, axis] * p[body + axis] * inverse[body + axis]
    return total


@kernel
def weight(rows: Rows, row: int, normals: np.ndarray, gradients: np.ndarray, inverse: np.ndarray) -> float:
    """The square of the row's gradient in the metric M⁻¹."""
    total = 0.0
    if rows.kind[row] == OTHER:
        gradient = rows.first[row]
        for k in range(inverse.size):
            total += gradients[gradient, k] ** 2 * inverse[k]
        return total
    dimension = normals.shape[1]
    body = rows.first[row] * dimension
    for axis in range(dimension):
        total += normals[row, axis] ** 2 * inverse[body + axis]
    if rows.second[row] >= 0:
        body = rows.second[row] * dimension
        for axis in range(dimension):
            total += normals[row, axis] ** 2 * inverse[body + axis]
    return total


@kernel
def push(
    rows: Rows, row: int, normals: np.ndarray, gradients: np.ndarray, impulse: float, momentum: np.ndarray
) -> None:
    """Add `impulse` along the row's gradient to the momentum."""
    if rows.kind[row] == OTHER:
        gradient = rows.first[row]
        for k in range(momentum.size):
            momentum[k] += impulse * gradients[gradient, k]
        return
    dimension = normals.shape[1]
    body = rows.first[row] * dimension
    for axis in range(dimension):
        momentum[body + axis] += impulse * normals[row, axis]
    if rows.second[row] >= 0:
        body = rows.second[row] * dimension
        for axis in range(dimension):
            momentum[body + axis] -= impulse * normals[row, axis]
