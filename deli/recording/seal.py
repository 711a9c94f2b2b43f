"""The seal of a file that deli has closed: a digest of its content, after the end of the HDF5 data.

Readers of HDF5 do not see it. A program that opens the file for writing through HDF5 cuts it off.
"""

import hashlib
import os
from pathlib import Path

MARK = b"\ndeli seal, sha256 of all bytes before: "
LENGTH = len(MARK) + hashlib.sha256().digest_size


def seal(path: Path) -> None:
    """Append the digest of a file, and sync it to the disk."""
    digest = _digest(path, path.stat().st_size)
    with path.open("ab") as file:
        file.write(MARK + digest)
        file.flush()
        os.fsync(file.fileno())


def sealed(path: Path) -> bool:
    """Return whether a file ends with a seal, without a check of its content; a file that was cut off does not."""
    return _recorded(path) is not None


def intact(path: Path) -> bool | None:
    """Return whether a file's content is the sealed content; None where there is no seal."""
    recorded = _recorded(path)
    return None if recorded is None else recorded == _digest(path, path.stat().st_size - LENGTH)


def _recorded(path: Path) -> bytes | None:
    with path.open("rb") as file:
        if file.seek(0, os.SEEK_END) < LENGTH:
            return None
        file.seek(-LENGTH, os.SEEK_END)
        tail = file.read(LENGTH)
    return tail[len(MARK) :] if tail.startswith(MARK) else None


def _digest(path: Path, size: int) -> bytes:
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while size > 0 and (block := file.read(min(size, 1 << 20))):
            digest.update(block)
            size -= len(block)
    return digest.digest()
