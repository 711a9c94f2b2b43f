"""Contents of a netCDF file of deli's, as they are stored: committed rows only, and not yet checked."""

import math
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from deli.errors import InputError

COMMITTED, WALL_TIME, COMMITTED_PROBLEMS = "committed_rows", "committed_wall_time", "committed_subproblems"
ENCODING = "_Encoding"
"""The attribute that tells readers to join letters to words."""
SMALLEST = 64
"""Bytes of values that a file of any size may claim."""
DEFLATED = 1032
"""Largest factor of compression by deflate; deli itself does not compress."""
WORD_BYTES = 16
"""Bytes that a file stores of a word besides its letters."""

LIBRARY = threading.RLock()
"""The lock around every use of the netCDF library, which is not safe to use from several threads."""

DAMAGE = (OSError, RuntimeError, AttributeError, LookupError, TypeError, ValueError, MemoryError, RecursionError)
"""Errors that the netCDF library, and the decoding of its output, raise on a damaged file."""


@dataclass
class Stored:
    """One variable of a file: its dimensions, its values and its attributes.

    Values along ``time`` and ``step`` end with the committed rows.
    """

    dims: tuple[str, ...]
    values: np.ndarray
    attributes: dict[str, Any]


@dataclass
class Contents:
    """The contents of a file.

    Attributes
    ----------
    attributes : dict
        Of the root.
    sizes : dict
        Lengths of dimensions as stored, by group; the root is ``/``.
    groups : dict
        Variables, by group and name.
    trusted : bool
        Whether deli wrote all of it.
    """

    attributes: dict[str, Any]
    sizes: dict[str, dict[str, int]]
    groups: dict[str, dict[str, Stored]]
    trusted: bool = False

    @property
    def root(self) -> dict[str, Stored]:
        """Variables of the root."""
        return self.groups["/"]


def open_file(path: Path, live: bool) -> netCDF4.Dataset:
    """Open a file for reading; a file that is `live`, or that its writer has locked, is opened as a copy in memory.

    Raises
    ------
    InputError
        If it is not a netCDF file.
    """
    if not live:
        try:
            return netCDF4.Dataset(path, "r")
        except DAMAGE as locked:
            if path.suffix != ".partial":
                raise InputError(f"{path} cannot be read as netCDF ({locked}); was it written by deli?") from locked
    # A running writer holds the file; rows that it has synced are on disk, and readable in a copy.
    try:
        return netCDF4.Dataset(path.name, "r", memory=path.read_bytes())
    except DAMAGE as error:
        raise InputError(f"{path} cannot be read ({error}); if a run is writing it, try again in a moment.") from error


def load(dataset: netCDF4.Dataset, path: Path, values: bool) -> Iterator[Any]:
    """Read a file: yield its `Contents`, whose variables have no values yet, then the values of each in their order.

    Without `values`, the contents are the attributes of the root and the sizes of dimensions.

    Raises
    ------
    InputError
        If a part cannot be read, or would take more room than the file.
    """
    dataset.set_auto_maskandscale(False)
    dataset.set_auto_chartostring(False)
    room = max(path.stat().st_size, SMALLEST)
    try:
        owners = {"/": dataset, **dataset.groups}
        sizes = {name: {key: len(size) for key, size in owner.dimensions.items()} for name, owner in owners.items()}
        contents = Contents(attributes_of(dataset), sizes, {name: {} for name in owners})
        if not values:
            yield contents
            return
        ends = _ends(dataset)
        plan = []
        for group, owner in owners.items():
            for name, variable in owner.variables.items():
                found: Any = variable
                if variable.dtype is str:
                    found = _letters(variable, f"{group.strip('/')}/{name}".strip("/"), room, path)
                elif not _plain(variable):
                    continue
                dims = variable.dimensions if found is variable else (*variable.dimensions, f"{name}_letter")
                shape = tuple(
                    min(size, ends.get(dim, size)) if place == 0 else size
                    for place, (dim, size) in enumerate(zip(dims, found.shape, strict=True))
                )
                if found is variable:
                    _require_room(variable, f"{group.strip('/')}/{name}".strip("/"), shape, room, path)
                empty = np.broadcast_to(np.zeros((), found.dtype), shape)
                contents.groups[group][name] = Stored(dims, empty, attributes_of(variable))
                plan.append((found, shape))
        yield contents
        for variable, shape in plan:
            found = variable[: shape[0]] if shape else variable[...]
            yield np.ascontiguousarray(np.asarray(found)).reshape(shape)
    except DAMAGE as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is damaged: it cannot be read ({type(error).__name__}: {error}).") from error


def gather(parts: Iterator[Any]) -> Contents:
    """Return the contents whose parts `load` yields."""
    contents: Contents = next(parts)
    for variables in contents.groups.values():
        for variable in variables.values():
            variable.values = next(parts)
    next(parts, None)
    return contents


def attributes_of(owner: netCDF4.Dataset | netCDF4.Variable) -> dict[str, Any]:
    """Return attributes in Python's own types."""
    values = ((name, owner.getncattr(name)) for name in owner.ncattrs())
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in values}


def _ends(dataset: netCDF4.Dataset) -> dict[str, int]:
    """Return the ends of the committed rows along ``time`` and ``step``; none where the file does not state them."""
    ends: dict[str, int] = {}
    if COMMITTED in dataset.variables and not dataset[COMMITTED].shape:
        rows = max(int(dataset[COMMITTED][...]), 0)
        ends = {"time": rows, "step": max(rows - 1, 0)}
    return ends


def _plain(variable: netCDF4.Variable) -> bool:
    """Return whether values are numbers or letters, the only kinds that deli writes."""
    return isinstance(variable.dtype, np.dtype) and variable.dtype.kind in "iufS" and variable.dtype.itemsize <= 8


def _letters(variable: netCDF4.Variable, name: str, room: int, path: Path) -> np.ndarray:
    """Return words of variable length, as other programs write them, in rows of letters, as deli writes them."""
    if WORD_BYTES * math.prod(variable.shape) > room:
        raise InputError(f"{path} is damaged: {name} has the shape {variable.shape}, and the file has {room:,} bytes.")
    words = [str(word).encode() for word in np.asarray(variable[...], dtype=object).reshape(-1)]
    width = max(map(len, words), default=0) or 1
    if width * len(words) > DEFLATED * room:
        raise InputError(f"{path} is damaged: {name} has {len(words):,} words of up to {width:,} letters.")
    return np.array(words, f"S{width}").view("S1").reshape(*variable.shape, width)


def _require_room(variable: netCDF4.Variable, name: str, shape: tuple[int, ...], room: int, path: Path) -> None:
    filters: Mapping[str, Any] = variable.filters() or {}
    factor = DEFLATED if any(value for key, value in filters.items() if key not in ("shuffle", "fletcher32")) else 1
    needed = variable.dtype.itemsize
    for size in shape:
        needed *= size
    if needed > factor * room:
        raise InputError(
            f"{path} is damaged: {name} has the shape {shape}, which takes {needed:,} bytes, and the file has {room:,}."
        )
