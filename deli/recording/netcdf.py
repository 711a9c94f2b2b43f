"""Runs on disk: rows appended to ``<output>.partial``, the finished file appearing under its own name by rename."""

import math
import os
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import netCDF4
import numpy as np

from deli.errors import DeliError, InputError
from deli.recording.schema import POSED, STATS, TRAJECTORY, Block, Schema, Variable, coordinates
from deli.recording.subproblems import COUNTED, places

CHUNK_ROWS, CHUNK_PLACES, CHUNK_BYTES = 256, 4096, 1_000_000
COMMITTED, WALL_TIME, COMMITTED_PROBLEMS = "committed_rows", "committed_wall_time", "committed_subproblems"
ENCODING = "_Encoding"
"""The attribute that tells readers to join letters to words."""


LIBRARY = threading.RLock()
"""Held around every use of the netCDF library, which is not safe to use from several threads."""

_writers: WeakValueDictionary[Path, "Writer"] = WeakValueDictionary()


class RecordingError(DeliError):
    """Rows could not be written: a full disk, a vanished folder."""


class Busy(InputError):
    """Another process is writing the file."""


def being_written(path: Path) -> bool:
    """Whether this process is writing the file; other processes are kept out by the library's lock on it."""
    return path.resolve() in _writers


class Writer:
    """Appends rows to a partial file, and commits them.

    A commit writes the rows, syncs, writes their number, and syncs again: whatever kills the process, the rows that
    the number counts are whole. Subproblems are counted before the rows: those of steps beyond the last committed row
    that a kill in between leaves are dropped when the file is continued.

    Attributes
    ----------
    rows : int
        Committed so far.
    ends : dict of str to int
        Where the committed subproblems end along each ragged dimension; empty where none are recorded.
    """

    def __init__(self, path: Path, dataset: netCDF4.Dataset, rows: int, wall_time: float, ends: dict[str, int]) -> None:
        self.path = path
        self.rows = rows
        self.ends = ends
        self._dataset = dataset
        self._earlier = wall_time
        self._started = time.perf_counter()
        self._key = path.resolve()
        _writers[self._key] = self

    @classmethod
    def create(cls, path: Path, schema: Schema, attributes: Mapping[str, Any]) -> "Writer":
        """Start a file without rows; it appears under its name when it is whole."""
        _refuse_second(path)
        fresh = path.with_name(f"{path.name}.new")
        with LIBRARY:
            try:
                if path.exists():
                    netCDF4.Dataset(path, "w").close()  # fails where another process holds the lock
                fresh.unlink(missing_ok=True)  # it may be a link to elsewhere
                dataset = netCDF4.Dataset(fresh, "w", format="NETCDF4")
            except OSError as error:
                raise Busy(f"{path} cannot be written ({error}); is another run writing it?") from error
            _lay_out(dataset, schema, attributes)
            dataset.close()
            os.replace(fresh, path)
            return cls.reopen(path)

    @classmethod
    def reopen(cls, path: Path, steps: int = 0) -> "Writer":
        """Continue a file after its last committed row, to which the run has taken `steps` steps."""
        _refuse_second(path)
        with LIBRARY:
            try:
                dataset = netCDF4.Dataset(path, "a")
            except OSError as error:
                raise Busy(f"{path} cannot be continued ({error}); is another run writing it?") from error
            _forget_what_is_written(dataset)
            ends = _ends(dataset, steps) if POSED in dataset.groups else {}
            return cls(path, dataset, int(dataset[COMMITTED][...]), float(dataset[WALL_TIME][...]), ends)

    @property
    def attributes(self) -> dict[str, Any]:
        """Root attributes that the file has so far."""
        with LIBRARY:
            return attributes_of(self._dataset)

    @property
    def wall_time(self) -> float:
        """Seconds spent on the run, earlier sessions included."""
        return self._earlier + time.perf_counter() - self._started

    def write(self, first_row: int, trajectory: Block, stats: Block, problems: Block | None = None) -> None:
        """Append rows, and subproblems, and commit them."""
        try:
            with LIBRARY:
                self._append(TRAJECTORY, first_row, trajectory)
                self._append(STATS, max(first_row - 1, 0), stats)
                self._dataset[WALL_TIME][...] = self.wall_time
                if problems is not None:
                    self._append_problems(problems)
                self._dataset.sync()
                if problems is not None:
                    self._dataset[COMMITTED_PROBLEMS][...] = self.ends["problem"]
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
        with LIBRARY:
            try:
                self._dataset.setncatts(dict(attributes))
            finally:
                self._dataset.close()
                _writers.pop(self._key, None)
        if rename is None:
            return self.path
        with self.path.open("rb+") as file:
            os.fsync(file.fileno())
        os.replace(self.path, rename)
        return rename

    def _append_problems(self, block: Block) -> None:
        group = self._dataset[POSED]
        for name, values in block.items():
            variable = group[name]
            if not variable.dimensions:
                variable[...] = values
            elif len(values):
                begin = self.ends[variable.dimensions[0]]
                variable[begin : begin + len(values)] = values
        added = {"problem": len(block["rows"]), **{name: int(block[counts].sum()) for name, counts in COUNTED.items()}}
        self.ends = {name: end + added[name] for name, end in self.ends.items()}

    def _append(self, group: str, first: int, block: Block) -> None:
        for name, values in block.items():
            if len(values):
                self._dataset[group][name][first : first + len(values)] = values


