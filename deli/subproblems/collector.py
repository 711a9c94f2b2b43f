"""The collector of the subproblems that solvers get during a run."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.posed import PosedSubproblem

if TYPE_CHECKING:
    from deli.kernels.program import Program

MOST = 10_000
MOST_BYTES = 256_000_000


class Collector:
    """A store of the subproblems that solvers get, up to a largest number and size.

    Parameters
    ----------
    most : int
        Largest number of subproblems to keep; later ones are only counted.
    kept, left_out, size : int
        Numbers of subproblems that earlier sessions have kept and left out, and the bytes of the kept ones.

    Attributes
    ----------
    left_out : int
        Number of subproblems that were not kept, because there were enough or they took `MOST_BYTES`.
    """

    def __init__(self, most: int = MOST, kept: int = 0, left_out: int = 0, size: int = 0) -> None:
        self.left_out = left_out
        self._most, self._kept, self._size = most, kept, size
        self._held: list[PosedSubproblem] = []
        self._posed: PosedSubproblem | None = None
        self._progress = np.full(2, -1, dtype=np.int64)
        self._begin_step(-1)

    def follow(self, progress: np.ndarray) -> None:
        """Read the number of steps that a run has taken from the first entry of this array."""
        self._progress = progress

    def pose(self, subproblem: int, newton: bool, program: "Program", size: int, equalities: int, rows: int) -> None:
        """Take the subproblem in `program`, which a solver is about to get."""
        if self._progress[0] != self._step:
            self._begin_step(int(self._progress[0]))
        number = self._solves[subproblem]
        self._solves[subproblem] += 1
        if self._kept >= self._most or self._size >= MOST_BYTES:
            self.left_out += 1
            return
        entries = int(program.start[rows])
        self._posed = PosedSubproblem(
            subproblem=subproblem,
            step=self._step,
            solve=number,
            equalities=equalities,
            start=program.start[: rows + 1].copy(),
            column=program.column[:entries].copy(),
            value=program.value[:entries].copy(),
            bounds=program.bounds[:rows].copy(),
            wish=program.wish[:size].copy(),
            metric=program.metric[:size, :size].copy() if newton else None,
            z=np.full(size, np.nan),
            y=np.full(rows, np.nan),
        )

    def take_answer(self, program: "Program", good: bool) -> None:
        """Take the answer to the last posed subproblem, if it was kept."""
        posed, self._posed = self._posed, None
        if posed is None:
            return
        if good:
            posed = replace(posed, z=program.z[: posed.variables].copy(), y=program.y[: posed.rows].copy())
        self._held.append(posed)
        self._kept += 1
        self._size += posed.bytes

    def forget_step(self) -> None:
        """Forget the subproblems of the current step, because the step begins anew."""
        if self._progress[0] != self._step:
            return
        while self._held and self._held[-1].step == self._step:
            self._kept -= 1
            self._size -= self._held.pop().bytes
        self.left_out = self._left_out_before
        self._begin_step(self._step)

    def release(self, steps: int | None = None) -> list[PosedSubproblem]:
        """Return the subproblems of the first `steps` steps of the run, by default all, and hold them no longer."""
        count = len(self._held)
        while steps is not None and count and self._held[count - 1].step >= steps:
            count -= 1
        released, self._held = self._held[:count], self._held[count:]
        return released

    def _begin_step(self, step: int) -> None:
        self._step, self._solves, self._left_out_before = step, [0, 0, 0], self.left_out
