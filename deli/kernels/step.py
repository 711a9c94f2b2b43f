"""One step: Algorithm 1 with bilateral constraints (7.8, 7.9), or its smooth part (5.6-5.9)."""

from numba import types

from deli.kernels.codes import (
    AFFINE,
    BILATERAL,
    DONE,
    NO_DIRECTION,
    POSITION,
    REFLECTION,
    TOO_MANY_PASSES,
    UNILATERAL,
)
from deli.kernels.compiled import address_of, call, kernel, unit
from deli.kernels.contacts import (
    begin,
    begin_anew,
    end,
    find_gaps,
    first_force_here,
    gradients_here,
    strayed,
    velocity_zeros,
)
from deli.kernels.forces import ask
from deli.kernels.landing import admissible, spread_to_violated, trap
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.position import predict, update
from deli.kernels.projection import carry
from deli.kernels.reflection import reflect
from deli.kernels.rows import normal, rate, value
from deli.kernels.tally import skip


@kernel
def _tangents(machine: Machine, pressing: int) -> int:
    """Write the values at q of the tangents, at the prediction, of the rows of a position update."""
    system, work, mail = machine.system, machine.work, machine.mail
    at, scaled = work.predicted, work.stress
    for k in range(at.size):
        scaled[k] = system.mass[k] * (work.q[k] - at[k])
    if pressing and system.other_unilateral:
        code = ask(machine, UNILATERAL, at)
        if code != DONE:
            return code
    for k in range(pressing):
        row = work.pressing[k]
        change = rate(system.unilateral, row, work.normals, work.gradients, scaled, system.inverse)
        work.base[row] = value(system.unilateral, row, at, mail.unilateral) + change - work.level[row]
    held = system.bilateral.kind.size
    if held and system.other_bilateral:
        code = ask(machine, BILATERAL, at)
        if code != DONE:
            return code
    for row in range(held):
        change = rate(system.bilateral, row, work.held_normals, work.held_gradients, scaled, system.inverse)
        work.held_base[row] = value(system.bilateral, row, at, mail.bilateral) + change
    return DONE


@kernel
def _attempt(machine: Machine, active: int) -> tuple[int, int]:
    """Reflect off 𝔸, find 𝕊, update the position; return a code and the size of 𝕊.

    𝕊 is at the front of ``work.smooth``; rows that land follow it in ``work.pressing``.
    """
    system, method, work, tally = machine.system, machine.method, machine.work, machine.tally
    table, dof = system.unilateral, work.q.size
    rows = table.kind.size
    work.struck[0] = 0
    linear = method.rows == AFFINE
    here = work.predicted if linear else work.q
    for k in range(dof):
        work.momentum[k] = work.p[k]
        work.velocity[k] = work.predicted_velocity[k]
        work.force[k] = work.predicted_force[k]
        work.moved[k] = work.predicted[k]
    smooth, free = 0, True
    if method.reflects and not active:
        skip(tally, REFLECTION)
    if method.reflects and active:
        code = first_force_here(machine)
        if code != DONE:
            return code, 0
        count = 0
        for row in range(rows):
            if work.active[row]:
                work.chosen[count] = row
                count += 1
                normal(table, row, here, work.normals)
        velocity_zeros(machine, work.p, count, method.contact_tolerance)
        code = reflect(machine, count)
        if code != DONE:
            return code, 0
        for k in range(dof):
            free = free and work.momentum[k] == work.p[k]
        count = 0
        for row in range(rows):
            if work.touching[row]:
                work.chosen[count] = row
                count += 1
        velocity_zeros(machine, work.momentum, count, method.contact_tolerance)
        for k in range(count):
            row = work.chosen[k]
            speed = rate(table, row, work.normals, work.gradients, work.momentum, system.inverse)
            if abs(speed) <= work.still[row]:
                work.smooth[smooth] = row
                smooth += 1
        # The force the position update starts from is that of the prediction, not that at q.
        for k in range(dof):
            work.force[k] = work.predicted_force[k]
    if not method.reflects:
        for row in range(rows):
            if work.touching[row]:
                work.smooth[smooth] = row
                smooth += 1
                normal(table, row, here, work.normals)
    for row in range(rows):
        work.resting[row] = False
    for k in range(smooth):
        work.pressing[k] = work.smooth[k]
        work.resting[work.smooth[k]] = True
    pressing = smooth
    for row in range(rows):
        if work.landing[row] and not work.resting[row]:
            work.pressing[pressing] = row
            pressing += 1
    if linear:
        code = _tangents(machine, pressing)
        if code != DONE:
            return code, smooth
    if method.skip and free and pressing == 0 and system.bilateral.kind.size == 0:
        skip(tally, POSITION)
    else:
        code = update(machine, pressing)
        if code != DONE:
            return code, smooth
        code = find_gaps(machine, work.moved, work.gaps_moved)
        if code != DONE:
            return code, smooth
    return DONE, smooth


