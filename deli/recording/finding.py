"""A finding of `deli check` about a recorded file."""

from dataclasses import dataclass

AGREEMENT = 1e-9
"""Largest difference of recomputed from recorded numbers, relative to their size or to 1."""


@dataclass(frozen=True)
class Finding:
    """A property of a file, whether it holds (None: could not be checked), and the observation behind that."""

    what: str
    holds: bool | None
    seen: str
