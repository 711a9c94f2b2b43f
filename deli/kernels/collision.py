"""Collision integrators: a step that is cut where it meets constraints (Kaufman and Pai 2012, section 1.3.2)."""

import math

from numba import types

from deli.kernels.codes import ACCUMULATED, DONE, POSITION, REFLECTION, UNBALANCED
from deli.kernels.compiled import find_root, kernel, unit
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
from deli.kernels.fractions import energy_after, gap_after, take
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.reflection import reflect
from deli.kernels.rows import normal
from deli.kernels.tally import skip

_ROUNDING = 2.0**-52
_INSTANT = 4 * _ROUNDING  # part of a step that is none
_STILL = (
    1e-12  # as `deli.kernels.contacts.velocity_zeros` takes it: nothing else keeps a slow contact from being violated
)
_EVENTS, _EVENTS_OF_A_BODY = 1000, 10  # in one step
_STOP = 0.5  # share of a reflection's impulse that leaves no normal velocity
_NEAR, _FAR = 2.0**-6, 2.0**10  # how far from 1 such a share is sought


@kernel
def _first_violated(machine: Machine) -> int:
    """Return the row, of those that the fraction at hand violates, that is met first on straight lines; -1 for none."""
    work, scale = machine.work, machine.system.gap_scale
    first, least = -1, math.inf
    for row in range(scale.size):
        after = work.gaps_moved[row]
        if after < -VIOLATED * scale[row]:
            before = max(work.gaps[row], 0.0)
            if before / (before - after) < least:
                first, least = row, before / (before - after)
    return first


@kernel
def _locate(machine: Machine, row: int, span: float, h: float) -> tuple[int, float]:
    """Return a code and the time at which a row is met, within a fraction that violates it.

    A row that touches at the start has opened: it is met again after the longest part in which it is open, which is
    sought by halving.
    """
    work = machine.work
    work.meeting[0], work.meeting[2] = row, DONE
    low, high = 0.0, span
    if work.gaps[row] <= VIOLATED * machine.system.gap_scale[row]:
        low = 0.5 * span
        while not gap_after(low, machine) > 0.0:
            if work.meeting[2] != DONE:
                return work.meeting[2], 0.0
            low, high = 0.5 * low, low
            if low <= _INSTANT * h:
                return ACCUMULATED, 0.0
    root = find_root(machine.hooks.root, gap_after, machine, low, high, _ROUNDING * h, _INSTANT)
    return work.meeting[2], root


@kernel
def _find_event(machine: Machine, row: int, rest: float, h: float) -> tuple[int, float]:
    """Return a code and the time of the first event, given a row that the rest of the step violates; move there."""
    work, span = machine.work, rest
    for _ in range(machine.system.unilateral.kind.size):
        code, span = _locate(machine, row, span, h)
        if code == DONE:
            code = take(machine, span, True)
        if code == DONE:
            code = find_gaps(machine, work.moved, work.gaps_moved)
        if code != DONE:
            return code, span
        row = _first_violated(machine)
        if row < 0:
            break
    return DONE, span


@kernel
def _balance(machine: Machine) -> int:
    """Scale the impulse so that the discrete energy is conserved: by the root nearest 1."""
    work = machine.work
    work.meeting[2] = DONE
    excess = energy_after(1.0, machine)
    other, low, high, reach = excess, 1.0, 1.0, _NEAR
    while work.meeting[2] == DONE and (other > 0.0) == (excess > 0.0):
        if low == _STOP or high > _FAR:
            return UNBALANCED
        if excess > 0.0:
            low, high = max(_STOP, 1.0 - reach), low
            other = energy_after(low, machine)
        else:
            low, high = high, 1.0 + reach
            other = energy_after(high, machine)
        reach *= 2.0
    if work.meeting[2] != DONE:
        return work.meeting[2]
    share = find_root(machine.hooks.root, energy_after, machine, low, high, _ROUNDING, _INSTANT)
    for k in range(work.q.size):
        work.event_momentum[k] = work.incoming[k] + share * work.impulse[k]
    return work.meeting[2]


