"""The holder of a file during writing, and the messages of a write that fails."""

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
    """A write that failed, because of a full disk or a vanished folder."""


class Busy(InputError):
    """A file that another run is writing, in this process or another."""


@contextmanager
def recording(path: Path, what: str) -> Iterator[None]:
    """Raise a failed write as an error that names its object, `what`, and says that committed rows are safe."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        raise RecordingError(
            f"{path}: {what} could not be written ({error}); rows that were committed before are safe. "
            "Is the disk full, or the folder gone? Mend it, and resume."
        ) from error


def require_locks(path: Path) -> None:
    """Refuse to record to a file where the system cannot lock files in the way of HDF5.

    Raises
    ------
    InputError
        On systems without POSIX locks.
    """
    if fcntl is None:
        raise InputError(
            f"output {path}: runs are recorded to files on POSIX systems only, and this one has no module fcntl; leave "
            "out the output, which keeps the run in memory, and save the returned run by its method to_netcdf."
        )


def lock(file: BinaryIO, wait: bool) -> None:
    """Lock an open file in the way of HDF5.

    Raises
    ------
    BlockingIOError
        If it is locked already, and `wait` is false.
    """
    fcntl.flock(file, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)


def hold(path: Path, identity: tuple[int, int, int] | None = None) -> BinaryIO | None:
    """Lock a file that is to be replaced, and return it open: closing it ends the lock. Return None without a file.

    Raises
    ------
    Busy
        If another run is writing the file, or has written it since its `identity` was taken.
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
    """Remove the unfinished new files that killed processes have left beside a file."""
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
    """Return the path at which the holder of a file prepares its replacement."""
    return path.with_name(f"{path.name}.new")


def which(path: Path) -> tuple[int, int]:
    """Return the device and the inode of a file, which differ from those of a file that has replaced it."""
    found = path.stat()
    return found.st_dev, found.st_ino
