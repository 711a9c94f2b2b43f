"""Fractions of a step without unilateral constraints, and the functions whose roots are sought in them.

A fraction begins at (``work.event``, ``work.event_momentum``), where ``work.gaps`` holds g; the step began at
(``work.start``, ``work.start_momentum``). ``work.meeting`` holds the row whose gap is sought, whether fractions are
composed of three steps, and the code of the function whose root is sought, which keeps its first failure;
``work.balance`` the rest of the step, and the discrete energies of the last fraction and of the one before the event,
at which the momentum was ``work.incoming`` and ``work.impulse`` is the reflection's.
"""

from numba import types

from deli.kernels.codes import DONE, UNILATERAL
from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import gradients_here
from deli.kernels.forces import ask, energy
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.position import predict, update
from deli.kernels.projection import carry
from deli.kernels.rows import value
from deli.mechanics.tables import OTHER

_OUTER = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_INNER = 1.0 - 2.0 * _OUTER


@kernel
def _move(machine: Machine) -> int:
    """Take the position update of a step without unilateral constraints."""
    system, method, work = machine.system, machine.method, machine.work
    held = system.bilateral.kind.size
    code = predict(machine)
    if code != DONE or (method.skip and held == 0):
        return code
    for k in range(work.q.size):
        work.momentum[k] = work.p[k]
    if held:
        code = gradients_here(machine, held, work.q)
        if code != DONE:
            return code
    return update(machine, 0)


@kernel
def _stay(machine: Machine) -> None:
    """Take a step of size zero."""
    system, work = machine.system, machine.work
    for k in range(work.q.size):
        work.velocity[k] = work.p[k] * system.inverse[k]
        work.moved[k] = work.q[k]
        work.carried[k] = work.p[k]


@kernel
def _discrete_energy(machine: Machine) -> tuple[int, float]:
    """Return a code and E_d = −∂L_d/∂h = ½ v̄ᵀMv̄ + V, v̄ = (x − q)/h, V at the midpoint (8.2) or the ends' mean (8.3)."""
    system, method, work = machine.system, machine.method, machine.work
    kinetic = 0.0
    for k in range(work.q.size):
        kinetic += 0.5 * system.mass[k] * work.velocity[k] ** 2
    if method.middle != 0.0:
        for k in range(work.q.size):
            work.stress[k] = 0.5 * (work.q[k] + work.moved[k])
        code, potential = energy(machine, work.stress)
        return code, kinetic + potential
    code, here = energy(machine, work.q)
    if code != DONE:
        return code, 0.0
    code, there = energy(machine, work.moved)
    return code, kinetic + 0.5 * (here + there)


@unit(types.int64, MACHINE, types.float64, types.boolean)
def take(machine: Machine, span: float, whole: bool) -> int:
    """Take a fraction of size `span`, to ``work.moved`` and, if `whole`, to ``work.carried``.

    A fraction composed of three steps of the scheme is of fourth order; its discrete energy is −∂/∂h of the sum of the
    three discrete Lagrangians.
    """
    method, work = machine.method, machine.work
    composed = work.meeting[1] != 0 and span != 0.0
    last = 2 if composed else 0
    for k in range(work.q.size):
        work.q[k] = work.event[k]
        work.p[k] = work.event_momentum[k]
    total = 0.0
    for stage in range(last + 1):
        share = 1.0
        if composed:
            share = _INNER if stage == 1 else _OUTER
        work.span[0] = share * span
        if span == 0.0:
            _stay(machine)
        else:
            code = _move(machine)
            if code != DONE:
                return code
        if method.discrete:
            code, part = _discrete_energy(machine)
            if code != DONE:
                return code
            total += share * part
        if span != 0.0 and (whole or stage < last):
            code = carry(machine, 0)
            if code != DONE:
                return code
        if stage < last:
            for k in range(work.q.size):
                work.q[k] = work.moved[k]
                work.p[k] = work.carried[k]
    work.balance[1] = total
    return DONE


@unit(types.float64, types.float64, MACHINE, needs=(take,))
def gap_after(span: float, machine: Machine) -> float:
    """Return the gap that is sought after a fraction of size `span`; 0, which ends a search, after a failure."""
    system, work = machine.system, machine.work
    row = work.meeting[0]
    if work.meeting[2] != DONE:
        return 0.0
    if span == 0.0:
        return work.gaps[row]
    code = take(machine, span, False)
    if code == DONE and system.unilateral.kind[row] == OTHER:
        code = ask(machine, UNILATERAL, work.moved)
    work.meeting[2] = code
    if code != DONE:
        return 0.0
    return value(system.unilateral, row, work.moved, machine.mail.unilateral)


@unit(types.float64, types.float64, MACHINE, needs=(take,))
def energy_after(share: float, machine: Machine) -> float:
    """Return the discrete energy that the rest of the step gains with `share` of the impulse; 0 as in `gap_after`."""
    work = machine.work
    if work.meeting[2] != DONE:
        return 0.0
    for k in range(work.q.size):
        work.event_momentum[k] = work.incoming[k] + share * work.impulse[k]
    work.meeting[2] = take(machine, work.balance[0], False)
    return work.balance[1] - work.balance[2] if work.meeting[2] == DONE else 0.0
