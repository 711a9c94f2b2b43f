"""One subproblem as a step posed it, with its answer."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from deli.subproblems.choices import SUBPROBLEMS
from deli.subproblems.rows import DENSE, LARGEST_DENSE, find_patterns

if TYPE_CHECKING:
    import cvxpy as cp


def count_bytes(variables: int, rows: int, entries: int, metric_entries: int) -> int:
    """Return the bytes that a stored problem takes, or several problems together if their counts are added."""
    return 16 * variables + 25 * rows + 12 * entries + 8 * metric_entries


@dataclass(frozen=True, eq=False)
class PosedSubproblem:
    """A metric projection (theory: one convex program, three times) with all its numbers.

    ``minimize ½ zᵀA z − wishᵀz  subject to  R z = b (equalities), R z >= b``, so that ``A z − wish = Rᵀ y``, in
    z = √M v over the largest speed of the problem, with rows of unit length, equalities first.

    Attributes
    ----------
    subproblem : int
        Index into `deli.subproblems.choices.SUBPROBLEMS`.
    step : int
        Number of integration steps before the one that posed it.
    solve : int
        Its number among the solves of the same subproblem in that step: passes, iterates and islands in their order.
    equalities : int
        Number of rows that are equations; they may depend on each other.
    start, column, value : arrays
        R by compressed rows.
    bounds : (rows,) array
    wish : (variables,) array
    metric : (variables, variables) array or None
        A; None if it is the identity.
    z, y : (variables,) and (rows,) arrays
        The answer with its multipliers; nan if the solver gave none.
    """

    subproblem: int
    step: int
    solve: int
    equalities: int
    start: np.ndarray
    column: np.ndarray
    value: np.ndarray
    bounds: np.ndarray
    wish: np.ndarray
    metric: np.ndarray | None
    z: np.ndarray
    y: np.ndarray

    @property
    def name(self) -> str:
        """Name of the subproblem."""
        return SUBPROBLEMS[self.subproblem]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.bounds.size

    @property
    def variables(self) -> int:
        """Number of variables."""
        return self.wish.size

    @property
    def bytes(self) -> int:
        """Size of its numbers in bytes, see `count_bytes`."""
        n = self.variables
        return count_bytes(n, self.rows, self.value.size, n * (n + 1) // 2 if self.newton else 0)

    @property
    def newton(self) -> bool:
        """Whether the metric is a parameter."""
        return self.metric is not None

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """The matrix R of all rows."""
        return sparse.csr_array((self.value, self.column, self.start), shape=(self.rows, self.variables))

    @property
    def active(self) -> np.ndarray:
        """Active set: equations, and inequalities whose multiplier exceeds their slack; empty without an answer."""
        pressing: np.ndarray = self.y > self.matrix @ self.z - self.bounds
        pressing[: self.equalities] = np.isfinite(self.y[: self.equalities])
        return pressing

    def residuals(self, z: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
        """Return the scaled primal, dual and complementarity residual of an answer, see `solvers.residuals.Residuals`.

        In the standard form of `solvers`, inequality rows have the opposite sign of the rows here, and the multipliers
        of equations have the opposite sign of the multipliers here.
        """
        from solvers.kernels import sparse_residuals  # numba takes half a second to import

        if not (np.isfinite(z).all() and np.isfinite(y).all()):
            return math.nan, math.nan, math.nan
        n, row = self.variables, np.repeat(np.arange(self.rows), np.diff(self.start))
        signs = np.where(np.arange(self.rows) < self.equalities, 1.0, -1.0)
        if self.metric is None:
            quadratic = np.arange(n + 1, dtype=np.int32), np.arange(n, dtype=np.int32), np.ones(n)
        else:
            every = np.arange(n, dtype=np.int32)
            quadratic = n * np.arange(n + 1, dtype=np.int32), np.tile(every, n), self.metric.ravel()
        order = np.argsort(self.column, kind="stable")
        ends = np.cumsum(np.bincount(self.column, minlength=n), dtype=np.int32)
        matrix = np.append(np.zeros(1, np.int32), ends), row[order].astype(np.int32), (signs[row] * self.value)[order]
        primal, dual, complementarity, *_ = sparse_residuals(
            *quadratic, *matrix, -self.wish, signs * self.bounds, self.equalities, z, -signs * y
        )
        return primal, dual, complementarity

    def problem(self) -> "cp.Problem":
        """Return the cvxpy model with these numbers in its Parameters, and with the answer in its Variable.

        Large problems have sparse Parameters. Multipliers are in the constraints' dual variables, with cvxpy's signs.
        """
        from deli.subproblems.models import MODELS

        split, free = self.equalities, self.rows - self.equalities
        large = self.rows > LARGEST_DENSE and not self.newton
        patterns = find_patterns(self.start, self.column, split)[1] if large else DENSE
        model = MODELS[self.subproblem][self.newton](np.ones(self.variables), free, split, patterns)
        values: dict[str, Any] = {"linear": -self.wish, "metric": self.metric, "targets": self.bounds[:split]}
        values["bounds"] = self.bounds[split:]
        for name, rows in (("bilateral", self.matrix[:split]), ("gradients", self.matrix[split:])):
            values[name] = rows
        for parameter in model.parameters():
            value = values[parameter.name()]
            if parameter.attributes["sparsity"]:
                parameter.value_sparse = sparse.coo_array(value)
            else:
                parameter.value = value.toarray() if sparse.issparse(value) else value
        (velocity,) = model.variables()
        velocity.value = self.z
        duals = ([self.y[split:]] if free else []) + ([-self.y[:split]] if split else [])
        for constraint, dual in zip(model.constraints, duals, strict=True):
            constraint.dual_variables[0].save_value(dual)
        return model
