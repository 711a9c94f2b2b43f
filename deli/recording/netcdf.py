"""Runs on disk: rows appended to ``<output>.partial``, the finished file appearing under its own name by rename."""

import fcntl
import glob
import os
import shutil
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO
from weakref import WeakValueDictionary

import netCDF4
import numpy as np
import psutil

from deli.errors import DeliError, InputError
from deli.recording import chunks
from deli.recording.schema import POSED, STATS, TRAJECTORY, Block, Schema, Variable, coordinates
from deli.recording.subproblems import COUNTED, places

CHUNK_ROWS, CHUNK_PLACES = 256, 4096
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
    that a kill in between leaves are dropped when the file is continued. What changes more of the file than numbers in
    their places is done to a file of another name, which then takes the place of the first: laying it out, making room
    in its trees of chunks, continuing it, closing it.

    Attributes
    ----------
    rows : int
        Committed so far.
    ends : dict of str to int
        Where the committed subproblems end along each ragged dimension; empty where none are recorded.
    """

    def __init__(
        self, path: Path, place: Path, dataset: netCDF4.Dataset, rows: int, wall_time: float, ends: dict[str, int]
    ) -> None:
        self.path = path
        self.rows = rows
        self.ends = ends
        self._dataset, self._place = dataset, place
        self._replaced: BinaryIO | None = None
        self._reserved = 0
        self._identity = _identity(place)
        self._chunks = chunks.chunk_lengths(dataset)
        self._earlier = wall_time
        self._started = time.perf_counter()
        self._key = path.resolve()
        _writers[self._key] = self

    @classmethod
    def create(cls, path: Path, schema: Schema, attributes: Mapping[str, Any]) -> "Writer":
        """Start a file; it appears under its name with its first rows."""
        _refuse_second(path)
        fresh = path.with_name(f"{path.name}.{os.getpid()}.new")
        with LIBRARY, _recording(path, "the file"):
            replaced = _hold(path)
            _sweep(path)
            dataset = netCDF4.Dataset(fresh, "w", format="NETCDF4")
            _lay_out(dataset, schema, attributes)
            chunks.write_through(dataset)
            ends = dict.fromkeys(("problem", *COUNTED), 0) if schema.subproblems else {}
            writer = cls(path, fresh, dataset, 0, 0.0, ends)
            writer._replaced = replaced
            return writer

    @classmethod
    def reopen(cls, path: Path, steps: int = 0) -> "Writer":
        """Continue a file after its last committed row, to which the run has taken `steps` steps."""
        _refuse_second(path)
        with LIBRARY, _recording(path, "a copy to continue"):
            try:
                dataset = netCDF4.Dataset(path, "a")
            except OSError as error:
                raise Busy(f"{path} cannot be continued ({error}); is another run writing it?") from error
            ends = _ends(dataset, steps) if POSED in dataset.groups else {}
            writer = cls(path, path, dataset, int(dataset[COMMITTED][...]), float(dataset[WALL_TIME][...]), ends)
            try:
                writer._rewrite(writer._chunks)
            except (OSError, RuntimeError):
                writer.abandon()
                raise
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
        """Append rows, and subproblems, and commit them.

        Raises
        ------
        RecordingError
            If they cannot be written, or the file is no longer there.
        """
        rows = first_row + len(trajectory["time"])
        with LIBRARY, _recording(self.path, f"rows from {first_row} on"):
            self._require_own()
            self._make_room({"time": rows, "step": rows - 1, **self._ends_with(problems)})
            self._append(TRAJECTORY, first_row, trajectory)
            self._append(STATS, max(first_row - 1, 0), stats)
            self._dataset[WALL_TIME][...] = self.wall_time
            if problems is not None:
                self._append_problems(problems)
            self._dataset.sync()
            if problems is not None:
                self._dataset[COMMITTED_PROBLEMS][...] = self.ends["problem"]
                self._dataset.sync()
            self._dataset[COMMITTED][...] = rows
            self._dataset.sync()
            self._reserved = min(self._reserved, self._place.stat().st_size)  # what is not used has been cut off
            if self._place != self.path:
                os.replace(self._place, self.path)
                self._place = self.path
                self._let_go()
            self.rows = rows

    def close(self, attributes: Mapping[str, Any], rename: Path | None) -> Path:
        """Write closing attributes, close, and give the file its final name if there is one; returns its path.

        Raises
        ------
        RecordingError
            If that is not possible; the rows are in the partial file still.
        """
        with LIBRARY, _recording(self.path, "its end"):
            self._require_own()
            self._dataset.sync()
            fresh = _beside(self.path)
            shutil.copyfile(self.path, fresh)
            with netCDF4.Dataset(fresh, "a") as dataset:
                dataset.setncatts(dict(attributes))
            with fresh.open("rb+") as file:
                fcntl.flock(file, fcntl.LOCK_EX)  # nobody is to continue it before it has its final name
                os.fsync(file.fileno())
                os.replace(fresh, self.path)
                if rename is not None:
                    os.replace(self.path, rename)
            self.abandon()
            return rename or self.path

    def abandon(self) -> None:
        """Let go of the file: what is committed stays."""
        _writers.pop(self._key, None)
        left = self._place if self._place != self.path else _beside(self.path)
        with LIBRARY, suppress(OSError, RuntimeError):  # what cannot be written was not committed, and has been told
            left.unlink(missing_ok=True)
            self._dataset.close()
        self._let_go()

    def _let_go(self) -> None:
        """Let others have the file that this one has replaced, or would have."""
        if self._replaced is not None:
            self._replaced.close()

    def _make_room(self, needed: dict[str, int]) -> None:
        """Have chunks enough, and the disk's word for their bytes: the library damages files that find none."""
        lengths = chunks.longer(self._chunks, needed)
        if lengths != self._chunks:
            self._rewrite(lengths)
        end = self._place.stat().st_size + chunks.bytes_to_come(self._dataset, lengths, needed)
        if hasattr(os, "posix_fallocate"):
            with self._place.open("rb+") as file:
                os.posix_fallocate(file.fileno(), self._reserved, end - self._reserved)
            self._reserved = end

    def _rewrite(self, lengths: dict[str, int]) -> None:
        """Go on in a copy of what is committed, with chunks of these lengths."""
        ends = {"time": self.rows, "step": max(self.rows - 1, 0), **self.ends}
        fresh = _beside(self.path)
        dataset = netCDF4.Dataset(fresh, "w", format="NETCDF4")
        chunks.copy(self._dataset, dataset, ends, lengths)
        if self.ends:
            dataset[COMMITTED_PROBLEMS][...] = self.ends["problem"]
        dataset.sync()
        os.replace(fresh, self.path)
        before, self._dataset, self._chunks = self._dataset, dataset, lengths
        self._reserved = 0
        self._place, self._identity = self.path, _identity(self.path)
        before.close()

    def _require_own(self) -> None:
        """Refuse to go on with a file that nobody would find."""
        if _identity(self._place) != self._identity:
            raise OSError(f"{self._place.name} is another file now; is another run writing it?")

    def _ends_with(self, problems: Block | None) -> dict[str, int]:
        """Where subproblems end once these are appended."""
        if problems is None:
            return self.ends
        added = {"problem": len(problems["rows"])}
        added |= {name: int(problems[counts].sum()) for name, counts in COUNTED.items()}
        return {name: end + added[name] for name, end in self.ends.items()}

    def _append_problems(self, block: Block) -> None:
        group = self._dataset[POSED]
        for name, values in block.items():
            variable = group[name]
            if not variable.dimensions:
                variable[...] = values
            elif len(values):
                begin = self.ends[variable.dimensions[0]]
                variable[begin : begin + len(values)] = values
        self.ends = self._ends_with(block)

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


