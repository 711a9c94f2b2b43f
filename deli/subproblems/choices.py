"""Choices of a backend for each subproblem."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import solvers
from deli.errors import InputError

SUBPROBLEMS = ("reflection", "position", "projection")
NATIVE = ("native", "auto")  # backends whose large programs go to the project's own sparse active-set method


@dataclass(frozen=True)
class SolverChoice:
    """A backend with its tolerance and settings.

    Parameters
    ----------
    backend : str
        A name from `solvers.available()`, or ``"auto"``: native, daqp and piqp one after another, then an error. A
        large program that native has not answered in compiled code goes to the chain of `solvers.choosing`.
    tolerance : float
        Largest scaled KKT residual of a solved subproblem; it means the same for every backend.
    polish : bool
        Whether the active set that the answer indicates is solved once more, exactly, and that answer is kept if its
        residual is smaller.
    warm_start : bool
        Whether each solve begins at the last answer to a program of the same shape; refused for a backend without warm
        starts. ``"auto"`` and ``"native"`` begin large programs with the last active set, and small ones anew. A step
        is then no longer a function of (q, p) alone: a run that is resumed, or repeated by another stepper, agrees only
        to the tolerance.
    options : mapping
        Settings by the backend's own names.
    """

    backend: str = "auto"
    tolerance: float = 1e-9
    polish: bool = True
    warm_start: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.backend, str):
            raise InputError(f"solvers: a backend is named by a string; found {self.backend!r}.")
        tolerance = self.tolerance
        if isinstance(tolerance, bool) or not isinstance(tolerance, (int, float)) or not 0 < tolerance < 1:
            raise InputError(f"solvers: tolerance of {self.backend!r} is {tolerance!r}; allowed: 0 < tolerance < 1.")
        for name in ("polish", "warm_start"):
            value = getattr(self, name)
            if not isinstance(value, bool):
                raise InputError(f"solvers: {name} of {self.backend!r} is {value!r}; allowed: true or false.")
        if not isinstance(self.options, Mapping):
            raise InputError(f"solvers: options of {self.backend!r} are {self.options!r}; allowed: a table.")


def parse_choices(choice: object) -> dict[str, SolverChoice]:
    """Return one choice for each subproblem from a user's `solvers`.

    Parameters
    ----------
    choice : str, SolverChoice or mapping
        A name; a table ``{backend, tolerance, polish, warm_start, options}``; or a table of these by subproblem
        (``reflection``, ``position``, ``projection``) with ``default`` for missing ones. Missing keys of a subproblem's
        table have the default's values, except for options, which belong to one backend.

    Raises
    ------
    InputError
        For unknown keys, a value out of range, a backend that is unknown or not installed, or a warm start with a
        backend that has none.
    """
    by_subproblem = isinstance(choice, Mapping) and not _FIELDS.intersection(choice)
    table = dict(choice) if by_subproblem and isinstance(choice, Mapping) else {"default": choice}
    unknown = sorted(set(table) - {*SUBPROBLEMS, "default"})
    if unknown:
        raise InputError(
            f"solvers: unknown key {unknown[0]!r}; allowed: default, {', '.join(SUBPROBLEMS)}, "
            f"or a single table with {', '.join(sorted(_FIELDS))}."
        )
    default = _parse_one(table.get("default", "auto"), SolverChoice())
    choices = {name: _parse_one(table.get(name, default), default) for name in SUBPROBLEMS}
    for one in choices.values():
        _require(one)
    return choices


_FIELDS = {"backend", "tolerance", "polish", "warm_start", "options"}


def _parse_one(choice: object, default: SolverChoice) -> SolverChoice:
    if isinstance(choice, SolverChoice):
        return choice
    if isinstance(choice, str):
        return replace(default, backend=choice, options={})
    if isinstance(choice, Mapping):
        unknown = sorted(set(choice) - _FIELDS)
        if unknown:
            raise InputError(f"solvers: unknown key {unknown[0]!r}; allowed: {', '.join(sorted(_FIELDS))}.")
        return replace(default, **{"options": {}, **choice})
    raise InputError(
        f"solvers: found {choice!r}; allowed: a backend's name or a table with {', '.join(sorted(_FIELDS))}."
    )


def _require(choice: SolverChoice) -> None:
    try:
        solvers.members(choice.backend)
    except solvers.SolverError as error:
        raise InputError(f"solvers: {error}") from error
    if choice.warm_start and choice.backend not in NATIVE and not solvers.can(choice.backend, "warm_starts"):
        raise InputError(
            f"solvers: warm_start is true, and {choice.backend!r} cannot begin at an earlier answer; "
            f"allowed with it: {', '.join((*NATIVE, *solvers.able('warm_starts')))}."
        )
