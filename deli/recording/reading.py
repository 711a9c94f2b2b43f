"""Reading recorded runs: committed rows only, from files that are finished, cut short or still growing."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from deli.errors import InputError
from deli.recording.netcdf import COMMITTED, COMMITTED_PROBLEMS, ENCODING, LIBRARY, attributes_of, being_written
from deli.recording.schema import CONVENTIONS, POSED, STATS, TRAJECTORY, Groups, VariableData
from deli.recording.subproblems import COUNTED, ORIGIN, places, unpack
from deli.subproblems.posed import PosedSubproblem


def read(path: Path) -> tuple[Groups, dict[str, Any]]:
    """Read the committed rows of a file, finished or not.

    Returns
    -------
    groups : dict
        Variables as (dims, values, attributes), by group and name.
    attributes : dict
        Root attributes.

    Raises
    ------
    InputError
        If the file is missing, is no netCDF file or was not written by deli.
    """
    with LIBRARY, _open(path) as dataset:
        found = dataset.getncattr("Conventions") if "Conventions" in dataset.ncattrs() else None
        if COMMITTED not in dataset.variables or not {TRAJECTORY, STATS} <= set(dataset.groups):
            raise InputError(f"{path} is a netCDF file, but not a run recorded by deli.")
        if found != CONVENTIONS:
            raise InputError(f"{path} follows the conventions {found!r}; this version of deli reads {CONVENTIONS!r}.")
        dataset.set_auto_maskandscale(False)
        rows = int(dataset[COMMITTED][...])
        length = {"time": rows, "step": max(rows - 1, 0)}
        groups = {}
        try:
            for group in (TRAJECTORY, STATS):
                groups[group] = {name: _read(variable, length) for name, variable in dataset[group].variables.items()}
            if POSED in dataset.groups:
                groups[POSED] = _read_problems(dataset)
        except (OSError, RuntimeError) as error:
            raise InputError(f"{path} is damaged: its rows cannot be read ({error}).") from error
        return groups, attributes_of(dataset)


def read_attributes(path: Path) -> dict[str, Any]:
    """Read root attributes only.

    Raises
    ------
    InputError
        If the file is missing or is no netCDF file.
    """
    with LIBRARY, _open(path) as dataset:
        return attributes_of(dataset)


def read_subproblems(path: Path) -> tuple[list[PosedSubproblem], list[str]]:
    """Read the subproblems in a file: a run's, or a library's.

    Returns
    -------
    problems : list of PosedSubproblem
    origins : list of str
        Where each comes from, in a word; of a run, its scene.

    Raises
    ------
    InputError
        If the file cannot be read or has no subproblems.
    """
    with LIBRARY, _open(path) as dataset:
        if POSED not in dataset.groups:
            raise InputError(
                f"{path} holds no subproblems; record them with record.subproblems = true in the config "
                f"(deli run ... --set record.subproblems=true) or deli.simulate(..., subproblems=True)."
            )
        dataset.set_auto_maskandscale(False)
        try:
            variables = _read_problems(dataset)
            problems = unpack({name: values for name, (_, values, _) in variables.items()})
        except (OSError, RuntimeError, KeyError, IndexError, ValueError) as error:
            raise InputError(f"{path} is damaged: its subproblems cannot be read ({error}).") from error
        if not problems:
            raise InputError(f"{path} holds no subproblems: nothing was solved in the run; skip = false solves all.")
        if ORIGIN in variables:
            return problems, variables[ORIGIN][1].tolist()
        table = tomllib.loads(attributes_of(dataset).get("config", ""))
        scene = table.get("scene", {})
        return problems, [scene.get("label", scene.get("name", ""))] * len(problems)


def _read_problems(dataset: netCDF4.Dataset) -> dict[str, VariableData]:
    group = dataset[POSED]
    committed = COMMITTED_PROBLEMS in dataset.variables
    count = int(dataset[COMMITTED_PROBLEMS][...]) if committed else len(group.dimensions["problem"])
    ends = places({name: group[name] for name in COUNTED.values()}, count)
    return {name: _read(variable, ends) for name, variable in group.variables.items()}


def stored_rows(path: Path) -> int:
    """Rows that a file holds, committed or not."""
    with LIBRARY, _open(path) as dataset:
        return len(dataset[TRAJECTORY].dimensions["time"])


def _open(path: Path) -> netCDF4.Dataset:
    if not path.exists():
        raise InputError(f"{path} does not exist.")
    if not being_written(path):
        try:
            return netCDF4.Dataset(path, "r")
        except OSError as locked:
            if path.suffix != ".partial":
                raise InputError(f"{path} cannot be read as netCDF ({locked}); was it written by deli?") from locked
    # A running writer holds the file; what it has synced is on disk and readable as a copy.
    try:
        return netCDF4.Dataset(path.name, "r", memory=path.read_bytes())
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error}); if a run is writing it, try again in a moment.") from error


def _read(variable: netCDF4.Variable, length: Mapping[str, int]) -> VariableData:
    first = variable.dimensions[0] if variable.dimensions else ""
    values = variable[: length[first]] if first in length else variable[...]
    attributes = attributes_of(variable)
    if attributes.pop(ENCODING, None) is None:
        return variable.dimensions, np.asarray(values), attributes
    return variable.dimensions[:-1], values.astype(str), attributes
