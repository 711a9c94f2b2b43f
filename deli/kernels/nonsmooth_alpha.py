"""One step of the nonsmooth generalized-alpha method (Brüls, Acary and Cardona 2014)."""

from numba import types

from deli.kernels.codes import DONE, PROJECTION
from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import begin, begin_anew, end, find_gaps, gradients_here, strayed
from deli.kernels.direct import move
from deli.kernels.forces import gradient
from deli.kernels.islands import connect
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.position import predict
from deli.kernels.rows import normal, rate
from deli.kernels.solve import gather_rows, solve
from deli.kernels.tally import skip

_POSITION, _VELOCITY, _AUXILIARY = 0, 1, 2  # rows of the recurrence
_NEW = 2  # its column of ã⁺


@kernel
def _predict(machine: Machine) -> int:
    """Write the position x̃ of the smooth motion: an unconstrained step, with a and ã added to the momentum."""
    system, method, work = machine.system, machine.method, machine.work
    h, weights = work.span[0], method.recurrence
    for k in range(work.q.size):
        remembered = weights[_POSITION, 0] * work.memory[0, k] + weights[_POSITION, 1] * work.memory[1, k]
        work.start_momentum[k] = work.p[k]
        work.p[k] += h * system.mass[k] * remembered
    code = predict(machine)
    for k in range(work.q.size):
        work.momentum[k] = work.p[k]
        work.p[k] = work.start_momentum[k]
    return code


@kernel
def _closed(machine: Machine, count: int) -> int:
    """Put contacts closed at x into ``work.pressing``, which held `count` rows of the update; return their number."""
    system, method, work = machine.system, machine.method, machine.work
    closed = 0
    for row in range(system.unilateral.kind.size):
        pressed = count > 0 and work.resting[row] and work.scaled[row] < work.pressed[row]
        if pressed or work.gaps_moved[row] <= method.contact_tolerance * system.gap_scale[row]:
            work.pressing[closed] = row
            closed += 1
    return closed


@kernel
def _turn_to_x(machine: Machine, closed: int) -> int:
    """Write the normal velocities at q of closed contacts to ``work.approach``, then the gradients of all rows at x."""
    system, work = machine.system, machine.work
    table = system.unilateral
    if closed:
        code = gradients_here(machine, 0, work.q)
        if code != DONE:
            return code
    for k in range(closed):
        row = work.pressing[k]
        normal(table, row, work.q, work.normals)
        work.approach[row] = rate(table, row, work.normals, work.gradients, work.p, system.inverse)
        normal(table, row, work.moved, work.normals)
    held = system.bilateral.kind.size
    return gradients_here(machine, held, work.moved) if closed or held else DONE


@kernel
def _project(machine: Machine, count: int) -> int:
    """Project ``work.carried`` onto Fᵀv = 0 and Gᵀv ≥ −e Gᵀv(q) for the first `count` of ``work.pressing``."""
    system, method, work, islands, program = (
        machine.system,
        machine.method,
        machine.work,
        machine.islands,
        machine.program,
    )
    dimension, root = system.dimension, system.root
    groups = connect(machine, count, True, system.coupled or not method.skip)
    for group in range(groups):
        equalities, rows = gather_rows(machine, group)
        for k in range(rows):
            program.bounds[k] = 0.0
        for k in range(equalities, rows):
            row = islands.rows[islands.row_start[group] + k - equalities]
            program.bounds[k] = -method.restitution * work.approach[row] / program.lengths[k]
        size = 0
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                program.wish[size] = work.carried[dof] / root[dof]
                size += 1
        code = solve(machine, PROJECTION, size, equalities, rows, False, method.skip and rows == equalities)
        if code != DONE:
            return code
        size = 0
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                work.carried[dof] = program.z[size] * root[dof]
                size += 1
    return DONE


@kernel
def _carry(machine: Machine, closed: int) -> int:
    """Write the momentum at x, and the memory of the smooth motion for the next step, a⁺ and ã⁺."""
    system, method, work, tally = machine.system, machine.method, machine.work, machine.tally
    h, weights, memory, remembered = work.span[0], method.recurrence, work.memory, work.remembered
    held = system.bilateral.kind.size
    before = tally.counts[0, PROJECTION]
    code = gradient(machine, work.moved, work.stress)
    if code != DONE:
        return code
    for k in range(work.q.size):
        remembered[1, k] = -work.stress[k] * system.inverse[k]
        change = weights[_VELOCITY, 0] * memory[0, k] + weights[_VELOCITY, 1] * memory[1, k]
        change += weights[_VELOCITY, _NEW] * remembered[1, k]
        work.carried[k] = work.start[k] = work.p[k] + h * system.mass[k] * change
    if held:
        code = _project(machine, 0)
        if code != DONE:
            return code
        for k in range(work.q.size):
            jump = (work.carried[k] - work.start[k]) * system.inverse[k]
            remembered[1, k] += jump / (h * weights[_VELOCITY, _NEW])
    for k in range(work.q.size):
        remembered[0, k] = weights[_AUXILIARY, 0] * memory[0, k] + weights[_AUXILIARY, 1] * memory[1, k]
        remembered[0, k] += weights[_AUXILIARY, _NEW] * remembered[1, k]
    if closed or not (held or method.skip):
        code = _project(machine, closed)
        if code != DONE:
            return code
    if tally.counts[0, PROJECTION] == before:
        skip(tally, PROJECTION)
    return DONE


@unit(types.int64, MACHINE, *(types.int64,) * 3)
def advance_and_jump(machine: Machine, known: int, _one: int, _two: int) -> int:
    """Write the state one step after (``work.q``, ``work.p``, ``work.memory``), as `deli.kernels.step.step` does.

    The memory for the step after it goes to ``work.remembered``.
    """
    work = machine.work
    code = begin(machine, known)
    if code == DONE:
        code = _predict(machine)
    if code != DONE:
        return code
    if strayed(machine, work.moved):
        return begin_anew(machine)
    code, count = move(machine)
    if code != DONE:
        return code
    if strayed(machine, work.moved):
        return begin_anew(machine)
    code = find_gaps(machine, work.moved, work.gaps_moved)
    if code != DONE:
        return code
    closed = _closed(machine, count)
    code = _turn_to_x(machine, closed)
    if code == DONE:
        code = _carry(machine, closed)
    if code != DONE:
        return code
    return end(machine, closed)
