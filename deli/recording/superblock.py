"""The length that an HDF5 file states; a shorter file was cut off."""

from pathlib import Path

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_ENDS = {0: 40, 1: 44, 2: 28, 3: 28}
"""Offset of the address of the end, by version of the superblock, with addresses of eight bytes."""
_WIDTHS = {0: 13, 1: 13, 2: 9, 3: 9}
"""Offset of the width of addresses, by version of the superblock."""


def stated_length(path: Path) -> int | None:
    """Return the length that a file states; None unless it begins as an HDF5 file with addresses of eight bytes."""
    with path.open("rb") as file:
        begin = file.read(64)
    version = begin[8] if len(begin) == 64 and begin.startswith(SIGNATURE) else None
    if version not in _ENDS or begin[_WIDTHS[version]] != 8:
        return None
    return int.from_bytes(begin[_ENDS[version] : _ENDS[version] + 8], "little")
