"""Paths of recorded runs, and checks that a run can be recorded there."""

import os
from pathlib import Path

from deli.errors import InputError

SUFFIXES = (".nc", ".nc4", ".netcdf")
LONGEST_SHOWN = 300
"""Letters shown of a name that is too long."""


def partial_path(output: str | os.PathLike[str]) -> Path:
    """Return the path of the rows of an unfinished run."""
    return Path(f"{os.fspath(output)}.partial")


def check_name(word: str, path: Path) -> None:
    """Refuse a path that no file can have, and a path through links that lead in a circle.

    Raises
    ------
    InputError
        Naming the file by ``word`` and its path.
    """
    try:
        os.fspath(path).encode()  # netCDF wants UTF-8
        path.stat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        return
    except (OSError, ValueError) as error:  # ValueError: letters that no name can have
        shown = os.fspath(path)[:LONGEST_SHOWN]
        raise InputError(
            f"{word} {shown} cannot be used: {getattr(error, 'strerror', error)}; name another."
        ) from error


def check_output(output: Path, *, resume: bool, overwrite: bool) -> None:
    """Refuse an output that cannot be written, or that exists, before anything is computed.

    Raises
    ------
    InputError
        If the folder is missing or unwritable, if `output` is a folder or has another suffix than netCDF's, or if
        `output` or its partial file exists and neither `resume` nor `overwrite` allows for it.
    """
    if resume and overwrite:
        raise InputError("resume and overwrite are both set; continue the run or start it anew, not both.")
    partial = partial_path(output)
    for path in (output, partial.with_name(f"{partial.name}.new")):
        check_name("output", path)
    folder = output.resolve().parent
    if not folder.is_dir():
        raise InputError(f"output {output}: the folder {folder} does not exist; create it or name another output.")
    if output.is_dir():
        raise InputError(f"output {output} is a folder; name a file, such as {output / 'run.nc'}.")
    if output.suffix.lower() not in SUFFIXES:
        raise InputError(
            f"output {output}: found the suffix {output.suffix!r}; rows are recorded as netCDF, allowed: "
            f"{', '.join(SUFFIXES)}."
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"output {output}: no permission to write in the folder {folder}; name another output.")
    if partial.is_symlink():
        raise InputError(f"{partial} is a link, and rows would go where it leads; remove it, or name another output.")
    if resume or overwrite:
        return
    if output.exists():
        raise InputError(f"output {output} exists; name another, or replace it (overwrite=True, --overwrite).")
    if partial.exists():
        raise InputError(
            f"{partial} holds an unfinished run; continue it (resume=True, --resume), start anew (overwrite=True, "
            "--overwrite), or name another output."
        )
