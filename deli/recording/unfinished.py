"""What is known of a run that has not ended, before it goes on."""

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
        Seconds spent on them.
    identity : tuple of int
        Which file they were read from, and how it was then; see `identity_of`.
    """

    groups: Groups
    attributes: dict[str, Any]
    wall_time: float
    identity: tuple[int, int, int]


def identity_of(path: Path) -> tuple[int, int, int]:
    """Say which file it is, and how it is: what changes where somebody writes to it."""
    found = path.stat()
    return found.st_ino, found.st_size, found.st_mtime_ns
