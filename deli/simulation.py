"""Run a method on a scene and record it; open what was recorded."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import xarray as xr

from deli.mechanics.scene import Scene
from deli.recording import provenance
from deli.recording.reading import read
from deli.recording.schema import build_tree
from deli.running.plan import Plan, make_plan
from deli.running.session import Session


def simulate(
    scene: Scene,
    method: Any,
    *,
    step_size: float,
    steps: int | None = None,
    duration: float | None = None,
    solvers: Any = "auto",
    output: str | os.PathLike[str] | None = None,
    every: int = 1,
    skip: bool = True,
    resume: bool = False,
    progress: bool = False,
    contact_tolerance: float = 1e-8,
    overwrite: bool = False,
) -> xr.DataTree:
    """Integrate a scene and record the run.

    Parameters
    ----------
    scene : deli.Scene
        The system with its initial state; it is not changed.
    method : deli.GVI, deli.DiscreteSmooth, ...
        The integrator.
    step_size : float
        h > 0, in the scene's unit of time.
    steps, duration : int, float
        Exactly one of them; `duration` is a multiple of `step_size` to a relative 1e-9.
    solvers : str or mapping
        A backend, a table ``{backend, tolerance, polish, warm_start, options}``, or a table of these by subproblem.
    output : path, optional
        A netCDF file to record to. Rows are in ``<output>.partial`` until the run ends, at most a second of work (ten
        seconds where 256 rows take longer) behind it; then the file gets its own name. Without `output` the run is
        kept in memory.
    every : int
        Record the initial state, every `every`-th step, and the last step whether or not `every` divides `steps`.
    skip : bool
        Answer subproblems that need no solver without one.
    resume : bool
        Continue ``<output>.partial`` after its last committed row, to the bit as if it had not stopped; with warm
        starts to the solvers' tolerance. Starts anew where there is no such file, returns the run where it is finished,
        refuses another configuration.
    progress : bool
        Show a bar on a terminal.
    contact_tolerance : float
        Scaled tolerance of "the gap is zero".
    overwrite : bool
        Replace `output`, and drop its partial file, where they exist.

    Returns
    -------
    xarray.DataTree
        Groups ``trajectory`` and ``solver_stats``. The root attribute ``outcome`` is ``complete``, or says in which
        step and why the run failed; a failed run ends with the last good state, whatever `every` is, and its file has
        the final name. Where that adds a row, the row's stats count the failed attempt too.

    Raises
    ------
    InputError
        If an argument is not allowed. Nothing has been computed or written then.
    Interrupted
        On SIGINT or SIGTERM (a KeyboardInterrupt), after the rows have been written. The file stays
        ``<output>.partial``, to be resumed; the exception's `run` holds the rows.
    """
    plan = make_plan(
        scene,
        method,
        step_size=step_size,
        steps=steps,
        duration=duration,
        solvers=solvers,
        output=output,
        every=every,
        skip=skip,
        resume=resume,
        contact_tolerance=contact_tolerance,
        overwrite=overwrite,
    )
    return run_plan(plan, progress)


def open_run(path: str | os.PathLike[str]) -> xr.DataTree:
    """Open a recorded run, finished or partial; of a partial file only rows that are whole.

    Raises
    ------
    InputError
        If the file is missing, unreadable, or not a run recorded by deli.
    """
    groups, attributes = read(Path(path))
    return build_tree(groups, attributes)


def run_plan(plan: Plan, progress: bool | Callable[[int], None] = False) -> xr.DataTree:
    """Carry out a checked plan, see `simulate`; `progress` may also be called with the number of steps now and then."""
    config = plan.config()
    if plan.resume and plan.output is not None and plan.output.exists():
        run = open_run(plan.output)
        provenance.require_same(run.attrs["config"], config, plan.output)
        return run
    return Session(plan, config, progress).run()
