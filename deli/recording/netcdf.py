"""Runs on disk: rows appended to ``<output>.partial``, the finished file appearing under its own name by rename."""

import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from deli.errors import DeliError, InputError
from deli.recording.schema import STATS, TRAJECTORY, Block, Groups, Schema, Variable, VariableData, coordinates

CHUNK_ROWS = 256
COMMITTED, WALL_TIME = "committed_rows", "committed_wall_time"


class RecordingError(DeliError):
    """Rows could not be written: a full disk, a vanished folder."""


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


class Writer:
    """Appends rows to a partial file, and commits them.

    A commit writes the rows, syncs, writes their number, and syncs again: whatever kills the process, the rows that
    the number counts are whole.
    """

    def __init__(self, path: Path, dataset: netCDF4.Dataset, rows: int, wall_time: float) -> None:
        self.path = path
        self.rows = rows
        self._dataset = dataset
        self._earlier = wall_time
        self._started = time.perf_counter()

    @classmethod
    def create(cls, path: Path, schema: Schema, attributes: Mapping[str, Any]) -> "Writer":
        """Start a file without rows; it appears under its name when it is whole."""
        fresh = path.with_name(f"{path.name}.new")
        try:
            if path.exists():
                netCDF4.Dataset(path, "w").close()  # fails where another run holds the lock
            dataset = netCDF4.Dataset(fresh, "w", format="NETCDF4")
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error}); is another run writing it?") from error
        dataset.setncatts(dict(attributes))
        committed = dataset.createVariable(COMMITTED, "i8", (), fill_value=False)
        committed.setncatts({"units": "1", "long_name": "rows that are whole"})
        wall_time = dataset.createVariable(WALL_TIME, "f8", (), fill_value=False)
        wall_time.setncatts({"units": "s", "long_name": "wall time spent on them"})
        committed[...], wall_time[...] = 0, 0.0
        constants = schema.constants()
        for name, variables in schema.groups.items():
            group = dataset.createGroup(name)
            group.setncattr("coordinates", " ".join(coordinates(name)))
            for dimension in dict.fromkeys(dim for variable in variables for dim in variable.dims):
                group.createDimension(dimension, schema.sizes.get(dimension))
            for variable in variables:
                created = _create(group, variable, schema.sizes)
                if not variable.grows:
                    values = constants[name][variable.name]
                    created[:] = values.astype(object) if variable.dtype == "str" else values
        dataset.close()
        os.replace(fresh, path)
        return cls.reopen(path)

    @classmethod
    def reopen(cls, path: Path) -> "Writer":
        """Continue a file after its last committed row."""
        try:
            dataset = netCDF4.Dataset(path, "a")
        except OSError as error:
            raise InputError(f"{path} cannot be continued ({error}); is another run writing it?") from error
        return cls(path, dataset, int(dataset[COMMITTED][...]), float(dataset[WALL_TIME][...]))

    @property
    def attributes(self) -> dict[str, Any]:
        """Root attributes that the file has so far."""
        return _attributes(self._dataset)

    @property
    def wall_time(self) -> float:
        """Seconds spent on the run, earlier sessions included."""
        return self._earlier + time.perf_counter() - self._started

    def write(self, first_row: int, trajectory: Block, stats: Block) -> None:
        """Append rows and commit them."""
        first_step = max(first_row - 1, 0)
        try:
            for group, first, block in ((TRAJECTORY, first_row, trajectory), (STATS, first_step, stats)):
                for name, values in block.items():
                    if len(values):
                        self._dataset[group][name][first : first + len(values)] = values
            self._dataset[WALL_TIME][...] = self.wall_time
            self._dataset.sync()
            self.rows = first_row + len(trajectory["time"])
            self._dataset[COMMITTED][...] = self.rows
            self._dataset.sync()
        except (OSError, RuntimeError) as error:
            raise RecordingError(
                f"rows from {first_row} on could not be written to {self.path} ({error}); rows before are safe. "
                "Is the disk full?"
            ) from error

    def close(self, attributes: Mapping[str, Any], rename: Path | None) -> Path:
        """Write closing attributes, close, and give the file its final name if there is one; returns its path."""
        try:
            self._dataset.setncatts(dict(attributes))
        finally:
            self._dataset.close()
        if rename is None:
            return self.path
        os.replace(self.path, rename)
        return rename


def _create(group: netCDF4.Group, variable: Variable, sizes: Mapping[str, int]) -> netCDF4.Variable:
    created: netCDF4.Variable
    if variable.dtype == "str":
        created = group.createVariable(variable.name, str, variable.dims)
    else:
        chunks = [sizes.get(dimension, CHUNK_ROWS) for dimension in variable.dims] if variable.grows else None
        created = group.createVariable(
            variable.name, np.dtype(variable.dtype), variable.dims, fill_value=False, chunksizes=chunks
        )
    created.set_auto_mask(False)
    created.setncatts(variable.attributes)
    return created


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
    with _open(path) as dataset:
        if COMMITTED not in dataset.variables or not {TRAJECTORY, STATS} <= set(dataset.groups):
            raise InputError(f"{path} is a netCDF file, but not a run recorded by deli.")
        dataset.set_auto_maskandscale(False)
        rows = int(dataset[COMMITTED][...])
        length = {"time": rows, "step": max(rows - 1, 0)}
        groups = {}
        for group in (TRAJECTORY, STATS):
            groups[group] = {name: _read(variable, length) for name, variable in dataset[group].variables.items()}
        return groups, _attributes(dataset)


def stored_rows(path: Path) -> int:
    """Rows that a file holds, committed or not."""
    with _open(path) as dataset:
        return len(dataset[TRAJECTORY].dimensions["time"])


def _open(path: Path) -> netCDF4.Dataset:
    if not path.exists():
        raise InputError(f"{path} does not exist.")
    try:
        return netCDF4.Dataset(path, "r")
    except OSError as locked:
        if path.suffix != ".partial":
            raise InputError(f"{path} cannot be read as netCDF ({locked}); was it written by deli?") from locked
    # A running writer holds the file's lock; what it has synced is on disk and readable as a copy.
    try:
        return netCDF4.Dataset(path.name, "r", memory=path.read_bytes())
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error}); if a run is writing it, try again in a moment.") from error


def _read(variable: netCDF4.Variable, length: Mapping[str, int]) -> VariableData:
    values = variable[: length[variable.dimensions[0]]] if variable.dimensions[0] in length else variable[:]
    values = values.astype(str) if variable.dtype is str else np.asarray(values)
    return variable.dimensions, values, _attributes(variable)


def _attributes(owner: netCDF4.Dataset | netCDF4.Variable) -> dict[str, Any]:
    values = ((name, owner.getncattr(name)) for name in owner.ncattrs())
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in values}
