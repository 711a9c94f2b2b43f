"""Run many scenes of one kind at once, in threads, and record them together."""

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

    Each member's rows are those of `simulate` of its scene, to the bit, whatever the number of workers. Members run
    in threads: compiled steps and the native solver use all cores, while functions in Python (`deli.Potential`,
    `deli.Constraints`) and the solvers of other packages run one at a time.

    Parameters
    ----------
    scenes : sequence of deli.Scene
        The members, of equal dimension and number of bodies; cheapest as variants of one scene:
        ``[dataclasses.replace(scene, momentum=p) for p in momenta]``.
    method, step_size, steps, duration, solvers, every, skip, contact_tolerance
        As for `simulate`, the same for all members.
    labels : mapping
        What tells the members apart, by name: arrays with a value for each, which become coordinates along
        ``member``. One called ``member`` takes the place of the numbers 0, 1, ...
    solver_stats : bool
        Record the group ``solver_stats``, which takes most of the room where scenes are small.
    workers : int
        Threads; as many as there are cores for this process if left out.
    progress : bool
        Show a bar, on a terminal or in a notebook.
    output : path, optional
        A netCDF file to write once at the end, to be opened by `deli.open_run`.
    overwrite : bool
        Replace `output` where it exists.

    Returns
    -------
    xarray.DataTree
        Groups ``trajectory`` and ``solver_stats`` as of `simulate`, with ``member`` as the first dimension of all that
        is recorded; ``time`` and ``step`` are common to all. At the root, ``outcome(member)`` is what a run's outcome
        would be, ``steps_taken(member)`` counts its steps, and attributes are those of a run: the config's scene is
        what members have in common, and so are conserved momenta. A member that fails does not stop the others; from
        there on its rows are nan, of status ``not_used`` and count nothing, and its last good state is recorded only
        if a row was due. Metrics and plots take all of it, and ``run.isel(member=0)`` as they take a run.

    Raises
    ------
    InputError
        If an argument is not allowed, or the rows need more memory than there is. Nothing has been computed then.
    Interrupted
        On SIGINT or SIGTERM (a KeyboardInterrupt). Its `run` holds what has been computed, and so does `output`;
        members that had not ended have an outcome that says so. One whose step has not ended five seconds later, or
        at a second signal, is left to itself.
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
    """Root attributes that are known at the start."""
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
    """Components of the momenta that all members conserve."""
    systems = {(id(one.potential), id(one.unilateral), id(one.bilateral), one.mass.tobytes()): one for one in scenes}
    found: dict[str, str] = {}
    for scene in systems.values():
        for key, components in provenance.conserved_momenta(scene).items():
            kept = found.get(key, components).split()
            found[key] = " ".join(axis for axis in components.split() if axis in kept) or "none"
        if set(found.values()) == {"none"}:
            break
    return found
