"""Assemble and solve the metric projection of one island: natively, or by the solver behind `Hooks.solve`."""

import math

import numpy as np
from numba import types

from deli.kernels.compiled import call, kernel, seconds, unit
from deli.kernels.system import DONE, MACHINE, RAISED, Machine, Program
from deli.kernels.tally import SOLVED, measure, note
from deli.mechanics.tables import OTHER, Rows
from solvers.native import project_within, residuals

_SATISFIED = 1e-15  # scaled velocity along an equality row that is rounding already
_LARGEST = 400  # rows that press at once, beyond which a sparse solver is faster
_DEPENDENT = 1e-7  # part of a unit row outside the span of the rows before it, below which it adds nothing
NEWTON = 8  # added to a subproblem's number where the program has a metric


@kernel
def append(
    program: Program,
    count: int,
    rows: Rows,
    row: int,
    normals: np.ndarray,
    gradients: np.ndarray,
    place: np.ndarray,
    root: np.ndarray,
) -> None:
    """Append a row of unit length as number `count`; `place` maps bodies to those of the island."""
    at = program.start[count]
    begin = at
    square = 0.0
    if rows.kind[row] == OTHER:
        gradient = rows.first[row]
        for k in range(root.size):
            program.column[at] = k
            program.value[at] = gradients[gradient, k] / root[k]
            square += program.value[at] ** 2
            at += 1
    else:
        dimension = normals.shape[1]
        for end in range(2):
            body = rows.first[row] if end == 0 else rows.second[row]
            if body >= 0:
                for axis in range(dimension):
                    entry = normals[row, axis] / root[body * dimension + axis]
                    program.column[at] = place[body] * dimension + axis
                    program.value[at] = entry if end == 0 else -entry
                    square += entry * entry
                    at += 1
    length = math.sqrt(square) if square > 0.0 else 1.0
    for k in range(begin, at):
        program.value[k] /= length
    program.lengths[count] = length
    program.start[count + 1] = at


@kernel
def along(program: Program, row: int, z: np.ndarray) -> float:
    """R z for one row."""
    total = 0.0
    for k in range(program.start[row], program.start[row + 1]):
        total += program.value[k] * z[program.column[k]]
    return total


@kernel
def factorize(matrix: np.ndarray, size: int, factor: np.ndarray) -> bool:
    """Lower Cholesky factor; False where the matrix is not positive definite."""
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total > 0.0:
                factor[i, i] = math.sqrt(total)
            else:
                return False
    return True


@kernel
def forward(factor: np.ndarray, size: int, x: np.ndarray) -> None:
    """Overwrite x with L⁻¹x."""
    for i in range(size):
        total = x[i]
        for k in range(i):
            total -= factor[i, k] * x[k]
        x[i] = total / factor[i, i]


