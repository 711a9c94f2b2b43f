"""Solvers that were chosen for a run and never called."""

import tomllib
from dataclasses import asdict

import xarray as xr

from deli.metrics.trajectory import has_all_steps
from deli.recording.members import is_ensemble
from deli.recording.provenance import plain
from deli.recording.schema import STATS, dataset_of
from deli.subproblems.choices import SolverChoice

HINT = "with skip=False (on the command line: --set skip=false), solvers are called for closed forms too"


def uncalled_solvers(run: xr.DataTree) -> list[str]:
    """Return a sentence about each solver that was chosen and never called, except the default one.

    A subproblem with a closed form, or with nothing to solve, calls no solver. Runs with different solvers are then
    identical.

    Parameters
    ----------
    run : xarray.DataTree

    Returns
    -------
    list of str
        Empty also if the run lacks solver statistics of some steps.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=10, solvers="clarabel")
    >>> deli.metrics.uncalled_solvers(run)
    ['clarabel was never called: all 30 subproblems were answered without a solver, so its choice changed nothing']
    """
    if STATS not in run.children or not (is_ensemble(run) or has_all_steps(run)):
        return []
    stats, choices = dataset_of(run, STATS), tomllib.loads(run.attrs["config"])["solvers"]
    work = stats[["solves", "skipped"]].sum([name for name in stats["solves"].dims if name != "subproblem"])
    told, judged = [], [plain(asdict(SolverChoice()))]
    for choice in choices.values():
        if choice in judged:
            continue
        judged.append(choice)
        names = [name for name, each in choices.items() if each == choice]
        solves, skipped = (int(work[kind].sel(subproblem=names).sum()) for kind in ("solves", "skipped"))
        if not solves:
            whose = "" if len(names) == len(choices) else f" of {' and '.join(names)}"
            every = (
                f"all {skipped:,} subproblems{whose} were answered without a solver" if skipped else "nothing was posed"
            )
            told.append(f"{choice['backend']} was never called: {every}, so its choice changed nothing")
    return told


def uncalled_note(run: xr.DataTree) -> str:
    """Return the sentences of `uncalled_solvers` with a remedy, or an empty text.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.metrics.uncalled_note(run)
    ''
    """
    told = uncalled_solvers(run)
    skipping = bool(told) and tomllib.loads(run.attrs["config"])["skip"]
    return "; ".join([*told, HINT] if skipping else told)
