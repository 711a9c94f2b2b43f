"""A subproblem's cvxpy model, compiled by shape and kept in units in which its data are of order one."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import solvers
from deli.errors import StepError
from deli.subproblems.choices import SUBPROBLEMS, SolverChoice
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

    Speeds, masses and gradients are divided by their own scales before a solver sees them, so that a tolerance means
    the same in any units. Problems are compiled once for each padded number of rows.

    Parameters
    ----------
    subproblem : int
        Index into `SUBPROBLEMS`.
    model : callable
        ``model(mass, rows, bilateral_rows)`` returns the `cvxpy.Problem`.
    mass : (dof,) array
    choice : SolverChoice
    padded : bool
        Whether rows may be padded to a few sizes (with rows that cannot bind); equality rows may not.
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
        padded: bool = True,
        measured: bool = True,
    ) -> None:
        self._subproblem = subproblem
        self._model = model
        self._mass_scale = float(mass.mean())
        self._mass = mass / self._mass_scale
        self._choice = choice
        self._stats = stats
        self._padded = padded
        self._measured = measured
        self._compiled: dict[tuple[int, int], solvers.CompiledProblem] = {}
        self.backends: set[str] = set()

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
        rows = len(gradients)
        compiled = self._program(rows, len(bilateral))
        row_scale, target_scale = _norms(gradients), _norms(bilateral)
        mass_scale = self._mass_scale
        speed = float(np.abs(linear).max()) / mass_scale
        if bounds is not None and rows:
            speed = max(speed, float(np.abs(bounds / row_scale).max()))
        if targets is not None and len(targets):
            speed = max(speed, float(np.abs(targets / target_scale).max()))
        speed = speed or 1.0

        data = compiled.parameters
        np.divide(linear, -speed * mass_scale, out=data["linear"])
        if rows:
            np.divide(gradients, row_scale[:, None], out=data["gradients"][:rows])
            if bounds is not None:
                data["bounds"][:rows] = bounds / (speed * row_scale)
            if "bounds" in data:
                if bounds is None:
                    data["bounds"][:rows] = 0.0
                data["gradients"][rows:] = 0.0
                data["bounds"][rows:] = -1.0
        if len(bilateral):
            np.divide(bilateral, target_scale[:, None], out=data["bilateral"])
            if targets is not None:
                data["targets"][:] = targets / (speed * target_scale)
        if metric is not None:
            np.divide(metric, mass_scale, out=data["metric"])

        solution = compiled.solve()
        self._account(solution, rows + len(bilateral))
        impulse = speed * mass_scale
        duals = iter(solution.dual)
        unilateral_dual = next(duals)[:rows] * impulse / row_scale if rows else _EMPTY
        bilateral_dual = next(duals) * (-impulse) / target_scale if len(bilateral) else _EMPTY
        return Multipliers(solution.primal["velocity"] * speed, unilateral_dual, bilateral_dual)

    def _program(self, rows: int, bilateral_rows: int) -> "solvers.CompiledProblem":
        size = next((size for size in _SIZES if size >= rows), rows) if self._padded else rows
        key = (size, bilateral_rows)
        if key not in self._compiled:
            choice = self._choice
            self._compiled[key] = solvers.compile(
                self._model(self._mass, size, bilateral_rows),
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


def _norms(rows: np.ndarray) -> np.ndarray:
    norms = np.sqrt(np.einsum("ij,ij->i", rows, rows))
    norms[norms == 0] = 1.0
    return norms
