"""The parts by name."""

from deli.bench import backends, ensemble, scaling, skip, startup, steps
from deli.bench.part import Part

_KNOWN = {module.PART.name: module.PART for module in (steps, skip, backends, scaling, ensemble, startup)}


def get(name: str) -> Part:
    """Return a part."""
    return _KNOWN[name]
