"""What an adapter is."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np

from solvers.errors import SolverError
from solvers.program import QuadraticProgram
from solvers.solution import Status


class Answer(NamedTuple):
    """What a solver said.

    Attributes
    ----------
    x, y : ndarray
        Point and multipliers in the standard form of `solvers.program`; the caller keeps them, so they must be
        the solver's no longer.
    claimed : Status
        The solver's own word.
    iterations : int
        Its own count.
    message : str
        Its own status text.
    """

    x: np.ndarray
    y: np.ndarray
    claimed: Status
    iterations: int
    message: str


class Backend(ABC):
    """A solver attached to one program.

    The answer must be a function of the program's current numbers alone, and of the point that `begin` may have given:
    no scaling and no step size left over from earlier numbers. The program is lent: what is written into it is undone
    after each call. An answer that is none, by type or shape, counts as failed, and what is raised as the backend's
    `solvers.BackendError`, behind which a chain goes on.

    Parameters
    ----------
    program : QuadraticProgram
        Rewritten in place between solves.
    tolerance : float
        Bound on the scaled KKT residuals of `solvers.residuals`.
    options : Mapping
        The solver's own settings, by its own names; they win over everything the adapter chooses.

    Attributes
    ----------
    name : str
    sparse : bool
        Whether the solver takes a sparse matrix as such, so that large programs are handed to it.
    warm_starts : bool
        Whether `begin` can be called.
    strictly_convex : bool
        Whether P must be positive definite. A problem in which it is not, whatever the values of its Parameters, is
        refused when it is compiled, or goes to the next member of a chain; where it depends on them, a solve that
        finds it indefinite fails with a message.
    prefers_curvature : bool
        Whether a P that is not positive definite, which it takes, costs it more time than others. A chain then begins
        behind it.
    """

    name: ClassVar[str]
    sparse: ClassVar[bool] = False
    warm_starts: ClassVar[bool] = False
    strictly_convex: ClassVar[bool] = False
    prefers_curvature: ClassVar[bool] = False

    @abstractmethod
    def __init__(self, program: QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None: ...

    @abstractmethod
    def update(self) -> None:
        """Hand the program's current numbers to the solver."""

    def begin(self, x: np.ndarray, y: np.ndarray) -> None:
        """Let the solve after this update, and no other, begin at a point and its multipliers."""
        raise NotImplementedError

    @abstractmethod
    def solve(self) -> Answer:
        """Solve for the numbers handed over last."""

    def __reduce__(self) -> NoReturn:
        """Refuse copies, which would be attached to a program that nobody rewrites."""
        raise TypeError(f"the backend {self.name!r} is attached to one program: copy the compiled problem instead")


def refuse_unknown(backend: str, options: Mapping[str, Any], allowed: Iterable[str]) -> None:
    """Raise if an option is not one of the solver's settings."""
    names = set(allowed)
    for option in options:
        if option not in names:
            raise SolverError(f"{backend} has no option {option!r}; allowed: {', '.join(sorted(names))}")


def settings_of(obj: Any) -> list[str]:
    """Names of the writable fields of a vendor's settings object."""
    return [name for name in dir(obj) if not name.startswith("_") and not callable(getattr(obj, name))]
