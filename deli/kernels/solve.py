"""Assembly and solution of the metric projection of one island, natively or by the solver of `Hooks.solve`."""

import math

import numpy as np
from numba import types

from deli.kernels.codes import ANSWERED, DONE, RAISED
from deli.kernels.compiled import call, kernel, seconds, unit
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.native import LARGEST, project_program
from deli.kernels.program import EXPORT, PROGRAM, Export, Program
from deli.kernels.tally import SOLVED, measure, note
from deli.mechanics.tables import OTHER, Rows

_SATISFIED = 1e-15  # scaled velocity along an equality row that is rounding already
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
    """Append a row of unit length as number `count`; `place` maps bodies to their numbers in the island."""
    at = program.start[count]
    begin = at
    program.factored[0] = 0
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
def gather_rows(machine: Machine, group: int) -> tuple[int, int]:
    """Write the rows of one island at q, bilateral rows first; return the number of bilateral rows and of all rows."""
    system, work, islands, program = machine.system, machine.work, machine.islands, machine.program
    count = 0
    program.start[0] = 0
    for k in range(islands.held_start[group], islands.held_start[group + 1]):
        append(
            program, count, system.bilateral, islands.held[k], work.held_normals, work.held_gradients,
            islands.place, system.root,
        )  # fmt: skip
        count += 1
    equalities = count
    for k in range(islands.row_start[group], islands.row_start[group + 1]):
        append(
            program, count, system.unilateral, islands.rows[k], work.normals, work.gradients,
            islands.place, system.root,
        )  # fmt: skip
        count += 1
    return equalities, count


@kernel
def along(program: Program, row: int, z: np.ndarray) -> float:
    """Return R z of one row."""
    total = 0.0
    for k in range(program.start[row], program.start[row + 1]):
        total += program.value[k] * z[program.column[k]]
    return total


@kernel
def _solve_native(
    machine: Machine, subproblem: int, size: int, equalities: int, rows: int, newton: bool, linear: bool
) -> bool:
    """Solve the program at hand by compiled code; return whether the answer is good."""
    method, program, hooks, tally = machine.method, machine.program, machine.hooks, machine.tally
    wish, z, y = program.wish, program.z, program.y
    if not newton and equalities == rows and _satisfied(program, rows):
        for k in range(size):
            z[k] = wish[k]
        for row in range(rows):
            y[row] = 0.0
        return True
    if not newton and rows > LARGEST and _pressing(program, equalities, rows) > LARGEST:
        return False
    tolerance = method.tolerance[subproblem]
    if linear:
        return project_program(program, size, equalities, rows, tolerance, newton, True) == 1
    began = seconds(hooks.clock, machine.work.ticks)
    good = project_program(program, size, equalities, rows, tolerance, newton, False) == 1
    solved = seconds(hooks.clock, machine.work.ticks)
    if good:
        tally.counts[0, subproblem] += 1
        tally.contacts[2] += 1
        tally.counts[2, subproblem] += int(program.report[0])
        tally.counts[3, subproblem] += rows
        tally.counts[5, subproblem] += 1
        tally.counts[6, subproblem] += 1
        tally.times[0, subproblem] += solved - began
        tally.times[1, subproblem] += seconds(hooks.clock, machine.work.ticks) - solved
        note(tally, subproblem, SOLVED)
        if subproblem != 1:
            measure(tally, subproblem, program.report[1], program.report[2], program.report[3])
    return good


@kernel
def _pressing(program: Program, equalities: int, rows: int) -> int:
    """Return the number of rows that the unconstrained point violates, an estimate of the size of the active set."""
    count = equalities
    for row in range(equalities, rows):
        if along(program, row, program.wish) < program.bounds[row]:
            count += 1
    return count


@kernel
def _satisfied(program: Program, rows: int) -> bool:
    for row in range(rows):  # noqa: SIM110, a generator is not compiled
        if not abs(along(program, row, program.wish) - program.bounds[row]) <= _SATISFIED:
            return False
    return True


@unit(types.int64, MACHINE, *(types.int64,) * 4, types.boolean, types.boolean)
def solve(machine: Machine, subproblem: int, size: int, equalities: int, rows: int, newton: bool, linear: bool) -> int:
    """Solve the program at hand; `linear` says that it counts as a linear solve, and not as a solve of a solver.

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
    asked = subproblem + NEWTON if newton else subproblem
    watched = hooks.posed != 0 and not linear
    if watched and call(hooks.posed, asked, size, equalities, rows) != ANSWERED:
        return RAISED
    code = DONE
    if not (linear or method.native[subproblem]) or not _solve_native(
        machine, subproblem, size, equalities, rows, newton, linear
    ):
        code = DONE if call(hooks.solve, asked, size, equalities, rows) == ANSWERED else RAISED
    if watched and call(hooks.solved, code, size, equalities, rows) != ANSWERED:
        return RAISED
    for k in range(size):
        z[k] *= speed
    for row in range(rows):
        y[row] *= speed
    return code


@kernel
def _extends(basis: np.ndarray, ranked: int, row: np.ndarray) -> bool:
    """Make the row the next of an orthonormal basis; return False if it lies in the span of the first `ranked` rows."""
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


@unit(types.int64, PROGRAM, EXPORT, types.int64, types.int64, types.int64)
def export(program: Program, out: Export, equalities: int, rows: int, size: int) -> int:
    """Write the rows to `out`, without equality rows that depend on earlier ones; return how many equality rows remain.

    Dependence is judged on rows of unit length.
    """
    dense, kept = out.dense, out.kept
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
