"""Settings of methods that are a choice among few values."""

from collections.abc import Mapping
from typing import Any

from deli.errors import InputError

Choices = Mapping[str, tuple[Any, ...]]
"""By setting, the values it can have."""


def choices_of(method: type[Any]) -> Choices:
    """Return the choices of a method: its ``CHOICES``; other settings are numbers."""
    choices: Choices = getattr(method, "CHOICES", {})
    return choices


def memory_of(method: type[Any]) -> tuple[str, ...]:
    """Return the names of what a method carries from step to step besides q and p, each of dof numbers."""
    names: tuple[str, ...] = getattr(method, "MEMORY", ())
    return names


def check_choices(method: object) -> None:
    """Refuse a setting that is not one of its choices.

    Raises
    ------
    InputError
        Naming the setting and what is allowed.
    """
    for key, allowed in choices_of(type(method)).items():
        if getattr(method, key) not in allowed:
            raise InputError(
                f"{type(method).__name__}: {key} {getattr(method, key)!r} is unknown; "
                f"allowed: {', '.join(map(str, allowed))}."
            )
