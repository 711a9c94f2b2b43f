"""Run a method on a scene and record it; open what was recorded."""

import logging
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.metrics.uncalled import uncalled_note
from deli.recording import provenance
from deli.recording.holding import require_locks
from deli.recording.reading import open_tree, read_subproblems
from deli.recording.scene_record import require_same_scene
from deli.running.plan import Plan, make_plan
from deli.running.session import Session

if TYPE_CHECKING:
    import cvxpy as cp

logger = logging.getLogger("deli")


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
    subproblems: bool | int = False,
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
        kept in memory, which all platforms can; files take POSIX locks.
    every : int
        Record the initial state, every `every`-th step, and the last step whether or not `every` divides `steps`.
    skip : bool
        Answer subproblems that need no solver without one. Where that leaves a solver that was chosen with nothing
        to do, a warning is logged (`deli.metrics.uncalled_note`).
    resume : bool
        Continue ``<output>.partial`` after its last committed row, to the bit as if it had not stopped; with warm
        starts to the solvers' tolerance. Starts anew where there is no such file, returns the run where it is finished,
        refuses another configuration and another scene, naming the family and the array that differ. Of functions in
        Python only values and derivatives at some states near the initial one are compared, and a log line says so.
    progress : bool
        Show a bar, on a terminal or in a notebook.
    contact_tolerance : float
        Scaled tolerance of "the gap is zero".
    overwrite : bool
        Replace `output`, and drop its partial file, where they exist.
    subproblems : bool or int
        Also record the subproblems that solvers get, with their answers, in a group ``subproblems``: the first so many,
        10,000 if True, until they take 256 MB. What `skip` answers without a solver is none of them. The trajectory
        is the same to the bit. `deli.replay` solves them again, `deli.load_subproblem` returns one as a cvxpy problem.

    Returns
    -------
    xarray.DataTree
        Groups ``trajectory`` and ``solver_stats``, and ``subproblems`` if asked for. The root attribute ``outcome`` is
        ``complete``, or says in which step and why the run failed; a failed run ends with the last good state,
        whatever `every` is, and its file has the final name. Where that adds a row, ``solver_stats``
        counts the work of the failed step too, and the row its contacts not.

    Raises
    ------
    InputError
        If an argument is not allowed. Nothing has been computed or written then.
    Interrupted
        On SIGINT or SIGTERM (a KeyboardInterrupt), after the step and after the rows have been written. A step that
        has not ended five seconds later is broken off, and so it is by a second signal. The file stays
        ``<output>.partial``, to be resumed; the exception's `run` holds the rows. A call of a library in C that does
        not return cannot be broken off: SIGQUIT or SIGKILL end the process then, and the rows committed
        before are in ``<output>.partial``.
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
        subproblems=subproblems,
    )
    run = run_plan(plan, progress)
    if note := uncalled_note(run):
        logger.warning("%s: %s", run.attrs["title"], note)
    return run


def open_run(path: str | os.PathLike[str]) -> xr.DataTree:
    """Open a recorded run, finished or partial, or an ensemble; of a partial file only rows that are whole.

    Raises
    ------
    InputError
        If the file is missing, unreadable, or not a run recorded by deli.
    """
    return open_tree(Path(path))


def load_subproblem(path: str | os.PathLike[str], index: int) -> "cp.Problem":
    """Load one recorded subproblem as the cvxpy problem that was posed.

    Parameters
    ----------
    path : path
        A run recorded with ``subproblems=True``, or a library of subproblems.
    index : int
        Its place along the dimension ``problem``, which `deli.replay` lists worst cases by; from the end if negative.

    Returns
    -------
    cvxpy.Problem
        The model in `deli.subproblems`, its Parameters holding the recorded values, its Variable the recorded answer
        and the constraints' dual values its multipliers. Units are those of the problem at hand: z = √M v over a
        speed, so that the masses are one, and rows of unit length. Equations may depend on each other;
        runs and `deli.replay` hand an independent set of them to backends.

    Raises
    ------
    InputError
        If the file has no subproblems, or none of that index.
    """
    problems, _ = read_subproblems(Path(path))
    whole = isinstance(index, int | np.integer) and not isinstance(index, bool)
    if not whole or not -len(problems) <= index < len(problems):
        raise InputError(f"index is {index!r}; {path} holds subproblems 0 to {len(problems) - 1}.")
    return problems[index].problem()


def run_plan(plan: Plan, progress: bool | Callable[[int], None] = False) -> xr.DataTree:
    """Carry out a checked plan, see `simulate`; `progress` may also be called with the number of steps now and then."""
    config = plan.config()
    if plan.resume and plan.output is not None and plan.output.exists():
        run = open_run(plan.output)
        provenance.require_same(run.attrs["config"], config, plan.output)
        require_same_scene(run.attrs, plan.scene, plan.output)
        return run
    if plan.output is not None:
        require_locks(plan.output)
    return Session(plan, config, progress).run()
