"""Momentum of landed contacts normal to their level, where reflections conserve another energy than H.

The momentum at x is y_t + a n′, see `deli.kernels.landing`, with a >= 0 from E(x, y_t + a n′) = E(q, p⁺); without a
solution, a is the value that comes nearest. On entry ``work.carried`` is y_t, and ``work.latent`` n′.
"""

import math

import numpy as np
from numba import types

from deli.kernels.codes import DONE, NO_SHADOW
from deli.kernels.compiled import kernel, unit
from deli.kernels.forces import energy, gradient, hessian
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.shadow import shadow

_EPSILON = 2.0**-52
_ITERATIONS = 200


@kernel
def _numerical_energy(machine: Machine, kinetic: bool) -> tuple[int, float, float, float]:
    """Return a code, the numerical Hamiltonian of y = ``work.carried`` at x, yᵀWn′ and n′ᵀWn′, n′ = ``work.latent``.

    Without `kinetic`, return the numerical Hamiltonian at (q, p), and zeros.
    """
    system, method, work, mail = machine.system, machine.method, machine.work, machine.mail
    q, p, latent, dof = work.q, work.p, work.latent, work.q.size
    if kinetic:
        q, p = work.moved, work.carried
    code, total = energy(machine, q)
    if code == DONE:
        code = gradient(machine, q, work.stress)
    if code == DONE:
        code = hessian(machine, q)
    mixed = square = 0.0
    if code != DONE:
        return code, total, mixed, square
    for i in range(dof):
        total += method.pull * work.stress[i] * work.stress[i] * system.inverse[i]
        for j in range(dof):
            metric = method.curvature * mail.hessian[i, j] * system.inverse[i] * system.inverse[j]
            if i == j:
                metric += system.inverse[i]
            total += 0.5 * metric * p[i] * p[j]
            mixed += metric * latent[i] * p[j]
            square += metric * latent[i] * latent[j]
    return code, total, mixed, square


@unit(types.int64, MACHINE, types.int64, types.int64, types.int64)
def balance_numerical(machine: Machine, _one: int, _two: int, _three: int) -> int:
    """Conserve the numerical Hamiltonian, which is quadratic in a."""
    work = machine.work
    code, wanted, _, _ = _numerical_energy(machine, False)
    if code != DONE:
        return code
    code, found, mixed, square = _numerical_energy(machine, True)
    if code != DONE or not square > 0.0:
        return code
    discriminant = mixed * mixed - 2.0 * square * (found - wanted)
    share = max(0.0, (math.sqrt(max(0.0, discriminant)) - mixed) / square)
    for k in range(work.q.size):
        work.carried[k] += share * work.latent[k]
    return DONE


@unit(types.int64, MACHINE, types.int64, types.int64, types.int64)
def balance_shadow(machine: Machine, resting: int, _two: int, _three: int) -> int:
    """Conserve the shadow energy, nearly linear in a², where the first `resting` rows of ``work.pressing`` hold at x.

    It is the shadow energy of motion without the landed contacts, which free steps before and after the landing keep.
    """
    work, inverse, dof = machine.work, machine.system.inverse, machine.work.q.size
    here, tangential, momentum = work.q.copy(), work.carried.copy(), np.empty(dof)
    held, count = np.empty(work.resting.size, np.int64), 0
    for row in range(work.resting.size):
        if work.resting[row]:
            held[count] = row
            count += 1
    there = work.pressing[:resting].copy()
    code, wanted = shadow(machine, work.momentum, held[:count].copy())
    if code != DONE:
        return code
    had = square = kinetic = 0.0
    for k in range(dof):
        had += work.before[k] * work.before[k] * inverse[k]
        square += work.latent[k] * work.latent[k] * inverse[k]
        kinetic += 0.5 * work.momentum[k] * work.momentum[k] * inverse[k]
        work.q[k] = work.moved[k]
    scale = kinetic + abs(wanted)
    if not square > _EPSILON * _EPSILON * scale:
        for k in range(dof):
            work.q[k] = here[k]
        return DONE
    slope, last, before_last = 0.5 * square, 0.0, 0.0
    squared = had / square
    code = NO_SHADOW
    for iteration in range(_ITERATIONS):
        for k in range(dof):
            momentum[k] = tangential[k] + math.sqrt(squared) * work.latent[k]
        failed, found = shadow(machine, momentum, there)
        if failed != DONE:
            code = failed
            break
        excess = found - wanted
        if iteration > 0 and squared != last and excess != before_last:
            slope = (excess - before_last) / (squared - last)
        last, before_last = squared, excess
        following = max(0.0, squared - excess / slope)
        if abs(excess) <= 4.0 * _EPSILON * scale or abs(following - squared) <= 4.0 * _EPSILON * squared:
            code = DONE
            break
        if iteration > 2 and abs(excess) <= 1e3 * _EPSILON * scale:
            code = DONE
            break
        if not math.isfinite(following):
            break
        squared = following
    for k in range(dof):
        work.q[k] = here[k]
        work.carried[k] = momentum[k]
    return code
