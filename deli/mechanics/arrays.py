"""Readers of users' input: read-only float64 arrays, finite and of the right shape, or one clear message."""

from __future__ import annotations

import reprlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from deli.errors import InputError
from deli.memory import require_memory

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

BYTES_A_BODY = 2000
"""Memory in bytes that a scene and a stepper keep for each body."""
TINY = np.finfo(np.float64).tiny
"""Smallest divisor, which keeps a division by a length finite if the length is zero."""


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return ``array`` itself with writing switched off."""
    array.setflags(write=False)
    return array


def real_array(name: str, value: ArrayLike) -> Array:
    """Read ``value`` as a read-only float64 copy, and refuse every entry that is not a finite real number."""
    try:
        found = np.asarray(value)
    except ValueError as error:
        raise InputError(f"{name}: found rows of unequal length ({error}); pass a rectangular array") from error
    if found.size == 0:
        found = found.astype(np.float64)
    if found.dtype.kind not in "fiu":
        raise InputError(f"{name}: found {reprlib.repr(value)} (type {found.dtype}); pass real numbers")
    array = np.array(found, dtype=np.float64)
    if not np.isfinite(array).all():
        where = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        at = f" at index {where[0] if len(where) == 1 else where}" if where else ""
        raise InputError(f"{name}: found {array[where]}{at}; every entry must be finite")
    return frozen(array)


def real_number(name: str, value: Any) -> float:
    """Read one finite real number."""
    array = real_array(name, value)
    if array.ndim != 0:
        raise InputError(f"{name}: found an array of shape {array.shape}; pass one number")
    return float(array)


def positive_number(name: str, value: Any) -> float:
    """Read one finite number > 0."""
    real_number(name, value)
    return float(positive_array(name, value))


def positive_array(name: str, value: ArrayLike) -> Array:
    """Read an array of finite numbers > 0."""
    array = real_array(name, value)
    if np.min(array, initial=np.inf) <= 0:
        raise InputError(f"{name}: found {float(np.min(array))!r}; it must be > 0")
    return array


def whole_number(name: str, value: Any, least: int = 0) -> int:
    """Read one whole number >= ``least``."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise InputError(f"{name}: found {value!r}; pass a whole number >= {least}")
    if value < least:
        raise InputError(f"{name}: found {value}; it must be >= {least}")
    return int(value)


def body_count(name: str, value: Any, least: int = 1) -> int:
    """Read a scene's number of bodies or walls: a whole number >= ``least`` whose scene fits into memory."""
    count = whole_number(name, value, least)
    require_memory(f"{name}: found {count:,}", BYTES_A_BODY * count, "take fewer")
    return count


def broadcast(name: str, array: Array, shape: tuple[int, ...], per: str) -> Array:
    """Repeat ``array`` to ``shape`` (read-only), and refuse lengths that do not fit."""
    try:
        return frozen(np.ascontiguousarray(np.broadcast_to(array, shape)))
    except ValueError:
        raise InputError(f"{name}: found shape {array.shape}; pass one value {per}, shape {shape}") from None


def one_vector_each(name: str, array: Array, rows: int, dimension: int) -> Array:
    """Repeat one vector of length ``dimension`` for every row, or take one a row; the number 0 is the zero vector."""
    if array.ndim == 0 and (dimension == 1 or not array.any()):
        return frozen(np.full((rows, dimension), float(array)))
    if array.shape in {(dimension,), (rows, dimension)}:
        return frozen(np.broadcast_to(array, (rows, dimension)).copy())
    raise InputError(
        f"{name}: found shape {array.shape}; pass one vector of length {dimension}, or one a row, "
        f"shape ({rows}, {dimension})"
    )


def body_indices(name: str, value: ArrayLike, distinct: bool = False) -> Indices:
    """Read body numbers (counted from 0) as a read-only vector, and refuse repeated ones if ``distinct``."""
    found = np.asarray(value)
    if found.size == 0:
        found = found.astype(np.intp)
    if found.dtype.kind not in "iu" or found.ndim != 1:
        raise InputError(f"{name}: found {reprlib.repr(value)}; pass a list of body numbers, counted from 0")
    numbers, times = np.unique(found, return_counts=True)
    if distinct and found.size > numbers.size:
        raise InputError(f"{name}: found body {int(numbers[times > 1][0])} more than once; name each body once")
    return frozen(found.astype(np.intp))


def body_pairs(name: str, value: ArrayLike) -> Indices:
    """Read pairs of body numbers (counted from 0) as a read-only array of shape (pairs, 2)."""
    found = np.asarray(value)
    if found.size == 0:
        found = np.zeros((0, 2), dtype=np.intp)
    if found.dtype.kind not in "iu" or found.ndim != 2 or found.shape[1] != 2:
        raise InputError(
            f"{name}: found {reprlib.repr(value)}; pass a list of pairs (i, j) of body numbers, counted from 0"
        )
    same = np.flatnonzero(found[:, 0] == found[:, 1])
    if same.size:
        body = int(found[same[0], 0])
        raise InputError(f"{name}: pair {int(same[0])} joins body {body} with itself; name two bodies")
    return frozen(found.astype(np.intp))


def check_range(name: str, indices: Indices, bodies: int) -> None:
    """Refuse body numbers that the scene does not have."""
    wrong = indices[(indices < 0) | (indices >= bodies)]
    if wrong.size:
        raise InputError(f"{name}: found body {int(wrong.flat[0])}; the scene has bodies 0 to {bodies - 1}")
