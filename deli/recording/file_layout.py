"""An empty file for a run: its dimensions, its variables, its attributes, and the lengths of its chunks."""

import math
from collections.abc import Mapping
from typing import Any

import netCDF4
import numpy as np

from deli.recording.contents import COMMITTED, COMMITTED_PROBLEMS, ENCODING, WALL_TIME
from deli.recording.schema import POSED, STATS, TRAJECTORY, Schema, coordinates
from deli.recording.variable import Variable

CHUNK_ROWS, CHUNK_PLACES, CHUNK_BYTES = 256, 4096, 1_000_000


def first_chunks(schema: Schema) -> dict[str, int]:
    """Return the lengths of chunks by growing dimension: short where rows are wide, because whole chunks are stored."""
    lengths: dict[str, int] = {}
    for group, usual in ((TRAJECTORY, CHUNK_ROWS), (STATS, CHUNK_ROWS), (POSED, CHUNK_PLACES)):
        for variable in schema.groups.get(group, ()):
            if variable.grows:
                width = math.prod(schema.sizes[dimension] for dimension in variable.dims[1:])
                most = max(1, CHUNK_BYTES // (np.dtype(variable.dtype).itemsize * width))
                lengths[variable.dims[0]] = min(lengths.get(variable.dims[0], usual), most)
    return lengths


def lay_out(dataset: netCDF4.Dataset, schema: Schema, attributes: Mapping[str, Any], chunks: Mapping[str, int]) -> None:
    """Write everything but rows into a new file."""
    dataset.setncatts(dict(attributes))
    committed = dataset.createVariable(COMMITTED, "i8", (), fill_value=False)
    committed.setncatts({"units": "1", "long_name": "number of committed rows"})
    wall_time = dataset.createVariable(WALL_TIME, "f8", (), fill_value=False)
    wall_time.setncatts({"units": "s", "long_name": "wall time of the run up to the last commit"})
    committed[...], wall_time[...] = 0, 0.0
    if schema.subproblems:
        problems = dataset.createVariable(COMMITTED_PROBLEMS, "i8", (), fill_value=False)
        problems.setncatts({"units": "1", "long_name": "number of committed subproblems"})
        problems[...] = 0
    constants = schema.constants()
    for name, variables in schema.groups.items():
        group = dataset.createGroup(name)
        group.setncattr("coordinates", " ".join(coordinates(name)))
        for dimension in dict.fromkeys(dim for variable in variables for dim in variable.dims):
            group.createDimension(dimension, schema.sizes.get(dimension))
        for variable in variables:
            if variable.dtype == "str":
                _write_words(group, variable, constants[name][variable.name])
                continue
            created = _create(group, variable, {**schema.sizes, **chunks})
            if not variable.grows:
                created[...] = constants[name][variable.name]


def _create(group: netCDF4.Group, variable: Variable, lengths: Mapping[str, int]) -> netCDF4.Variable:
    created: netCDF4.Variable = group.createVariable(
        variable.name,
        np.dtype(variable.dtype),
        variable.dims,
        fill_value=False,
        chunksizes=[lengths[dimension] for dimension in variable.dims] if variable.grows else None,
    )
    created.set_auto_mask(False)
    created.setncatts(variable.attributes)
    return created


def _write_words(group: netCDF4.Group, variable: Variable, words: np.ndarray) -> None:
    """Write words as rows of letters, because HDF5 crashes on strings of variable length in a file opened twice."""
    letters = words.astype(bytes)
    dimension = f"{variable.name}_letter"
    group.createDimension(dimension, letters.itemsize)
    created = group.createVariable(variable.name, "S1", (*variable.dims, dimension), fill_value=False)
    created[:] = letters.view("S1").reshape(*words.shape, letters.itemsize)
    created.setncatts({**variable.attributes, ENCODING: "ascii"})
