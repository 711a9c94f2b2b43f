"""What the subproblems of a step cost and how well they were solved."""

from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.choices import SUBPROBLEMS

if TYPE_CHECKING:
    from solvers import Solution

SKIPPED, SOLVED, INACCURATE, FAILED, UNUSED = 0, 1, 2, 3, 4
STATUS_MEANINGS = ("skipped", "solved", "inaccurate", "failed", "not_used")
_SEVERITY = (1, 2, 3, 4, 0)  # of each status above: what a step reports is the worst it met

COUNTS = ("solves", "skipped", "iterations", "rows", "fallbacks", "claimed", "verified")
TIMES = ("solve_time", "overhead_time")
RESIDUALS = ("primal_residual", "dual_residual", "complementarity")


class StepStats:
    """Statistics by subproblem (reflection, position, projection) since the last `reset`.

    They are of the work that was done: of all attempts at a step, those that a closed loop or a search for an event
    discards included, and of steps that failed. Contacts are those of the steps as they were taken. A step that begins
    anew because neighbours have to be searched farther counts once, so that a run has the same statistics wherever it
    is resumed.

    Attributes
    ----------
    solves, skipped, iterations, rows, fallbacks, claimed, verified : (3,) int64 arrays
        Solver calls, subproblems answered without one, the solver's iterations, constraint rows handed to it, members
        of a chain that failed before one succeeded, solves that the solver calls solved, and those whose recomputed
        residuals say so.
    solve_time, overhead_time : (3,) float64 arrays
        Seconds inside the solver, and in writing its data, reading its answer and checking it.
    primal_residual, dual_residual, complementarity : (3,) float64 arrays
        Largest scaled residuals, nan where none was measured. For the position update they are those of the
        nonlinear system (7.3, 7.4, 7.8) and not of the last convex program on the way to it.
    status : (3,) int64 array
        The worst that happened: an index into `STATUS_MEANINGS`.
    """

    def __init__(self) -> None:
        from deli.kernels.work import Tally  # loads the compiler, which the names above do without

        # Apart from what the steppers of other threads write to, which processors would keep from this one.
        counts, times, residuals, status, contacts = np.split(np.zeros(74, dtype=np.int64)[16:58], (21, 27, 36, 39))
        self.tally = Tally(
            counts.reshape(len(COUNTS), len(SUBPROBLEMS)),
            times.view(float).reshape(len(TIMES), len(SUBPROBLEMS)),
            residuals.view(float).reshape(len(RESIDUALS), len(SUBPROBLEMS)),
            status,
            contacts,
        )
        self.tally.residuals[:], self.tally.status[:] = np.nan, UNUSED
        self.solves, self.skipped, self.iterations, self.rows, self.fallbacks = self.tally.counts[:5]
        self.claimed, self.verified = self.tally.counts[5:]
        self.solve_time, self.overhead_time = self.tally.times
        self.primal_residual, self.dual_residual, self.complementarity = self.tally.residuals
        self.status = self.tally.status

    @property
    def smooth_contacts(self) -> int:
        """Size of the smooth set of the last step that was taken."""
        return int(self.tally.contacts[0])

    @property
    def reflected_contacts(self) -> int:
        """Contacts that took part in a reflection of a step that was taken, summed over reflections."""
        return int(self.tally.contacts[1])

    @property
    def native_solves(self) -> int:
        """Programs solved by compiled code, of all steps ever."""
        return int(self.tally.contacts[2])

    def reset(self) -> None:
        """Forget everything but the size of the smooth set."""
        tally = self.tally
        tally.counts[:], tally.times[:], tally.residuals[:], tally.status[:] = 0, 0.0, np.nan, UNUSED
        tally.contacts[1] = 0

    def add(self, subproblem: int, solution: "Solution", rows: int) -> None:
        """Count a call of a solver, whether it succeeded or not."""
        self.solves[subproblem] += 1
        self.iterations[subproblem] += solution.iterations
        self.rows[subproblem] += rows
        self.fallbacks[subproblem] += solution.fallbacks
        self.claimed[subproblem] += solution.claimed == "solved"
        self.verified[subproblem] += solution.ok
        self.solve_time[subproblem] += solution.setup_time + solution.solve_time
        self.overhead_time[subproblem] += solution.overhead_time
        self._worsen(subproblem, SOLVED if solution.ok else INACCURATE if solution.status == "inaccurate" else FAILED)

    def add_native(self, subproblem: int, iterations: int, rows: int, solve_time: float, overhead_time: float) -> None:
        """Count a program that was solved without a backend's adapter."""
        self.solves[subproblem] += 1
        self.iterations[subproblem] += iterations
        self.rows[subproblem] += rows
        self.claimed[subproblem] += 1
        self.verified[subproblem] += 1
        self.solve_time[subproblem] += solve_time
        self.overhead_time[subproblem] += overhead_time
        self._worsen(subproblem, SOLVED)

    def add_failure(self, subproblem: int, rows: int) -> None:
        """Count a program that a backend has no answer to, not even a bad one."""
        self.solves[subproblem] += 1
        self.rows[subproblem] += rows
        self._worsen(subproblem, FAILED)

    def measure(self, subproblem: int, primal: float, dual: float, complementarity: float) -> None:
        """Record residuals of a subproblem; the largest since the last reset are kept."""
        self.primal_residual[subproblem] = np.fmax(self.primal_residual[subproblem], primal)
        self.dual_residual[subproblem] = np.fmax(self.dual_residual[subproblem], dual)
        self.complementarity[subproblem] = np.fmax(self.complementarity[subproblem], complementarity)

    def _worsen(self, subproblem: int, status: int) -> None:
        if _SEVERITY[status] > _SEVERITY[self.status[subproblem]]:
            self.status[subproblem] = status
