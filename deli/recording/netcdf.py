"""Runs on disk: rows appended to ``<output>.partial``, the finished file appearing under its own name by rename."""

import fcntl
import os
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import netCDF4
import numpy as np

from deli.errors import DeliError, InputError
from deli.recording.checksums import Checksums
from deli.recording.contents import COMMITTED, COMMITTED_PROBLEMS, ENCODING, LIBRARY, WALL_TIME, attributes_of
from deli.recording.schema import POSED, STATS, TRAJECTORY, Block, Schema, Variable, coordinates
from deli.recording.seal import seal
from deli.recording.subproblems import COUNTED, taken
from deli.recording.unfinished import Unfinished, identity_of

CHUNK_ROWS, CHUNK_PLACES = 256, 4096

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
    that a kill in between leaves are dropped when the file is continued. Files that are closed are sealed, see
    `deli.recording.seal`.

    Attributes
    ----------
    rows : int
        Committed so far.
    ends : dict of str to int
        Where the committed subproblems end along each ragged dimension; empty where none are recorded.
    """

    def __init__(self, path: Path, schema: Schema, attributes: Mapping[str, Any], wall_time: float = 0.0) -> None:
        self.path = path
        self.rows = 0
        self.ends = dict.fromkeys(("problem", *COUNTED), 0) if schema.subproblems else {}
        try:
            self._dataset = netCDF4.Dataset(_beside(path), "w", format="NETCDF4")
        except OSError as error:
            raise Busy(f"{path} cannot be written ({error}); is another run writing it?") from error
        self._checksums = Checksums(schema)
        self._earlier = wall_time
        self._started = time.perf_counter()
        self._key = path.resolve()
        _lay_out(self._dataset, schema, attributes)
        self._checksums.lay_out(self._dataset)

    @classmethod
    def create(cls, path: Path, schema: Schema, attributes: Mapping[str, Any]) -> "Writer":
        """Start a file without rows; it appears under its name when it is whole."""
        with LIBRARY, _held(path):
            writer = cls(path, schema, attributes)
            writer._appear()
            return writer

    @classmethod
    def resume(
        cls, path: Path, schema: Schema, attributes: Mapping[str, Any], found: Unfinished, steps: int
    ) -> "Writer":
        """Go on after the rows of an unfinished file, to the last of which the run has taken `steps` steps.

        They are written to another file, which takes the place of the first when it is whole: what is damaged in a file
        where nobody has looked must not get into the hands of who writes. Subproblems of later steps are left out.
        """
        problems = found.groups.get(POSED)
        with LIBRARY, _held(path, found.identity):
            writer = cls(path, schema, attributes, found.wall_time)
            writer.write(
                0,
                {name: found.groups[TRAJECTORY][name][1] for name in schema.growing(TRAJECTORY)},
                {name: found.groups[STATS][name][1] for name in schema.growing(STATS)},
                None if problems is None else taken({name: one[1] for name, one in problems.items()}, steps),
            )
            writer._appear()
            return writer

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
                rows = first_row + len(trajectory["time"])
                self._checksums.write(self._dataset, rows, self.ends.get("problem", 0))
                self._dataset.sync()
                if problems is not None:
                    self._count(COMMITTED_PROBLEMS, self.ends["problem"])
                self._count(COMMITTED, rows)
                self.rows = rows
        except (OSError, RuntimeError) as error:
            raise RecordingError(
                f"rows from {first_row} on could not be written to {self.path} ({error}); rows before are safe. "
                "Is the disk full?"
            ) from error

    def close(self, attributes: Mapping[str, Any], rename: Path | None) -> Path:
        """Write closing attributes, close, seal, and give the file its final name if there is one; returns its path."""
        with LIBRARY:
            try:
                self._dataset.setncatts(dict(attributes))
            finally:
                self._dataset.close()
                _writers.pop(self._key, None)
        seal(self.path)
        if rename is None:
            return self.path
        os.replace(self.path, rename)
        return rename

    def _appear(self) -> None:
        """Give the file its name, under which others find it from now on."""
        self._dataset.close()
        os.replace(_beside(self.path), self.path)
        self._dataset = netCDF4.Dataset(self.path, "a")
        _writers[self._key] = self

    def _count(self, what: str, number: int) -> None:
        """Commit what has been written."""
        self._dataset[what][...] = number
        self._dataset.sync()

    def _append_problems(self, block: Block) -> None:
        group = self._dataset[POSED]
        self._checksums.add(POSED, block)
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
        self._checksums.add(group, block)
        for name, values in block.items():
            if len(values):
                self._dataset[group][name][first : first + len(values)] = values


@contextmanager
def _held(path: Path, identity: tuple[int, int, int] | None = None) -> Iterator[None]:
    """Keep others from a file that is to be replaced, if there is one.

    Raises
    ------
    Busy
        If somebody writes it, or has done so since it was the one of that `identity`.
    """
    if being_written(path):
        raise InputError(f"{path} is being written; is another run writing it in this process?")
    if not path.exists():
        yield
        return
    try:
        file = path.open("rb+")
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # as HDF5 does
    except OSError as error:
        raise Busy(f"{path} cannot be written ({error}); is another run writing it?") from error
    with file:
        if identity not in (None, identity_of(path)):
            raise Busy(f"{path} has just been written by another run.")
        yield


def _beside(path: Path) -> Path:
    """Where a file is made that is to take the place of another."""
    return path.with_name(f"{path.name}.new")


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
    usual = CHUNK_PLACES if variable.dims and variable.dims[0] in COUNTED else CHUNK_ROWS
    chunks = [sizes.get(dimension, usual) for dimension in variable.dims] if variable.grows else None
    created: netCDF4.Variable = group.createVariable(
        variable.name, np.dtype(variable.dtype), variable.dims, fill_value=False, chunksizes=chunks
    )
    created.set_auto_mask(False)
    created.setncatts(variable.attributes)
    return created


def _write_words(group: netCDF4.Group, variable: Variable, words: np.ndarray) -> None:
    """Write words as rows of letters: where a file is opened twice, HDF5 crashes on strings of any length."""
    letters = words.astype(bytes)
    dimension = f"{variable.name}_letter"
    group.createDimension(dimension, letters.itemsize)
    created = group.createVariable(variable.name, "S1", (*variable.dims, dimension), fill_value=False)
    created[:] = letters.view("S1").reshape(*words.shape, letters.itemsize)
    created.setncatts({**variable.attributes, ENCODING: "ascii"})
