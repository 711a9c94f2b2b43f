"""Contact islands: bodies that rows connect, directly or through other bodies."""

import numpy as np
from numba import types

from deli.kernels.compiled import kernel, unit
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.system import System
from deli.kernels.work import Islands


@kernel
def _root(parent: np.ndarray, body: int) -> int:
    while parent[body] != body:
        parent[body] = parent[parent[body]]
        body = parent[body]
    return body


@kernel
def _gather(label: np.ndarray, islands: Islands, groups: int, rows: np.ndarray, count: int, system: System) -> None:
    """Sort bodies and rows by label, by counting."""
    body_start, row_start, held_start = islands.body_start, islands.row_start, islands.held_start
    first, held_first = system.unilateral.first, system.bilateral.first
    for body in range(label.size):
        if label[body] >= 0:
            body_start[label[body] + 1] += 1
    for k in range(count):
        row_start[label[first[rows[k]]] + 1] += 1
    for row in range(held_first.size):
        if label[held_first[row]] >= 0:
            held_start[label[held_first[row]] + 1] += 1
    for group in range(groups):
        body_start[group + 1] += body_start[group]
        row_start[group + 1] += row_start[group]
        held_start[group + 1] += held_start[group]
    # Filling moves each start to its group's end, which is the next group's start; it is moved back after.
    for body in range(label.size):
        group = label[body]
        if group >= 0:
            islands.bodies[body_start[group]] = body
            body_start[group] += 1
    for k in range(count):
        group = label[first[rows[k]]]
        islands.rows[row_start[group]] = rows[k]
        row_start[group] += 1
    for row in range(held_first.size):
        group = label[held_first[row]]
        if group >= 0:
            islands.held[held_start[group]] = row
            held_start[group] += 1
    for group in range(groups, 0, -1):
        body_start[group] = body_start[group - 1]
        row_start[group] = row_start[group - 1]
        held_start[group] = held_start[group - 1]
    body_start[0] = row_start[0] = held_start[0] = 0
    for group in range(groups):
        for k in range(body_start[group], body_start[group + 1]):
            islands.place[islands.bodies[k]] = k - body_start[group]


@kernel
def _connect_touched(machine: Machine, count: int) -> int:
    """Group bodies as `connect` does, by chosen rows alone: the time does not grow with the number of other bodies."""
    islands, rows, table = machine.islands, machine.work.pressing, machine.system.unilateral
    parent, label, touched = islands.parent, islands.label, islands.touched
    last = touched.size - 1
    for k in range(touched[last]):
        label[touched[k]] = -1
    number = 0
    for k in range(count):
        for end in range(2):
            body = table.first[rows[k]] if end == 0 else table.second[rows[k]]
            if body >= 0 and label[body] < 0:
                label[body] = 0
                parent[body] = body
                touched[number] = body
                number += 1
    touched[last] = number
    for k in range(count):
        if table.second[rows[k]] >= 0:
            one, two = _root(parent, table.first[rows[k]]), _root(parent, table.second[rows[k]])
            parent[max(one, two)] = min(one, two)
    body_start, row_start = islands.body_start, islands.row_start
    groups = 0
    for k in range(number):
        if parent[touched[k]] == touched[k]:
            label[touched[k]] = groups
            groups += 1
            body_start[groups] = row_start[groups] = islands.held_start[groups] = 0
    for k in range(number):
        label[touched[k]] = label[_root(parent, touched[k])]
        body_start[label[touched[k]] + 1] += 1
    for k in range(count):
        row_start[label[table.first[rows[k]]] + 1] += 1
    for group in range(groups):
        body_start[group + 1] += body_start[group]
        row_start[group + 1] += row_start[group]
    for k in range(number):
        group = label[touched[k]]
        islands.bodies[body_start[group]] = touched[k]
        body_start[group] += 1
    for k in range(count):
        group = label[table.first[rows[k]]]
        islands.rows[row_start[group]] = rows[k]
        row_start[group] += 1
    for group in range(groups, 0, -1):
        body_start[group], row_start[group] = body_start[group - 1], row_start[group - 1]
    body_start[0] = row_start[0] = 0
    for group in range(groups):
        for k in range(body_start[group], body_start[group + 1]):
            islands.place[islands.bodies[k]] = k - body_start[group]
    return groups


@unit(types.int64, MACHINE, types.int64, types.boolean, types.boolean)
def connect(machine: Machine, count: int, all_held: bool, whole: bool) -> int:
    """Group bodies by the first `count` of ``work.pressing`` and by bilateral constraints; return the number of groups.

    Bodies that no chosen row touches are left out, and so are those on bilateral constraints alone unless
    `all_held`. With `whole`, everything is one group. Groups are numbered by their lowest body; in each, bodies,
    rows and bilateral rows (`held`) keep their order.
    """
    system, islands, rows = machine.system, machine.islands, machine.work.pressing
    bodies, held = system.component.size, system.bilateral.kind.size
    parent, label = islands.parent, islands.label
    if held == 0 and not whole:
        return _connect_touched(machine, count)
    if whole:
        islands.body_start[1], islands.row_start[1], islands.held_start[1] = bodies, count, held
        for body in range(bodies):
            islands.bodies[body] = body
            islands.place[body] = body
        for k in range(count):
            islands.rows[k] = rows[k]
        for row in range(held):
            islands.held[row] = row
        return 1
    for body in range(bodies):
        parent[body] = system.component[body]
        label[body] = -1
    table = system.unilateral
    for k in range(count):
        one = _root(parent, table.first[rows[k]])
        if table.second[rows[k]] >= 0:
            two = _root(parent, table.second[rows[k]])
            parent[max(one, two)] = min(one, two)
    for k in range(count):
        label[_root(parent, table.first[rows[k]])] = 0
    if all_held:
        for row in range(held):
            label[_root(parent, system.bilateral.first[row])] = 0
    groups = 0
    for body in range(bodies):
        if parent[body] == body and label[body] == 0:
            label[body] = groups
            islands.body_start[groups + 1] = 0
            islands.row_start[groups + 1] = 0
            islands.held_start[groups + 1] = 0
            groups += 1
    for body in range(bodies):
        label[body] = label[_root(parent, body)]
    _gather(label, islands, groups, rows, count, system)
    return groups
