"""One reflection off chosen contacts: the impulse that conserves the Hamiltonian, or the numerical one."""

import math

import numpy as np
from numba import types

from deli.kernels.codes import DONE, INDEFINITE, REFLECTION
from deli.kernels.compiled import kernel, unit
from deli.kernels.dense import backward, factorize, forward
from deli.kernels.forces import hessian
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.rows import push, rate, weight
from deli.kernels.solve import append, gather_rows, solve


@kernel
def turn_back(machine: Machine, group: int, share: float) -> int:
    """Add `share` of the impulse that conserves the Hamiltonian to the momentum of one island."""
    system, method, work, islands, program = (
        machine.system,
        machine.method,
        machine.work,
        machine.islands,
        machine.program,
    )
    momentum, table, held = work.momentum, system.unilateral, system.bilateral
    begin, end = islands.row_start[group], islands.row_start[group + 1]
    held_begin, held_end = islands.held_start[group], islands.held_start[group + 1]
    if method.skip and end - begin == 1 and held_begin == held_end:
        row = islands.rows[begin]
        speed = rate(table, row, work.normals, work.gradients, momentum, system.inverse)
        inertia = weight(table, row, work.normals, work.gradients, system.inverse)
        push(table, row, work.normals, work.gradients, share * (-2.0 * speed / inertia), momentum)
        return DONE
    equalities, rows = gather_rows(machine, group)
    dimension, size = system.dimension, 0
    for k in range(islands.body_start[group], islands.body_start[group + 1]):
        for axis in range(dimension):
            dof = islands.bodies[k] * dimension + axis
            program.wish[size] = 2.0 * momentum[dof] / system.root[dof]
            size += 1
    for k in range(rows):
        program.bounds[k] = 0.0
    linear = method.skip and end - begin == 1
    code = solve(machine, REFLECTION, size, equalities, rows, False, linear)
    for k in range(rows):
        impulse = share * program.y[k] / program.lengths[k]
        if k < equalities:
            row = islands.held[held_begin + k]
            push(held, row, work.held_normals, work.held_gradients, impulse, momentum)
        else:
            row = islands.rows[begin + k - equalities]
            push(table, row, work.normals, work.gradients, impulse, momentum)
    return code


@kernel
def _tangent(machine: Machine, normals: np.ndarray) -> int:
    """Write the gradients over √M, projected onto the bilateral tangent space (7.7), one a row of `normals`."""
    system, work, islands, program = machine.system, machine.work, machine.islands, machine.program
    dof, root = system.mass.size, system.root
    taken, held = normals.shape[0], islands.held_start[1]
    for k in range(taken):
        for i in range(dof):
            normals[k, i] = 0.0
        push(system.unilateral, islands.rows[k], work.normals, work.gradients, 1.0, normals[k])
        for i in range(dof):
            normals[k, i] /= root[i]
    if held == 0:
        return DONE
    program.start[0] = 0
    for k in range(held):
        append(
            program, k, system.bilateral, islands.held[k], work.held_normals, work.held_gradients,
            islands.place, root,
        )  # fmt: skip
    for k in range(taken):
        for i in range(dof):
            program.wish[i] = normals[k, i]
        for row in range(held):
            program.bounds[row] = 0.0
        code = solve(machine, REFLECTION, dof, held, held, False, True)
        if code != DONE:
            return code
        for i in range(dof):
            normals[k, i] = program.z[i]
    return DONE


