"""How long an HDF5 file says it is: where less of it is there, it was cut off."""

from pathlib import Path

SIGNATURE = b"\x89HDF\r\n\x1a\n"
_ENDS = {0: 40, 1: 44, 2: 28, 3: 28}
"""Where the address of the end stands, by version of the superblock, with addresses of eight bytes."""
_WIDTHS = {0: 13, 1: 13, 2: 9, 3: 9}
"""Where it says how wide addresses are."""


def stated_length(path: Path) -> int | None:
    """Return the length that a file states; None if it does not begin as an HDF5 file of eight-byte addresses does."""
    with path.open("rb") as file:
        begin = file.read(64)
    version = begin[8] if len(begin) == 64 and begin.startswith(SIGNATURE) else None
    if version not in _ENDS or begin[_WIDTHS[version]] != 8:
        return None
    return int.from_bytes(begin[_ENDS[version] : _ENDS[version] + 8], "little")
