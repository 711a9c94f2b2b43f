"""Statistics of the subproblems of a step: their cost and their residuals."""

from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.choices import SUBPROBLEMS

if TYPE_CHECKING:
    from solvers import Solution

SKIPPED, SOLVED, INACCURATE, FAILED, UNUSED = 0, 1, 2, 3, 4
STATUS_MEANINGS = ("skipped", "solved", "inaccurate", "failed", "not_used")
_SEVERITY = (1, 2, 3, 4, 0)  # of each status above: a step reports the worst one

COUNTS = ("solves", "skipped", "iterations", "rows", "fallbacks", "claimed", "verified")
TIMES = ("solve_time", "overhead_time")
RESIDUALS = ("primal_residual", "dual_residual", "complementarity")


class StepStats:
    """Statistics by subproblem (reflection, position, projection) since the last `reset`.

    They count all work: all attempts at a step, including those that a closed loop or a search for an event discards,
    and steps that failed. Contacts are counted in taken steps only. A step that begins anew because neighbours are
    searched farther counts once, so that a resumed run has the same statistics.

    Attributes
    ----------
    solves, skipped, iterations, rows, fallbacks, claimed, verified : (3,) int64 arrays
        Solver calls, subproblems answered without a solver, iterations of solvers, constraint rows handed to solvers,
        members of a chain that failed before one succeeded, solves that the solver reports as solved, and solves whose
        recomputed residuals confirm it.
    solve_time, overhead_time : (3,) float64 arrays
        Seconds inside the solver, and seconds for writing its data, reading its answer and checking it.
    primal_residual, dual_residual, complementarity : (3,) float64 arrays
        Largest scaled residuals, nan if none was measured. For the position update they are those of the nonlinear
        system (7.3, 7.4, 7.8), and not those of the last convex program in its solution.
    status : (3,) int64 array
        The worst status, an index into `STATUS_MEANINGS`.
    """

    def __init__(self) -> None:
        from deli.kernels.work import Tally  # loads the compiler, which the constants above do not need

        # Padded, so that no other thread's stepper writes to the same cache lines.
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
        """Size of the smooth set of the last taken step."""
        return int(self.tally.contacts[0])

    @property
    def reflected_contacts(self) -> int:
        """Number of contacts in the reflections of taken steps, summed over reflections."""
        return int(self.tally.contacts[1])

    @property
    def native_solves(self) -> int:
        """Number of programs solved by compiled code, in all steps since the stepper was made."""
        return int(self.tally.contacts[2])

    def reset(self) -> None:
        """Reset all statistics except the size of the smooth set."""
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
        """Count a program to which a backend gave no answer, not even a bad one."""
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
