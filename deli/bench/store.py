"""The file of results: for each part its date, the versions, the machine and the rows."""

import json
import math
import os
import platform
from pathlib import Path
from typing import Any

from deli.bench.part import Row
from deli.errors import InputError
from deli.recording import provenance
from deli.recording.whole import write_text
from deli.version import __version__

FORMAT = 1
_PACKAGES = ("numpy", "scipy", "numba", "cvxpy", "clarabel", "osqp", "daqp", "piqp")

Results = dict[str, dict[str, Any]]
"""Results by part: ``date``, ``versions``, ``machine``, ``quick`` and ``rows``."""


def entry(rows: list[Row], quick: bool) -> dict[str, Any]:
    """Return rows of a part with the date, the versions and the machine of the measurement."""
    return {
        "date": provenance.now(),
        "versions": {
            "python": platform.python_version(),
            "deli": __version__,
            **{name: provenance.version(name) for name in _PACKAGES},
        },
        "machine": machine(),
        "quick": quick,
        "rows": rows,
    }


def machine() -> dict[str, Any]:
    """Return a description of this machine."""
    return {"platform": platform.platform(), "processor": _processor(), "cores": cores()}


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def read(path: Path) -> Results:
    """Return the results in a file.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no results of this format.
    """
    try:
        content = json.loads(path.read_text())
        form, parts = content["format"], dict(content["parts"])
        for part in parts.values():
            part["rows"] = [dict(row) for row in part["rows"]]
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path} holds no results of `deli bench`.") from error
    if form != FORMAT:
        raise InputError(f"{path}: found format {form!r}; this version reads format {FORMAT}.")
    return parts


def write(path: Path, parts: Results) -> None:
    """Replace the results in a file."""
    text = json.dumps({"format": FORMAT, "parts": _finite(parts)}, indent=1)
    write_text(path, f"{text}\n")


def _finite(value: Any) -> Any:
    """Replace numbers that JSON cannot express by null."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())
