"""Checks that work fits into the memory and onto the disk of this machine, before it begins."""

from pathlib import Path

import psutil

from deli.errors import InputError

try:
    import resource
except ImportError:  # Windows limits no address space
    resource = None  # type: ignore[assignment]


def available_memory() -> int:
    """Return the bytes that this process can take without swapping, and under its own limit if it has one."""
    free = int(psutil.virtual_memory().available)
    if resource is None:
        return free
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return free if limit == resource.RLIM_INFINITY else max(0, min(free, limit - psutil.Process().memory_info().vms))


def require_memory(what: str, needed: float, remedy: str) -> None:
    """Refuse work that needs more memory than is free.

    Parameters
    ----------
    what : str
        The work, as the beginning of a sentence.
    needed : float
        The estimate in bytes.
    remedy : str
        An alternative, as the end of the sentence.

    Raises
    ------
    InputError
        If the estimate exceeds the free memory; the message states both, and the remedy.
    """
    _require(what, needed, available_memory(), "of memory", remedy)


def require_disk(what: str, needed: float, folder: Path, remedy: str) -> None:
    """Refuse work that needs more space than is free on the disk of a folder, see `require_memory`."""
    _require(what, needed, psutil.disk_usage(str(folder)).free, "on the disk", remedy)


def in_words(size: float) -> str:
    """Return a number of bytes in MB or GB."""
    return f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"


def _require(what: str, needed: float, free: float, where: str, remedy: str) -> None:
    if needed > free:
        raise InputError(
            f"{what}, which take about {in_words(needed)} {where}, and {in_words(free)} are free; {remedy}."
        )
