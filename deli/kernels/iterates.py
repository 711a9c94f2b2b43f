"""Residuals of the iterates of a position update in the nonlinear system, and the best iterate so far."""

import math

from deli.kernels.codes import DONE
from deli.kernels.compiled import kernel
from deli.kernels.forces import hessian
from deli.kernels.machine import Machine
from deli.kernels.work import Islands, Work

_ROUNDING = 8 * 2.0**-52


@kernel
def judge(machine: Machine, group: int, rows: int, equalities: int) -> tuple[float, float, float, float]:
    """Return the scaled residuals of (7.3, 7.4, 7.8) at x, and the residual that an interior-point solver can reach.

    Impulses are compared in the metric of the masses. The last residual has products λg in place of min(λ, g).
    """
    system, work, islands, program = machine.system, machine.work, machine.islands, machine.program
    dimension, root = system.dimension, system.root
    wish = program.wish  # scratch: the impulse that no constraint and no force explains
    impulse, local = 0.0, 0
    for k in range(islands.body_start[group], islands.body_start[group + 1]):
        for axis in range(dimension):
            dof = islands.bodies[k] * dimension + axis
            carried = root[dof] * work.velocity[dof]
            given, force = work.momentum[dof] / root[dof], work.force[dof] / root[dof]
            impulse = max(impulse, abs(carried), abs(given), abs(force))
            wish[local] = carried - given - force
            local += 1
    if not impulse > 0.0:
        impulse = 1.0
    primal = complementarity = product = negative = 0.0
    for k in range(rows):
        for entry in range(program.start[k], program.start[k + 1]):
            wish[program.column[entry]] -= program.value[entry] * program.y[k]
        if k < equalities:
            row = islands.held[islands.held_start[group] + k]
            primal = max(primal, abs(work.mismatch[row]) / system.bilateral_scale[row])
        else:
            row = islands.rows[islands.row_start[group] + k - equalities]
            pressed, gap = program.y[k] / impulse, work.gaps_moved[row] / system.gap_scale[row]
            work.pressed[row], work.scaled[row] = pressed, gap
            primal = max(primal, -gap)
            complementarity = max(complementarity, abs(min(pressed, gap)))
            product = max(product, abs(pressed * gap))
            negative = max(negative, -pressed)
    dual = 0.0
    for k in range(local):
        dual = max(dual, abs(wish[k]))
        if not math.isfinite(wish[k]):
            dual = math.nan
            break
    dual /= impulse
    return primal, dual, complementarity, max(primal, dual, product, negative)


@kernel
def keep(dimension: int, group: int, store: bool, work: Work, islands: Islands) -> None:
    """Store the best iterate of one island, or restore it."""
    for k in range(islands.body_start[group], islands.body_start[group + 1]):
        for axis in range(dimension):
            dof = islands.bodies[k] * dimension + axis
            if store:
                work.best[dof], work.best_force[dof] = work.velocity[dof], work.force[dof]
            else:
                work.velocity[dof], work.force[dof] = work.best[dof], work.best_force[dof]
    for k in range(islands.row_start[group], islands.row_start[group + 1]):
        row = islands.rows[k]
        if store:
            work.best_pressed[row], work.best_scaled[row] = work.pressed[row], work.scaled[row]
        else:
            work.pressed[row], work.scaled[row] = work.best_pressed[row], work.best_scaled[row]


@kernel
def floor(machine: Machine, group: int, newton: bool) -> tuple[int, float]:
    """Return a code and the residuals that rounding of x alone causes, far from the origin or with a stiff force."""
    system, method, work, islands, mail = machine.system, machine.method, machine.work, machine.islands, machine.mail
    h, dimension, root = work.span[0], system.dimension, system.root
    reach = impulse = 0.0
    for k in range(islands.body_start[group], islands.body_start[group + 1]):
        for axis in range(dimension):
            dof = islands.bodies[k] * dimension + axis
            reach = max(reach, abs(work.q[dof] + h * work.best[dof]))
            impulse = max(impulse, abs(work.momentum[dof]) / root[dof], abs(work.best_force[dof]) / root[dof])
    floor = reach / system.length
    if newton:
        for k in range(work.q.size):
            work.stress[k] = work.q[k] + (0.5 if method.middle != 0.0 else 1.0) * h * work.best[k]
        code = hessian(machine, work.stress)
        if code != DONE:
            return code, math.nan
        for i in range(work.q.size):
            total = 0.0
            for j in range(work.q.size):
                total += abs(mail.hessian[i, j]) * abs(work.q[j] + h * work.best[j])
            stiffness = h * h * method.stiffness * total / root[i]
            floor = max(floor, stiffness / (h * (impulse if impulse > 0.0 else 1.0)))
    return DONE, _ROUNDING * floor
