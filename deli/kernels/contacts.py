"""Contacts that touch, approach or are violated, and the range of searched neighbours."""

import math

import numpy as np

from deli.kernels.codes import BILATERAL_GRADIENTS, DONE, NOT_FINITE, REFRESH, UNILATERAL, UNILATERAL_GRADIENTS
from deli.kernels.compiled import kernel
from deli.kernels.forces import ask, gradient
from deli.kernels.machine import Machine
from deli.kernels.rows import normal, values, weight
from deli.kernels.tally import copy_tally
from deli.mechanics.tables import OTHER

VIOLATED = 1e-12  # scaled gap below which a constraint is violated by more than rounding
_ROUNDOFF = 8 * 2.0**-52  # of the momenta of all bodies, which leaks into each of them


@kernel
def find_gaps(machine: Machine, q: np.ndarray, out: np.ndarray) -> int:
    """Write the values of all unilateral rows at q."""
    system, mail = machine.system, machine.mail
    if system.other_unilateral:
        code = ask(machine, UNILATERAL, q)
        if code != DONE:
            return code
    values(system.unilateral, q, mail.unilateral, out)
    return DONE


@kernel
def approached(machine: Machine, q: np.ndarray) -> float:
    """Return the largest approach of two bodies since neighbours were searched: twice the largest displacement."""
    system = machine.system
    dimension, most = system.dimension, 0.0
    for body in range(system.component.size):
        square = 0.0
        for axis in range(dimension):
            dof = body * dimension + axis
            square += (q[dof] - system.reference[dof]) ** 2
        most = max(most, square)
    return 2.0 * math.sqrt(most)


@kernel
def strayed(machine: Machine, q: np.ndarray) -> bool:
    """Return whether a body may touch another that is not among its searched neighbours."""
    system = machine.system
    return system.reference.size > 0 and not approached(machine, q) < 0.999 * system.reach


@kernel
def begin(machine: Machine, known: int) -> int:
    """Begin a step: find g(q), unless it is known."""
    machine.work.struck[0] = 0
    if machine.system.reference.size > 0:
        copy_tally(machine.tally, machine.kept)
    if known:
        return DONE
    if strayed(machine, machine.work.q):
        return REFRESH
    return find_gaps(machine, machine.work.q, machine.work.gaps)


@kernel
def begin_anew(machine: Machine) -> int:
    """Return the code of a step that needs a new search for neighbours; its cost is not counted."""
    copy_tally(machine.kept, machine.tally)
    return REFRESH


@kernel
def end(machine: Machine, smooth: int) -> int:
    """Return the code of a step to (``work.moved``, ``work.carried``), and count its contacts if it is taken."""
    work, tally = machine.work, machine.tally
    total = 0.0
    for k in range(work.moved.size):
        total += abs(work.moved[k]) + abs(work.carried[k])
    if not math.isfinite(total):
        return NOT_FINITE
    tally.contacts[0] = smooth
    tally.contacts[1] += work.struck[0]
    return DONE


@kernel
def copy(matrix: np.ndarray, out: np.ndarray) -> None:
    """Write `matrix` to `out`."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i, j] = matrix[i, j]


@kernel
def gradients_here(machine: Machine, held: int, at: np.ndarray) -> int:
    """Prepare the gradients, at q or a similar point, of a step; rows are added to them when they are chosen."""
    system, work, mail = machine.system, machine.work, machine.mail
    if system.other_unilateral:
        code = ask(machine, UNILATERAL_GRADIENTS, at)
        if code != DONE:
            return code
        copy(mail.unilateral_gradients, work.gradients)
    if held:
        if system.other_bilateral:
            code = ask(machine, BILATERAL_GRADIENTS, at)
            if code != DONE:
                return code
            copy(mail.bilateral_gradients, work.held_gradients)
        for row in range(held):
            normal(system.bilateral, row, at, work.held_normals)
    return DONE


@kernel
def first_force_here(machine: Machine) -> int:
    """Write the force slot at (q, q), the scale of velocities that count as zero, to ``work.force``."""
    system, method, work = machine.system, machine.method, machine.work
    if not (method.implicit and system.curved):
        return DONE  # it is the prediction's
    code = gradient(machine, work.q, work.force)
    for k in range(work.q.size):
        work.force[k] *= -0.5 * work.span[0]
    return code


@kernel
def velocity_zeros(machine: Machine, momentum: np.ndarray, count: int, tolerance: float) -> None:
    """Write the normal velocities below which the first `count` chosen rows count as resting to ``work.still``.

    ``|∇g_iᵀv| ≤ τ ‖∇g_i‖ (‖p‖ + ‖impulse of the forces in one step‖)``, norms in the metric M⁻¹ over the bodies
    that the constraint touches, plus the rounding of the norms over all bodies. For rows that do not touch, τ is zero:
    they are not in 𝕊, so that nothing else stops a slow approach that ends within the step.
    """
    system, method, work = machine.system, machine.method, machine.work
    table, inverse, force, dimension = system.unilateral, system.inverse, work.force, system.dimension
    everything = push = 0.0
    for k in range(momentum.size):
        everything += momentum[k] * momentum[k] * inverse[k]
        push += force[k] * force[k] * inverse[k]
    rounding = _ROUNDOFF * (math.sqrt(everything) + math.sqrt(push))
    for k in range(count):
        row = chosen = work.chosen[k]
        here = there = 0.0
        if table.kind[row] == OTHER:
            gradient_number = table.first[row]
            for body in range(system.component.size):
                touched = False
                for axis in range(dimension):
                    touched = touched or work.gradients[gradient_number, body * dimension + axis] != 0.0
                if touched:
                    for axis in range(dimension):
                        dof = body * dimension + axis
                        here += momentum[dof] * momentum[dof] * inverse[dof]
                        there += force[dof] * force[dof] * inverse[dof]
        else:
            for end in range(2):
                body = table.first[row] if end == 0 else table.second[row]
                if body >= 0:
                    for axis in range(dimension):
                        dof = body * dimension + axis
                        here += momentum[dof] * momentum[dof] * inverse[dof]
                        there += force[dof] * force[dof] * inverse[dof]
        size = math.sqrt(weight(table, row, work.normals, work.gradients, inverse))
        touches = abs(work.gaps[chosen]) <= method.contact_tolerance * system.gap_scale[chosen]
        speed = (tolerance if touches else 0.0) * (math.sqrt(here) + math.sqrt(there)) + rounding
        work.still[chosen] = speed * size