@kernel
def _numerical_impulse(
    machine: Machine, taken: int, normals: np.ndarray, root: np.ndarray, momentum: np.ndarray, impulse: np.ndarray
) -> int:
    """Solve ``minimize ½|u − 2Wp|²_A subject to Ĝᵀu >= 0`` with A = W⁻¹; the impulse is Ĝλ."""
    program = machine.program
    dof = root.size
    scaled = np.empty(dof)
    for i in range(dof):
        scaled[i] = 2.0 * momentum[i] / root[i]
    program.start[0] = 0
    at = 0
    for k in range(taken):
        square = 0.0
        for i in range(dof):
            square += normals[k, i] ** 2
        length = math.sqrt(square) if square > 0.0 else 1.0
        for i in range(dof):
            program.column[at] = i
            program.value[at] = normals[k, i] / length
            at += 1
        program.start[k + 1] = at
        program.lengths[k] = length
        program.bounds[k] = 0.0
    # A = (√M W √M)⁻¹ in these coordinates, and A·(√M W √M)·2p/√M is 2p/√M itself.
    _invert(program.factor, dof, program.metric)
    for i in range(dof):
        program.wish[i] = scaled[i]
    if not factorize(program.metric, dof, program.factor):
        return INDEFINITE
    code = solve(machine, 0, dof, 0, taken, True, False)
    for k in range(taken):
        size = max(0.0, program.y[k]) / program.lengths[k]
        for i in range(dof):
            impulse[i] += size * normals[k, i] * root[i]
    return code


@kernel
def _invert(factor: np.ndarray, size: int, out: np.ndarray) -> None:
    """Write the inverse of L Lᵀ, symmetric to the bit."""
    column = np.empty(size)
    for j in range(size):
        for i in range(size):
            column[i] = 1.0 if i == j else 0.0
        forward(factor, size, column)
        backward(factor, size, column)
        for i in range(j, size):
            out[i, j] = column[i]
            out[j, i] = column[i]


@unit(types.int64, MACHINE, types.int64, types.int64, types.int64)
def turn_numerical(machine: Machine, _one: int, _two: int, _three: int) -> int:
    """Add the impulse that conserves ½pᵀWp, W = M⁻¹ + c h² M⁻¹V″M⁻¹; nearly zero if contacts graze.

    The program is posed in the metric A = W⁻¹ with gradients projected as in (7.7); with √M W √M = L Lᵀ it is
    ``minimize ½|z − 2Lᵀp/√M|²`` over the rows times L/√M.
    """
    system, method, work, islands, program, mail = (
        machine.system,
        machine.method,
        machine.work,
        machine.islands,
        machine.program,
        machine.mail,
    )
    dof, momentum, root = system.mass.size, work.momentum, system.root
    code = hessian(machine, work.q)
    if code != DONE:
        return code
    for i in range(dof):
        for j in range(dof):
            program.metric[i, j] = method.curvature * mail.hessian[i, j] / (root[i] * root[j])
        program.metric[i, i] += 1.0
    if not factorize(program.metric, dof, program.factor):
        return INDEFINITE
    # √M W √M is needed to go on; the metric of the model is its inverse.
    taken = islands.row_start[1]
    normals = np.empty((taken, dof))
    code = _tangent(machine, normals)
    if code != DONE:
        return code
    impulse = np.zeros(dof)
    if method.skip and taken == 1:
        speed = inertia = 0.0
        for i in range(dof):
            response = 0.0
            for j in range(dof):
                response += program.metric[i, j] * normals[0, j]
            speed += response * momentum[i] / root[i]
            inertia += response * normals[0, i]
        size = max(0.0, -2.0 * speed / inertia)
        for i in range(dof):
            impulse[i] = size * normals[0, i] * root[i]
    else:
        code = _numerical_impulse(machine, taken, normals, root, momentum, impulse)
        if code != DONE:
            return code
    approach, after = 0.0, 0.0
    for k in range(taken):
        row = islands.rows[k]
        size = math.sqrt(weight(system.unilateral, row, work.normals, work.gradients, system.inverse))
        size = size if size > 0.0 else 1.0
        speed = rate(system.unilateral, row, work.normals, work.gradients, momentum, system.inverse) / size
        turn = rate(system.unilateral, row, work.normals, work.gradients, impulse, system.inverse) / size
        approach = speed if k == 0 else min(approach, speed)
        after = speed + turn if k == 0 else min(after, speed + turn)
    if after >= 0.5 * approach:
        for i in range(dof):
            momentum[i] += impulse[i]
        return DONE
    # Contacts that graze approach in M⁻¹ while they recede in W, and no positive impulse conserves ½pᵀWp. Half the
    # impulse that conserves H is the smallest one that stops the approach; where nothing can rest, all of it is taken.
    return turn_back(machine, 0, 0.5 if method.order == 0 else 1.0)
