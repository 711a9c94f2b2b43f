"""Reading of recorded runs: committed rows only, from files that are finished, cut short, still growing, or damaged.

Files that deli has closed are sealed, and are read in this process if the seal is intact. Other files are read in a
process of their own, because a damaged file can kill it.
"""

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from deli.errors import InputError
from deli.recording import checksums, structure
from deli.recording.apart import load_apart
from deli.recording.contents import LIBRARY, WALL_TIME, Contents, gather, load, open_file
from deli.recording.damage import refuse
from deli.recording.decoding import words_of
from deli.recording.netcdf import being_written
from deli.recording.schema import MEMBER, POSED, TRAJECTORY, Groups, build_tree
from deli.recording.seal import intact
from deli.recording.subproblems import ORIGIN, unpack
from deli.recording.superblock import stated_length
from deli.recording.unfinished import Unfinished, identity_of
from deli.subproblems.posed import PosedSubproblem

if TYPE_CHECKING:
    import xarray as xr

logger = logging.getLogger("deli")


def open_tree(path: Path) -> "xr.DataTree":
    """Return the run of a file, see `read`, or its ensemble, as the tree that users get.

    Raises
    ------
    InputError
        As `read`.
    """
    contents = contents_of(path)
    if holds_ensemble(contents):
        from deli.recording.ensemble_file import tree_of  # imports xarray, which takes a second

        return tree_of(contents, path)
    groups, attributes = read(path, contents)
    return build_tree(groups, attributes)


def holds_ensemble(contents: Contents) -> bool:
    """Return whether a file holds an ensemble."""
    return MEMBER in contents.sizes["/"] and TRAJECTORY in contents.groups


def read(path: Path, contents: Contents | None = None) -> tuple[Groups, dict[str, Any]]:
    """Read the committed rows of a file, finished or not.

    A log line names a finished file that another program has written again; `deli.recording.verify` says whether its
    rows are those that were recorded.

    Returns
    -------
    groups : dict
        Variables as (dims, values, attributes), by group and name.
    attributes : dict
        Root attributes.

    Raises
    ------
    InputError
        If the file is missing, is not a netCDF file, holds no run, or is damaged.
    """
    groups, contents = _run(path, contents)
    if structure.rewritten(contents, path):
        logger.warning("%s is not sealed: another program wrote it; deli check says what still holds", path)
    return groups, contents.attributes


def read_unfinished(path: Path) -> Unfinished:
    """Read the committed rows of a partial file that is to be continued.

    Raises
    ------
    InputError
        As `read`.
    """
    identity = identity_of(path)
    groups, contents = _run(path)
    wall_time = structure.number_of(contents.root, WALL_TIME, path)
    return Unfinished(groups, contents.attributes, wall_time, identity)


def read_attributes(path: Path) -> dict[str, Any]:
    """Read the root attributes of a file only.

    Raises
    ------
    InputError
        If the file is missing, is not a netCDF file, or is damaged.
    """
    attributes = contents_of(path, values=False).attributes
    structure.require_attributes(attributes, path)
    return attributes


def read_subproblems(path: Path) -> tuple[list[PosedSubproblem], list[str]]:
    """Read the subproblems of a run or of a library.

    Returns
    -------
    problems : list of PosedSubproblem
    origins : list of str
        The origin of each, in a word; for a run, the name of its scene.

    Raises
    ------
    InputError
        If the file cannot be read or has no subproblems.
    """
    contents = contents_of(path)
    if POSED not in contents.groups:
        raise InputError(
            f"{path} holds no subproblems; record them with record.subproblems = true in the config "
            f"(deli run ... --set record.subproblems=true) or deli.simulate(..., subproblems=True)."
        )
    problems = unpack({name: values for name, (_, values, _) in structure.problems_of(contents, path).items()})
    if not problems:
        raise InputError(f"{path} holds no subproblems: nothing was solved in the run; skip = false solves all.")
    if ORIGIN in contents.groups[POSED]:
        origins = words_of(contents.groups[POSED][ORIGIN], f"{POSED}/{ORIGIN}", path).tolist()
        return problems, origins[: len(problems)]
    scene = structure.config_of(contents.attributes, path)["scene"]
    return problems, [scene.get("label", scene["name"])] * len(problems)


@dataclass(frozen=True)
class Examined:
    """A file with the evidence that `deli.recording.verify` judges.

    Attributes
    ----------
    groups, attributes : dict
        See `read`.
    stored : int
        Number of rows in the file, committed or not.
    counted : bool
        Whether the number of committed rows is known; another program that wrote the file may have left rows out.
    sealed : bool
        Whether the file has the digest of its content.
    broken : list of str, or None
        Variables whose committed numbers have changed; None for a file without checksums.
    """

    groups: Groups
    attributes: dict[str, Any]
    stored: int
    counted: bool
    sealed: bool
    broken: list[str] | None


def examine(path: Path, contents: Contents | None = None) -> Examined:
    """Read a file with its counts, its seal and its checksums.

    Raises
    ------
    InputError
        As `read`.
    """
    groups, contents = _run(path, contents)
    broken = checksums.broken(contents.root, groups, len(groups[TRAJECTORY]["time"][1]))
    stored, counted = contents.sizes[TRAJECTORY]["time"], not structure.rewritten(contents, path)
    return Examined(groups, contents.attributes, stored, counted, contents.trusted, broken)


def _run(path: Path, contents: Contents | None = None) -> tuple[Groups, Contents]:
    if contents is None:
        contents = contents_of(path)
    groups = structure.run_of(contents, path)
    if not contents.trusted:
        structure.config_of(contents.attributes, path)
    if path.suffix == ".partial":
        rows = len(groups[TRAJECTORY]["time"][1])
        broken = checksums.broken(contents.root, groups, rows)
        if broken:
            names = ", ".join(broken)
            refuse(path, f"checksums of {names} differ; if a run is writing it, try again in a moment")
    return groups, contents


def contents_of(path: Path, values: bool = True) -> Contents:
    """Return the contents of a file, `trusted` if they are as deli wrote them.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    if not path.exists():
        raise InputError(f"{path} does not exist.")
    if not path.is_file():
        raise InputError(f"{path} cannot be read as netCDF: it is not a file.")
    live = being_written(path)
    if not live and not _sealed(path):
        return load_apart(path, values)
    with LIBRARY, open_file(path, live) as dataset:
        contents = gather(load(dataset, path, values))
        contents.trusted = True
        return contents


def _sealed(path: Path) -> bool:
    """Return whether a file is sealed; refuse a file whose seal is broken, or that was cut off."""
    try:
        found, length, stated = intact(path), path.stat().st_size, stated_length(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error}).") from error
    if found is False:
        refuse(path, "its content has changed since it was closed: the digest differs")
    if stated is not None and length < stated:
        hint = "; if a run is writing it, try again in a moment" if path.suffix == ".partial" else ""
        refuse(path, f"it was cut off, {length:,} of {stated:,} bytes are there{hint}")
    return bool(found)
