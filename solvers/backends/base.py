"""The interface of adapters."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np

from solvers.errors import SolverError
from solvers.program import QuadraticProgram
from solvers.solution import Status


class Answer(NamedTuple):
    """The answer of a solver.

    Attributes
    ----------
    x, y : ndarray
        Point and multipliers in the standard form of `solvers.program`, in arrays that the solver does not use again.
    claimed : Status
        The solver's claim.
    iterations : int
        The solver's count.
    message : str
        The solver's status text.

    Examples
    --------
    >>> import numpy as np
    >>> import solvers
    >>> answer = solvers.Answer(np.array([1.0]), np.array([0.0]), solvers.Status.SOLVED, 3, "optimal")
    >>> answer.x, answer.claimed.value
    (array([1.]), 'solved')
    """

    x: np.ndarray
    y: np.ndarray
    claimed: Status
    iterations: int
    message: str


class Backend(ABC):
    """A solver attached to one program.

    The answer must be a function of the program's current numbers alone, and of the point that `begin` may have given,
    without scalings and step sizes from earlier numbers. The program is lent: numbers written into it are restored
    after each call. An answer of another type or shape counts as failed. An exception becomes a `solvers.BackendError`,
    after which a chain goes on with its next member.

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
        Whether the solver takes sparse matrices without making them dense, so that it suits large programs.
    warm_starts : bool
        Whether `begin` can be called.
    strictly_convex : bool
        Whether P must be positive definite. If P is not, at all values of the Parameters, the problem is refused when
        it is compiled, or goes to the next member of a chain. If that depends on the values, a solve that finds P
        indefinite fails with a message.
    prefers_curvature : bool
        Whether the solver takes a P that is not positive definite, but needs more time for it than others. A chain then
        begins with its next member.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import numpy as np
    >>> import solvers
    >>> class Direct(solvers.Backend):
    ...     '''One linear solve, for programs without rows.'''
    ...     name = "direct"
    ...     def __init__(self, program, tolerance, options):
    ...         self.program = program
    ...     def update(self):
    ...         pass  # the arrays of the program are read in place
    ...     def solve(self):
    ...         x = np.linalg.solve(self.program.quadratic.to_dense(), -self.program.linear)
    ...         return solvers.Answer(x, np.zeros(0), solvers.Status.SOLVED, 1, "")
    >>> solvers.register("direct", Direct)
    >>> x, b = cp.Variable(2, name="x"), cp.Parameter(2, name="b")
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x) - b @ x))
    >>> solvers.compile(problem, "direct").solve(b=[2.0, 4.0]).primal["x"]
    array([1., 2.])
    >>> solvers.unregister("direct")
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
        """Let the next solve, and no later one, begin at a point and its multipliers."""
        raise NotImplementedError

    @abstractmethod
    def solve(self) -> Answer:
        """Solve for the numbers of the last update."""

    def __reduce__(self) -> NoReturn:
        """Refuse copies, because no compiled problem would rewrite the program of a copy."""
        raise TypeError(f"the backend {self.name!r} is attached to one program: copy the compiled problem instead")


def refuse_unknown(backend: str, options: Mapping[str, Any], allowed: Iterable[str]) -> None:
    """Raise if an option is not one of the solver's settings."""
    names = set(allowed)
    for option in options:
        if option not in names:
            raise SolverError(f"{backend} has no option {option!r}; allowed: {', '.join(sorted(names))}")


def settings_of(obj: Any) -> list[str]:
    """Return the names of the writable fields of a solver's settings object."""
    return [name for name in dir(obj) if not name.startswith("_") and not callable(getattr(obj, name))]
