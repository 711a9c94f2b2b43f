"""Where a run is recorded, and whether that is possible."""

import os
from pathlib import Path

from deli.errors import InputError


def partial_path(output: str | os.PathLike[str]) -> Path:
    """Where rows of an unfinished run are kept."""
    return Path(f"{os.fspath(output)}.partial")


def check_output(output: Path, *, resume: bool, overwrite: bool) -> None:
    """Refuse an output that cannot be written, or that holds something, before anything is computed.

    Raises
    ------
    InputError
        If the folder is missing or unwritable, if `output` is a folder, or if `output` or its partial file exists
        and neither `resume` nor `overwrite` allows for it.
    """
    folder, partial = output.resolve().parent, partial_path(output)
    if resume and overwrite:
        raise InputError("resume and overwrite are both set; continue the run or start it anew, not both.")
    if not folder.is_dir():
        raise InputError(f"output {output}: the folder {folder} does not exist; create it or name another output.")
    if output.is_dir():
        raise InputError(f"output {output} is a folder; name a file, such as {output / 'run.nc'}.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"output {output}: no permission to write in the folder {folder}; name another output.")
    if resume or overwrite:
        return
    if output.exists():
        raise InputError(f"output {output} exists; name another, or replace it (overwrite=True, --overwrite).")
    if partial.exists():
        raise InputError(
            f"{partial} holds an unfinished run; continue it (resume=True, --resume), start anew (overwrite=True, "
            "--overwrite), or name another output."
        )
