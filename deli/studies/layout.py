"""The layout of a study's folder."""

import json
from pathlib import Path
from typing import Any

from deli.errors import InputError

MANIFEST, CASES = "manifest.json", "cases"
PICTURES, TEXT, PAGE = REPORT = ("report", "report.md", "report.html")


def run_path(folder: Path, digest: str) -> Path:
    """Return the file of a case's run."""
    return folder / CASES / f"{digest}.nc"


def config_path(run: Path) -> Path:
    """Return the file of a run's config, with which ``deli run`` repeats the run alone."""
    return run.with_suffix(".toml")


def metrics_path(run: Path) -> Path:
    """Return the file of a run's metrics."""
    return run.with_suffix(".json")


def read_json(path: Path) -> Any:
    """Read a JSON file that deli wrote.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read: {error}.") from error
