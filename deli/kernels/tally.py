"""Counts of the cost of a step."""

import math

from deli.kernels.compiled import kernel
from deli.kernels.work import Tally

SKIPPED, SOLVED, UNUSED = 0, 1, 4


@kernel
def note(tally: Tally, subproblem: int, status: int) -> None:
    """Keep the worse status: not used, skipped, solved."""
    if tally.status[subproblem] == UNUSED or (tally.status[subproblem] == SKIPPED and status == SOLVED):
        tally.status[subproblem] = status


@kernel
def skip(tally: Tally, subproblem: int) -> None:
    """Count a subproblem that needed no solver."""
    tally.counts[1, subproblem] += 1
    note(tally, subproblem, SKIPPED)


@kernel
def measure(tally: Tally, subproblem: int, primal: float, dual: float, complementarity: float) -> None:
    """Keep the largest residuals since the last reset."""
    for k, residual in enumerate((primal, dual, complementarity)):
        known = tally.residuals[k, subproblem]
        if not (known >= residual):
            tally.residuals[k, subproblem] = residual


@kernel
def reset(tally: Tally) -> None:
    """Reset all statistics except the size of the smooth set."""
    for subproblem in range(tally.status.size):
        for k in range(tally.counts.shape[0]):
            tally.counts[k, subproblem] = 0
        for k in range(2):
            tally.times[k, subproblem] = 0.0
        for k in range(3):
            tally.residuals[k, subproblem] = math.nan
        tally.status[subproblem] = UNUSED
    tally.contacts[1] = 0


@kernel
def copy_tally(tally: Tally, out: Tally) -> None:
    """Write the statistics to `out`."""
    for subproblem in range(tally.status.size):
        for k in range(tally.counts.shape[0]):
            out.counts[k, subproblem] = tally.counts[k, subproblem]
        for k in range(2):
            out.times[k, subproblem] = tally.times[k, subproblem]
        for k in range(3):
            out.residuals[k, subproblem] = tally.residuals[k, subproblem]
        out.status[subproblem] = tally.status[subproblem]
    for k in range(tally.contacts.size):
        out.contacts[k] = tally.contacts[k]
