"""The studies that come with deli, by name."""

from pathlib import Path

from deli.config.models import listed
from deli.errors import InputError
from deli.shipped import FOLDER

FAMILIES = ("", "work_precision", "stability")
"""Folders of studies; the name of a study begins with that of its folder."""


def studies() -> dict[str, Path]:
    """Return the file of each study by name, such as ``stability/gap``."""
    files = [path for family in FAMILIES for path in sorted((FOLDER / family).glob("*.toml"))]
    return {path.relative_to(FOLDER).with_suffix("").as_posix(): path for path in files}


def is_both(source: Path) -> bool:
    """Return whether a plain file is called like a study that comes with deli."""
    return source.as_posix() in studies() and source.is_file()


def find(source: Path) -> Path:
    """Return the file of a study, which is given by its path or by the name of one that comes with deli.

    A file wins over a study of the same name; a folder, such as that of the study's runs, does not.

    Raises
    ------
    InputError
        If there is neither, and the path does not end in ``.toml``: a reader says more of one that does.
    """
    known = studies()
    if source.as_posix() in known:
        return source if source.is_file() else known[source.as_posix()]
    if source.suffix != ".toml" and not _exists(source):
        raise InputError(f"{source} is no file, and no study that comes with deli; {listed(source.as_posix(), known)}.")
    return source


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # of names that no file has
        return False
