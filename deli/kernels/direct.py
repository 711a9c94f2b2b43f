"""Methods that substitute the impulses of the constraints into a scheme (Appendix B), or into Moreau's scheme."""

from numba import types

from deli.kernels.codes import AFFINE, DONE, MOVING, POSITION
from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import (
    VIOLATED,
    begin,
    begin_anew,
    end,
    find_gaps,
    gradients_here,
    strayed,
    velocity_zeros,
)
from deli.kernels.forces import gradient
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.position import predict, update
from deli.kernels.rows import normal, rate
from deli.kernels.tally import skip

_FORECAST = 0.5  # of a step, after which Moreau's scheme looks for constraints that are met


@kernel
def _select_here(machine: Machine) -> int:
    """Put rows that are met at q, or half a step later, into ``work.pressing``; return their number.

    Half a step later, rows that touch and do not open count as met, so that rounding does not decide about them.
    """
    system, method, work = machine.system, machine.method, machine.work
    table, count, touching = system.unilateral, 0, 0
    for row in range(table.kind.size):
        normal(table, row, work.q, work.normals)
        if abs(work.gaps[row]) <= method.contact_tolerance * system.gap_scale[row]:
            work.chosen[touching] = row
            touching += 1
    if method.rows == AFFINE:
        velocity_zeros(machine, work.p, touching, method.contact_tolerance)
    for row in range(table.kind.size):
        gap, allowed = work.gaps[row], method.contact_tolerance * system.gap_scale[row]
        met = gap <= allowed
        if method.rows == AFFINE:
            speed = rate(table, row, work.normals, work.gradients, work.p, system.inverse)
            rests = abs(gap) <= allowed and speed <= work.still[row]
            met = rests or gap + _FORECAST * work.span[0] * speed <= 0.0
            work.base[row] = work.span[0] * method.restitution * speed
        if met:
            work.pressing[count] = row
            count += 1
    for row in range(system.bilateral.kind.size):
        work.held_base[row] = 0.0
    return count


@kernel
def _select_violated(machine: Machine, count: int) -> tuple[int, int]:
    """Append rows that are violated at ``work.spot`` to ``work.pressing``; return a code and the new number."""
    system, method, work = machine.system, machine.method, machine.work
    for k in range(work.q.size):
        work.spot[k] = work.q[k] + method.place * (work.moved[k] - work.q[k])
    code = find_gaps(machine, work.spot, work.gaps_moved)
    if code != DONE:
        return code, count
    for row in range(system.unilateral.kind.size):
        if not work.resting[row] and work.gaps_moved[row] < -VIOLATED * system.gap_scale[row]:
            work.resting[row] = True
            work.pressing[count] = row
            count += 1
    return DONE, count


@kernel
def move(machine: Machine) -> tuple[int, int]:
    """Update the position with all constraints that it meets; return a code and the number of their rows."""
    system, method, work = machine.system, machine.method, machine.work
    held = system.bilateral.kind.size
    if method.rows != MOVING:
        code = gradients_here(machine, held, work.q)
        if code != DONE:
            return code, 0
        count = _select_here(machine)
        if count or held or not method.skip:
            code = update(machine, count)
        else:
            skip(machine.tally, POSITION)
        return code, count
    for row in range(system.unilateral.kind.size):
        work.resting[row] = False
    before = count = 0
    solved = held == 0 and method.skip
    if solved:
        skip(machine.tally, POSITION)
    while True:
        before = count
        code, count = _select_violated(machine, count)
        if code != DONE or (solved and count == before):
            return code, count
        code = update(machine, count)
        if code != DONE:
            return code, count
        solved = True


@kernel
def _carry(machine: Machine) -> int:
    """Write the momentum at x: that at q, the force with later weights, and the constraints' impulse times the gain."""
    system, method, work = machine.system, machine.method, machine.work
    h, dof, later = work.span[0], work.q.size, work.before
    for k in range(dof):
        impulse = system.mass[k] * work.velocity[k] - work.p[k] - work.force[k]
        work.carried[k] = work.p[k] + method.gain * impulse
    if method.later_start != 0.0:
        for k in range(dof):
            work.carried[k] -= h * method.later_start * work.here[k]
    if method.later_middle != 0.0 or method.later_end != 0.0:
        weight = method.later_end
        for k in range(dof):
            work.stress[k] = work.moved[k]
        if method.later_middle != 0.0:
            weight = method.later_middle
            for k in range(dof):
                work.stress[k] = 0.5 * (work.q[k] + work.moved[k])
        code = gradient(machine, work.stress, later)
        if code != DONE:
            return code
        for k in range(dof):
            work.carried[k] -= h * weight * later[k]
    return DONE


@unit(types.int64, MACHINE, *(types.int64,) * 3)
def substitute(machine: Machine, known: int, _one: int, _two: int) -> int:
    """Write the state one step after (``work.q``, ``work.p``), as `deli.kernels.step.step` does.

    M u = p + φ(x) + N r + F s with 0 ≤ r ⊥ the rows of the method ≥ 0, and x = q + h (share u + (1 − share) M⁻¹p).
    """
    work, method = machine.work, machine.method
    code = begin(machine, known)
    if code == DONE and (method.later_start != 0.0 or (method.start != 0.0 and method.end != 0.0)):
        code = gradient(machine, work.q, work.here)
    if code == DONE:
        code = predict(machine)
    if code != DONE:
        return code
    for k in range(work.q.size):
        work.momentum[k] = work.p[k]
    if strayed(machine, work.moved):
        return begin_anew(machine)
    code, count = move(machine)
    if code == DONE:
        code = begin_anew(machine) if strayed(machine, work.moved) else _carry(machine)
    if code == DONE:
        code = find_gaps(machine, work.moved, work.gaps_moved)
    if code != DONE:
        return code
    return end(machine, count)