@kernel
def _meet(machine: Machine, rest: float, h: float) -> int:
    """Reflect the momentum at an event off all contacts that touch and approach."""
    system, method, work = machine.system, machine.method, machine.work
    for k in range(work.q.size):
        work.q[k] = work.event[k]
        work.p[k] = work.incoming[k] = work.momentum[k] = work.event_momentum[k]
    count = 0
    for row in range(system.unilateral.kind.size):
        if work.gaps[row] <= method.contact_tolerance * system.gap_scale[row]:
            work.chosen[count] = row
            count += 1
            normal(system.unilateral, row, work.q, work.normals)
    code = gradients_here(machine, system.bilateral.kind.size, work.q)
    if code == DONE:
        code = gradient(machine, work.q, work.force)
    if code != DONE:
        return code
    for k in range(work.q.size):
        work.force[k] *= -0.5 * h
    velocity_zeros(machine, work.p, count, _STILL)
    code = reflect(machine, count)
    if code != DONE:
        return code
    turned = False
    for k in range(work.q.size):
        work.event_momentum[k] = work.momentum[k]
        work.impulse[k] = work.momentum[k] - work.incoming[k]
        turned = turned or work.impulse[k] != 0.0
    if turned and method.order == 4:
        work.meeting[1] = 1
    if not (turned and method.discrete):
        return DONE
    work.balance[0], work.balance[2] = rest, work.balance[1]
    return _balance(machine)


@kernel
def _collide(machine: Machine, h: float) -> int:
    """Take fractions of the step from event to event, and keep ``work.gaps`` up to date."""
    system, method, work = machine.system, machine.method, machine.work
    rest, events, met = h, 0, False
    most = _EVENTS + _EVENTS_OF_A_BODY * system.component.size
    work.meeting[0], work.meeting[1] = -1, 0
    for row in range(system.unilateral.kind.size):
        if work.gaps[row] <= VIOLATED * system.gap_scale[row]:
            met = True
            work.meeting[0] = row
    work.report[0], work.report[1], work.report[2] = work.meeting[0], 0, 0.0
    if met:
        code = take(machine, 0.0, True)
        if code == DONE:
            code = _meet(machine, rest, h)
        if code != DONE:
            return code
    while True:
        code = take(machine, rest, True)
        if code == DONE:
            if strayed(machine, work.moved):
                return begin_anew(machine)
            code = find_gaps(machine, work.moved, work.gaps_moved)
        if code != DONE:
            return code
        row = _first_violated(machine)
        if row < 0:
            break
        if method.order == 4 and work.meeting[1] == 0:
            work.meeting[1] = 1
            continue
        code, span = _find_event(machine, row, rest, h)
        if code == DONE and (events == most or span <= _INSTANT * h):
            code = ACCUMULATED
        rest = rest - span if rest - span > _INSTANT * h else 0.0
        work.report[0], work.report[1], work.report[2] = work.meeting[0], events, h - rest
        if code != DONE:
            return code
        events += 1
        for k in range(work.q.size):
            work.event[k] = work.moved[k]
            work.event_momentum[k] = work.carried[k]
        for row in range(work.gaps.size):
            work.gaps[row] = work.gaps_moved[row]
        code = _meet(machine, rest, h)
        if code != DONE:
            return code
    if events == 0 and not met:
        skip(machine.tally, REFLECTION)
    if system.bilateral.kind.size == 0 and method.skip:
        skip(machine.tally, POSITION)
    return DONE


@unit(types.int64, MACHINE, *(types.int64,) * 3, needs=(take, gap_after, energy_after))
def collide(machine: Machine, known: int, _one: int, _two: int) -> int:
    """Write the state one step after (``work.q``, ``work.p``), as `deli.kernels.step.step` does."""
    work = machine.work
    code = begin(machine, known)
    if code != DONE:
        return code
    h = work.span[0]
    for k in range(work.q.size):
        work.start[k] = work.event[k] = work.q[k]
        work.start_momentum[k] = work.event_momentum[k] = work.p[k]
    code = _collide(machine, h)
    work.span[0] = h
    for k in range(work.q.size):
        work.q[k] = work.start[k]
        work.p[k] = work.start_momentum[k]
    return end(machine, 0) if code == DONE else code
