"""Simulation of many scenes of one kind at once, in threads, and their common record."""

import logging
import os
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.metrics.uncalled import uncalled_note
from deli.recording import ensemble, ensemble_file, provenance
from deli.recording.schema import Schema
from deli.running.crew import Crew
from deli.running.interrupts import Interrupted, StopRequests
from deli.running.plan import Plan, make_plan
from deli.running.progress import ProgressBar
from deli.running.session import COMPLETE, INTERRUPTED

logger = logging.getLogger("deli")


def simulate_ensemble(
    scenes: Sequence[Scene],
    method: Any,
    *,
    step_size: float,
    steps: int | None = None,
    duration: float | None = None,
    solvers: Any = "auto",
    every: int = 1,
    skip: bool = True,
    contact_tolerance: float = 1e-8,
    labels: Mapping[str, Any] | None = None,
    solver_stats: bool = True,
    workers: int | None = None,
    progress: bool = False,
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
) -> xr.DataTree:
    """Integrate many scenes by one method, and record all runs together.

    Each member's rows equal the rows of `simulate` for its scene, to the bit, for any number of workers. Members
    run in threads: compiled steps and the native solver use all cores. Functions in Python (`deli.Potential`,
    `deli.Constraints`) and the solvers of other packages run one at a time.

    Parameters
    ----------
    scenes : sequence of deli.Scene
        The members, of equal dimension and number of bodies. Variants of one scene are the cheapest:
        ``[dataclasses.replace(scene, momentum=p) for p in momenta]``.
    method, step_size, steps, duration, solvers, every, skip, contact_tolerance
        As for `simulate`, the same for all members.
    labels : mapping
        Values that distinguish the members, by name: arrays with one value for each member, which become coordinates
        along ``member``. A label of the name ``member`` replaces the numbers 0, 1, ...
    solver_stats : bool
        Record the group ``solver_stats``, which takes most of the memory where scenes are small.
    workers : int
        Number of threads; by default, the number of cores that this process may use.
    progress : bool
        Show a bar, on a terminal or in a notebook.
    output : path, optional
        A netCDF file, which is written at the end; `deli.open_run` opens it.
    overwrite : bool
        Replace an existing `output`.

    Returns
    -------
    xarray.DataTree
        Groups ``trajectory`` and ``solver_stats`` as of `simulate`, with ``member`` as the first dimension of all
        recorded variables; ``time`` and ``step`` are common to all members. At the root, ``outcome(member)`` is the
        outcome of each member, and ``steps_taken(member)`` counts its steps. Attributes are those of a run; its scene
        and conserved momenta are those that all members have in common. A member that fails does not stop the others.
        After the failure its rows are nan, with status ``not_used`` and counts of zero, and its last good state
        is recorded only if a row was due. Metrics and plots take the whole tree, or ``run.isel(member=0)`` as a run.

    Raises
    ------
    InputError
        If an argument is not allowed, or the rows need more memory than there is. Nothing has been computed then.
    Interrupted
        On SIGINT or SIGTERM (it is a KeyboardInterrupt). Its `run` holds all computed rows, and so does `output`; the
        outcome of an unfinished member says so. A member whose step has not ended after five seconds, or at a second
        signal, is abandoned.

    Examples
    --------
    Three pogo sticks with other initial momenta:

    >>> import dataclasses
    >>> import deli
    >>> scene = deli.scenes.pogo_stick()
    >>> scenes = [dataclasses.replace(scene, momentum=[p, p]) for p in (0.0, 1.0, 2.0)]
    >>> run = deli.simulate_ensemble(scenes, deli.GVI(), step_size=0.01, steps=100, labels={"p": [0.0, 1.0, 2.0]})
    >>> run.trajectory["position"].sizes
    Frozen({'member': 3, 'time': 101, 'dof': 2})
    >>> run["outcome"].values.tolist()
    ['complete', 'complete', 'complete']
    >>> run.trajectory["hamiltonian"][:, 0].round(3).values.tolist()
    [68.6, 69.6, 72.6]
    """
    began, members = time.perf_counter(), _check_scenes(scenes)
    arguments = {"step_size": step_size, "steps": steps, "duration": duration, "solvers": solvers, "every": every}
    plan = make_plan(
        members[0],
        method,
        **arguments,
        skip=skip,
        contact_tolerance=contact_tolerance,
        output=output,
        overwrite=overwrite,
    )
    if not isinstance(solver_stats, bool | np.bool_):
        raise InputError(f"solver_stats is {solver_stats!r}; allowed: True, False.")
    count, schema = _check_workers(workers), Schema(members[0].dof, members[0].dimension, plan.memory)
    named = ensemble.check_labels(labels, len(members), schema)
    gathering = ensemble.Gathering(len(members), plan.rows, schema, bool(solver_stats))
    crew = Crew(plan, members, gathering, count)
    attributes = _attributes(plan, members, bool(solver_stats))
    with StopRequests() as stop, ProgressBar(_label(members), plan.steps * len(members), 0, progress) as bar:
        crew.run(stop, bar)
    finished = sum(outcome == COMPLETE for outcome in crew.outcomes)
    interrupted = any(outcome.startswith(INTERRUPTED) for outcome in crew.outcomes)
    failed = sum(not outcome.startswith((COMPLETE, INTERRUPTED)) for outcome in crew.outcomes)
    outcome = f"{failed} of {len(members)} members failed" if failed else COMPLETE
    if interrupted:
        outcome = f"{INTERRUPTED} by {stop.reason} with {finished} of {len(members)} members complete"
    attributes |= {
        "backend_versions": provenance.backend_versions(crew.backends),
        "outcome": outcome,
        "end": provenance.now(),
        "wall_time": time.perf_counter() - began,
    }
    row_times = np.minimum(np.arange(plan.rows) * plan.every, plan.steps) * plan.step_size
    run = gathering.tree(row_times, named, crew.outcomes, attributes)
    if plan.output is not None:
        ensemble_file.write(plan.output, run)
    if interrupted:
        raise Interrupted(f"{outcome}; the rows are in this exception's `run`", run)
    if failed:
        logger.warning("%s: %s", attributes["title"], outcome)
    if note := uncalled_note(run):
        logger.warning("%s: %s", attributes["title"], note)
    return run


