"""Many steps at once, with the recorded rows of a run."""

import math
from typing import Annotated, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from deli.kernels.arrays import Matrix, Numbers
from deli.kernels.codes import BILATERAL, DONE, LEAST_GAP
from deli.kernels.compiled import address_of, call, kernel, seconds, unit
from deli.kernels.contacts import approached, find_gaps, strayed
from deli.kernels.forces import ask, energy
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.record import Record, RecordType
from deli.kernels.rows import value
from deli.kernels.tally import reset


class Block(NamedTuple):
    """Rows of a run, in the order of their times.

    Attributes
    ----------
    progress : (2,) int64 array
        Number of steps that the run has taken, and number of filled rows of the block.
    steps : (rows,) int64 array
        Number of steps of the run before each row.
    position, momentum : (rows, dof) arrays
    memory : (rows, names, dof) array
        Arrays that the method carries besides q and p, see `Work`.
    diagnostics : (rows, columns) array
        Kinetic and potential energy, least gap, equality residual, linear momentum, angular momentum.
    counts : (rows, 7, 3) int64 array
    times : (rows, 2, 3) array
    residuals : (rows, 3, 3) array
    status : (rows, 3) int64 array
    contacts : (rows, 2) int64 array
        As in `Tally`; `counts` to `status` have no rows if they are not recorded.
    """

    progress: Numbers
    steps: Numbers
    position: Matrix
    momentum: Matrix
    memory: Annotated[NDArray[np.float64], 3]
    diagnostics: Matrix
    counts: Annotated[NDArray[np.int64], 3]
    times: Annotated[NDArray[np.float64], 3]
    residuals: Annotated[NDArray[np.float64], 3]
    status: Annotated[NDArray[np.int64], 2]
    contacts: Annotated[NDArray[np.int64], 2]


BLOCK = RecordType(Block)


def make_block(rows: int, dof: int, dimension: int, memory: int = 0) -> Record:
    """Return an empty block; `memory` is the number of arrays that the method carries besides q and p."""
    angular = {1: 0, 2: 1, 3: 3}[dimension]
    return Record(
        BLOCK,
        Block(
            progress=np.zeros(2, dtype=np.int64),
            steps=np.zeros(rows, dtype=np.int64),
            position=np.zeros((rows, dof)),
            momentum=np.zeros((rows, dof)),
            memory=np.zeros((rows, memory, dof)),
            diagnostics=np.zeros((rows, 4 + dimension + angular)),
            counts=np.zeros((rows, 7, 3), dtype=np.int64),
            times=np.zeros((rows, 2, 3)),
            residuals=np.zeros((rows, 3, 3)),
            status=np.zeros((rows, 3), dtype=np.int64),
            contacts=np.zeros((rows, 2), dtype=np.int64),
        ),
    )


@kernel
def diagnose(machine: Machine, out: np.ndarray) -> int:
    """Write energies, least gap, equality residual, linear and angular momentum of one state, see `Block`."""
    system, work, mail = machine.system, machine.work, machine.mail
    dimension = system.dimension
    kinetic = 0.0
    for k in range(work.p.size):
        kinetic += work.p[k] * work.p[k] / system.mass[k]
    out[0] = 0.5 * kinetic
    code, out[1] = energy(machine, work.q)
    if code != DONE:
        return code
    least = math.inf
    for k in range(work.gaps.size):
        least = min(least, work.gaps[k]) if work.gaps[k] == work.gaps[k] else math.nan
    out[2] = least
    if system.reference.size and not least < system.reach - approached(machine, work.q):
        code = ask(machine, LEAST_GAP, work.q)
        if code != DONE:
            return code
        out[2] = min(least, mail.energy[0])
    elif work.gaps.size == 0:
        out[2] = math.nan
    held = system.bilateral.kind.size
    out[3] = math.nan if held == 0 else 0.0
    if held and system.other_bilateral:
        code = ask(machine, BILATERAL, work.q)
        if code != DONE:
            return code
    for k in range(held):
        out[3] = max(out[3], abs(value(system.bilateral, k, work.q, mail.bilateral)))
    for k in range(4, out.size):
        out[k] = 0.0
    for body in range(system.component.size):
        begin = body * dimension
        for axis in range(dimension):
            out[4 + axis] += work.p[begin + axis]
        if dimension == 2:
            out[6] += work.q[begin] * work.p[begin + 1] - work.q[begin + 1] * work.p[begin]
        elif dimension == 3:
            for axis in range(3):
                one, two = begin + (axis + 1) % 3, begin + (axis + 2) % 3
                out[7 + axis] += work.q[one] * work.p[two] - work.q[two] * work.p[one]
    return DONE


@kernel
def record(machine: Machine, block: Block) -> int:
    """Write the next row, and begin to count anew; ``work.gaps`` holds g(q)."""
    work, tally, row = machine.work, machine.tally, block.progress[1]
    block.steps[row] = block.progress[0]
    for k in range(work.q.size):
        block.position[row, k] = work.q[k]
        block.momentum[row, k] = work.p[k]
        for name in range(block.memory.shape[1]):
            block.memory[row, name, k] = work.memory[name, k]
    for subproblem in range(tally.status.size if block.status.shape[0] > 0 else 0):
        for k in range(tally.counts.shape[0]):
            block.counts[row, k, subproblem] = tally.counts[k, subproblem]
        for k in range(2):
            block.times[row, k, subproblem] = tally.times[k, subproblem]
        for k in range(3):
            block.residuals[row, k, subproblem] = tally.residuals[k, subproblem]
        block.status[row, subproblem] = tally.status[subproblem]
    block.contacts[row, 0], block.contacts[row, 1] = tally.contacts[0], tally.contacts[1]
    code = diagnose(machine, block.diagnostics[row])
    if code == DONE:
        block.progress[1] += 1
        reset(tally)
    return code


@unit(types.int64, MACHINE, BLOCK)
def record_state(machine: Machine, block: Block) -> int:
    """Write a row of a state with unknown gaps."""
    code = find_gaps(machine, machine.work.q, machine.work.gaps)
    return record(machine, block) if code == DONE else code


@unit(types.int64, MACHINE, BLOCK, types.int64, types.int64, types.float64)
def advance(machine: Machine, block: Block, steps: int, every: int, deadline: float) -> int:
    """Advance (``work.q``, ``work.p``) until the run has `steps` steps, the block is full or `deadline` has passed.

    A row is written after every `every`-th step of the run and after the last.
    """
    work, hooks, progress = machine.work, machine.hooks, block.progress
    known = 0
    while progress[0] < steps and progress[1] < block.position.shape[0]:
        code = call(hooks.step, address_of(machine), known, 0, 0)
        if code != DONE:
            return code
        known = 1
        for k in range(work.q.size):
            work.q[k] = work.moved[k]
            work.p[k] = work.carried[k]
            for name in range(work.memory.shape[0]):
                work.memory[name, k] = work.remembered[name, k]
        for row in range(work.gaps.size):
            work.gaps[row] = work.gaps_moved[row]
        progress[0] += 1
        if progress[0] % every == 0 or progress[0] == steps:
            code = record(machine, block)
            if code != DONE:
                return code
        if hooks.clock != 0 and seconds(hooks.clock, work.ticks) > deadline:
            break
    return DONE


@unit(types.int64, MACHINE)
def has_strayed(machine: Machine) -> int:
    """Return whether neighbours must be searched anew around the state."""
    return 1 if strayed(machine, machine.work.q) else 0
