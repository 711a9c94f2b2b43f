"""Generalized reflection (6.6-6.9, Algorithms 2 and 3) of the contacts of an extended active set."""

import math

import numpy as np
from numba import types

from deli.kernels.codes import DONE, FASTEST, GENERALIZED, MOREAU, NO_DIRECTION, REFLECTION, SEQUENTIAL, TOO_MANY_PASSES
from deli.kernels.compiled import address_of, call, kernel, unit
from deli.kernels.islands import connect
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.rows import rate, weight
from deli.kernels.tally import skip
from deli.kernels.turning import turn_back

_PASSES = 1000
_MOST_PASSES = 1_000_000
_SAME = 1e-10  # relative difference of two momenta that are one
_TIE = 1e-12  # relative difference of two speeds that are one
_SMALL = 1000  # degrees of freedom up to which every pass is compared with the one before


@kernel
def _pass(machine: Machine, taken: int) -> tuple[int, int]:
    """Reflect off the first `taken` rows of ``work.pressing``, island by island; return a code and their number."""
    system, method, tally = machine.system, machine.method, machine.tally
    numerical, shadow = method.numerical and system.curved, method.shadow.size > 0
    other = numerical or shadow
    before = tally.counts[0, REFLECTION]
    # Each island has a share of its own that conserves the shadow energy, whether or not solvers are skipped.
    groups = connect(machine, taken, False, system.coupled or numerical or not (method.skip or shadow))
    for group in range(groups):
        code = (
            call(machine.hooks.numerical, address_of(machine), group, 0, 0) if other else turn_back(machine, group, 1.0)
        )
        if code != DONE:
            return code, groups
    if tally.counts[0, REFLECTION] == before:
        skip(tally, REFLECTION)
    return DONE, groups


@kernel
def _list_joints(machine: Machine, count: int) -> None:
    """List, by body, the places in ``work.chosen`` of the rows on it."""
    islands, table, chosen = machine.islands, machine.system.unilateral, machine.work.chosen
    start, joints = islands.joint_start, islands.joints
    for body in range(start.size):
        start[body] = 0
    for k in range(count):
        start[table.first[chosen[k]] + 1] += 1
        if table.second[chosen[k]] >= 0:
            start[table.second[chosen[k]] + 1] += 1
    for body in range(start.size - 1):
        start[body + 1] += start[body]
    for k in range(count - 1, -1, -1):  # each start moves from its body's end to its beginning
        for end in range(2):
            body = table.first[chosen[k]] if end == 0 else table.second[chosen[k]]
            if body >= 0:
                start[body + 1] -= 1
                joints[start[body + 1]] = k


@kernel
def _approaching(machine: Machine, groups: int, passes: int) -> int:
    """Put the rows that approach since the last pass, in order, into ``work.pressing``; return their number.

    If every approaching row was reflected, these rows are on bodies that the last pass has turned. ``work.smooth``
    holds the number of the pass for the places in ``work.chosen`` that have been examined.
    """
    system, work, islands = machine.system, machine.work, machine.islands
    start, found = islands.joint_start, work.pressing
    count = 0
    for place in range(islands.body_start[groups]):
        body = islands.bodies[place]
        for joint in range(start[body + 1], start[body + 2]):
            k = islands.joints[joint]
            if work.smooth[k] == passes:
                continue
            work.smooth[k] = passes
            row = work.chosen[k]
            work.approach[k] = rate(system.unilateral, row, work.normals, work.gradients, work.momentum, system.inverse)
            if work.approach[k] < -work.still[row]:
                work.marked[row] += 1
                at = count
                while at > 0 and found[at - 1] > row:
                    found[at] = found[at - 1]
                    at -= 1
                found[at] = row
                count += 1
    return count


@kernel
def _changed(momentum: np.ndarray, before: np.ndarray) -> bool:
    """Return whether a pass has changed the momentum."""
    changed = False
    for k in range(momentum.size):
        changed = changed or momentum[k] != before[k]
    return changed


@kernel
def _rattle(mass: np.ndarray) -> float:
    """Return a factor on n² passes, enough for n equal balls in a row: light balls rattle √(mass ratio) times."""
    least = most = mass[0]
    for k in range(mass.size):
        least, most = min(least, mass[k]), max(most, mass[k])
    return 4.0 * math.sqrt(most / least)


