"""Position update with complementarity (7.3, 7.4, 7.8), island by island, as a sequence of metric projections."""

import math

from numba import types

from deli.kernels.codes import AFFINE, DONE, MOVING, POSITION, SOFTEN, UNCONVERGED
from deli.kernels.compiled import kernel, unit
from deli.kernels.dense import backward, factorize, forward
from deli.kernels.forces import ask, hessian
from deli.kernels.islands import connect
from deli.kernels.iterates import floor, judge, keep
from deli.kernels.linearization import bounds, evaluate, evaluate_affine, first_force, reached
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.solve import gather_rows, solve
from deli.kernels.tally import measure, skip

_TARGET = 1e-14  # scaled residual at which the iteration is done
_ACCEPTED = 1e-10  # scaled residual accepted of an iteration that has reached its floor
_SLACK = 10.0  # what is accepted instead of an unpolished solver, in its tolerances
_ITERATIONS = 200
_PROGRESS = 0.9  # factor by which a residual has to fall to count as progress
_PATIENCE = 3  # iterations without progress after which the floor is reached


@kernel
def _metric(machine: Machine) -> int:
    """Write Newton's metric A = M + K and ŵ = p + φ + K u, over √M, with K = (h²/4)V″ for (8.2); z holds √M u.

    If A is not positive definite, the hessian's most negative eigenvalues are raised in both, which does not change
    the fixed point.
    """
    system, method, work, program, mail = machine.system, machine.method, machine.work, machine.program, machine.mail
    size, root = system.mass.size, system.root
    stiffness = work.span[0] * work.span[0] * method.stiffness
    for k in range(size):
        work.stress[k] = 0.5 * (work.q[k] + work.moved[k]) if method.middle != 0.0 else work.moved[k]
    code = hessian(machine, work.stress)
    if code != DONE:
        return code
    for attempt in range(2):
        for i in range(size):
            for j in range(size):
                entry = mail.hessian[i, j]
                if attempt == 0:
                    entry *= stiffness / (root[i] * root[j])
                    mail.hessian[i, j] = entry
                program.metric[i, j] = entry + 1.0 if i == j else entry
        if factorize(program.metric, size, program.factor):
            break
        code = ask(machine, SOFTEN, work.stress)
        if code != DONE:
            return code
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += mail.hessian[i, j] * program.z[j]
        program.wish[i] += total
    return DONE


