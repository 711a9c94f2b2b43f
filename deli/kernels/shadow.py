"""The shadow energy of a scheme, from a few of its smooth steps, and reflections that conserve it."""

import math

import numpy as np
from numba import types

from deli.kernels.codes import (
    BILATERAL,
    BILATERAL_GRADIENTS,
    DONE,
    NO_SHADOW,
    UNILATERAL,
    UNILATERAL_GRADIENTS,
)
from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import find_gaps, gradients_here, velocity_zeros
from deli.kernels.dense import backward, factorize, forward
from deli.kernels.forces import ask, energy, gradient
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.rows import normal, push, rate, value
from deli.kernels.turning import turn_back

_EPSILON = 2.0**-52
_ITERATIONS = 200
_CONVERGED = 1e-11  # relative change at which an iteration may end because rounding lets it fall no more
_RIDGE = 1e-13  # relative, so that rows which depend on each other have a factor; the iterations make up for it
_SLIGHT = 1e-12  # share of the energy below which that of an impulse is lost in the rounding of shadow energies


@kernel
def _gradients(machine: Machine, resting: np.ndarray, q: np.ndarray, out: np.ndarray) -> int:
    """Gradients at q of resting and bilateral rows, one a row."""
    system, work, mail = machine.system, machine.work, machine.mail
    count, held = resting.size, system.bilateral.kind.size
    if count and system.other_unilateral:
        code = ask(machine, UNILATERAL_GRADIENTS, q)
        if code != DONE:
            return code
    if held and system.other_bilateral:
        code = ask(machine, BILATERAL_GRADIENTS, q)
        if code != DONE:
            return code
    for k in range(count + held):
        for i in range(q.size):
            out[k, i] = 0.0
    for k in range(count):
        normal(system.unilateral, resting[k], q, work.normals_moved)
        push(system.unilateral, resting[k], work.normals_moved, mail.unilateral_gradients, 1.0, out[k])
    for k in range(held):
        normal(system.bilateral, k, q, work.held_normals_moved)
        push(system.bilateral, k, work.held_normals_moved, mail.bilateral_gradients, 1.0, out[count + k])
    return DONE


@kernel
def _values(machine: Machine, resting: np.ndarray, q: np.ndarray, out: np.ndarray) -> int:
    """Values at q of resting and bilateral rows."""
    system, mail = machine.system, machine.mail
    count, held = resting.size, system.bilateral.kind.size
    if count and system.other_unilateral:
        code = ask(machine, UNILATERAL, q)
        if code != DONE:
            return code
    if held and system.other_bilateral:
        code = ask(machine, BILATERAL, q)
        if code != DONE:
            return code
    for k in range(count):
        out[k] = value(system.unilateral, resting[k], q, mail.unilateral)
    for k in range(held):
        out[count + k] = value(system.bilateral, k, q, mail.bilateral)
    return DONE


@kernel
def _factor(rows: np.ndarray, inverse: np.ndarray, matrix: np.ndarray, factor: np.ndarray) -> bool:
    """Factor of the rows' Delassus matrix NᵀM⁻¹N."""
    size = rows.shape[0]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(inverse.size):
                total += rows[i, k] * rows[j, k] * inverse[k]
            matrix[i, j] = total
        matrix[i, i] *= 1.0 + _RIDGE
    return factorize(matrix, size, factor)


