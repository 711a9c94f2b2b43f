"""The compiled solver for the program at hand."""

import math

import numpy as np
from numba import types

from deli.kernels.compiled import kernel, unit
from deli.kernels.dense import backward, forward
from deli.kernels.program import PROGRAM, Program
from solvers.native import project_within
from solvers.native_equations import factorize, project_onto_row, project_onto_within
from solvers.native_rows import residuals_within

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


@kernel
def _project_onto(
    program: Program,
    start: np.ndarray,
    column: np.ndarray,
    value: np.ndarray,
    size: int,
    equalities: int,
    rows: int,
    newton: bool,
) -> float:
    """Solve the program at hand as equations; return the residual, nan if these do not give its answer.

    Unchanged rows, as in the iterations of a position update, are factorized once.
    """
    bounds, wish = program.bounds[:rows], program.wish[:size]
    if rows == 1:
        return project_onto_row(start, column, value, bounds, equalities, wish, program.z, program.y)
    if rows > program.begins.size:
        return math.nan
    if newton or program.factored[0] != rows:
        if not factorize(start, column, value, rows, program.pull[:size], program.begins, program.gram):
            return math.nan
        program.factored[0] = 0 if newton else rows
    return project_onto_within(
        start, column, value, bounds, equalities, wish,
        program.begins, program.gram, program.right, program.pull, program.z, program.y,
    )  # fmt: skip


@unit(types.int64, PROGRAM, *(types.int64,) * 3, types.float64, types.boolean, types.boolean)
def project_program(
    program: Program, size: int, equalities: int, rows: int, tolerance: float, newton: bool, linear: bool
) -> int:
    """Solve the program at hand; return whether its residuals are within `tolerance`.

    ``program.report`` gets the iterations and the primal, dual and complementarity residual. In coordinates Lᵀz, with
    A = L Lᵀ, the metric is the identity. `linear` says that all rows are likely to hold as equations; that is tried
    first.
    """
    wish, bounds, z, y = program.wish, program.bounds, program.z, program.y
    start, column, value = program.start, program.column, program.value
    if newton:
        _whiten(program, size, rows)
        start, column, value = program.white_start, program.white_column, program.white_value
    good = linear and _project_onto(program, start, column, value, size, equalities, rows, newton) <= tolerance
    if not good:
        most = 100 + 20 * (rows + size)
        status, iterations = project_within(
            start, column, value, bounds[:rows], equalities, wish[:size], tolerance, LARGEST, most, z[:size], y[:rows]
        )
        found = residuals_within(
            start, column, value, bounds[:rows], equalities, wish[:size], z[:size], y[:rows], program.pull
        )
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
