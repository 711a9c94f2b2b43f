"""Reading recorded runs: committed rows only, from files that are finished, cut short or still growing."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from deli.errors import InputError
from deli.recording.netcdf import COMMITTED, ENCODING, LIBRARY, attributes_of, being_written
from deli.recording.schema import CONVENTIONS, STATS, TRAJECTORY, Groups, VariableData


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
        except (OSError, RuntimeError) as error:
            raise InputError(f"{path} is damaged: its rows cannot be read ({error}).") from error
        return groups, attributes_of(dataset)


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
    values = variable[: length[variable.dimensions[0]]] if variable.dimensions[0] in length else variable[:]
    attributes = attributes_of(variable)
    if attributes.pop(ENCODING, None) is None:
        return variable.dimensions, np.asarray(values), attributes
    return variable.dimensions[:-1], values.astype(str), attributes
