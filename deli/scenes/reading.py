"""Readers of parameters that several scenes share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from deli.errors import InputError
from deli.mechanics.arrays import real_number


def one_of(name: str, value: Any, allowed: Iterable[str]) -> str:
    """Read one of the allowed words."""
    words = list(allowed)
    if not isinstance(value, str) or value not in words:
        raise InputError(f"{name}: found {value!r}; choose one of {', '.join(map(repr, words))}")
    return value


def between(name: str, value: Any, low: float, high: float) -> float:
    """Read one number > ``low`` and < ``high``."""
    number = real_number(name, value)
    if not low < number < high:
        raise InputError(f"{name}: found {value!r}; it must be > {low:g} and < {high:g}")
    return number


def jitter_of(name: str, value: Any) -> float:
    """Read the share of the free space that random displacements take up, >= 0 and < 1."""
    number = real_number(name, value)
    if not 0.0 <= number < 1.0:
        raise InputError(f"{name}: found {value!r}; it must be >= 0 and < 1")
    return number