@kernel
def backward(factor: np.ndarray, size: int, x: np.ndarray) -> None:
    """Overwrite x with L⁻ᵀx."""
    for i in range(size - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * x[k]
        x[i] = total / factor[i, i]


@kernel
def _solve_native(
    machine: Machine, subproblem: int, size: int, equalities: int, rows: int, newton: bool, linear: bool
) -> bool:
    """Solve the program at hand by compiled code; say whether the answer is good."""
    method, program, hooks, tally = machine.method, machine.program, machine.hooks, machine.tally
    wish, bounds, z, y = program.wish, program.bounds, program.z, program.y
    began = seconds(hooks.clock, machine.work.ticks)
    start, column, value = program.start, program.column, program.value
    if newton:
        # In coordinates Lᵀz, with A = L Lᵀ, the metric is the identity.
        start, column, value = _whiten(program, size, rows)
    elif equalities == rows and _satisfied(program, rows):
        for k in range(size):
            z[k] = wish[k]
        for row in range(rows):
            y[row] = 0.0
        return True
    status, iterations = project_within(
        start, column, value, bounds[:rows], equalities, wish[:size], method.tolerance[subproblem], _LARGEST,
        100 + 20 * (rows + size), z[:size], y[:rows],
    )  # fmt: skip
    solved = seconds(hooks.clock, machine.work.ticks)
    found = residuals(start, column, value, bounds[:rows], equalities, wish[:size], z[:size], y[:rows])
    primal, dual, complementarity = found[0], found[1], found[2]
    good = status == 0 and max(primal, dual, complementarity) <= method.tolerance[subproblem]
    if newton:
        backward(program.factor, size, z)
        for row in range(rows):
            y[row] /= program.lengths[rows + row]
            bounds[row] *= program.lengths[rows + row]
        if not good:
            _unwhiten(program.factor, size, wish)
    if good and not linear:
        tally.counts[0, subproblem] += 1
        tally.contacts[2] += 1
        tally.counts[2, subproblem] += iterations
        tally.counts[3, subproblem] += rows
        tally.times[0, subproblem] += solved - began
        tally.times[1, subproblem] += seconds(hooks.clock, machine.work.ticks) - solved
        note(tally, subproblem, SOLVED)
        if subproblem != 1:
            measure(tally, subproblem, primal, dual, complementarity)
    return good


@kernel
def _satisfied(program: Program, rows: int) -> bool:
    for row in range(rows):
        if not abs(along(program, row, program.wish) - program.bounds[row]) <= _SATISFIED:
            return False
    return True


@kernel
def _whiten(program: Program, size: int, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Turn wish, bounds and rows to coordinates in which the metric is the identity, rows again of unit length."""
    factor = program.factor
    forward(factor, size, program.wish)
    start = np.empty(rows + 1, dtype=np.int64)
    start[0] = 0
    column = np.empty(rows * size, dtype=np.int64)
    value = np.zeros(rows * size)
    for row in range(rows):
        at = row * size
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
    return start, column, value


@kernel
def _unwhiten(factor: np.ndarray, size: int, wish: np.ndarray) -> None:
    """Overwrite wish with L wish."""
    for i in range(size - 1, -1, -1):
        total = 0.0
        for k in range(i + 1):
            total += factor[i, k] * wish[k]
        wish[i] = total


@unit(types.int64, MACHINE, *(types.int64,) * 4, types.boolean, types.boolean)
def solve(machine: Machine, subproblem: int, size: int, equalities: int, rows: int, newton: bool, linear: bool) -> int:
    """Solve the program at hand; `linear` says that it counts as a linear solve and not as a solver's.

    On entry `wish` and `bounds` are in units of √M v; they are scaled to order one. On return `z` and `y` are in the
    same units.
    """
    method, program, hooks = machine.method, machine.program, machine.hooks
    wish, bounds, z, y = program.wish, program.bounds, program.z, program.y
    speed = 0.0
    for k in range(size):
        speed = max(speed, abs(wish[k]))
    for row in range(rows):
        speed = max(speed, abs(bounds[row]))
    if not speed > 0.0:
        speed = 1.0
    for k in range(size):
        wish[k] /= speed
    for row in range(rows):
        bounds[row] /= speed
    code = DONE
    if not (linear or method.native[subproblem]) or not _solve_native(
        machine, subproblem, size, equalities, rows, newton, linear
    ):
        asked = subproblem + NEWTON if newton else subproblem
        code = DONE if call(hooks.solve, asked, size, equalities, rows) == 0 else RAISED
    for k in range(size):
        z[k] *= speed
    for row in range(rows):
        y[row] *= speed
    return code


@kernel
def export(program: Program, equalities: int, rows: int, size: int, dense: np.ndarray, kept: np.ndarray) -> int:
    """Write the rows to `dense`, without equality rows that depend on those before them; return how many are left.

    `kept` gets the numbers of the rows written. Dependence is judged on rows of unit length.
    """
    basis = np.zeros((min(equalities, size), size))
    count = ranked = 0
    for row in range(rows):
        target = dense[count]
        for k in range(size):
            target[k] = 0.0
        for k in range(program.start[row], program.start[row + 1]):
            target[program.column[k]] = program.value[k]
        kept[count] = row
        if row >= equalities:
            count += 1
        elif ranked < basis.shape[0] and _extends(basis, ranked, target):
            ranked += 1
            count += 1
    return ranked


@kernel
def _extends(basis: np.ndarray, ranked: int, row: np.ndarray) -> bool:
    """Make the row the next of an orthonormal basis, unless it lies in the span of the first `ranked`."""
    size = row.size
    candidate = basis[ranked]
    for k in range(size):
        candidate[k] = row[k]
    for _ in range(2):  # the second pass removes the rounding error of the first
        for other in range(ranked):
            share = 0.0
            for k in range(size):
                share += basis[other, k] * candidate[k]
            for k in range(size):
                candidate[k] -= share * basis[other, k]
    square = 0.0
    for k in range(size):
        square += candidate[k] * candidate[k]
    length = math.sqrt(square)
    if not length > _DEPENDENT:
        return False
    for k in range(size):
        candidate[k] /= length
    return True
