"""The registry of backends: those of this package, those of users, and those that other packages offer."""

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

# The members of a chain are tried in order until an answer is verified; each failed member is counted.
CHAINS: dict[str, tuple[str, ...]] = {"auto": ("native", "daqp", "piqp")}

_registered: dict[str, Factory] = {}


@dataclass(frozen=True, slots=True)
class BackendInfo:
    """An entry of the registry: name of the backend, whether it is installed, and the line that installs it.

    Examples
    --------
    >>> import solvers
    >>> info = solvers.backends()[0]
    >>> info.name, info.installed
    ('clarabel', True)
    """

    name: str
    installed: bool
    install: str


def register(name: str, factory: Factory) -> None:
    """Register a backend under a name.

    Parameters
    ----------
    name : str
        A name that is not taken and does not start with ``cvxpy:``.
    factory : callable
        ``factory(program, tolerance, options)`` returns a `solvers.Backend`. Another package offers a factory through
        an entry point of the group ``deli.solvers``, and is imported when the backend is used.

    Raises
    ------
    SolverError
        If the name is taken.

    Examples
    --------
    >>> import solvers
    >>> from solvers.backends.native import Native
    >>> def careful(program, tolerance, options):
    ...     return Native(program, tolerance / 100.0, options)
    >>> solvers.register("careful", careful)
    >>> "careful" in solvers.available()
    True
    >>> solvers.unregister("careful")
    """
    if name in _registered or name in BUILTIN or name in CHAINS or name.startswith(REFERENCE):
        raise SolverError(f"the backend name {name!r} is taken: register under another name")
    _registered[name] = factory


def unregister(name: str) -> None:
    """Remove a backend that was added with `register`.

    Raises
    ------
    UnknownBackendError
        If no backend was registered under the name.

    Examples
    --------
    >>> import solvers
    >>> from solvers.backends.native import Native
    >>> solvers.register("mine", Native)
    >>> solvers.unregister("mine")
    >>> "mine" in solvers.available()
    False
    """
    if name not in _registered:
        raise UnknownBackendError(f"{name!r} was not registered; registered: {', '.join(_registered) or 'none'}")
    del _registered[name]


@cache
def _offered() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP) if point.name not in BUILTIN}


_found: set[str] = set()


def _installed(package: str) -> bool:
    """Return whether a package is installed; one that was found is not searched again."""
    if package not in _found and find_spec(package) is not None:
        _found.add(package)
    return package in _found


def backends() -> list[BackendInfo]:
    """List all backends of the registry, installed or not, without importing any of them.

    Examples
    --------
    >>> import solvers
    >>> [info.name for info in solvers.backends()]
    ['clarabel', 'daqp', 'highs', 'native', 'osqp', 'piqp', 'proxqp', 'qoco', 'qpalm', 'scs'...]
    """
    known = [BackendInfo(name, _installed(package), install_line(EXTRA)) for name, (_, package) in BUILTIN.items()]
    others = [*_registered, *(name for name in _offered() if name not in _registered)]
    return known + [BackendInfo(name, True, "") for name in others]


def available() -> list[str]:
    """List the names of the backends that are installed.

    Examples
    --------
    >>> import solvers
    >>> {"clarabel", "daqp", "native", "osqp", "piqp"} <= set(solvers.available())
    True
    """
    return [info.name for info in backends() if info.installed]


def members(backend: str) -> tuple[str, ...]:
    """Return the names of the backends behind a name: the members of a chain, or the name itself.

    Of ``"auto"`` these are the members for small programs; others are chosen when a problem is compiled
    (`solvers.choosing`).

    Raises
    ------
    UnknownBackendError
        If the registry has no such name.
    NotInstalledError
        If the package of the backend is not installed.

    Examples
    --------
    >>> import solvers
    >>> solvers.members("auto")
    ('native', 'daqp', 'piqp')
    >>> solvers.members("osqp")
    ('osqp',)
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
    """Say whether a backend, or every member of a chain, has an ability: the name of a flag of `solvers.Backend`.

    Examples
    --------
    >>> import solvers
    >>> solvers.can("osqp", "warm_starts"), solvers.can("daqp", "warm_starts")
    (True, False)
    """
    return all(not name.startswith(REFERENCE) and getattr(factory(name), what, False) for name in members(backend))


def able(what: str) -> list[str]:
    """List the installed backends with an ability; all adapters are imported.

    Examples
    --------
    >>> import solvers
    >>> {"clarabel", "osqp", "piqp"} <= set(solvers.able("sparse"))
    True
    """
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
