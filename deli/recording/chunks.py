"""Chunks of variables that grow: their lengths, and copies of files into longer chunks.

HDF5 finds the chunks of a variable through a tree. A tree of up to 64 chunks is changed by a single write, so that its
file can be read whenever the process is killed. A larger tree is split by several writes, and between them no chunk is
found. Therefore, where a variable needs more chunks, or a file was cut off during a commit, the rows are copied to
another file with longer chunks, which replaces the first when it is complete.
"""

import math
from collections.abc import Mapping

import netCDF4

MOST_CHUNKS = 64
GROWTH = 8
NODE_BYTES = 4096
"""Upper bound on the bytes of a tree of chunks."""


def bytes_to_come(dataset: netCDF4.Dataset, lengths: Mapping[str, int], needed: Mapping[str, int]) -> int:
    """Return the bytes by which a file grows at most when its dimensions reach the lengths `needed`."""
    found = 0
    for group in dataset.groups.values():
        for variable in group.variables.values():
            if _grows(group, variable):
                name = variable.dimensions[0]
                added = math.ceil(needed[name] / lengths[name]) - math.ceil(len(variable) / lengths[name])
                found += NODE_BYTES + max(added, 0) * math.prod(_lengths(variable)) * variable.dtype.itemsize
    return found


def longer(lengths: Mapping[str, int], needed: Mapping[str, int]) -> dict[str, int]:
    """Return lengths of chunks with which no dimension needs more chunks than a tree holds."""
    found = dict(lengths)
    for dimension, places in needed.items():
        while places > MOST_CHUNKS * found[dimension]:
            found[dimension] *= GROWTH
    return found


def write_through(dataset: netCDF4.Dataset) -> None:
    """Write rows straight to the file, because a chunk in memory would be written as a whole each time."""
    dataset.sync()  # the first write of a variable settles its cache
    for group in dataset.groups.values():
        for variable in group.variables.values():
            if _grows(group, variable):
                variable.set_var_chunk_cache(size=0)


def copy(source: netCDF4.Dataset, target: netCDF4.Dataset, ends: Mapping[str, int], chunks: Mapping[str, int]) -> None:
    """Copy a file, its growing dimensions up to `ends`, into chunks of the lengths `chunks`."""
    target.setncatts({name: source.getncattr(name) for name in source.ncattrs()})
    pairs = [(source, target)]
    for name, group in source.groups.items():
        pairs.append((group, target.createGroup(name)))
        pairs[-1][1].setncatts({key: group.getncattr(key) for key in group.ncattrs()})
    copied = []
    for here, there in pairs:
        for name, dimension in here.dimensions.items():
            there.createDimension(name, None if dimension.isunlimited() else len(dimension))
        for name, variable in here.variables.items():
            grows = _grows(here, variable)
            sizes = [chunks[variable.dimensions[0]], *_lengths(variable)[1:]] if grows else None
            created = there.createVariable(
                name, variable.dtype, variable.dimensions, fill_value=False, chunksizes=sizes
            )
            created.setncatts({key: variable.getncattr(key) for key in variable.ncattrs()})
            copied.append((variable, created, grows))
    write_through(target)
    for variable, created, grows in copied:
        variable.set_auto_maskandscale(False)
        variable.set_auto_chartostring(False)
        created.set_auto_maskandscale(False)
        created.set_auto_chartostring(False)
        if not grows:
            created[...] = variable[...]
            continue
        end, length = ends[variable.dimensions[0]], MOST_CHUNKS * _lengths(variable)[0]
        for begin in range(0, end, length):
            created[begin : min(begin + length, end)] = variable[begin : min(begin + length, end)]


def _lengths(variable: netCDF4.Variable) -> list[int]:
    """Return the lengths of the chunks of a variable that grows."""
    return [int(length) for length in variable.chunking()]


def _grows(group: netCDF4.Dataset | netCDF4.Group, variable: netCDF4.Variable) -> bool:
    return bool(variable.dimensions) and group.dimensions[variable.dimensions[0]].isunlimited()
