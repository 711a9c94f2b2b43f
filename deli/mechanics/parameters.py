"""Parameters of a scene, which its runs record: numbers, texts and flags, and lists and tables of them."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deli.errors import InputError


def check_text(name: str, text: str) -> str:
    """Return a text, and refuse characters that no file can hold."""
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise InputError(f"{name}: found {text!r}; letter {error.start} is half of a pair, leave it out") from error
    return text


def check_parameters(name: str, value: Any) -> None:
    """Refuse a parameter that cannot be recorded; the message names its path."""
    if isinstance(value, str):
        check_text(name, value)
    elif isinstance(value, Mapping):
        for key, entry in value.items():
            if not isinstance(key, str):
                raise InputError(f"{name}: found the key {key!r}; a parameter is named by a string")
            check_text(name, key)
            if entry is not None:
                check_parameters(f"{name}.{key}", entry)
    elif number_array(value) is None and not isinstance(value, bool | int):
        if not isinstance(value, list | tuple):
            raise InputError(
                f"{name}: found {reprlib.repr(value)} of type {type(value).__name__}; pass numbers, texts, flags, or "
                "lists and tables of them"
            )
        for number, entry in enumerate(value):
            check_parameters(f"{name}.{number}", entry)


def number_array(value: Any) -> NDArray[Any] | None:
    """Return real numbers or flags as an array, with −0 replaced by 0; None for any other value."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # lists of unequal length
        return None
    if array.dtype.kind == "f":
        return array.astype(np.float64) + 0.0
    return array if array.dtype.kind in "biu" else None
