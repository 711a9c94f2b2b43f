"""Runs on disk: rows are appended to ``<output>.partial``, which is renamed once the run has ended."""

import os
import shutil
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import netCDF4

from deli.recording import chunks
from deli.recording.checksums import Checksums
from deli.recording.contents import COMMITTED, COMMITTED_PROBLEMS, LIBRARY, WALL_TIME, attributes_of
from deli.recording.file_layout import first_chunks, lay_out
from deli.recording.holding import Busy, beside, hold, lock, recording, sweep, which
from deli.recording.schema import POSED, STATS, TRAJECTORY, Schema
from deli.recording.seal import seal
from deli.recording.subproblems import COUNTED, taken
from deli.recording.unfinished import Unfinished
from deli.recording.variable import Block

_writers: WeakValueDictionary[Path, "Writer"] = WeakValueDictionary()


def being_written(path: Path) -> bool:
    """Return whether this process is writing the file; the library's lock on the file keeps out other processes."""
    return path.resolve() in _writers


class Writer:
    """The writer of a partial file, which appends rows and commits them.

    A commit writes the rows, syncs, writes their number, and syncs again: whenever the process is killed, the rows that
    the number counts are whole. Subproblems are counted before the rows. A kill in between leaves subproblems of steps
    beyond the last committed row, which are dropped when the file is continued. Changes of the file's structure are
    made in a file of another name, which then replaces the first: the layout, more room in trees of chunks, the
    continuation, the closing. Closed files are sealed, see `deli.recording.seal`.

    Attributes
    ----------
    rows : int
        Number of committed rows.
    ends : dict of str to int
        Ends of the committed subproblems along each ragged dimension; empty where none are recorded.
    """

    def __init__(
        self,
        path: Path,
        schema: Schema,
        attributes: Mapping[str, Any],
        found: Unfinished | None = None,
        steps: int = 0,
    ) -> None:
        """Start a file, which gets its name with its first rows.

        The rows of an unfinished file are written at once. `steps` is the number of steps up to the last of them, and
        subproblems of later steps are left out. The unfinished file is read and never written to, because undetected
        damage in its structure could spoil the rows that follow.

        Raises
        ------
        Busy
            If another run is writing the file, or has written it since it was `found`.
        RecordingError
            If it cannot be written.
        """
        self.path = path
        self.rows = 0
        self.ends = dict.fromkeys(("problem", *COUNTED), 0) if schema.subproblems else {}
        self._chunks = first_chunks(schema)
        self._reserved = 0
        self._checksums = Checksums(schema)
        self._earlier = found.wall_time if found else 0.0
        self._started = time.perf_counter()
        self._key = path.resolve()
        self._place = path.with_name(f"{path.name}.{os.getpid()}.new")
        with LIBRARY, recording(path, "the file"):
            if being_written(path):
                raise Busy(f"{path} is being written; is another run writing it in this process?")
            self._replaced = hold(path, found.identity if found else None)
            sweep(path)
            self._dataset = _fresh(self._place)
            self._identity = which(self._place)
            _writers[self._key] = self
            lay_out(self._dataset, schema, attributes, self._chunks)
            self._checksums.lay_out(self._dataset)
            chunks.write_through(self._dataset)
        if found:
            trajectory, stats, problems = (found.groups.get(name) for name in (TRAJECTORY, STATS, POSED))
            assert trajectory is not None
            assert stats is not None
            self.write(
                0,
                {name: trajectory[name][1] for name in schema.growing(TRAJECTORY)},
                {name: stats[name][1] for name in schema.growing(STATS)},
                None if problems is None else taken({name: one[1] for name, one in problems.items()}, steps),
            )

    @property
    def attributes(self) -> dict[str, Any]:
        """Root attributes of the file so far."""
        with LIBRARY:
            return attributes_of(self._dataset)

    @property
    def wall_time(self) -> float:
        """Seconds spent on the run, earlier sessions included."""
        return self._earlier + time.perf_counter() - self._started

    def write(self, first_row: int, trajectory: Block, stats: Block, problems: Block | None = None) -> None:
        """Append rows and subproblems, and commit them.

        Raises
        ------
        RecordingError
            If they cannot be written, or the file is no longer there.
        """
        rows = first_row + len(trajectory["time"])
        with LIBRARY, recording(self.path, f"rows from {first_row} on"):
            self._require_own()
            self._make_room({"time": rows, "step": rows - 1, **self._ends_with(problems)})
            self._append(TRAJECTORY, first_row, trajectory)
            self._append(STATS, max(first_row - 1, 0), stats)
            self._dataset[WALL_TIME][...] = self.wall_time
            if problems is not None:
                self._append_problems(problems)
            self._checksums.write(self._dataset, rows, self.ends.get("problem", 0))
            self._dataset.sync()
            if problems is not None:
                self._count(COMMITTED_PROBLEMS, self.ends["problem"])
            self._count(COMMITTED, rows)
            self._reserved = min(self._reserved, self._place.stat().st_size)  # the sync has cut off unused bytes
            if self._place != self.path:
                os.replace(self._place, self.path)
                self._place = self.path
                self._let_go()
            self.rows = rows

    def close(self, attributes: Mapping[str, Any], rename: Path | None) -> Path:
        """Write closing attributes, close and seal the file, rename it if `rename` is a path, and return its path.

        Raises
        ------
        RecordingError
            If that fails; the rows are still in the partial file.
        """
        with LIBRARY, recording(self.path, "its end"):
            self._require_own()
            self._dataset.sync()
            fresh = beside(self.path)
            fresh.unlink(missing_ok=True)  # it may be a link to elsewhere
            shutil.copyfile(self.path, fresh)
            with netCDF4.Dataset(fresh, "a") as dataset:
                dataset.setncatts(dict(attributes))
            seal(fresh)
            with fresh.open("rb+") as file:
                lock(file, wait=True)  # no other run may continue it before it has its final name
                os.replace(fresh, self.path)
                if rename is not None:
                    os.replace(self.path, rename)
            self.abandon()
            return rename or self.path

    def abandon(self) -> None:
        """Let go of the file; committed rows stay."""
        _writers.pop(self._key, None)
        left = self._place if self._place != self.path else beside(self.path)
        with LIBRARY, suppress(OSError, RuntimeError):  # rows that cannot be written were not committed
            left.unlink(missing_ok=True)
            self._dataset.close()
        self._let_go()

    def _let_go(self) -> None:
        """Release the lock on the file that this one has replaced, or was to replace."""
        if self._replaced is not None:
            self._replaced.close()

    def _make_room(self, needed: dict[str, int]) -> None:
        """Provide chunks, and reserve disk space for them, because the library damages a file when the disk is full."""
        lengths = chunks.longer(self._chunks, needed)
        if lengths != self._chunks:
            self._rewrite(lengths)
        end = self._place.stat().st_size + chunks.bytes_to_come(self._dataset, lengths, needed)
        if hasattr(os, "posix_fallocate"):
            with self._place.open("rb+") as file:
                os.posix_fallocate(file.fileno(), self._reserved, end - self._reserved)
            self._reserved = end

    def _rewrite(self, lengths: dict[str, int]) -> None:
        """Continue in a copy of the committed rows, with chunks of these lengths."""
        ends = {"time": self.rows, "step": max(self.rows - 1, 0), **self.ends}
        fresh = beside(self.path)
        dataset = _fresh(fresh)
        chunks.copy(self._dataset, dataset, ends, lengths)
        if self.ends:
            dataset[COMMITTED_PROBLEMS][...] = self.ends["problem"]
        dataset.sync()
        os.replace(fresh, self._place)
        before, self._dataset, self._chunks = self._dataset, dataset, lengths
        self._reserved, self._identity = 0, which(self._place)
        before.close()

    def _require_own(self) -> None:
        """Refuse to write to a file that no longer has its name."""
        if which(self._place) != self._identity:
            raise OSError(f"{self._place.name} is another file now; is another run writing it?")

    def _count(self, what: str, number: int) -> None:
        """Commit written rows or subproblems, by writing their number."""
        self._dataset[what][...] = number
        self._dataset.sync()

    def _ends_with(self, problems: Block | None) -> dict[str, int]:
        """Return the ends of the subproblems once these are appended."""
        if problems is None:
            return self.ends
        added = {"problem": len(problems["rows"])}
        added |= {name: int(problems[counts].sum()) for name, counts in COUNTED.items()}
        return {name: end + added[name] for name, end in self.ends.items()}

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
        self.ends = self._ends_with(block)

    def _append(self, group: str, first: int, block: Block) -> None:
        self._checksums.add(group, block)
        for name, values in block.items():
            if len(values):
                self._dataset[group][name][first : first + len(values)] = values


def _fresh(path: Path) -> netCDF4.Dataset:
    path.unlink(missing_ok=True)  # it may be a link to elsewhere
    return netCDF4.Dataset(path, "w", format="NETCDF4")