@kernel
def _fastest(machine: Machine, count: int) -> int:
    """Return the place of the row with the largest approach speed ``−∇gᵀv / ‖∇g‖_{M⁻¹}``; of equal ones, the first."""
    system, work = machine.system, machine.work
    largest, place = 0.0, -1
    for k in range(count):
        row = work.chosen[k]
        if work.approach[k] < -work.still[row]:
            square = weight(system.unilateral, row, work.normals, work.gradients, system.inverse)
            speed = -work.approach[k] / math.sqrt(square)
            if place < 0 or speed > (1.0 + _TIE) * largest:
                largest, place = speed, k
    return place


@kernel
def _select(machine: Machine, count: int, last: int) -> tuple[int, int, int]:
    """Examine all chosen rows, and put the rows to reflect off into ``work.pressing``.

    Returns the number of approaching rows, the place of the row that the sequential operator takes, and the number of
    taken rows.
    """
    system, method, work = machine.system, machine.method, machine.work
    chosen, approach, still, selected = work.chosen, work.approach, work.still, work.pressing
    violated, next_one, first_one = 0, -1, -1
    for k in range(count):
        approach[k] = rate(system.unilateral, chosen[k], work.normals, work.gradients, work.momentum, system.inverse)
        if approach[k] < -still[chosen[k]]:
            violated += 1
            first_one = k if first_one < 0 else first_one
            next_one = k if next_one < 0 and k > last else next_one
    if violated == 0:
        return 0, last, 0
    if method.operator == SEQUENTIAL or method.operator == FASTEST:
        next_one = next_one if next_one >= 0 else first_one
        last = _fastest(machine, count) if method.operator == FASTEST else next_one
        selected[0] = chosen[last]
        work.marked[selected[0]] += 1
        return violated, last, 1
    taken = 0
    for k in range(count):
        zero = still[chosen[k]]
        if approach[k] <= zero if method.operator == MOREAU else approach[k] < -zero:
            selected[taken] = chosen[k]
            work.marked[chosen[k]] += 1
            taken += 1
    return violated, last, taken


@unit(types.int64, MACHINE, types.int64)
def reflect(machine: Machine, count: int) -> int:
    """Turn ``work.momentum`` until none of the first `count` rows of ``work.chosen`` approaches.

    Each pass selects rows and reflects off them together: ``generalized`` selects the approaching contacts, ``moreau``
    all contacts that do not separate, and ``sequential`` one contact, the next approaching one in index order or the
    fastest. If the passes do not end, the rows of the last pass are the first ``work.report[4]`` of ``work.pressing``.
    """
    system, method, work, tally = machine.system, machine.method, machine.work, machine.tally
    momentum, dof = work.momentum, system.mass.size
    for k in range(count):
        work.marked[work.chosen[k]] = 0
        work.smooth[k] = -1
    limit = min(_MOST_PASSES, _PASSES + int(_rattle(system.mass) * float(count) ** 2))
    last, before_known = -1, False
    local = method.operator == GENERALIZED and system.other_unilateral == 0
    if local:
        _list_joints(machine, count)
    violated = groups = -1
    for passes in range(limit):
        if local and groups >= 0:
            violated = taken = _approaching(machine, groups, passes)
        else:
            violated, last, taken = _select(machine, count, last)
        if violated == 0:
            if passes == 0:
                skip(tally, REFLECTION)
            for k in range(count):
                work.struck[0] += work.marked[work.chosen[k]] > 0
            return DONE
        compared = dof <= _SMALL or passes >= limit // 2
        if compared:
            for k in range(dof):
                work.free_momentum[k] = momentum[k]
        code, groups = _pass(machine, taken)
        if code != DONE:
            return code
        if compared and _changed(momentum, work.free_momentum):
            # `before` is the momentum of two passes ago; what comes back to it will do so for ever.
            change = size = 0.0
            for k in range(dof):
                change += (momentum[k] - work.before[k]) ** 2 * system.inverse[k]
                size += momentum[k] ** 2 * system.inverse[k]
            if before_known and math.sqrt(change) <= _SAME * math.sqrt(size):
                work.report[0], work.report[4] = count, taken
                return NO_DIRECTION
            for k in range(dof):
                work.before[k] = work.free_momentum[k]
            before_known = True
    work.report[0], work.report[1], work.report[2] = violated, count, limit
    work.report[3], work.report[4] = work.approach[0], taken
    for k in range(count):
        work.report[3] = min(work.report[3], work.approach[k])
    return TOO_MANY_PASSES
