"""Rows of a run, on their way from a stepper to a file or to memory."""

from typing import Protocol

import numpy as np

from deli.integrators.discrete_smooth import DiscreteSmooth
from deli.mechanics.scene import Scene
from deli.recording.schema import STATS, Groups, Schema
from deli.recording.subproblems import LEFT_OUT, pack
from deli.recording.variable import Block
from deli.subproblems.collector import Collector
from deli.subproblems.stats import COUNTS, RESIDUALS, TIMES

BLOCK_ROWS = 256
MOST_ROWS = 8192
BLOCK_BYTES = 32_000_000
STAT_NAMES = (*COUNTS, *TIMES, *RESIDUALS, "status")


class Sink(Protocol):
    """A receiver of rows, in order."""

    def write(self, first_row: int, trajectory: Block, stats: Block, problems: Block | None = None) -> None:
        """Keep rows `first_row`, `first_row` + 1, ... and the steps that lead to them (none leads to row 0).

        `problems` are the subproblems of these steps, where they are recorded.
        """


class Memory:
    """A sink that keeps rows in memory."""

    def __init__(self) -> None:
        self._blocks: list[tuple[Block, Block, Block]] = []

    def write(self, first_row: int, trajectory: Block, stats: Block, problems: Block | None = None) -> None:
        """Keep rows, see `Sink`."""
        self._blocks.append((trajectory, stats, problems or {}))

    def collect(self, schema: Schema) -> Groups:
        """Return all rows, in the form in which a file is read."""
        constants = schema.constants()
        groups: Groups = {}
        for index, (group, variables) in enumerate(schema.groups.items()):
            blocks = [block[index] for block in self._blocks]
            groups[group] = {}
            for variable in variables:
                name = variable.name
                if variable.grows:
                    values = np.concatenate([block[name] for block in blocks])
                else:
                    last = blocks[-1] if blocks else {}
                    values = last[name] if name in last else constants[group][name]
                groups[group][name] = (variable.dims, values, variable.attributes)
        return groups


class Recorder:
    """The buffer for the rows of a stepper, which hands them to a sink.

    Parameters
    ----------
    scene : Scene
    step_size : float
    sink : Sink
    first_row : int
        Number of rows that earlier sessions have recorded.
    memory : tuple of str
        Names of the quantities besides q and p that the method carries from step to step.
    collector : Collector, optional
        The holder of the subproblems to record.

    Attributes
    ----------
    block : Record
        The record into which a stepper writes its rows.
    """

    def __init__(
        self,
        scene: Scene,
        step_size: float,
        sink: Sink,
        first_row: int = 0,
        memory: tuple[str, ...] = (),
        collector: Collector | None = None,
    ) -> None:
        from deli.kernels.advance import make_block  # the import compiles kernels

        self._scene = scene
        self._step_size = step_size
        self._sink = sink
        self._first_row = first_row
        self._remembered = memory
        self._collector = collector
        self._dtypes = {variable.name: variable.dtype for variable in Schema(scene.dof, scene.dimension).groups[STATS]}
        rows = int(np.clip(BLOCK_BYTES // (16 * scene.dof), 1, MOST_ROWS))
        self.block = make_block(rows, scene.dof, scene.dimension, len(memory))

    @property
    def buffered(self) -> int:
        """Number of rows that the sink has not received yet."""
        return int(self.block.fields.progress[1])

    @property
    def full(self) -> bool:
        """Whether there is no room for another row."""
        return self.buffered == len(self.block.fields.steps)

    @property
    def rows(self) -> int:
        """Number of all rows, those of earlier sessions included."""
        return self._first_row + self.buffered

    @property
    def last_step(self) -> int:
        """The step that leads to the last buffered row."""
        return int(self.block.fields.steps[self.buffered - 1])

    def flush(self, last: bool = False) -> None:
        """Hand all buffered rows to the sink, and the subproblems of the steps that lead to them.

        With `last`, hand over the subproblems of later steps too, which lead to no row.
        """
        count, block = self.buffered, self.block.fields
        problems = self._problems(last)
        if not count and not (problems and len(problems["step"])):
            return
        trajectory: Block = {
            "time": block.steps[:count] * self._step_size,
            "position": block.position[:count].copy(),
            "momentum": block.momentum[:count].copy(),
            **{name: block.memory[:count, k].copy() for k, name in enumerate(self._remembered)},
            **named_diagnostics(block.diagnostics[:count].copy(), self._scene.dimension),
            "smooth_contacts": block.contacts[:count, 0].copy(),
            "reflected_contacts": block.contacts[:count, 1].copy(),
        }
        first = 1 if self._first_row == 0 else 0  # no step leads to the initial state
        columns = [*np.moveaxis(block.counts, 1, 0), *np.moveaxis(block.times, 1, 0)]
        columns += [*np.moveaxis(block.residuals, 1, 0), block.status]
        stats = {
            name: values[first:count].astype(self._dtypes[name])
            for name, values in zip(STAT_NAMES, columns, strict=True)
        }
        stats["step"] = np.arange(max(self._first_row - 1, 0), self.rows - 1)
        self._sink.write(self._first_row, trajectory, stats, problems)
        self._first_row += count
        block.progress[1] = 0

    def _problems(self, last: bool) -> Block | None:
        if self._collector is None:
            return None
        steps = None if last else self.last_step if self.buffered else 0
        return pack(self._collector.release(steps)) | {LEFT_OUT: np.array(self._collector.left_out)}


def named_diagnostics(columns: np.ndarray, dimension: int) -> Block:
    """Return diagnostics of rows by name, as views of the columns that kernels write, shape (..., columns)."""
    kinetic, potential, gap, mismatch = (columns[..., k] for k in range(4))
    with np.errstate(invalid="ignore"):  # energies of either sign may overflow; `deli check` finds the row
        total = kinetic + potential
    values = {
        "hamiltonian": total,
        "kinetic_energy": kinetic,
        "potential_energy": potential,
        "linear_momentum": columns[..., 4 : 4 + dimension],
        "gap_min": gap,
        "equality_residual": mismatch,
    }
    if dimension > 1:
        angular = columns[..., 4 + dimension :]
        values["angular_momentum"] = angular[..., 0] if dimension == 2 else angular
    return values


def diagnose(scene: Scene, q: np.ndarray, p: np.ndarray) -> Block:
    """Return energies, momenta, the smallest gap and the equality residual of states q, p of shape (rows, dof)."""
    stepper = DiscreteSmooth("verlet").stepper(scene, 1.0)
    return named_diagnostics(stepper.diagnose(q, p), scene.dimension)
