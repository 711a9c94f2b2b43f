"""One step: Algorithm 1 with bilateral constraints (7.8, 7.9), or its smooth part (5.6-5.9)."""

from numba import types

from deli.kernels.compiled import kernel, unit
from deli.kernels.contacts import (
    begin,
    copy,
    find_gaps,
    finite,
    first_force_here,
    gradients_here,
    spread_to_violated,
    strayed,
    velocity_zeros,
)
from deli.kernels.forces import ask, gradient
from deli.kernels.position import predict, update
from deli.kernels.projection import tangent
from deli.kernels.reflection import reflect
from deli.kernels.rows import normal, rate
from deli.kernels.system import (
    BILATERAL_GRADIENTS,
    DONE,
    MACHINE,
    POSITION,
    PROJECTION,
    REFLECTION,
    REFRESH,
    UNILATERAL_GRADIENTS,
    Machine,
)
from deli.kernels.tally import copy_tally, skip


@kernel
def _attempt(machine: Machine, active: int) -> tuple[int, int]:
    """Reflect off 𝔸, find 𝕊, update the position; return a code and the size of 𝕊.

    𝕊 is at the front of ``work.smooth``; what presses besides, because it lands, follows it in ``work.pressing``.
    """
    system, method, work, tally = machine.system, machine.method, machine.work, machine.tally
    table, dof = system.unilateral, work.q.size
    rows = table.kind.size
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
                normal(table, row, work.q, work.normals)
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
                normal(table, row, work.q, work.normals)
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


@kernel
def carry(machine: Machine, smooth: int) -> int:
    """Momentum at x: D₂L_d(q, x) without what the constraints that stay active do not allow."""
    system, method, work, mail, tally = machine.system, machine.method, machine.work, machine.mail, machine.tally
    dof, moved, held = system.mass.size, work.moved, system.bilateral.kind.size
    force = work.force
    if not method.implicit:
        code = gradient(machine, moved, work.stress)
        if code != DONE:
            return code
        h = work.span[0]
        for k in range(dof):
            work.stress[k] *= -0.5 * h
        force = work.stress
    for k in range(dof):
        work.carried[k] = system.mass[k] * work.velocity[k] + force[k]
    count = 0
    for k in range(smooth):
        row = work.smooth[k]
        opened = work.pressed[row] < work.scaled[row]
        if not opened and abs(work.gaps_moved[row]) <= method.contact_tolerance * system.gap_scale[row]:
            work.pressing[count] = row
            count += 1
            normal(system.unilateral, row, moved, work.normals_moved)
    if count and system.other_unilateral:
        code = ask(machine, UNILATERAL_GRADIENTS, moved)
        if code != DONE:
            return code
        copy(mail.unilateral_gradients, work.gradients_moved)
    if held:
        if system.other_bilateral:
            code = ask(machine, BILATERAL_GRADIENTS, moved)
            if code != DONE:
                return code
            copy(mail.bilateral_gradients, work.held_gradients_moved)
        for row in range(held):
            normal(system.bilateral, row, moved, work.held_normals_moved)
    if method.skip and count == 0 and held == 0:
        skip(tally, PROJECTION)
        return DONE
    return tangent(machine, count)


@unit(types.int64, MACHINE, *(types.int64,) * 3)
def step(machine: Machine, known: int, _one: int, _two: int) -> int:
    """Write the state one step after (``work.q``, ``work.p``) to ``work.moved`` and ``work.carried``.

    `known` says that ``work.gaps`` holds g(q) already; on return ``work.gaps_moved`` holds g(x).
    """
    system, method, work, tally = machine.system, machine.method, machine.work, machine.tally
    table, dof = system.unilateral, work.q.size
    rows = table.kind.size
    code = begin(machine, known)
    if code != DONE:
        return code
    code = predict(machine)
    if code != DONE:
        return code
    if strayed(machine, work.moved):
        return REFRESH
    touching = 0
    for row in range(rows):
        work.touching[row] = abs(work.gaps[row]) <= method.contact_tolerance * system.gap_scale[row]
        work.landing[row] = False
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
    active = 0
    for row in range(rows):
        crossed = method.reflects and not method.closed_loop and work.gaps_moved[row] <= 0.0
        work.active[row] = method.reflects and (work.touching[row] or crossed)
        active += work.active[row]
    if held or (touching and not method.reflects):
        code = gradients_here(machine, held)
        if code != DONE:
            return code
    gradients_known = held > 0 or (touching > 0 and not method.reflects)
    smooth = 0
    if system.reference.size > 0:
        copy_tally(tally, machine.kept)
    while True:
        if active and not gradients_known:
            code = gradients_here(machine, held)
            if code != DONE:
                return code
            gradients_known = True
        code, smooth = _attempt(machine, active)
        if code != DONE:
            return code
        if strayed(machine, work.moved):
            copy_tally(machine.kept, tally)
            return REFRESH
        if not (method.reflects and method.closed_loop):
            break
        if not spread_to_violated(system, work):
            break
        active = 0
        for row in range(rows):
            active += work.active[row]
    tally.contacts[0] = smooth
    code = carry(machine, smooth)
    if code != DONE:
        return code
    return finite(work)


@unit(types.int64, MACHINE)
def reflect_touching(machine: Machine) -> int:
    """Reflect ``work.p`` off all contacts with g(q) = 0, into ``work.momentum``; no forces act."""
    system, work = machine.system, machine.work
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
    code = gradients_here(machine, system.bilateral.kind.size)
    if code != DONE:
        return code
    velocity_zeros(machine, work.p, count, machine.method.contact_tolerance)
    return reflect(machine, count)
