"""Who holds a file while it is written, where what takes its place is prepared, and what is said if that fails."""

import glob
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

import psutil

from deli.errors import DeliError, InputError
from deli.recording.unfinished import identity_of

try:
    import fcntl
except ImportError:  # Windows has other locks than HDF5 asks for
    fcntl = None  # type: ignore[assignment]


class RecordingError(DeliError):
    """Rows could not be written: a full disk, a vanished folder."""


class Busy(InputError):
    """Another process is writing the file, or this one is."""


@contextmanager
def recording(path: Path, what: str) -> Iterator[None]:
    """Say what could not be written, and that what is committed is safe."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise RecordingError(
            f"{path}: {what} could not be written ({error}); rows that were committed before are safe. "
            "Is the disk full, or the folder gone? Mend it, and resume."
        ) from error


def require_locks(path: Path) -> None:
    """Refuse to record to a file where files cannot be locked as HDF5 does.

    Raises
    ------
    InputError
    """
    if fcntl is None:
        raise InputError(
            f"output {path}: runs are recorded to files on POSIX systems only, and this one has no module fcntl; leave "
            "out the output, which keeps the run in memory, and save what simulate returns by its to_netcdf."
        )


def lock(file: BinaryIO, wait: bool) -> None:
    """Lock an open file as HDF5 does.

    Raises
    ------
    BlockingIOError
        If somebody else has locked it, and there is to be no waiting.
    """
    fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


def hold(path: Path, identity: tuple[int, int, int] | None = None) -> BinaryIO | None:
    """Keep others from a file that is to be replaced, until what is returned is closed; None without a file.

    Raises
    ------
    Busy
        If somebody writes it, or has done so since it was the one of that `identity`.
    """
    if not path.exists():
        return None
    file = path.open("rb+")
    try:
        lock(file, wait=False)
    except BlockingIOError as error:
        file.close()
        raise Busy(f"{path} cannot be written; is another run writing it?") from error
    if identity not in (None, identity_of(path)):
        file.close()
        raise Busy(f"{path} has just been written by another run.")
    return file


def sweep(path: Path) -> None:
    """Remove what processes that were killed have left of files that they had just begun."""
    for left in path.parent.glob(f"{glob.escape(path.name)}.*.new"):
        process = left.suffixes[-2][1:]
        if not process.isdigit() or psutil.pid_exists(int(process)):
            continue
        with suppress(Busy, FileNotFoundError):  # a process on another machine holds it, or has removed it
            held = hold(left)
            left.unlink()
            if held is not None:
                held.close()


def beside(path: Path) -> Path:
    """Where the holder of a file prepares what is to take its place."""
    return path.with_name(f"{path.name}.new")


def which(path: Path) -> tuple[int, int]:
    """Tell a file from one that has taken its place."""
    found = path.stat()
    return found.st_dev, found.st_ino
