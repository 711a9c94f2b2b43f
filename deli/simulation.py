"""Simulation of a scene by a method, and opening of recorded runs and subproblems."""

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
        A netCDF file to record to. Until the run ends, its rows are in ``<output>.partial``, which is at most a second
        of work behind the run (ten seconds where 256 rows take longer than a second). Then the file is renamed to
        `output`. Files need POSIX locks. Without `output` the run is kept in memory, on all platforms.
    every : int
        Record the initial state, every `every`-th step, and the last step whether or not `every` divides `steps`.
    skip : bool
        Answer subproblems that need no solver without one. If a solver that was chosen is then never called, a warning
        is logged (`deli.metrics.uncalled_note`).
    resume : bool
        Continue ``<output>.partial`` after its last committed row. The rows are those of a run without a stop, to the
        bit, or with warm starts to the solvers' tolerance. Without a partial file the run starts anew; a finished
        `output` is returned. Another configuration is refused, and so is another scene: the message names the family
        and the array that differ. Functions in Python are compared by values and derivatives at some states near the
        initial one, and a log line says so.
    progress : bool
        Show a bar, on a terminal or in a notebook.
    contact_tolerance : float
        Scaled tolerance within which a gap counts as zero.
    overwrite : bool
        Replace an existing `output`, and drop its partial file.
    subproblems : bool or int
        Also record the subproblems that solvers get, with their answers, in a group ``subproblems``: at most this
        number, 10,000 if True, and at most 256 MB. Subproblems that `skip` answers without a solver are not recorded.
        The trajectory is the same to the bit. `deli.replay` solves recorded subproblems again, and
        `deli.load_subproblem` returns one as a cvxpy problem.

    Returns
    -------
    xarray.DataTree
        Groups ``trajectory`` and ``solver_stats``, and ``subproblems`` if asked for. The root attribute ``outcome`` is
        ``complete``, or names the step in which the run failed and the reason. A failed run ends with the last good
        state, whatever `every` is, and its file has the final name. Where that state adds a row, ``solver_stats``
        counts the work of the failed step too, but the row does not count the contacts of that step.

    Raises
    ------
    InputError
        If an argument is not allowed. Nothing has been computed or written then.
    Interrupted
        On SIGINT or SIGTERM (it is a KeyboardInterrupt), after the current step has ended and the rows have been
        written. A second signal breaks the step off, and so do five seconds. The file stays ``<output>.partial``, to be
        resumed; the exception's `run` holds the rows. A call of a library in C that does not return cannot be broken
        off: SIGQUIT or SIGKILL end the process then, and the rows committed before are in ``<output>.partial``.

    Examples
    --------
    A pogo stick falls, bounces and keeps its energy:

    >>> import deli
    >>> scene = deli.scenes.pogo_stick()
    >>> run = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=100)
    >>> run.attrs["outcome"]
    'complete'
    >>> int(run.trajectory["reflected_contacts"].sum())
    2
    >>> energy = run.trajectory["hamiltonian"]
    >>> float(energy[0].round(9)), bool(abs(energy - energy[0]).max() < 1e-9)
    (68.6, True)

    The same run by another solver, with every tenth row:

    >>> choice = {"backend": "clarabel", "tolerance": 1e-9}
    >>> run = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=100, solvers=choice, skip=False, every=10)
    >>> run.trajectory.sizes["time"]
    11
    >>> run.attrs["backend_versions"].split()[0]
    'clarabel'
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
    """Open a recorded run, finished or partial, or an ensemble. Of a partial file only committed rows are read.

    Parameters
    ----------
    path : path
        A file that `simulate` or `simulate_ensemble` has written as its `output`.

    Returns
    -------
    xarray.DataTree
        The tree that `simulate` or `simulate_ensemble` returned.

    Raises
    ------
    InputError
        If the file is missing, unreadable, or not a run recorded by deli.

    Examples
    --------
    >>> import deli, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "run.nc"
    ...     run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.01, steps=20, output=file)
    ...     again = deli.open_run(file)
    >>> again.identical(run)
    True
    """
    return open_tree(Path(path))


def load_subproblem(path: str | os.PathLike[str], index: int) -> "cp.Problem":
    """Load one recorded subproblem as the cvxpy problem that was posed.

    Parameters
    ----------
    path : path
        A run recorded with ``subproblems=True``, or a library of subproblems.
    index : int
        Place of the subproblem along the dimension ``problem``, by which the command ``deli replay`` lists worst cases.
        A negative index counts from the end.

    Returns
    -------
    cvxpy.Problem
        The model in `deli.subproblems`. Its Parameters hold the recorded values, its Variable the recorded answer, and
        the dual values of its constraints the multipliers. Quantities are scaled: z = √M v over a speed, so that the
        masses are one, and rows have unit length. Equations may depend on each other; runs and `deli.replay` hand an
        independent set of them to backends.

    Raises
    ------
    InputError
        If the file has no subproblems, or no subproblem of that index.

    Examples
    --------
    >>> import deli, pathlib, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "run.nc"
    ...     run = deli.simulate(
    ...         deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=10, output=file, skip=False, subproblems=True
    ...     )
    ...     problem = deli.load_subproblem(file, 0)
    >>> velocity = problem.var_dict["velocity"]
    >>> recorded = velocity.value
    >>> objective = problem.solve(solver="CLARABEL")
    >>> bool(abs(velocity.value - recorded).max() < 1e-6)
    True
    """
    problems, _ = read_subproblems(Path(path))
    whole = isinstance(index, int | np.integer) and not isinstance(index, bool)
    if not whole or not -len(problems) <= index < len(problems):
        raise InputError(f"index is {index!r}; {path} holds subproblems 0 to {len(problems) - 1}.")
    return problems[index].problem()


def run_plan(plan: Plan, progress: bool | Callable[[int], None] = False) -> xr.DataTree:
    """Carry out a checked plan, see `simulate`; `progress` may be a function, called with the number of steps."""
    config = plan.config()
    if plan.resume and plan.output is not None and plan.output.exists():
        run = open_run(plan.output)
        provenance.require_same(run.attrs["config"], config, plan.output)
        require_same_scene(run.attrs, plan.scene, plan.output)
        return run
    if plan.output is not None:
        require_locks(plan.output)
    return Session(plan, config, progress).run()
