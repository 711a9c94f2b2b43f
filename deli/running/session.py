"""The loop over steps: advance, record, report now and then, and end in an orderly way."""

import logging
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from deli.mechanics import energies
from deli.recording import netcdf, provenance
from deli.recording.damage import refuse
from deli.recording.holding import RecordingError
from deli.recording.paths import partial_path
from deli.recording.reading import read, read_unfinished
from deli.recording.recorder import BLOCK_ROWS, Memory, Recorder
from deli.recording.scene_record import require_same_scene, scene_attributes
from deli.recording.schema import STATS, TRAJECTORY, Groups, Schema, build_tree
from deli.recording.structure import require_schema
from deli.recording.subproblems import COUNTED
from deli.running.interrupts import PATIENCE_SECONDS as STEP_SECONDS
from deli.running.interrupts import Interrupted, StopRequests
from deli.running.plan import Plan
from deli.running.progress import ProgressBar
from deli.subproblems.collector import Collector
from deli.subproblems.posed import count_bytes

COMPLETE, FAILED, INTERRUPTED = "complete", "failed", "interrupted"
FLUSH_SECONDS, PATIENCE_SECONDS, REFRESH_SECONDS = 1.0, 10.0, 0.1

logger = logging.getLogger("deli")


class Session:
    """One session of a run: from the initial state, or from the last committed row of a partial file.

    `progress` says whether to show a bar, or is a function that is called with the number of steps now and then. Rows
    go to the partial file once `BLOCK_ROWS` are buffered and a second has passed, and at the latest after ten seconds.
    """

    def __init__(self, plan: Plan, config: dict[str, Any], progress: bool | Callable[[int], None]) -> None:
        self._plan = plan
        self._report, self._shown = None if isinstance(progress, bool) else progress, progress is True
        self._began = time.perf_counter()
        self._stepper = plan.stepper()
        self._attributes = scene_attributes(plan.scene) | provenance.attributes(config, plan.scene)
        self._schema = Schema(plan.scene.dof, plan.scene.dimension, plan.memory, plan.subproblems > 0)
        self._state: tuple[np.ndarray, ...] = (plan.scene.position, plan.scene.momentum)
        self._energy = float(energies.hamiltonian(plan.scene, *self._state))
        self._memory, self._writer, first_row = Memory(), None, 0
        self._solves = 0
        if plan.output is not None:
            self._writer, first_row = self._open(partial_path(plan.output), config)
        try:
            self._begin(first_row)
        except BaseException:
            self._abandon()
            raise

    def _begin(self, first_row: int) -> None:
        """Put the stepper into its state, and record the state if it is the initial one."""
        plan = self._plan
        collector = self._collect() if plan.subproblems else None
        self._recorder = Recorder(
            plan.scene, plan.step_size, self._writer or self._memory, first_row, plan.memory, collector
        )
        self._stepper.place(*self._state)
        self._progress = self._recorder.block.fields.progress
        if first_row == 0:
            self._stepper.record(self._recorder.block)
            self._recorder.flush()
        self._progress[0] = plan.step_of(self._recorder.rows - 1)
        self._bar = ProgressBar(plan.scene.name, plan.steps, self._step, self._shown)
        self._flushed = time.perf_counter()

    def run(self) -> xr.DataTree:
        """Take all steps that are left; see `deli.simulate` for how this can end."""
        stop = StopRequests(STEP_SECONDS)
        try:
            with stop:
                outcome, run = self._go(stop)
        except RecordingError:
            self._abandon()
            raise
        if outcome.startswith(INTERRUPTED):
            raise Interrupted(self._advice(outcome), run)
        if outcome != COMPLETE:
            logger.warning("%s: %s", self._attributes["title"], outcome)
        return run

    def _go(self, stop: StopRequests) -> tuple[str, xr.DataTree]:
        """Take steps, and end; return the outcome and the rows."""
        try:
            with self._bar:
                outcome = self._advance(stop)
        except KeyboardInterrupt:
            by = f" by {stop.reason}" if stop.reason else ""
            outcome = f"{INTERRUPTED}{by} after step {self._step}, in the middle of the next"
        except RecordingError:
            raise
        except BaseException as error:  # an exit and a panic in Rust are not of class Exception
            outcome = self._failure(f"{type(error).__name__}: {error}")
            with stop.undisturbed():
                with suppress(Exception):  # the function that raised may be the one that the row needs
                    self._record_last_good()
                self._finish(outcome)
            raise
        with stop.undisturbed():
            return outcome, self._finish(outcome)

    def _open(self, path: Path, config: dict[str, Any]) -> tuple[netcdf.Writer, int]:
        if self._plan.resume and path.exists():
            found = read_unfinished(path)
            groups, rows = found.groups, len(found.groups[TRAJECTORY]["time"][1])
            if rows:
                provenance.require_same(found.attributes["config"], config, path)
                require_same_scene(found.attributes, self._plan.scene, path)
                require_schema(groups, self._schema, path)
                self._require_same_times(groups[TRAJECTORY]["time"][1], path)
                self._state = self._last_state(groups)
                self._solves = int(groups[STATS]["solves"][1].sum())
                recorded = provenance.continued(found.attributes, self._attributes, path)
                steps = self._plan.step_of(rows - 1)
                return netcdf.Writer(path, self._schema, recorded, found, steps), rows
        return netcdf.Writer(path, self._schema, self._attributes), 0

    def _last_state(self, groups: Groups) -> tuple[np.ndarray, ...]:
        last = {name: groups[TRAJECTORY][name][1][-1] for name in ("position", "momentum", *self._plan.memory)}
        position, momentum, *memory = last.values()
        return (position, momentum, np.array(memory)) if memory else (position, momentum)

    def _collect(self) -> Collector:
        """Return a collector of the stepper's subproblems, which continues those of earlier sessions."""
        ends = {} if self._writer is None else self._writer.ends
        kept = ends.get("problem", 0)
        size = count_bytes(*(ends[name] for name in COUNTED)) if ends else 0
        collector = Collector(self._plan.subproblems, kept, self._solves - kept, size)
        self._stepper.collect(collector)
        return collector

    def _require_same_times(self, times: np.ndarray, path: Path) -> None:
        due = np.minimum(np.arange(len(times)) * self._plan.every, self._plan.steps) * self._plan.step_size
        if len(times) > self._plan.rows or not np.array_equal(times, due):
            refuse(path, "its times are not those that the run records")

    @property
    def _step(self) -> int:
        """Number of steps of the run that have been taken."""
        return int(self._progress[0])

    def _advance(self, stop: StopRequests) -> str:
        plan, block = self._plan, self._recorder.block
        if self._report is not None:
            self._report(self._step)
        while self._step < plan.steps:
            if stop.reason is not None:
                return f"{INTERRUPTED} by {stop.reason} after step {self._step}"
            error = self._stepper.advance(block, plan.steps, plan.every, time.monotonic() + REFRESH_SECONDS)
            with stop.undisturbed():  # rows are written whole
                if error is not None:
                    self._record_last_good()
                    return self._failure(str(error))
                self._look_up()
        return COMPLETE

    def _look_up(self) -> None:
        waited = time.perf_counter() - self._flushed
        enough = self._recorder.buffered >= BLOCK_ROWS and waited > FLUSH_SECONDS
        if self._recorder.full or (self._writer is not None and (enough or waited > PATIENCE_SECONDS)):
            self._recorder.flush()
            self._flushed = time.perf_counter()
        if self._report is not None:
            self._report(self._step)
        if self._bar.active:
            energy = float(energies.hamiltonian(self._plan.scene, *self._stepper.state[:2]))
            self._bar.update(self._step, energy - self._energy)

    def _record_last_good(self) -> None:
        """Record the state before a failed step unless it is a row; its statistics count the work of that step too."""
        if self._step > self._plan.step_of(self._recorder.rows - 1):
            self._stepper.record(self._recorder.block)

    def _failure(self, why: str) -> str:
        begin = self._step * self._plan.step_size
        return f"{FAILED} in step {self._step + 1} (from time {begin:.9g}): {why}"

    def _abandon(self) -> None:
        if self._writer is not None:
            self._writer.abandon()

    def _finish(self, outcome: str) -> xr.DataTree:
        self._recorder.flush(last=not outcome.startswith(INTERRUPTED))
        recorded = self._attributes if self._writer is None else self._writer.attributes
        closing: dict[str, Any] = {
            "backend_versions": provenance.backend_versions(self._stepper.backends, recorded["backend_versions"]),
            "outcome": outcome,
            "end": provenance.now(),
        }
        if self._writer is None:
            closing["wall_time"] = time.perf_counter() - self._began
            return build_tree(self._memory.collect(self._schema), self._attributes | closing)
        closing["wall_time"] = self._writer.wall_time
        keep = outcome.startswith(INTERRUPTED)
        path = self._writer.close(closing, rename=None if keep else self._plan.output)
        groups, attributes = read(path)
        return build_tree(groups, attributes)

    def _advice(self, outcome: str) -> str:
        if self._writer is None:
            return f"{outcome}; the rows are in this exception's `run`, and nowhere else: there was no output."
        return f"{outcome}; {self._recorder.rows} rows are in {self._writer.path}: resume to continue."
