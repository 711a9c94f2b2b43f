"""Kinds of files that commands take, and the message about a file of another kind."""

import stat
from dataclasses import dataclass
from pathlib import Path

from deli.errors import InputError

HDF5, CLASSIC = b"\x89HDF\r\n\x1a\n", b"CDF"
STUDY_KEYS = {"base", "axes", "zip", "cases", "exclude", "reference", "limits", "plots"}
FIGURE_KEYS = {"panels", "view", "claim", "runs", "notes"}
CONFIG_KEYS = {"scene", "method", "step_size", "steps", "duration", "skip", "contact_tolerance", "solvers", "record"}


@dataclass(frozen=True)
class Kind:
    """A kind of file: its name, and the commands that take it."""

    name: str
    taken_by: str


CONFIG = Kind("a run's config", "deli run and deli check take it")
STUDY = Kind("a study's file", "deli study takes it")
FIGURE = Kind("a figure's config", "deli figures takes its name, with its folder as --configs")
NETCDF = Kind("a netCDF file, as runs are recorded in", "deli plot, deli animate, deli check and deli replay take it")
STUDY_FOLDER = Kind("a study's folder", "deli report takes it, and deli study continues it as -o")
FIGURE_FOLDER = Kind("a folder of figures", "deli figures continues it as -o")
CONFIG_FOLDER = Kind(
    "a folder of configs", "deli figures takes one of figures as --configs, other commands a file in it"
)
FOLDER = Kind("a folder", "no command takes it; name a file in it")
PYTHON = Kind("a Python file", "python takes it")
NOTEBOOK = Kind("a notebook", "jupyter lab takes it")
PICTURE = Kind("a picture", "no command takes it; a viewer does")
RESULTS = Kind("a JSON file", "deli bench takes its results as -o and --against")
PAGE = Kind("a page", "no command takes it; a browser does")

SUFFIXES = {
    ".py": PYTHON,
    ".ipynb": NOTEBOOK,
    ".json": RESULTS,
    **dict.fromkeys((".png", ".pdf", ".svg", ".gif", ".mp4", ".jpg", ".jpeg"), PICTURE),
    **dict.fromkeys((".html", ".md"), PAGE),
}


def require_kind(path: Path, command: str, takes: str, *kinds: Kind) -> None:
    """Refuse a file of another kind than a command takes.

    A file that is missing, unreadable or of unknown kind passes, because the command's own reader says more about it.

    Raises
    ------
    InputError
        With the kind of the file and the commands that take it.
    """
    kind = kind_of(path)
    if kind is not None and kind not in kinds:
        raise InputError(f"{path} is {kind.name}: {kind.taken_by}; deli {command} takes {takes}.")


def kind_of(path: Path) -> Kind | None:
    """Return the kind of a file or a folder by its name and its beginning, or None if it is unknown."""
    try:
        mode = path.stat().st_mode
        if stat.S_ISDIR(mode):
            return _kind_of_folder(path)
        if not stat.S_ISREG(mode):
            return None
        with path.open("rb") as file:
            start = file.read(len(HDF5))
        if start == HDF5 or start.startswith(CLASSIC):
            return NETCDF
        return _kind_of_toml(path) if path.suffix == ".toml" else SUFFIXES.get(path.suffix.lower())
    except (OSError, ValueError):  # a ValueError comes of an impossible file name
        return None


def _kind_of_folder(path: Path) -> Kind:
    from deli.studies.layout import MANIFEST

    if (path / MANIFEST).exists():
        return STUDY_FOLDER
    if (path / "runs").is_dir():
        return FIGURE_FOLDER
    return CONFIG_FOLDER if any(path.glob("*.toml")) else FOLDER


def _kind_of_toml(path: Path) -> Kind | None:
    from deli.config.reading import read_toml

    try:
        keys = read_toml(path)[1].keys()
    except InputError:
        return None
    known = ((FIGURE, FIGURE_KEYS), (STUDY, STUDY_KEYS), (CONFIG, CONFIG_KEYS))
    return next((kind for kind, own in known if keys & own), None)