@unit(types.int64, MACHINE, *(types.int64,) * 3)
def step(machine: Machine, known: int, _one: int, _two: int) -> int:
    """Write the state one step after (``work.q``, ``work.p``) to ``work.moved`` and ``work.carried``.

    `known` says that ``work.gaps`` holds g(q) on entry; on return ``work.gaps_moved`` holds g(x).
    """
    system, method, work = machine.system, machine.method, machine.work
    table, dof = system.unilateral, work.q.size
    rows = table.kind.size
    code = begin(machine, known)
    if code != DONE:
        return code
    code = predict(machine)
    if code != DONE:
        return code
    if strayed(machine, work.moved):
        return begin_anew(machine)
    touching = 0
    for row in range(rows):
        work.touching[row] = abs(work.gaps[row]) <= method.contact_tolerance * system.gap_scale[row]
        work.landing[row] = False
        work.level[row] = 0.0
        touching += work.touching[row]
    # D₂L_d of a step that meets nothing needs the prediction only.
    for k in range(dof):
        work.predicted[k] = work.moved[k]
        work.predicted_velocity[k] = work.velocity[k]
        work.predicted_force[k] = work.force[k]
    code = find_gaps(machine, work.moved, work.gaps_moved)
    if code != DONE:
        return code
    held = system.bilateral.kind.size
    here = work.predicted if method.rows == AFFINE else work.q
    active = 0
    for row in range(rows):
        crossed = method.reflects and not method.closed_loop and work.gaps_moved[row] <= 0.0
        work.active[row] = method.reflects and (work.touching[row] or crossed)
        active += work.active[row]
    if held or (touching and not method.reflects):
        code = gradients_here(machine, held, here)
        if code != DONE:
            return code
    gradients_known = held > 0
    smooth = 0
    while True:
        if active and not gradients_known:
            code = gradients_here(machine, held, here)
            if code != DONE:
                return code
            gradients_known = True
        code, smooth = _attempt(machine, active)
        trapped = False
        if method.closed_loop and code in (NO_DIRECTION, TOO_MANY_PASSES):
            trapped = True
            trap(machine, int(work.report[4]))
        elif code != DONE:
            return code
        elif strayed(machine, work.moved):
            return begin_anew(machine)
        if not (method.reflects and method.closed_loop):
            break
        if not (trapped or spread_to_violated(machine)):
            break
        active = 0
        for row in range(rows):
            active += work.active[row]
    code = carry(machine, smooth)
    if method.closed_loop and code == DONE:
        code = call(machine.hooks.land, address_of(machine), smooth, 0, 0)
    if method.closed_loop and code == DONE:
        code = admissible(machine)
    if code != DONE:
        return code
    return end(machine, smooth)


@unit(types.int64, MACHINE)
def reflect_touching(machine: Machine) -> int:
    """Reflect ``work.p`` off all contacts with g(q) = 0, into ``work.momentum``; no forces act."""
    system, work = machine.system, machine.work
    work.struck[0] = 0
    for k in range(work.q.size):
        work.momentum[k] = work.p[k]
        work.force[k] = 0.0
    code = find_gaps(machine, work.q, work.gaps)
    if code != DONE:
        return code
    count = 0
    for row in range(system.unilateral.kind.size):
        if abs(work.gaps[row]) <= machine.method.contact_tolerance * system.gap_scale[row]:
            work.chosen[count] = row
            count += 1
            normal(system.unilateral, row, work.q, work.normals)
    if count == 0:
        return DONE
    code = gradients_here(machine, system.bilateral.kind.size, work.q)
    if code != DONE:
        return code
    velocity_zeros(machine, work.p, count, machine.method.contact_tolerance)
    code = reflect(machine, count)
    if code == DONE:
        machine.tally.contacts[1] += work.struck[0]
    return code
