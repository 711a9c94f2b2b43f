"""The compiled solver, on the program at hand."""

import math

import numpy as np
from numba import types

from deli.kernels.compiled import kernel, unit
from deli.kernels.dense import backward, forward
from deli.kernels.program import PROGRAM, Program
from solvers.native import project_within, residuals

LARGEST = 150  # rows that press at once, beyond which a sparse solver is faster


@kernel
def _whiten(program: Program, size: int, rows: int) -> None:
    """Turn wish, bounds and rows to coordinates in which the metric is the identity, rows again of unit length."""
    factor = program.factor
    forward(factor, size, program.wish)
    start, column, value = program.white_start, program.white_column, program.white_value
    start[0] = 0
    for row in range(rows):
        at = row * size
        for k in range(size):
            value[at + k] = 0.0
        for k in range(program.start[row], program.start[row + 1]):
            value[at + program.column[k]] = program.value[k]
        image = value[at : at + size]
        forward(factor, size, image)
        square = 0.0
        for k in range(size):
            column[at + k] = k
            square += image[k] * image[k]
        length = math.sqrt(square) if square > 0.0 else 1.0
        for k in range(size):
            image[k] /= length
        program.lengths[rows + row] = length
        program.bounds[row] /= length
        start[row + 1] = at + size


@kernel
def _unwhiten(factor: np.ndarray, size: int, wish: np.ndarray) -> None:
    """Overwrite wish with L wish."""
    for i in range(size - 1, -1, -1):
        total = 0.0
        for k in range(i + 1):
            total += factor[i, k] * wish[k]
        wish[i] = total


@unit(types.int64, PROGRAM, types.int64, types.int64, types.int64, types.float64, types.boolean)
def project_program(program: Program, size: int, equalities: int, rows: int, tolerance: float, newton: bool) -> int:
    """Solve the program at hand; return whether its residuals are within `tolerance`.

    ``program.report`` gets the iterations and the primal, dual and complementarity residual. In coordinates Lᵀz, with
    A = L Lᵀ, the metric is the identity.
    """
    wish, bounds, z, y = program.wish, program.bounds, program.z, program.y
    start, column, value = program.start, program.column, program.value
    if newton:
        _whiten(program, size, rows)
        start, column, value = program.white_start, program.white_column, program.white_value
    most = 100 + 20 * (rows + size)
    status, iterations = project_within(
        start, column, value, bounds[:rows], equalities, wish[:size], tolerance, LARGEST, most, z[:size], y[:rows]
    )
    found = residuals(start, column, value, bounds[:rows], equalities, wish[:size], z[:size], y[:rows])
    good = status == 0 and max(found[0], found[1], found[2]) <= tolerance
    program.report[0] = iterations
    program.report[1], program.report[2], program.report[3] = found[0], found[1], found[2]
    if newton:
        backward(program.factor, size, z)
        for row in range(rows):
            y[row] /= program.lengths[rows + row]
            bounds[row] *= program.lengths[rows + row]
        if not good:
            _unwhiten(program.factor, size, wish)
    return 1 if good else 0