@contextmanager
def _recording(path: Path, what: str) -> Iterator[None]:
    """Say what could not be written, and that what is committed is safe."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise RecordingError(
            f"{path}: {what} could not be written ({error}); rows that were committed before are safe. "
            "Is the disk full, or the folder gone? Mend it, and resume."
        ) from error


def _hold(path: Path) -> BinaryIO | None:
    """Keep others from writing a file that is to be replaced, until what is returned is closed; None without a file.

    Raises
    ------
    Busy
        If somebody is writing it.
    """
    if not path.exists():
        return None
    file = path.open("rb+")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # as HDF5 does
    except BlockingIOError as error:
        file.close()
        raise Busy(f"{path} cannot be written; is another run writing it?") from error
    return file


def _sweep(path: Path) -> None:
    """Remove what processes that were killed have left of files that they had just begun."""
    for left in path.parent.glob(f"{glob.escape(path.name)}.*.new"):
        process = left.suffixes[-2][1:]
        if not process.isdigit() or psutil.pid_exists(int(process)):
            continue
        with suppress(Busy, FileNotFoundError):  # a process on another machine holds it, or has removed it
            held = _hold(left)
            left.unlink()
            if held is not None:
                held.close()


def _beside(path: Path) -> Path:
    """Where the holder of a file prepares what is to take its place."""
    return path.with_name(f"{path.name}.new")


def _identity(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_dev, found.st_ino


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
