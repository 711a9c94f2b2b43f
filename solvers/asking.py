"""Calls of a backend: the program that it borrows is restored, and its answer is checked for type and shape."""

import operator
from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from solvers.backends.base import Answer, Backend
from solvers.errors import BackendError, SolverError
from solvers.solution import Status

if TYPE_CHECKING:
    from solvers.affine import AffineMap

FLOAT = np.dtype(float)
REAL = "fiu"  # kinds of numpy's types that stand for real numbers
MOST = 2**53  # largest count of iterations that is accepted
# Exceptions that are no fault of a backend. All others are, also those that do not inherit Exception: a panic in Rust
# and SystemExit.
PASSED_ON = (KeyboardInterrupt, MemoryError)

Point = tuple[np.ndarray, np.ndarray]


def attach(name: str, make: Callable[[], Backend], lender: "AffineMap") -> Backend:
    """Return the backend that `make` sets up.

    Raises
    ------
    BackendError
        If `make` raises anything but a `SolverError`.
    """
    lent = lender.lend()
    try:
        return make()
    except (SolverError, *PASSED_ON):
        raise
    except BaseException as error:
        raise _blame(name, error) from error
    finally:
        lender.take_back(lent)


def ask(name: str, backend: Backend, lender: "AffineMap", begin: Point | None) -> tuple[Answer, float, float]:
    """Let a backend solve the program that it borrows, from a point if one is given.

    Return the answer, the seconds of handing the numbers over, and the seconds of solving. Numbers that the backend
    writes into the program are restored.

    Raises
    ------
    BackendError
        If the backend raises anything.
    """
    lent = lender.lend()
    before = perf_counter()
    try:
        backend.update()
        if begin is not None:
            backend.begin(*begin)
        ready = perf_counter()
        answer = backend.solve()
        after = perf_counter()
    except PASSED_ON:
        raise
    except BaseException as error:
        raise _blame(name, error) from error
    finally:
        lender.take_back(lent)
    program = lender.program
    return receive(answer, program.variables, program.rows), ready - before, after - ready


def _blame(name: str, error: BaseException) -> BackendError:
    first = str(error).partition("\n")[0]
    return BackendError(f"backend {name!r} raised {type(error).__name__}{': ' if first else ''}{first}")


def receive(answer: Any, variables: int, rows: int) -> Answer:
    """Return an answer in new arrays.

    An object that is no answer to a program of this size becomes an answer of nan. Its message names the fault, and its
    claim is kept.
    """
    if not isinstance(answer, Answer):
        return _nothing(variables, rows, Status.FAILED, f"{_name(answer)} was returned where a solvers.Answer is due")
    x, y, claimed, iterations, message = answer
    if type(claimed) is not Status:
        return _nothing(variables, rows, Status.FAILED, f"claimed is {claimed!r}, which is no solvers.Status")
    point, multipliers = _own(x, variables), _own(y, rows)
    if point is None or multipliers is None:
        name, found, size = ("x", x, variables) if point is None else ("y", y, rows)
        return _nothing(variables, rows, claimed, f"{name} is {_name(found)} where {size} real numbers are due")
    count = _count(iterations)
    if count < 0 or not isinstance(message, str):
        return _nothing(variables, rows, claimed, f"iterations are {iterations!r} and the message is {message!r}")
    return Answer(point, multipliers, claimed, count, message)


def _own(given: Any, size: int) -> np.ndarray | None:
    """Return a copy of a vector of real numbers; None if the object is no such vector of this size."""
    try:
        vector = np.asarray(given)
    except ValueError:  # a list of lists of different lengths
        return None
    if vector.shape != (size,) or vector.dtype.kind not in REAL:
        return None
    return vector.copy() if vector.dtype is FLOAT else vector.astype(float)


def _count(given: Any) -> int:
    """Return a count of iterations; -1 if the object is no count."""
    try:
        count = operator.index(given)
    except TypeError:
        return -1
    return count if count < MOST else -1


def _nothing(variables: int, rows: int, claimed: Status, message: str) -> Answer:
    return Answer(np.full(variables, np.nan), np.full(rows, np.nan), claimed, 0, message)


def _name(given: Any) -> str:
    if isinstance(given, np.ndarray):
        return f"an array of shape {given.shape} and type {given.dtype}"
    return "None" if given is None else f"a {type(given).__name__}"
