"""Decisions about the runs of a study: to keep, to measure or to run, and why."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deli.errors import InputError
from deli.recording.paths import partial_path
from deli.recording.provenance import NONE_USED, backend_version, flatten
from deli.recording.reading import read_attributes
from deli.recording.seal import sealed
from deli.studies.expansion import Case, Study
from deli.studies.layout import config_path, run_path
from deli.studies.measuring import EXACT, definition, measured
from deli.studies.states import DONE, FAILED, FAILURES, INTERRUPTED, WAITING
from deli.studies.timing import TIMES
from deli.version import __version__

KEEP, MEASURE, RUN = "keep", "measure", "run"
KNOWN = ("outcome", "deli_version", "backend_versions", "machine")
"""The attributes of a run that the manifest keeps."""
RETRY = "--retry-failed"
SHOWN_CHANGES = 3


@dataclass(frozen=True)
class Decision:
    """The decision about one run.

    Attributes
    ----------
    case : Case
    action : str
        ``keep`` the run, ``measure`` the recorded run, or ``run`` it.
    why : str
    fresh : bool
        Whether to start anew rather than to continue from the recorded rows.
    record : dict
        Entries of the run in the manifest until the decision is carried out.
    """

    case: Case
    action: str
    why: str
    fresh: bool = False
    record: Mapping[str, Any] | None = None


def decide(study: Study, folder: Path, earlier: Mapping[str, Any] | None, retry: bool) -> list[Decision]:
    """Decide about every run of a study, references first."""
    records = {} if earlier is None else earlier["runs"]
    before = {} if earlier is None else {_place(entry["labels"]): entry["digest"] for entry in earlier["cases"]}
    found = []
    for digest, case in study.runs.items():
        decision = _of_run(case, run_path(folder, digest), records.get(digest, {}), retry)
        if decision.why == _MISSING and case.labels:
            old = before.get(_place(case.labels))
            decision = Decision(case, RUN, _changes(case, folder, old) if old not in (None, digest) else _MISSING)
        found.append(decision)
    again = {decision.case.digest for decision in found if decision.action == RUN}
    return [_remeasured(decision, study, folder, again) for decision in found]


def reference_of(study: Study, case: Case) -> str | None:
    """Return the name of a case's reference, see `deli.studies.measuring.Measured`."""
    if study.exact:
        return EXACT
    reference = study.references.get(case.digest)
    return None if reference is None or reference.digest == case.digest else reference.digest


_MISSING = "missing"


def _of_run(case: Case, file: Path, record: Mapping[str, Any], retry: bool) -> Decision:
    state = record.get("state")
    if file.exists():
        try:
            told = state in (DONE, FAILED) and set(KNOWN) <= record.keys() and sealed(file)
            known = record if told else read_attributes(file)
        except (InputError, OSError) as error:
            return Decision(case, RUN, f"cannot be read: {error}", fresh=True)
        newer = _newer_versions(known["deli_version"], known["backend_versions"])
        if newer:
            return Decision(case, RUN, newer, fresh=True)
        kept = {key: known[key] for key in KNOWN}
        if known["outcome"] == "complete" and state in FAILURES and not retry:  # while it was measured
            return Decision(case, KEEP, str(state))
        if known["outcome"] == "complete":
            return Decision(case, KEEP, "done", record={**kept, "state": DONE, "reason": ""})
        if retry:
            return Decision(case, RUN, f"failed before, {RETRY}", fresh=True)
        return Decision(case, KEEP, FAILED, record={**kept, "state": FAILED, "reason": known["outcome"]})
    begun = partial_path(file).exists()
    if state in FAILURES:
        if retry:
            return Decision(case, RUN, f"{state} before, {RETRY}", fresh=state == FAILED, record={"seconds": 0.0})
        return Decision(case, KEEP, str(state))
    if not begun:
        return Decision(case, RUN, _MISSING, record={"state": WAITING, "reason": "", "seconds": 0.0})
    try:
        attributes = read_attributes(partial_path(file))
    except InputError as error:
        return Decision(case, RUN, f"cannot be continued: {error}", fresh=True, record={"state": WAITING})
    newer = _newer_versions(attributes["deli_version"], NONE_USED)
    return Decision(case, RUN, newer or "unfinished", fresh=bool(newer), record={"state": INTERRUPTED})


def _remeasured(decision: Decision, study: Study, folder: Path, again: set[str]) -> Decision:
    """Return the decision to measure a kept run if its metrics are missing, outdated, or of another reference."""
    if decision.action != KEEP or (decision.record or {}).get("state") != DONE:
        return decision
    reference = reference_of(study, decision.case)
    try:
        found = measured(run_path(folder, decision.case.digest))
    except InputError as error:
        return Decision(decision.case, MEASURE, str(error), record=decision.record)
    why = ""
    if found is None:
        why = "not measured yet"
    elif found.definition != definition():
        why = "the definition of metrics has changed"
    elif found.reference != reference:
        why = "the reference has changed"
    elif study.timed and decision.case.labels and not set(TIMES) <= found.metrics.keys():
        why = "steps are not timed yet"
    elif reference in again:
        why = "the reference runs again"
    return Decision(decision.case, MEASURE, why, record=decision.record) if why else decision


def _newer_versions(deli: str, backends: str) -> str:
    """Say which versions have changed since a run, of deli and of the backends that the run used."""
    recorded = {"deli": deli}
    if backends != NONE_USED:
        recorded |= {name: found for name, _, found in (entry.partition(" ") for entry in backends.split(", "))}
    present = {name: __version__ if name == "deli" else backend_version(name) for name in recorded}
    return "; ".join(
        f"{name} was {recorded[name]} and is {present[name]}" for name in recorded if recorded[name] != present[name]
    )


def _changes(case: Case, folder: Path, old: str | None) -> str:
    """Say how a case's config differs from the earlier config with the same labels."""
    path = config_path(run_path(folder, str(old)))
    if not path.exists():
        return "config changed"
    try:
        before = flatten(tomllib.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, RecursionError):  # an unreadable config counts as changed
        return "config changed"
    after = flatten(case.config)
    keys = [key for key in before | after if before.get(key) != after.get(key)]
    said = [f"{key} was {before.get(key, 'absent')!r} and is {after.get(key, 'absent')!r}" for key in keys]
    more = [f"{len(said) - SHOWN_CHANGES} more"] if len(said) > SHOWN_CHANGES else []
    return f"config changed: {', '.join([*said[:SHOWN_CHANGES], *more])}"


def _place(labels: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    return tuple(sorted(labels.items()))
