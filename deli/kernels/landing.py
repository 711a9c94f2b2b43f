"""Contacts that land: they keep their gap for a step, and their momentum along the gradients for the next step.

A contact lands where a reflection off it is undone within the step: a bounce shorter than h, or a boundary that curves
back. Its gap is held at the level it had at q, so that (7.3-7.6) moves along that level as it does along the boundary,
and is symplectic there. The momentum along its gradient takes no part in this motion, and is returned after it.
"""

import math

from numba import types

from deli.kernels.codes import AFFINE, DONE, PENETRATED, UNILATERAL_GRADIENTS
from deli.kernels.compiled import address_of, call, kernel, unit
from deli.kernels.contacts import VIOLATED, copy
from deli.kernels.forces import ask
from deli.kernels.islands import connect
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.projection import list_smooth, presses, tangent
from deli.kernels.rows import normal


@kernel
def _land(machine: Machine, row: int) -> None:
    work = machine.work
    work.landing[row] = True
    work.level[row] = max(work.gaps[row], 0.0)


@kernel
def spread_to_violated(machine: Machine) -> bool:
    """Add the rows that x violates to 𝔸, or let them land if all are in it already; return whether any row changed."""
    system, work = machine.system, machine.work
    rows, joined, landed = system.unilateral.kind.size, False, False
    for row in range(rows):
        violated = work.gaps_moved[row] < -VIOLATED * system.gap_scale[row]
        if violated and not (work.active[row] or work.landing[row]):
            work.active[row] = joined = True
    if joined:
        return True
    for row in range(rows):
        violated = work.gaps_moved[row] < -VIOLATED * system.gap_scale[row]
        if violated and not (work.landing[row] or work.resting[row]):
            _land(machine, row)
            landed = True
    return landed


@kernel
def trap(machine: Machine, taken: int) -> None:
    """Let the contacts of a reflection's last pass land, because there is no momentum at which all of them separate."""
    work = machine.work
    for k in range(taken):
        work.active[work.pressing[k]] = False
        _land(machine, work.pressing[k])


@kernel
def admissible(machine: Machine) -> int:
    """Return the code of a step that must violate no constraint by more than the contact tolerance."""
    system, method, work = machine.system, machine.method, machine.work
    if method.rows == AFFINE:
        return DONE
    for row in range(system.unilateral.kind.size):
        if work.gaps_moved[row] < -method.contact_tolerance * system.gap_scale[row]:
            work.report[0], work.report[1] = row, work.gaps_moved[row]
            return PENETRATED
    return DONE


@kernel
def _return(machine: Machine, count: int) -> None:
    """Add ``work.latent`` to the momentum at x, in each island with the kinetic energy that it had at q."""
    system, work, islands = machine.system, machine.work, machine.islands
    dimension = system.dimension
    groups = connect(machine, count, True, system.other_unilateral + system.other_bilateral > 0)
    for group in range(groups):
        had = left = 0.0
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                had += work.before[dof] ** 2 * system.inverse[dof]
                left += work.latent[dof] ** 2 * system.inverse[dof]
        if not left > 0.0:
            continue
        share = math.sqrt(had / left)
        for k in range(islands.body_start[group], islands.body_start[group + 1]):
            for axis in range(dimension):
                dof = islands.bodies[k] * dimension + axis
                work.carried[dof] += share * work.latent[dof]


@unit(types.int64, MACHINE, types.int64, types.int64, types.int64)
def land(machine: Machine, smooth: int, _two: int, _three: int) -> int:
    """Write the momentum at x if contacts land; on entry it is that of `carry`, tangent to 𝕊 and bilateral constraints.

    ``p⁺ = p_t + n`` at q and ``y = y_t + a n′`` at x, where p_t and y_t are tangent to the landed contacts too. The
    part of n, carried to x, in the span of the gradients there is n′, and a >= 0 conserves energy: ``|a n′| = |n|`` in
    the metric M⁻¹, island by island; or E(x, y) = E(q, p) for another energy than H, see `deli.kernels.balance`.
    """
    system, method, work = machine.system, machine.method, machine.work
    dof, tangential, latent = work.q.size, work.best, work.latent
    there = work.predicted if method.rows == AFFINE else work.moved
    resting = list_smooth(machine, smooth)
    count = resting
    for row in range(system.unilateral.kind.size):
        if work.landing[row] and not work.resting[row] and presses(machine, row):
            work.pressing[count] = row
            count += 1
            normal(system.unilateral, row, there, work.normals_moved)
    if count == resting:
        return DONE
    if system.other_unilateral:
        code = ask(machine, UNILATERAL_GRADIENTS, there)
        if code != DONE:
            return code
        copy(machine.mail.unilateral_gradients, work.gradients_moved)
    for k in range(dof):
        tangential[k] = work.carried[k]
        work.carried[k] = work.momentum[k]
    code = tangent(machine, count, False)
    if code != DONE:
        return code
    for k in range(dof):
        work.before[k] = work.carried[k] = work.momentum[k] - work.carried[k]
    code = tangent(machine, resting, True)
    if code != DONE:
        return code
    for k in range(dof):
        latent[k] = work.carried[k]
    code = tangent(machine, count, True)
    if code != DONE:
        return code
    for k in range(dof):
        latent[k] -= work.carried[k]
        work.carried[k] = tangential[k]
    code = tangent(machine, count, True)
    if code != DONE:
        return code
    if (method.numerical and system.curved) or method.shadow.size:
        return call(machine.hooks.balance, address_of(machine), resting, 0, 0)
    _return(machine, count)
    return DONE