def _ends(dataset: netCDF4.Dataset, steps: int) -> dict[str, int]:
    dataset.set_auto_mask(False)
    group, committed = dataset[POSED], int(dataset[COMMITTED_PROBLEMS][...])
    taken = int(np.searchsorted(group["step"][:committed], steps))
    return places({name: group[name] for name in COUNTED.values()}, taken)


def attributes_of(owner: netCDF4.Dataset | netCDF4.Variable) -> dict[str, Any]:
    """Attributes in Python's own types."""
    values = ((name, owner.getncattr(name)) for name in owner.ncattrs())
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in values}


def _refuse_second(path: Path) -> None:
    if being_written(path):
        raise InputError(f"{path} is being written; is another run writing it in this process?")


def _lay_out(dataset: netCDF4.Dataset, schema: Schema, attributes: Mapping[str, Any]) -> None:
    dataset.setncatts(dict(attributes))
    committed = dataset.createVariable(COMMITTED, "i8", (), fill_value=False)
    committed.setncatts({"units": "1", "long_name": "rows that are whole"})
    wall_time = dataset.createVariable(WALL_TIME, "f8", (), fill_value=False)
    wall_time.setncatts({"units": "s", "long_name": "wall time spent on them"})
    committed[...], wall_time[...] = 0, 0.0
    if schema.subproblems:
        problems = dataset.createVariable(COMMITTED_PROBLEMS, "i8", (), fill_value=False)
        problems.setncatts({"units": "1", "long_name": "subproblems that are whole"})
        problems[...] = 0
    constants = schema.constants()
    for name, variables in schema.groups.items():
        group = dataset.createGroup(name)
        group.setncattr("coordinates", " ".join(coordinates(name)))
        for dimension in dict.fromkeys(dim for variable in variables for dim in variable.dims):
            group.createDimension(dimension, schema.sizes.get(dimension))
        for variable in variables:
            if variable.dtype == "str":
                _write_words(group, variable, constants[name][variable.name])
                continue
            created = _create(group, variable, schema.sizes)
            if not variable.grows:
                created[...] = constants[name][variable.name]


def _create(group: netCDF4.Group, variable: Variable, sizes: Mapping[str, int]) -> netCDF4.Variable:
    created: netCDF4.Variable = group.createVariable(
        variable.name,
        np.dtype(variable.dtype),
        variable.dims,
        fill_value=False,
        chunksizes=_chunks(variable, sizes) if variable.grows else None,
    )
    created.set_auto_mask(False)
    created.setncatts(variable.attributes)
    return created


def _chunks(variable: Variable, sizes: Mapping[str, int]) -> list[int]:
    """Shape of the pieces that a variable grows by: whole ones are stored, so rows of many bodies go into small ones."""
    inner = [sizes[dimension] for dimension in variable.dims[1:]]
    usual = CHUNK_PLACES if variable.dims[0] in COUNTED else CHUNK_ROWS
    most = CHUNK_BYTES // (np.dtype(variable.dtype).itemsize * math.prod(inner))
    return [max(1, min(usual, most)), *inner]


def _forget_what_is_written(dataset: netCDF4.Dataset) -> None:
    """Let the library hold one chunk of each variable, where it would hold megabytes of what is on disk already."""
    for group in dataset.groups.values():
        for variable in group.variables.values():
            chunks = variable.chunking()
            if chunks != "contiguous":
                variable.set_var_chunk_cache(variable.dtype.itemsize * math.prod(chunks), 1, 1.0)


def _write_words(group: netCDF4.Group, variable: Variable, words: np.ndarray) -> None:
    """Write words as rows of letters: where a file is opened twice, HDF5 crashes on strings of any length."""
    letters = words.astype(bytes)
    dimension = f"{variable.name}_letter"
    group.createDimension(dimension, letters.itemsize)
    created = group.createVariable(variable.name, "S1", (*variable.dims, dimension), fill_value=False)
    created[:] = letters.view("S1").reshape(*words.shape, letters.itemsize)
    created.setncatts({**variable.attributes, ENCODING: "ascii"})
