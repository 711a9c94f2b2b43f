"""One line of what `deli check` says of a recorded file."""

from dataclasses import dataclass

AGREEMENT = 1e-9
"""How far recomputed numbers may be from recorded ones, relative to their size or to 1."""


@dataclass(frozen=True)
class Finding:
    """One thing that was checked: what, whether it holds (None: could not be checked), and what was seen."""

    what: str
    holds: bool | None
    seen: str
