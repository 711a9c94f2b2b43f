"""The shadow energy of a scheme, from a few of its smooth steps, and reflections that conserve it."""

import math

import numpy as np
from numba import types

from deli.kernels.codes import DONE, NO_SHADOW
from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import find_gaps, gradients_here, velocity_zeros
from deli.kernels.forces import gradient
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.rows import normal, rate
from deli.kernels.smooth import gradients_of, smooth_step
from deli.kernels.turning import turn_back

_EPSILON = 2.0**-52
_ITERATIONS = 200
_SLIGHT = 1e-12  # share of the energy below which that of an impulse is lost in the rounding of shadow energies


@kernel
def shadow(machine: Machine, momentum: np.ndarray, resting: np.ndarray) -> tuple[int, float]:
    """Return a code and the shadow energy of (``work.q``, `momentum`); see `deli.metrics.shadow_energy`.

    ``method.shadow`` holds B_jk = ½ ∫₋₁¹ ℓ_j ℓ_k′ dt of the polynomials ℓ of the nodes −m, …, m.
    """
    system, q, weights = machine.system, machine.work.q, machine.method.shadow
    nodes, dof = weights.shape[0], q.size
    middle, size = nodes // 2, resting.size + system.bilateral.kind.size
    positions, momenta = np.empty((nodes, dof)), np.empty((nodes, dof))
    begin, rows, there = np.empty((size, dof)), np.empty((size, dof)), np.empty((size, dof))
    code = gradients_of(machine, resting, q, begin)
    if code != DONE:
        return code, 0.0
    for k in range(dof):
        positions[middle, k], momenta[middle, k] = q[k], momentum[k]
    action = 0.0
    here, heading = np.empty(dof), np.empty(dof)
    for way in (1, -1):
        rows[:] = begin
        for k in range(dof):
            here[k], heading[k] = q[k], way * momentum[k]
        for step in range(1, middle + 1):
            node = middle + way * step
            code, part = smooth_step(machine, resting, here, heading, rows, positions[node], momenta[node], there)
            if code != DONE:
                return code, 0.0
            if step == 1:
                action += part
            rows[:] = there
            for k in range(dof):
                here[k], heading[k] = positions[node, k], momenta[node, k]
                momenta[node, k] *= way
    total = 0.0
    for j in range(nodes):
        for i in range(nodes):
            if i != middle and weights[j, i] != 0.0:
                product = 0.0
                for k in range(dof):
                    product += momenta[j, k] * (positions[i, k] - q[k])
                total += weights[j, i] * product
    return DONE, (total - 0.5 * action) / machine.work.span[0]


@kernel
def _resting(machine: Machine, momentum: np.ndarray) -> np.ndarray:
    """Return the rows that touch at q and do not move, given ``work.still``."""
    system, work, table = machine.system, machine.work, machine.system.unilateral
    count = 0
    found = np.empty(table.kind.size, np.int64)
    for row in range(table.kind.size):
        if abs(work.gaps[row]) <= machine.method.contact_tolerance * system.gap_scale[row]:
            speed = rate(table, row, work.normals, work.gradients, momentum, system.inverse)
            if abs(speed) <= work.still[row]:
                found[count] = row
                count += 1
    return found[:count].copy()


@unit(types.int64, MACHINE)
def measure_shadow(machine: Machine) -> int:
    """Write the shadow energy of (``work.q``, ``work.p``) to ``work.report[0]``; resting contacts hold."""
    system, method, work = machine.system, machine.method, machine.work
    code = find_gaps(machine, work.q, work.gaps)
    if code != DONE:
        return code
    count = 0
    for row in range(system.unilateral.kind.size):
        if abs(work.gaps[row]) <= method.contact_tolerance * system.gap_scale[row]:
            work.chosen[count] = row
            count += 1
            normal(system.unilateral, row, work.q, work.normals)
    if count:
        code = gradients_here(machine, 0, work.q)
        if code != DONE:
            return code
        code = gradient(machine, work.q, work.force)
        if code != DONE:
            return code
        for k in range(work.q.size):
            work.force[k] *= -0.5 * work.span[0]
        velocity_zeros(machine, work.p, count, method.contact_tolerance)
    code, found = shadow(machine, work.p, _resting(machine, work.p))
    work.report[0] = found
    return code


@unit(types.int64, MACHINE, types.int64, types.int64, types.int64)
def turn_shadow(machine: Machine, group: int, _two: int, _three: int) -> int:
    """Add a multiple of one island's impulse for H to the momentum, such that the shadow energy is conserved.

    To solve E(p + sJ) = E(p) for s ≠ 0, a root of (E(p + sJ) − E(p))/s is sought, which is nearly linear. With s ≤ 0
    the contacts recede in the velocity ∂E/∂p of the shadow flow, and are not reflected; neither are contacts that
    approach after an impulse with s < ½.
    """
    system, work, islands = machine.system, machine.work, machine.islands
    momentum, dof = work.momentum, system.mass.size
    before = momentum.copy()
    code, level = shadow(machine, before, _resting(machine, before))
    if code != DONE:
        return code
    code = turn_back(machine, group, 1.0)
    if code != DONE:
        return code
    impulse, kinetic, slope = np.empty(dof), 0.0, 0.0
    for k in range(dof):
        impulse[k] = momentum[k] - before[k]
        kinetic += 0.5 * momentum[k] * momentum[k] * system.inverse[k]
        slope += 0.5 * impulse[k] * impulse[k] * system.inverse[k]
    scale = kinetic + abs(level)
    if slope <= _SLIGHT * scale:
        return DONE
    resting = _resting(machine, momentum)
    share, last, before_last = 1.0, 0.0, 0.0
    for iteration in range(_ITERATIONS):
        for k in range(dof):
            momentum[k] = before[k] + share * impulse[k]
        code, found = shadow(machine, momentum, resting)
        if code != DONE:
            return code
        excess = (found - level) / share
        if iteration > 0 and excess != before_last:
            slope = (excess - before_last) / (share - last)
        last, before_last = share, excess
        following = share - excess / slope
        if abs(found - level) <= 4.0 * _EPSILON * scale or abs(following - share) <= 4.0 * _EPSILON * abs(share):
            break
        if iteration > 2 and abs(found - level) <= 1e3 * _EPSILON * scale:
            break
        if iteration == _ITERATIONS - 1 or not math.isfinite(following):
            return NO_SHADOW
        share = following
        if share <= 0.0:
            break
    if share <= 0.0:
        for k in range(dof):
            momentum[k] = before[k]
        for k in range(islands.row_start[group], islands.row_start[group + 1]):
            work.marked[islands.rows[k]] -= 1
    if share < 0.5:
        for k in range(islands.row_start[group], islands.row_start[group + 1]):
            row = islands.rows[k]
            speed = rate(system.unilateral, row, work.normals, work.gradients, momentum, system.inverse)
            work.still[row] = max(work.still[row], -speed)
    return DONE
