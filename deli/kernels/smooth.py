"""One smooth step of a scheme, in which given contacts and the bilateral constraints hold."""

import math

import numpy as np

from deli.kernels.codes import BILATERAL, BILATERAL_GRADIENTS, DONE, NO_SHADOW, UNILATERAL, UNILATERAL_GRADIENTS
from deli.kernels.compiled import kernel
from deli.kernels.dense import backward, factorize, forward
from deli.kernels.forces import ask, energy, gradient
from deli.kernels.machine import Machine
from deli.kernels.rows import normal, push, value

_EPSILON = 2.0**-52
_ITERATIONS = 200
_CONVERGED = 1e-11  # relative change at which an iteration may end because rounding lets it fall no more
_RIDGE = 1e-13  # relative, so that rows which depend on each other have a factor; the iterations make up for it


@kernel
def gradients_of(machine: Machine, resting: np.ndarray, q: np.ndarray, out: np.ndarray) -> int:
    """Write the gradients at q of resting and bilateral rows, one a row."""
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
    """Write the values at q of resting and bilateral rows."""
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
    """Write the factor of the rows' Delassus matrix NᵀM⁻¹N; return whether there is one."""
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
def smooth_step(
    machine: Machine,
    resting: np.ndarray,
    q: np.ndarray,
    p: np.ndarray,
    rows: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    there: np.ndarray,
) -> tuple[int, float]:
    """Take a smooth step (q, p) → (x, y) in which `resting` and bilateral rows hold; return a code and its action L_d.

    `rows` holds their gradients at q, and `there` receives those at x.
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
        code = gradients_of(machine, resting, x, there)
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
