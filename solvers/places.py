"""Places of a problem's Variables and multipliers in the flat answers of a backend.

Only this file, `solvers.canonical` and `solvers.leaves` use cvxpy's internals.
"""

from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.reductions.solution import Solution as CvxpySolution
from scipy import sparse

from solvers.errors import SolverError

_REMEDY = "install the cvxpy version deli pins"


@dataclass(slots=True, eq=False)
class Place:
    """The place of a Variable's value, or of a constraint's multiplier, in a flat answer.

    Attributes
    ----------
    index : slice or ndarray of int
        Places in the flat answer, in Fortran order of the entries.
    shape : tuple of int
        Shape of the value.
    filled : ndarray of int or None
        The entries with a place, if others have none and are zero, because they are off a pattern or of an open bound.
        None if all entries have a place.
    """

    index: Any
    shape: tuple[int, ...]
    filled: np.ndarray | None

    def take(self, flat: np.ndarray) -> np.ndarray:
        """Return the value that a flat answer holds."""
        value = flat[self.index]
        if self.filled is not None:
            whole = np.zeros(int(np.prod(self.shape)))
            whole[self.filled] = value
            value = whole
        return value if len(self.shape) == 1 else value.reshape(self.shape, order="F")

    def put(self, flat: np.ndarray, value: Any) -> None:
        """Write a value into a flat answer."""
        entries = _dense(value).ravel(order="F")
        flat[self.index] = entries if self.filled is None else entries[self.filled]

    def entries(self, at: np.ndarray) -> np.ndarray:
        """Return the entries, numbered in Fortran order, at the places `at`."""
        found = np.flatnonzero(np.isin(self.places(), at))
        return found if self.filled is None else self.filled[found]

    def places(self) -> np.ndarray:
        """Return all places in the flat answer."""
        return np.arange(self.index.start, self.index.stop) if isinstance(self.index, slice) else self.index


def places_of_variables(problem: cp.Problem, chain: Any, parametrized: Any) -> list[tuple[str, Place]]:
    """Find the place of each Variable in x.

    The numbers 1, 2, 3, ... are sent through cvxpy's linear maps of increments (`var_forward`). Its maps of values
    would project them onto the sets that the Variables' attributes declare.
    """
    found = {
        identifier: np.arange(start + 1.0, start + variable.size + 1.0).reshape(variable.shape, order="F")
        for identifier, start in parametrized.var_id_to_col.items()
        for variable in (parametrized.id_to_var[identifier],)
    }
    for reduction in reversed(chain.reductions[:-1]):
        found = reduction.var_forward(found)
    places = []
    for variable in problem.variables():
        what = f"Variable {variable.name()!r}"
        if variable.size and variable.id not in found:
            raise SolverError(f"{what} has no place in the standard form of cvxpy {cp.__version__}: {_REMEDY}")
        places.append((variable.name(), _place(what, found.get(variable.id, np.zeros(variable.shape)), variable.shape)))
    return places


def places_of_multipliers(
    problem: cp.Problem, chain: Any, inverse: list[Any], parametrized: Any, rows: np.ndarray
) -> list[Place]:
    """Find the place of each constraint's multiplier in y, by the numbers of its rows, sent back through cvxpy's chain.

    Parameters
    ----------
    rows : ndarray
        For each row of cvxpy's standard form 1 + its number in the program; 0 for a row that is left out.
    """
    ends = np.cumsum([constraint.size for constraint in parametrized.constraints], dtype=int)
    duals = {c.id: rows[end - c.size : end] for c, end in zip(parametrized.constraints, ends, strict=True)}
    values = {parametrized.x.id: np.zeros(parametrized.x.size)}  # needed by the interface, and ignored
    answer = CvxpySolution(cp.OPTIMAL, 0.0, values, duals, {})
    for reduction, data in reversed(list(zip(chain.reductions[:-1], inverse[:-1], strict=True))):
        answer = reduction.invert(answer, data)
    return [
        _place(f"the multiplier of constraint {number}", answer.dual_vars[constraint.id], constraint.shape)
        for number, constraint in enumerate(problem.constraints)
    ]


def _dense(value: Any) -> np.ndarray:
    return np.asarray(value.toarray() if sparse.issparse(value) else value, dtype=float)


def _place(what: str, probe: Any, shape: tuple[int, ...]) -> Place:
    flat = _dense(probe).ravel(order="F")
    index = flat.astype(int) - 1
    if index.size != int(np.prod(shape)) or np.any(index != flat - 1.0) or np.any(index < -1):
        raise SolverError(f"{what} is no selection of the standard form of cvxpy {cp.__version__}: {_REMEDY}")
    filled = np.flatnonzero(index >= 0)
    index = index[filled]
    whole = filled.size == flat.size
    if index.size == 0:
        return Place(slice(0, 0), shape, None if whole else filled)
    if np.array_equal(index, np.arange(index[0], index[0] + index.size)):
        return Place(slice(int(index[0]), int(index[0]) + index.size), shape, None if whole else filled)
    return Place(index, shape, None if whole else filled)
