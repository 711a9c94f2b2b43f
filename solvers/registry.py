"""Which backends exist, which are installed, and how others join."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any

from solvers.backends.base import Backend
from solvers.distribution import install_line
from solvers.errors import NotInstalledError, SolverError, UnknownBackendError
from solvers.program import QuadraticProgram

Factory = Callable[[QuadraticProgram, float, Mapping[str, Any]], Backend]

GROUP = "deli.solvers"
EXTRA = "solvers"
REFERENCE = "cvxpy:"

# name: (class, package it needs)
BUILTIN: dict[str, tuple[str, str]] = {
    "clarabel": ("Clarabel", "clarabel"),
    "daqp": ("DAQP", "daqp"),
    "highs": ("HiGHS", "highspy"),
    "native": ("Native", "numba"),
    "osqp": ("OSQP", "osqp"),
    "piqp": ("PIQP", "piqp"),
    "proxqp": ("ProxQP", "proxsuite"),
    "qoco": ("QOCO", "qoco"),
    "qpalm": ("QPALM", "qpalm"),
    "scs": ("SCS", "scs"),
}

# Chains try their members in order until one is verified; every failed one is counted.
CHAINS: dict[str, tuple[str, ...]] = {"auto": ("native", "daqp", "piqp")}

_registered: dict[str, Factory] = {}


@dataclass(frozen=True, slots=True)
class BackendInfo:
    """A backend deli knows: its name, whether it can be used, and how it is installed."""

    name: str
    installed: bool
    install: str


def register(name: str, factory: Factory) -> None:
    """Make a backend known under a name.

    Parameters
    ----------
    name : str
        Must not be taken; may not start with ``cvxpy:``.
    factory : callable
        ``factory(program, tolerance, options)`` returning a `solvers.Backend`. A package offers one without
        being imported through an entry point of the group ``deli.solvers``.

    Raises
    ------
    SolverError
        If the name is taken.
    """
    if name in _registered or name in BUILTIN or name in CHAINS or name.startswith(REFERENCE):
        raise SolverError(f"the backend name {name!r} is taken: register under another name")
    _registered[name] = factory


def unregister(name: str) -> None:
    """Forget a backend added with `register`."""
    if name not in _registered:
        raise UnknownBackendError(f"{name!r} was not registered; registered: {', '.join(_registered) or 'none'}")
    del _registered[name]


@cache
def _offered() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in BUILTIN}


_found: set[str] = set()


def _installed(package: str) -> bool:
    """Whether a package is there; what was found once is not looked for again."""
    if package not in _found and find_spec(package) is not None:
        _found.add(package)
    return package in _found


def backends() -> list[BackendInfo]:
    """List all backends deli knows, installed or not, without importing any of them."""
    known = [BackendInfo(name, _installed(package), install_line(EXTRA)) for name, (_, package) in BUILTIN.items()]
    others = [*_registered, *(name for name in _offered() if name not in _registered)]
    return known + [BackendInfo(name, True, "") for name in others]


def available() -> list[str]:
    """List the names of the backends that are installed."""
    return [info.name for info in backends() if info.installed]


def members(backend: str) -> tuple[str, ...]:
    """Return the backends a name stands for: the members of a chain, or the name itself.

    Raises
    ------
    UnknownBackendError
        If nobody knows the name.
    NotInstalledError
        If its package is missing.
    """
    names = CHAINS.get(backend, (backend,))
    for name in names:
        _require(name)
    return names


def _require(name: str) -> None:
    if name.startswith(REFERENCE):
        from solvers.backends.reference import require  # cvxpy takes a second to import

        require(name)
        return
    if name in _registered or name in _offered():
        return
    if name not in BUILTIN:
        allowed = [*CHAINS, *(info.name for info in backends()), f"{REFERENCE}SOLVER"]
        raise UnknownBackendError(f"unknown backend {name!r}; allowed: {', '.join(allowed)}")
    package = BUILTIN[name][1]
    if not _installed(package):
        raise NotInstalledError(f"the backend {name!r} needs the package {package!r}: {install_line(EXTRA)}")


def can(backend: str, what: str) -> bool:
    """Say whether a backend, or every member of a chain, has one of the abilities of `solvers.Backend`, by name."""
    return all(not name.startswith(REFERENCE) and getattr(factory(name), what, False) for name in members(backend))


def able(what: str) -> list[str]:
    """List the installed backends with an ability, importing all adapters."""
    return [name for name in available() if can(name, what)]


def factory(name: str) -> Factory:
    """Return the factory of a single backend, importing its adapter now."""
    _require(name)
    if name in _registered:
        return _registered[name]
    if name in BUILTIN:
        adapter: Factory = getattr(import_module(f"solvers.backends.{name}"), BUILTIN[name][0])
        return adapter
    offered: Factory = _offered()[name].load()
    return offered
