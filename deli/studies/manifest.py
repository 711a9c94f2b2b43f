"""The manifest of a study's folder, ``manifest.json``, which is always replaced as a whole."""

import json
import os
import platform
import time
from pathlib import Path
from typing import Any

from deli.errors import InputError
from deli.recording.provenance import now
from deli.recording.whole import write_text
from deli.studies.expansion import Study
from deli.studies.layout import MANIFEST, read_json
from deli.studies.manifest_model import check_manifest
from deli.studies.states import RUNNING, WAITING
from deli.version import __version__

FORMAT = 1
SECONDS_BETWEEN_WRITES = 0.5

Record = dict[str, Any]
"""The record of one run: state, reason, steps, seconds, and after its end versions, machine and load."""


class Manifest:
    """The manifest of a running study.

    Attributes
    ----------
    runs : dict
        `Record` by digest.
    """

    def __init__(
        self, folder: Path, study: Study, earlier: dict[str, Any] | None, session: dict[str, Any] | None
    ) -> None:
        self._path, self._written, self._behind = folder / MANIFEST, 0.0, False
        records = {} if earlier is None else earlier["runs"]
        fresh = {"state": WAITING, "reason": "", "seconds": 0.0}
        self.runs: dict[str, Record] = {
            digest: {**records.get(digest, fresh), "steps": case.steps} for digest, case in study.runs.items()
        }
        self._sessions: list[dict[str, Any]] = [] if earlier is None else earlier["sessions"]
        if session is not None:
            self._sessions.append({**_circumstances(), **session})
        self._rest = {
            "format": FORMAT,
            "title": study.title,
            "study": study.text,
            "timed": study.timed,
            "limits": study.limits.model_dump(),
            "sessions": self._sessions,
            "dimensions": [
                {
                    "name": dimension.name,
                    "keys": list(dimension.keys),
                    "positions": [{"label": each.label, "changes": dict(each.changes)} for each in dimension.positions],
                }
                for dimension in study.dimensions
            ],
            "cases": [{"labels": dict(case.labels), "digest": case.digest} for case in study.cases],
            "references": {digest: reference.digest for digest, reference in study.references.items()},
        }

    def set(self, digest: str, **changes: Any) -> None:
        """Change a run's record; write an end at once, and leave a beginning to `keep_up`."""
        self.runs[digest] |= changes
        self._behind = True
        if changes.get("state") != RUNNING:
            self.write()

    def keep_up(self) -> None:
        """Write the manifest if it has changed, at most every `SECONDS_BETWEEN_WRITES`."""
        if self._behind and time.monotonic() - self._written > SECONDS_BETWEEN_WRITES:
            self.write()

    def write(self) -> None:
        """Write the manifest."""
        if self._sessions:
            self._sessions[-1]["end"] = now()
        write_text(self._path, json.dumps({**self._rest, "runs": self.runs}, indent=1))
        self._written, self._behind = time.monotonic(), False


def _circumstances() -> dict[str, Any]:
    return {
        "start": now(),
        "machine": f"{platform.node()}, {platform.platform()}, {os.cpu_count()} CPUs",
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        "deli_version": __version__,
    }


def read_manifest(folder: Path) -> dict[str, Any] | None:
    """Read a folder's manifest, or return None if there is none.

    Raises
    ------
    InputError
        If the manifest cannot be read, is damaged, or has another format.
    """
    path = folder / MANIFEST
    if not path.exists():
        return None
    found = read_json(path)
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputError(f"{path} is no manifest of format {FORMAT}; name another folder.")
    check_manifest(found, path)
    return found