def _check_scenes(scenes: Sequence[Scene]) -> list[Scene]:
    if isinstance(scenes, Scene) or not isinstance(scenes, Sequence | np.ndarray):
        raise InputError(f"scenes is {type(scenes).__name__}; pass a list of deli.Scene, one for each member.")
    members = list(scenes)
    if not members:
        raise InputError("scenes is empty; pass at least one deli.Scene.")
    for number, scene in enumerate(members):
        if not isinstance(scene, Scene):
            raise InputError(f"scenes: member {number} is {scene!r}; expected a deli.Scene.")
        found, expected = ((one.bodies, one.dimension) for one in (scene, members[0]))
        if found != expected:
            raise InputError(
                f"scenes: member {number} has {found[0]} bodies in dimension {found[1]}, member 0 has {expected[0]} in "
                f"dimension {expected[1]}; simulate scenes of one size together."
            )
    return members


def _check_workers(workers: int | None) -> int:
    if workers is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if isinstance(workers, bool) or not isinstance(workers, int | np.integer) or workers < 1:
        raise InputError(f"workers is {workers!r}; allowed: a whole number >= 1, or None for all cores.")
    return int(workers)


def _label(scenes: list[Scene]) -> str:
    name = scenes[0].name if ensemble.same(scenes, "name") else provenance.CUSTOM
    return f"{len(scenes)} x {name}"


def _attributes(plan: Plan, scenes: list[Scene], solver_stats: bool) -> dict[str, Any]:
    """Return the root attributes that are known at the start."""
    first, config = scenes[0], plan.config()
    common = {name: getattr(first, name) for name in ("mass", "position", "momentum") if ensemble.same(scenes, name)}
    states = ("mass", "position", "momentum")
    parameters = {
        key: value
        for key, value in first.parameters.items()
        if key not in states and all(key in scene.parameters and scene.parameters[key] == value for scene in scenes)
    }
    config["scene"] = provenance.plain(
        {
            "name": provenance.ENSEMBLE,
            "label": _label(scenes),
            "members": len(scenes),
            "dimension": first.dimension,
            **common,
            "parameters": parameters,
        }
    )
    if not solver_stats:
        config["record"]["solver_stats"] = False
    return provenance.attributes(config, first) | _conserved_momenta(scenes)


def _conserved_momenta(scenes: list[Scene]) -> dict[str, str]:
    """Return the components of the momenta that all members conserve."""
    systems = {(id(one.potential), id(one.unilateral), id(one.bilateral), one.mass.tobytes()): one for one in scenes}
    found: dict[str, str] = {}
    for scene in systems.values():
        for key, components in provenance.conserved_momenta(scene).items():
            kept = found.get(key, components).split()
            found[key] = " ".join(axis for axis in components.split() if axis in kept) or "none"
        if set(found.values()) == {"none"}:
            break
    return found
