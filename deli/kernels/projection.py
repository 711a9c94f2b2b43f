"""Momentum update (7.5, 7.6, 7.9): momentum returns to the cotangent space of the constraints that stay active."""

from numba import types

from deli.kernels.codes import AFFINE, BILATERAL_GRADIENTS, DONE, PROJECTION, UNILATERAL_GRADIENTS
from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import copy
from deli.kernels.forces import ask, gradient
from deli.kernels.islands import connect
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.rows import normal
from deli.kernels.solve import append, solve
from deli.kernels.tally import skip


@unit(types.int64, MACHINE, types.int64, types.boolean)
def tangent(machine: Machine, count: int, there: bool) -> int:
    """Project ``work.carried`` off the first `count` rows of ``work.pressing`` and bilateral rows.

    Gradients are those at x if `there`, those at q otherwise.
    """
    system, method, work, islands, program, tally = (
        machine.system,
        machine.method,
        machine.work,
        machine.islands,
        machine.program,
        machine.tally,
    )
    dimension, root = system.dimension, system.root
    before = tally.counts[0, PROJECTION]
    normals, gradients = work.normals, work.gradients
    held_normals, held_gradients = work.held_normals, work.held_gradients
    if there:
        normals, gradients = work.normals_moved, work.gradients_moved
        held_normals, held_gradients = work.held_normals_moved, work.held_gradients_moved
    groups = connect(machine, count, True, system.coupled or not method.skip)
    for group in range(groups):
        rows = local = 0
        program.start[0] = 0
        for k in range(islands.row_start[group], islands.row_start[group + 1]):
            append(
                program, rows, system.unilateral, islands.rows[k], normals, gradients, islands.place, root,
            )  # fmt: skip
            rows += 1
        for k in range(islands.held_start[group], islands.held_start[group + 1]):
            append(
                program, rows, system.bilateral, islands.held[k], held_normals, held_gradients, islands.place, root,
            )  # fmt: skip
            rows += 1
        if method.skip and rows == 0:
            continue
        for k in range(rows):
            program.bounds[k] = 0.0
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                program.wish[local] = work.carried[dof] / root[dof]
                local += 1
        code = solve(machine, PROJECTION, local, rows, rows, False, method.skip)
        if code != DONE:
            return code
        local = 0
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                work.carried[dof] = program.z[local] * root[dof]
                local += 1
    if tally.counts[0, PROJECTION] == before:
        skip(tally, PROJECTION)
    return DONE


@kernel
def presses(machine: Machine, row: int) -> bool:
    """Return whether a row of the position update is still active at x."""
    work = machine.work
    opened = work.pressed[row] < work.scaled[row]
    return not opened and abs(work.scaled[row]) <= machine.method.contact_tolerance


@kernel
def list_smooth(machine: Machine, smooth: int) -> int:
    """Put the rows of 𝕊 that are still active at x to the front of ``work.pressing``; return their number."""
    work, count = machine.work, 0
    for k in range(smooth):
        if presses(machine, work.smooth[k]):
            work.pressing[count] = work.smooth[k]
            count += 1
    return count


@kernel
def carry(machine: Machine, smooth: int) -> int:
    """Write the momentum at x: D₂L_d(q, x), projected onto the tangent space of the constraints that stay active."""
    system, method, work, mail, tally = machine.system, machine.method, machine.work, machine.mail, machine.tally
    dof, moved, held = system.mass.size, work.moved, system.bilateral.kind.size
    force, there = work.force, moved
    if method.rows == AFFINE:
        there = work.predicted
    if not method.implicit:
        code = gradient(machine, moved, work.stress)
        if code != DONE:
            return code
        h = work.span[0]
        for k in range(dof):
            work.stress[k] *= -0.5 * h
        force = work.stress
    for k in range(dof):
        work.carried[k] = system.mass[k] * work.velocity[k] + force[k]
    count = list_smooth(machine, smooth)
    for k in range(count):
        normal(system.unilateral, work.pressing[k], there, work.normals_moved)
    if count and system.other_unilateral:
        code = ask(machine, UNILATERAL_GRADIENTS, there)
        if code != DONE:
            return code
        copy(mail.unilateral_gradients, work.gradients_moved)
    if held:
        if system.other_bilateral:
            code = ask(machine, BILATERAL_GRADIENTS, there)
            if code != DONE:
                return code
            copy(mail.bilateral_gradients, work.held_gradients_moved)
        for row in range(held):
            normal(system.bilateral, row, there, work.held_normals_moved)
    if method.skip and count == 0 and held == 0:
        skip(tally, PROJECTION)
        return DONE
    return tangent(machine, count, True)
