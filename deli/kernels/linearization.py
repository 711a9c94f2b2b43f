"""Position updates about an iterate: the force at x, and the rows with their values and right-hand sides."""

import numpy as np

from deli.kernels.codes import AFFINE, BILATERAL, BILATERAL_GRADIENTS, DONE, MOVING, UNILATERAL, UNILATERAL_GRADIENTS
from deli.kernels.compiled import kernel
from deli.kernels.contacts import copy
from deli.kernels.forces import ask, gradient
from deli.kernels.machine import Machine
from deli.kernels.rows import normal, value
from deli.kernels.solve import along, gather_rows


@kernel
def first_force(machine: Machine, q: np.ndarray, x: np.ndarray, out: np.ndarray) -> int:
    """Write the force of the position update: that at the midpoint for (8.2), that at q for (8.3)."""
    method, work = machine.method, machine.work
    at, weight = q, method.start
    if method.middle != 0.0:
        at, weight = work.stress, method.middle
        for k in range(q.size):
            at[k] = 0.5 * (q[k] + x[k])
    elif method.end != 0.0:
        at, weight = x, method.end
    code = gradient(machine, at, out)
    h = work.span[0]
    for k in range(q.size):
        out[k] *= -h * weight
    if method.end != 0.0 and method.start != 0.0:
        for k in range(q.size):
            out[k] -= h * method.start * work.here[k]
    return code


@kernel
def reached(machine: Machine, dof: int) -> float:
    """Return one component of x."""
    system, method, work = machine.system, machine.method, machine.work
    velocity = work.velocity[dof]
    if method.share != 1.0:
        velocity = method.share * velocity + (1.0 - method.share) * work.p[dof] * system.inverse[dof]
    return work.q[dof] + work.span[0] * velocity


@kernel
def evaluate(machine: Machine, group: int, whole: bool) -> int:
    """Write the force if it depends on x, and g_𝕊 above its level and f of one island; gather moving rows anew."""
    system, method, work, islands, mail = (
        machine.system,
        machine.method,
        machine.work,
        machine.islands,
        machine.mail,
    )
    if whole and not system.constant:
        code = first_force(machine, work.q, work.moved, work.force)
        if code != DONE:
            return code
    if method.rows == AFFINE:
        return DONE
    spot, moving = work.moved, method.rows == MOVING
    if method.place != 1.0:
        spot = work.spot
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(system.dimension):
                dof = islands.bodies[k] * system.dimension + axis
                spot[dof] = work.q[dof] + method.place * (work.moved[dof] - work.q[dof])
    begin, end = islands.row_start[group], islands.row_start[group + 1]
    if begin < end and system.other_unilateral:
        code = ask(machine, UNILATERAL, spot)
        if code == DONE and moving:
            code = ask(machine, UNILATERAL_GRADIENTS, spot)
            copy(mail.unilateral_gradients, work.gradients)
        if code != DONE:
            return code
    for k in range(begin, end):
        row = islands.rows[k]
        work.gaps_moved[row] = value(system.unilateral, row, spot, mail.unilateral) - work.level[row]
        if moving:
            normal(system.unilateral, row, spot, work.normals)
    begin, end = islands.held_start[group], islands.held_start[group + 1]
    if begin < end and system.other_bilateral:
        code = ask(machine, BILATERAL, spot)
        if code == DONE and moving:
            code = ask(machine, BILATERAL_GRADIENTS, spot)
            copy(mail.bilateral_gradients, work.held_gradients)
        if code != DONE:
            return code
    for k in range(begin, end):
        row = islands.held[k]
        work.mismatch[row] = value(system.bilateral, row, spot, mail.bilateral)
        if moving:
            normal(system.bilateral, row, spot, work.held_normals)
    if moving:
        gather_rows(machine, group)
    return DONE


@kernel
def evaluate_affine(machine: Machine, group: int, equalities: int, rows: int) -> None:
    """Write the values at z of affine rows."""
    work, islands, program = machine.work, machine.islands, machine.program
    h = work.span[0]
    for k in range(rows):
        change = h * program.lengths[k] * along(program, k, program.z)
        if k < equalities:
            row = islands.held[islands.held_start[group] + k]
            work.mismatch[row] = work.held_base[row] + change
        else:
            row = islands.rows[islands.row_start[group] + k - equalities]
            work.gaps_moved[row] = work.base[row] + change


@kernel
def bounds(machine: Machine, group: int, equalities: int, rows: int) -> None:
    """Write the right-hand sides of the linearization about the iterate, whose √M u is in z."""
    method, work, islands, program = machine.method, machine.work, machine.islands, machine.program
    h = work.span[0]
    for k in range(rows):
        if k < equalities:
            row = islands.held[islands.held_start[group] + k]
            gap = work.held_base[row] if method.rows == AFFINE else work.mismatch[row]
        else:
            row = islands.rows[islands.row_start[group] + k - equalities]
            gap = work.base[row] if method.rows == AFFINE else work.gaps_moved[row]
        program.bounds[k] = -gap / (h * method.place * program.lengths[k])
        if method.rows != AFFINE:
            program.bounds[k] += along(program, k, program.z)