@unit(types.int64, MACHINE, types.int64, types.boolean, types.boolean)
def _iterate(machine: Machine, group: int, whole: bool, free: bool) -> int:
    """Iterate the linearizations of one island until the nonlinear system holds; keep the best iterate."""
    system, method, work, islands, program, tally = (
        machine.system,
        machine.method,
        machine.work,
        machine.islands,
        machine.program,
        machine.tally,
    )
    dimension, root = system.dimension, system.root
    row_begin, row_end = islands.row_start[group], islands.row_start[group + 1]
    held_begin, held_end = islands.held_start[group], islands.held_start[group + 1]
    body_begin, body_end = islands.body_start[group], islands.body_start[group + 1]
    equalities, rows = held_end - held_begin, held_end - held_begin + row_end - row_begin
    size = (body_end - body_begin) * dimension
    linear = free or (method.skip and row_end == row_begin)
    exact = linear or method.exact[POSITION]
    accepted = _ACCEPTED if exact else max(_ACCEPTED, _SLACK * method.tolerance[POSITION])
    newton = system.newton and whole
    if rows and method.rows != MOVING:
        gather_rows(machine, group)
    code = evaluate(machine, group, whole)
    if code != DONE:
        return code
    least, stalled = math.inf, 0
    primal = dual = complementarity = math.nan
    for _ in range(_ITERATIONS):
        local = 0
        for k in range(body_begin, body_end):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                program.z[local] = root[dof] * work.velocity[dof]
                program.wish[local] = (work.momentum[dof] + work.force[dof]) / root[dof]
                local += 1
        if newton:
            code = _metric(machine)
            if code != DONE:
                return code
        bounds(machine, group, equalities, rows)
        if linear and rows == 0:
            for k in range(size):
                program.z[k] = program.wish[k]
            if newton:
                forward(program.factor, size, program.z)
                backward(program.factor, size, program.z)
        else:
            code = solve(machine, POSITION, size, equalities, rows, newton, linear)
            if code != DONE:
                return code
        local = 0
        for k in range(body_begin, body_end):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                work.velocity[dof] = program.z[local] / root[dof]
                work.moved[dof] = reached(machine, dof)
                local += 1
        if method.rows == AFFINE:
            evaluate_affine(machine, group, equalities, rows)
        code = evaluate(machine, group, whole)
        if code != DONE:
            return code
        first, second, third, certified = judge(machine, group, rows, equalities)
        worst = max(first, second, third) if exact else certified
        stalled = 0 if worst < _PROGRESS * least else stalled + 1
        if worst < least or math.isinf(least):
            least, primal, dual, complementarity = worst, first, second, third
            keep(dimension, group, True, work, islands)
        if least <= _TARGET or (stalled >= _PATIENCE and least <= accepted) or not math.isfinite(worst):
            break
    if not least <= accepted:
        code, lowest = floor(machine, group, newton)
        if code != DONE:
            return code
        if not least <= lowest:
            work.report[0], work.report[1] = row_end - row_begin, equalities
            work.report[2], work.report[3], work.report[4] = primal, dual, complementarity
            work.report[5] = accepted
            return UNCONVERGED
    keep(dimension, group, False, work, islands)
    for k in range(body_begin, body_end):
        for axis in range(dimension):
            dof = islands.bodies[k] * dimension + axis
            work.moved[dof] = reached(machine, dof)
    if not free:
        measure(tally, POSITION, primal, dual, complementarity)
    return DONE


@unit(types.int64, MACHINE)
def predict(machine: Machine) -> int:
    """Write the unconstrained step (8.1) to ``work.velocity``, ``work.moved`` and ``work.force``."""
    system, work, islands = machine.system, machine.work, machine.islands
    h = work.span[0]
    for k in range(work.q.size):
        work.velocity[k] = work.p[k] * system.inverse[k]
        work.moved[k] = work.q[k] + h * work.velocity[k]
    if system.constant:
        code = first_force(machine, work.q, work.moved, work.force)
        for k in range(work.q.size):
            work.velocity[k] = (work.p[k] + work.force[k]) * system.inverse[k]
            work.moved[k] = reached(machine, k)
        return code
    for k in range(work.q.size):
        work.momentum[k] = work.p[k]
    islands.row_start[1] = islands.held_start[1] = 0
    islands.body_start[1] = system.component.size
    for body in range(system.component.size):
        islands.bodies[body] = body
    return _iterate(machine, 0, True, True)


@unit(types.int64, MACHINE, types.int64)
def update(machine: Machine, count: int) -> int:
    """Move from ``work.q`` with ``work.momentum`` and the first `count` rows of ``work.pressing``.

    On entry ``work.velocity`` is the start of the iteration, and ``work.force`` the force unless it depends on x. On
    return ``work.velocity``, ``work.moved`` and ``work.force`` are those of the update, and ``work.pressed`` and
    ``work.scaled`` hold λ_i|∇g_i| and g_i(x), scaled, by number of the unilateral row.
    """
    system, method, work, tally = machine.system, machine.method, machine.work, machine.tally
    whole = system.coupled or not method.skip
    before = tally.counts[0, POSITION]
    if not whole:
        for k in range(work.q.size):
            work.velocity[k] = (work.momentum[k] + work.force[k]) * system.inverse[k]
            work.moved[k] = reached(machine, k)
    groups = connect(machine, count, True, whole)
    for group in range(groups):
        code = _iterate(machine, group, whole, False)
        if code != DONE:
            return code
    if tally.counts[0, POSITION] == before:
        skip(tally, POSITION)
    return DONE
