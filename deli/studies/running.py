"""The execution of a study: decisions about missing runs, their execution, and the manifest."""

import queue
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from filelock import FileLock, Timeout

from deli.errors import InputError
from deli.recording.paths import check_name
from deli.running.interrupts import StopRequests
from deli.studies.expansion import Study
from deli.studies.layout import CASES, REPORT, run_path
from deli.studies.local import Event, Local, cores
from deli.studies.manifest import Manifest, read_manifest
from deli.studies.planning import KEEP, RUN, Decision, decide, reference_of
from deli.studies.states import RUNNING, WAITING
from deli.studies.worker import Order

TICK_SECONDS = 0.2
LOCK = ".lock"


class Scheduler(Protocol):
    """The interface of a place where cases run."""

    events: "queue.SimpleQueue[Event]"
    workers: int

    def submit(self, order: Order) -> None:
        """Run a case as soon as a worker is free."""

    def stop(self) -> None:
        """Interrupt running cases and begin no others; every submitted case still has an event ``ended``."""

    def close(self) -> None:
        """End the workers."""


class Watcher(Protocol):
    """The interface of an observer of a study."""

    def started(self, decision: Decision) -> None:
        """Note that a run begins."""

    def step(self, decision: Decision, step: int) -> None:
        """Note the step of a run; the first call comes after the run's code is compiled and loaded."""

    def ended(self, decision: Decision, record: dict[str, Any]) -> None:
        """Note that a run has ended."""

    def tick(self) -> None:
        """Update the display; called several times a second."""


@dataclass(frozen=True)
class Result:
    """The state of a study.

    Attributes
    ----------
    states : Counter
        Number of runs by state.
    runs : dict
        Records by digest.
    titles : dict
        Titles of the runs by digest.
    stopped : str or None
        The signal that interrupted the study.
    """

    states: "Counter[str]"
    runs: dict[str, dict[str, Any]]
    titles: dict[str, str]
    stopped: str | None


def plan_study(study: Study, folder: Path, *, retry_failed: bool = False) -> list[Decision]:
    """Return the decisions that `run_study` would carry out.

    Raises
    ------
    InputError
        If the folder is not a study's, or cannot be read.
    """
    check_name("folder", folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder.")
    earlier = read_manifest(folder)
    if earlier is None and folder.exists() and {entry.name for entry in folder.iterdir()} - {CASES, LOCK, *REPORT}:
        raise InputError(f"{folder} holds other files than a study's; name another folder.")
    return decide(study, folder, earlier, retry_failed)


def run_study(
    study: Study,
    folder: Path,
    *,
    workers: int | None = None,
    address: str | None = None,
    retry_failed: bool = False,
    watcher: Watcher | None = None,
) -> Result:
    """Run and measure the missing and outdated runs of a study.

    Parameters
    ----------
    study : Study
    folder : Path
        Folder of runs, metrics and manifest; it is made if it does not exist.
    workers : int
        Worker processes on this machine (default: the study's own number, or one a core).
    address : str
        Address of a Dask scheduler to run on instead; its workers must see the folder under the same path.
    retry_failed : bool
        Whether to repeat runs that failed, timed out, ran out of memory or were killed.
    watcher : Watcher
        Observer of the runs.

    Raises
    ------
    InputError
        If the folder is not a study's, or another process runs a study there.
    """
    plan_study(study, folder, retry_failed=retry_failed)
    try:
        (folder / CASES).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror or error}.") from error
    with (
        _only_here(folder),
        StopRequests() as stop,
        stop.undisturbed(),
    ):  # no other process changes the folder after the decisions
        decisions = plan_study(study, folder, retry_failed=retry_failed)
        todo = [decision for decision in decisions if decision.action != KEEP]
        scheduler = _scheduler(study, workers, address, len(todo))
        session = {"workers": scheduler.workers, "scheduler": address or "local"} if todo else None
        manifest = Manifest(folder, study, read_manifest(folder), session)
        for decision in decisions:
            manifest.runs[decision.case.digest] |= decision.record or {}
        manifest.write()
        try:
            _Conductor(study, folder, scheduler, manifest, watcher or _Nobody()).run(todo, stop)
        finally:
            scheduler.close()
            manifest.write()
    states = Counter(record["state"] for record in manifest.runs.values())
    titles = {digest: case.title for digest, case in study.runs.items()}
    return Result(states, manifest.runs, titles, stop.reason)


class _Conductor:
    """A loop that submits runs to a scheduler, each after its reference, and records their ends."""

    def __init__(self, study: Study, folder: Path, scheduler: Scheduler, manifest: Manifest, watcher: Watcher) -> None:
        self._study, self._folder, self._scheduler = study, folder, scheduler
        self._manifest, self._watcher = manifest, watcher
        self._open: dict[str, Decision] = {}

    def run(self, todo: Sequence[Decision], stop: StopRequests) -> None:
        """Run all runs, or until a stop is requested."""
        waiting, stopping = list(todo), False
        while waiting or self._open:
            if stop.reason is not None and not stopping:
                stopping = True
                self._scheduler.stop()
            waiting = [] if stopping else self._submit(waiting)
            with suppress(queue.Empty):
                self._note(*self._scheduler.events.get(timeout=TICK_SECONDS))
            self._manifest.keep_up()
            self._watcher.tick()

    def _submit(self, waiting: list[Decision]) -> list[Decision]:
        """Submit the runs that wait for no reference; return the others."""
        pending = {decision.case.digest for decision in waiting} | set(self._open)
        rest = []
        for decision in waiting:
            case = decision.case
            reference = reference_of(self._study, case)
            if reference in pending:
                rest.append(decision)
                continue
            spent = 0.0 if decision.fresh else float(self._manifest.runs[case.digest]["seconds"])
            file = str(run_path(self._folder.resolve(), case.digest))
            fresh = decision.fresh and decision.action == RUN
            self._open[case.digest] = decision
            timed = self._study.timed and bool(case.labels)
            self._scheduler.submit(Order(case.digest, file, dict(case.config), reference, fresh, spent, timed))
        return rest

    def _note(self, kind: str, digest: str, what: Any) -> None:
        if digest not in self._open:  # events of a cluster may come late
            return
        decision, record = self._open[digest], self._manifest.runs[digest]
        if kind == "started":
            self._manifest.set(digest, state=RUNNING, reason=decision.why)
            self._watcher.started(decision)
        elif kind == "step":
            self._watcher.step(decision, what)
        else:
            del self._open[digest]
            if what["state"] == WAITING:
                return
            told = what if decision.action == RUN else {key: what[key] for key in ("state", "reason")}
            self._manifest.set(digest, **told)
            self._watcher.ended(decision, record)


class _Nobody:
    def started(self, decision: Decision) -> None: ...

    def step(self, decision: Decision, step: int) -> None: ...

    def ended(self, decision: Decision, record: dict[str, Any]) -> None: ...

    def tick(self) -> None: ...


def _scheduler(study: Study, workers: int | None, address: str | None, todo: int) -> Scheduler:
    if address is not None:
        from deli.studies.cluster import Cluster

        return Cluster(address, study.limits)
    return Local(min(workers or study.workers or cores(), max(todo, 1)), study.limits)


@contextmanager
def _only_here(folder: Path) -> Iterator[None]:
    lock = FileLock(folder / LOCK, timeout=0)
    try:
        lock.acquire()
    except Timeout as error:
        raise InputError(f"{folder} is being written by another deli study; wait, or name another folder.") from error
    except OSError as error:
        raise InputError(f"{folder} cannot be written: {error.strerror or error}.") from error
    try:
        yield
    finally:
        lock.release()