@kernel
def _fly(
    machine: Machine,
    resting: np.ndarray,
    q: np.ndarray,
    p: np.ndarray,
    rows: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    there: np.ndarray,
) -> tuple[int, float]:
    """One smooth step (q, p) → (x, y) on which `resting` and bilateral rows hold; return a code and its action L_d.

    `rows` holds their gradients at q, `there` is for those at x.
    """
    system, method = machine.system, machine.method
    h, dof, size, inverse = machine.work.span[0], q.size, rows.shape[0], system.inverse
    velocity, spot, force = np.empty(dof), np.empty(dof), np.empty(dof)
    multiplier, residual = np.zeros(size), np.empty(size)
    matrix, factor = np.empty((size, size)), np.empty((size, size))
    if size and not _factor(rows, inverse, matrix, factor):
        return NO_SHADOW, 0.0
    for k in range(dof):
        velocity[k] = p[k] * inverse[k]
    least = math.inf
    for iteration in range(_ITERATIONS):
        if iteration == 0 or method.implicit:
            for k in range(dof):
                spot[k] = q[k] + 0.5 * h * velocity[k] if method.implicit else q[k]
            code = gradient(machine, spot, force)
            if code != DONE:
                return code, 0.0
        change = speed = 0.0
        for k in range(dof):
            momentum = p[k] - 0.5 * h * force[k]
            for row in range(size):
                momentum += rows[row, k] * multiplier[row]
            change += system.mass[k] * (momentum * inverse[k] - velocity[k]) ** 2
            speed += momentum * momentum * inverse[k]
            velocity[k] = momentum * inverse[k]
            x[k] = q[k] + h * velocity[k]
        if size:
            code = _values(machine, resting, x, residual)
            if code != DONE:
                return code, 0.0
            for row in range(size):
                residual[row] /= -h
            forward(factor, size, residual)
            backward(factor, size, residual)
            for row in range(size):
                multiplier[row] += residual[row]
        elif not method.implicit:
            break
        relative = math.sqrt(change / speed) if speed > 0.0 else 0.0
        if relative <= 2.0 * _EPSILON or (iteration > 0 and least <= relative < _CONVERGED):
            break
        least = min(least, relative)
        if iteration == _ITERATIONS - 1 or not math.isfinite(relative):
            return NO_SHADOW, 0.0
    if method.implicit:
        code, potential = energy(machine, spot)
        if code != DONE:
            return code, 0.0
    else:
        code, here = energy(machine, q)
        if code != DONE:
            return code, 0.0
        code, potential = energy(machine, x)
        if code != DONE:
            return code, 0.0
        potential = 0.5 * (here + potential)
        code = gradient(machine, x, force)
        if code != DONE:
            return code, 0.0
    kinetic = 0.0
    for k in range(dof):
        kinetic += 0.5 * system.mass[k] * velocity[k] * velocity[k]
        y[k] = system.mass[k] * velocity[k] - 0.5 * h * force[k]
    if size:
        code = _gradients(machine, resting, x, there)
        if code != DONE:
            return code, 0.0
        if not _factor(there, inverse, matrix, factor):
            return NO_SHADOW, 0.0
        for _ in range(2):
            for row in range(size):
                residual[row] = 0.0
                for k in range(dof):
                    residual[row] -= there[row, k] * y[k] * inverse[k]
            forward(factor, size, residual)
            backward(factor, size, residual)
            for row in range(size):
                for k in range(dof):
                    y[k] += residual[row] * there[row, k]
    return DONE, h * (kinetic - potential)


@kernel
def shadow(machine: Machine, momentum: np.ndarray, resting: np.ndarray) -> tuple[int, float]:
    """Shadow energy of (``work.q``, `momentum`), after a code; see `deli.metrics.shadow_energy`.

    ``method.shadow`` holds B_jk = ½ ∫₋₁¹ ℓ_j ℓ_k′ dt of the polynomials ℓ of the nodes −m, …, m.
    """
    system, q, weights = machine.system, machine.work.q, machine.method.shadow
    nodes, dof = weights.shape[0], q.size
    middle, size = nodes // 2, resting.size + system.bilateral.kind.size
    positions, momenta = np.empty((nodes, dof)), np.empty((nodes, dof))
    begin, rows, there = np.empty((size, dof)), np.empty((size, dof)), np.empty((size, dof))
    code = _gradients(machine, resting, q, begin)
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
            code, part = _fly(machine, resting, here, heading, rows, positions[node], momenta[node], there)
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
    """Rows that touch at q and do not move, ``work.still`` being known."""
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
    """Write the shadow energy of (``work.q``, ``work.p``) to ``work.report[0]``; contacts that rest are held."""
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
    """Add to the momentum a multiple of one island's impulse for H, so that the shadow energy stays what it was.

    Of E(p + sJ) = E(p), s ≠ 0, the function (E(p + sJ) − E(p))/s is nearly linear. With s ≤ 0 the contacts recede in
    the velocity ∂E/∂p of the shadow flow, and are let go, as are those that approach after an impulse with s < ½.
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
    if share < 0.5:
        for k in range(islands.row_start[group], islands.row_start[group + 1]):
            row = islands.rows[k]
            speed = rate(system.unilateral, row, work.normals, work.gradients, momentum, system.inverse)
            work.still[row] = max(work.still[row], -speed)
    return DONE
