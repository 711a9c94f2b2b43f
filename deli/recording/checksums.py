"""Checksums of committed rows, which show whether an unsealed file still has the numbers that were written.

Each variable that grows has the CRC-32 of all its numbers. A commit writes the checksums into one of two slots, with
the numbers of rows and subproblems that they cover, before it writes the number of committed rows. An interruption at
any point therefore leaves a slot that covers the committed rows.
"""

import zlib
from collections.abc import Mapping

import netCDF4
import numpy as np

from deli.recording.contents import Stored
from deli.recording.schema import Groups, Schema
from deli.recording.subproblems import COUNTED, places
from deli.recording.variable import Block

CHECKSUMS, COVERED = "checksums", "checksums_cover"
SLOTS = 2


class Checksums:
    """The checksums of a file that is being written.

    Parameters
    ----------
    schema : Schema
        The variables of the file.
    """

    def __init__(self, schema: Schema) -> None:
        self._dtypes = {
            (group, variable.name): np.dtype(variable.dtype)
            for group, variables in schema.groups.items()
            for variable in variables
            if variable.grows
        }
        self._running = dict.fromkeys(self._dtypes, 0)
        self._commits = 0

    def lay_out(self, dataset: netCDF4.Dataset) -> None:
        """Make room for the checksums in a file."""
        dataset.createDimension("slot", SLOTS)
        dataset.createDimension("checksum", len(self._dtypes))
        dataset.createDimension("count", 2)
        sums = dataset.createVariable(CHECKSUMS, "u4", ("slot", "checksum"), fill_value=False)
        names = " ".join("/".join(name) for name in self._dtypes)
        sums.setncatts({"units": "1", "long_name": "CRC-32 of the numbers of variables", "variables": names})
        covered = dataset.createVariable(COVERED, "i8", ("slot", "count"), fill_value=False)
        covered.setncatts({"units": "1", "long_name": "rows and subproblems that the checksums are of"})
        sums[...], covered[...] = 0, 0

    def add(self, group: str, block: Block) -> None:
        """Update the checksums by numbers that are appended."""
        for name, values in block.items():
            if (group, name) in self._dtypes:
                self._running[group, name] = _checksum(values, self._dtypes[group, name], self._running[group, name])

    def write(self, dataset: netCDF4.Dataset, rows: int, problems: int) -> None:
        """Write the checksums into a slot."""
        self._commits += 1
        slot = self._commits % SLOTS
        dataset[CHECKSUMS][slot] = list(self._running.values())
        dataset[COVERED][slot] = rows, problems


def broken(root: Mapping[str, Stored], groups: Groups, rows: int) -> list[str] | None:
    """Return the names of variables whose committed numbers have changed; None for a file without checksums.

    Parameters
    ----------
    root : dict
        Variables of the file's root.
    groups : dict
        Variables that were read, by group and name.
    rows : int
        Number of committed rows.
    """
    if CHECKSUMS not in root or COVERED not in root:
        return None
    sums, covered = root[CHECKSUMS], root[COVERED].values
    names = str(sums.attributes.get("variables", "")).split()
    if sums.values.shape != (SLOTS, len(names)) or covered.shape != (SLOTS, 2):
        return [CHECKSUMS]
    slots = np.flatnonzero(covered[:, 0] == rows)
    if not len(slots):
        return [COVERED]
    return min((_differing(groups, names, sums.values[slot], rows, int(covered[slot, 1])) for slot in slots), key=len)


def _differing(groups: Groups, names: list[str], sums: np.ndarray, rows: int, problems: int) -> list[str]:
    ends = {"time": rows, "step": max(rows - 1, 0)}
    found = []
    for name, recorded in zip(names, sums.tolist(), strict=True):
        group, _, variable = name.partition("/")
        if variable not in groups.get(group, {}):
            found.append(name)
            continue
        dims, values, _ = groups[group][variable]
        if dims[0] not in ends:
            counts = {count: groups[group][count][1] for count in COUNTED.values()}
            ends |= places(counts, min(max(problems, 0), len(counts["rows"])))
        if _checksum(values[: ends[dims[0]]], values.dtype, 0) != recorded:
            found.append(name)
    return found


def _checksum(values: np.ndarray, dtype: np.dtype, start: int) -> int:
    numbers = np.ascontiguousarray(values, dtype).reshape(-1)
    return zlib.crc32(numbers.view(np.uint8).data, start)
