"""Rows of a run: gathered one by one, given their diagnostics block by block."""

from typing import Protocol

import numpy as np

from deli.mechanics import energies, symmetry
from deli.mechanics.scene import Scene
from deli.recording.schema import STATS, Block, Groups, Schema
from deli.subproblems.choices import SUBPROBLEMS
from deli.subproblems.stats import COUNTS, RESIDUALS, TIMES, StepStats

BLOCK_ROWS = 256
STAT_NAMES = (*COUNTS, *TIMES, *RESIDUALS, "status")


class Sink(Protocol):
    """Takes rows, in order."""

    def write(self, first_row: int, trajectory: Block, stats: Block) -> None:
        """Keep rows `first_row`, `first_row` + 1, ... and the steps that lead to them (none leads to row 0)."""


class Memory:
    """Keeps rows in memory."""

    def __init__(self) -> None:
        self._blocks: list[tuple[Block, Block]] = []

    def write(self, first_row: int, trajectory: Block, stats: Block) -> None:
        """Keep rows, see `Sink`."""
        self._blocks.append((trajectory, stats))

    def collect(self, schema: Schema) -> Groups:
        """All rows, as they would be read from a file."""
        constants = schema.constants()
        groups: Groups = {}
        for index, (group, variables) in enumerate(schema.groups.items()):
            blocks = [block[index] for block in self._blocks]
            groups[group] = {}
            for variable in variables:
                name = variable.name
                values = np.concatenate([block[name] for block in blocks]) if variable.grows else constants[group][name]
                groups[group][name] = (variable.dims, values, variable.attributes)
        return groups


class Recorder:
    """Gathers rows and hands them, with diagnostics, to a sink.

    Diagnostics are evaluated for `BLOCK_ROWS` rows at a time, at the row's own place in its block: the last bits of
    a batched sum depend on the shape of the batch, and a resumed run must not differ from an uninterrupted one.
    """

    def __init__(self, scene: Scene, sink: Sink, first_row: int = 0) -> None:
        self._scene = scene
        self._sink = sink
        self._first_row = first_row
        self._filled = 0
        dtypes = {variable.name: variable.dtype for variable in Schema(scene.dof, scene.dimension).groups[STATS]}
        self._trajectory: Block = {
            "time": np.zeros(BLOCK_ROWS),
            "position": np.zeros((BLOCK_ROWS, scene.dof)),
            "momentum": np.zeros((BLOCK_ROWS, scene.dof)),
            "smooth_contacts": np.zeros(BLOCK_ROWS, dtype=np.int64),
            "reflected_contacts": np.zeros(BLOCK_ROWS, dtype=np.int64),
        }
        self._stats: Block = {name: np.zeros((BLOCK_ROWS, len(SUBPROBLEMS)), dtype=dtypes[name]) for name in STAT_NAMES}

    @property
    def buffered(self) -> int:
        """Rows that the sink has not got yet."""
        return self._filled

    @property
    def rows(self) -> int:
        """Rows in total, those of earlier sessions included."""
        return self._first_row + self._filled

    def add(self, time: float, q: np.ndarray, p: np.ndarray, stats: StepStats | None) -> None:
        """Append a row; `stats` of the steps that lead to it, None for the initial state."""
        row = self._filled
        if row == len(self._trajectory["time"]):
            self._trajectory = {name: _doubled(values) for name, values in self._trajectory.items()}
            self._stats = {name: _doubled(values) for name, values in self._stats.items()}
        trajectory = self._trajectory
        trajectory["time"][row] = time
        trajectory["position"][row] = q
        trajectory["momentum"][row] = p
        trajectory["smooth_contacts"][row] = 0 if stats is None else stats.smooth_contacts
        trajectory["reflected_contacts"][row] = 0 if stats is None else stats.reflected_contacts
        if stats is not None:
            for name, values in self._stats.items():
                values[row] = getattr(stats, name)
        self._filled = row + 1

    def flush(self) -> None:
        """Hand all buffered rows to the sink."""
        if not self._filled:
            return
        trajectory = {name: values[: self._filled].copy() for name, values in self._trajectory.items()}
        trajectory |= diagnose_rows(self._scene, self._first_row, trajectory["position"], trajectory["momentum"])
        first_step = 1 if self._first_row == 0 else 0
        stats = {name: values[first_step : self._filled].copy() for name, values in self._stats.items()}
        stats["step"] = np.arange(max(self._first_row - 1, 0), self.rows - 1)
        self._sink.write(self._first_row, trajectory, stats)
        self._first_row += self._filled
        self._filled = 0


def _doubled(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values, np.zeros_like(values)])


def diagnose(scene: Scene, q: np.ndarray, p: np.ndarray) -> Block:
    """Energies, momenta, the smallest gap and the equality residual of states q, p of shape (rows, dof)."""
    values = {
        "hamiltonian": energies.hamiltonian(scene, q, p),
        "kinetic_energy": energies.kinetic_energy(scene, p),
        "potential_energy": scene.potential.energy(q),
        "linear_momentum": symmetry.linear_momentum(scene, p),
    }
    angular = symmetry.angular_momentum(scene, q, p)
    if angular is not None:
        values["angular_momentum"] = angular
    missing = np.full(len(q), np.nan)
    values["gap_min"] = scene.unilateral.value(q).min(axis=-1) if scene.unilateral.rows else missing
    values["equality_residual"] = np.abs(scene.bilateral.value(q)).max(axis=-1) if scene.bilateral.rows else missing
    return {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}


def diagnose_rows(scene: Scene, first_row: int, q: np.ndarray, p: np.ndarray) -> Block:
    """Diagnostics of rows `first_row`, `first_row` + 1, ... to the same bits whichever rows come along."""
    pieces: list[Block] = []
    done = 0
    while done < len(q):
        place = (first_row + done) % BLOCK_ROWS
        count = min(BLOCK_ROWS - place, len(q) - done)
        block_q = np.tile(q[done], (BLOCK_ROWS, 1))
        block_p = np.tile(p[done], (BLOCK_ROWS, 1))
        block_q[place : place + count] = q[done : done + count]
        block_p[place : place + count] = p[done : done + count]
        block = diagnose(scene, block_q, block_p)
        pieces.append({name: values[place : place + count] for name, values in block.items()})
        done += count
    return {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
