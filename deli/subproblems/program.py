"""A subproblem's cvxpy model, compiled by shape and kept in units in which its data are of order one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import solvers
from deli.errors import InputError, StepError
from deli.subproblems.choices import SUBPROBLEMS, SolverChoice
from deli.subproblems.linear import independent_rows
from deli.subproblems.stats import StepStats

if TYPE_CHECKING:
    import cvxpy as cp

_ACCEPTED = 1e3  # an answer whose residual exceeds this many tolerances stops the run
_SIZES = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128)


@dataclass(frozen=True)
class Multipliers:
    """What a program returns: the velocity-like unknown, and the multipliers of its two groups of rows."""

    velocity: np.ndarray
    unilateral: np.ndarray
    bilateral: np.ndarray


class Program:
    """The metric projection of theory section 3, through one subproblem's cvxpy model.

    ``minimize ½ vᵀA v − ŵᵀv  subject to  N v ≥ b (λ ≥ 0),  F v = c (ν)``, so that ``A v − ŵ = Nᵀλ + Fᵀν``.

    A solver sees z = √M v / s with s a speed of the problem at hand, and rows of unit length, so that a tolerance
    means the same in any units and for any masses: with A = M the model's masses are all one. Of equality rows that
    depend on each other it sees an independent set. Problems are compiled once for each padded number of rows.

    Parameters
    ----------
    subproblem : int
        Index into `SUBPROBLEMS`.
    model : callable
        ``model(mass, rows, bilateral_rows)`` returns the `cvxpy.Problem`.
    mass : (dof,) array
    choice : SolverChoice
    stats : StepStats
    measured : bool
        Whether the residuals of each solve are the subproblem's own and so recorded.
    """

    def __init__(
        self,
        subproblem: int,
        model: "Callable[[np.ndarray, int, int], cp.Problem]",
        mass: np.ndarray,
        choice: SolverChoice,
        stats: StepStats,
        measured: bool = True,
    ) -> None:
        self._subproblem = subproblem
        self._model = model
        self._root = np.sqrt(mass)
        self._choice = choice
        self._stats = stats
        self._measured = measured
        self._compiled: dict[tuple[int, int], solvers.CompiledProblem] = {}
        self._independent: tuple[np.ndarray, np.ndarray | None] | None = None
        self.backends: set[str] = set()
        if choice.options or choice.backend.startswith("cvxpy:"):
            self._try()

    def solve(
        self,
        linear: np.ndarray,
        gradients: np.ndarray,
        bounds: np.ndarray | None,
        bilateral: np.ndarray,
        targets: np.ndarray | None = None,
        metric: np.ndarray | None = None,
    ) -> Multipliers:
        """Solve for the given data.

        Parameters
        ----------
        linear : (dof,) array
            ŵ, in units of momentum.
        gradients, bilateral : (rows, dof) and (bilateral rows, dof) arrays
            N and F, one row a constraint.
        bounds, targets : arrays or None
            b and c; None stands for zeros.
        metric : (dof, dof) array or None
            A, for a model that has it as a parameter.

        Raises
        ------
        StepError
            When no answer within a thousand tolerances was found.
        """
        chosen = self._choose(bilateral)
        equalities = bilateral if chosen is None else bilateral[chosen]
        rows = len(gradients)
        compiled = self._program(rows, len(equalities))
        data = compiled.parameters
        normals, lengths = _unit(gradients / self._root)
        if rows:
            data["gradients"][:rows] = normals
            data["gradients"][rows:] = 0.0
            data["bounds"][rows:] = -1.0
        tangents, spans = _unit(equalities / self._root)
        if len(equalities):
            data["bilateral"][:] = tangents
        pull = linear / self._root
        speed = float(np.abs(pull).max())
        if bounds is not None and rows:
            bounds = bounds / lengths
            speed = max(speed, float(np.abs(bounds).max()))
        if targets is not None and len(equalities):
            targets = (targets if chosen is None else targets[chosen]) / spans
            speed = max(speed, float(np.abs(targets).max()))
        speed = speed or 1.0
        np.divide(pull, -speed, out=data["linear"])
        if rows:
            data["bounds"][:rows] = 0.0 if bounds is None else bounds / speed
        if targets is not None and len(equalities):
            np.divide(targets, speed, out=data["targets"])
        if metric is not None:
            np.divide(metric, np.outer(self._root, self._root), out=data["metric"])

        solution = compiled.solve()
        self._account(solution, rows + len(equalities))
        duals = iter(solution.dual)
        unilateral_dual = next(duals)[:rows] * (speed / lengths) if rows else _EMPTY
        bilateral_dual = np.zeros(len(bilateral))
        if len(equalities):
            # cvxpy's multiplier of an equality has the opposite sign.
            bilateral_dual[slice(None) if chosen is None else chosen] = next(duals) * (-speed / spans)
        return Multipliers(solution.primal["velocity"] * (speed / self._root), unilateral_dual, bilateral_dual)

    def _try(self) -> None:
        """Solve a trivial problem, so that what a backend does not accept is refused before a run starts."""
        try:
            compiled = self._program(1, 0)
            for name, view in compiled.parameters.items():
                view[...] = np.eye(len(view)) if name == "metric" else 0.0
            compiled.solve()
        except Exception as error:
            with_options = f" with options {dict(self._choice.options)!r}" if self._choice.options else ""
            raise InputError(
                f"solvers.{SUBPROBLEMS[self._subproblem]}: backend {self._choice.backend!r}{with_options}: "
                f"{str(error).splitlines()[0]}"
            ) from error

    def _choose(self, bilateral: np.ndarray) -> np.ndarray | None:
        """Indices of independent rows, None for all; found once for the solves that share their gradients."""
        if self._independent is None or self._independent[0] is not bilateral:
            self._independent = (bilateral, independent_rows(bilateral / self._root))
        return self._independent[1]

    def _program(self, rows: int, bilateral_rows: int) -> "solvers.CompiledProblem":
        size = next((size for size in _SIZES if size >= rows), rows)
        key = (size, bilateral_rows)
        if key not in self._compiled:
            choice = self._choice
            self._compiled[key] = solvers.compile(
                self._model(np.ones(len(self._root)), size, bilateral_rows),
                choice.backend,
                tolerance=choice.tolerance,
                polish=choice.polish,
                **choice.options,
            )
        return self._compiled[key]

    def _account(self, solution: "solvers.Solution", rows: int) -> None:
        self._stats.add(self._subproblem, solution, rows)
        residuals = (solution.primal_residual, solution.dual_residual, solution.complementarity)
        if self._measured:
            self._stats.measure(self._subproblem, *residuals)
        self.backends.add(solution.backend)
        residual = max(residuals)
        if not (solution.ok or residual <= _ACCEPTED * self._choice.tolerance):
            raise StepError(
                f"{SUBPROBLEMS[self._subproblem]}: backend {solution.backend!r} reports {solution.claimed} and leaves "
                f"a residual of {residual:.1e} where {self._choice.tolerance:.1e} was asked ({solution.status}"
                f"{': ' + solution.message if solution.message else ''}); "
                f"try another backend, polish = true, or a smaller step_size."
            )


_EMPTY = np.zeros(0)


def _unit(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of unit length, and the lengths they had (1 for a zero row)."""
    lengths = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    lengths[lengths == 0] = 1.0
    return rows / lengths[:, None], lengths
