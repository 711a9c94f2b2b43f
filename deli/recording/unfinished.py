"""The rows of a run that is to be continued."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deli.recording.schema import Groups


@dataclass(frozen=True)
class Unfinished:
    """The rows of a partial file.

    Attributes
    ----------
    groups : dict
    attributes : dict
    wall_time : float
        Seconds spent on the rows.
    identity : tuple of int
        Identity of the file when the rows were read, see `identity_of`.
    """

    groups: Groups
    attributes: dict[str, Any]
    wall_time: float
    identity: tuple[int, int, int]


def identity_of(path: Path) -> tuple[int, int, int]:
    """Return inode, size and time of modification of a file: they change when it is replaced or written."""
    found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns
