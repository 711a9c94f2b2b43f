"""Numbers and words of a stored variable, decoded from the forms in which programs store them."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from deli.recording.contents import ENCODING, Stored
from deli.recording.damage import refuse

MISSING, PACKED = ("_FillValue", "missing_value"), ("scale_factor", "add_offset")
STORAGE = (ENCODING, *MISSING, "coordinates")
"""Attributes that describe the storage of values, not their meaning."""


def words_of(stored: Stored, name: str, path: Path) -> np.ndarray:
    """Join the letters of words.

    Raises
    ------
    InputError
        If the values are not words.
    """
    if stored.values.dtype != np.dtype("S1") or stored.values.ndim != 2:
        refuse(path, f"{name} has the type {stored.values.dtype} and {stored.values.ndim} dimensions, not words")
    letters = np.ascontiguousarray(stored.values)
    joined = letters.view(f"S{max(letters.shape[1], 1)}").reshape(-1) if letters.size else np.zeros(len(letters), "S1")
    try:
        return np.array([word.decode() for word in joined.tolist()], dtype=str)
    except UnicodeDecodeError:
        refuse(path, f"{name} has bytes that are not letters")


def described(stored: Stored) -> dict[str, Any]:
    """Return the attributes without those that describe storage."""
    return {key: value for key, value in stored.attributes.items() if key not in STORAGE}


def decoded(stored: Stored) -> np.ndarray:
    """Return numbers in this machine's byte order, with nan in place of those marked as missing."""
    values = stored.values.astype(stored.values.dtype.newbyteorder("="), copy=False)
    for key in MISSING:
        mark = stored.attributes.get(key)
        if values.dtype.kind == "f" and isinstance(mark, int | float) and not math.isnan(mark):
            values = np.where(values == mark, np.nan, values)
    return values
