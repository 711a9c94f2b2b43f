"""Momentum projection (7.5, 7.6, 7.9): momentum returns to the cotangent space of the constraints that stay active."""

from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.choices import SolverChoice
from deli.subproblems.linear import EqualityProjection
from deli.subproblems.program import Program
from deli.subproblems.stats import StepStats

if TYPE_CHECKING:
    import cvxpy as cp

PROJECTION = 2


def model(mass: np.ndarray, _rows: int, tangent_rows: int) -> "cp.Problem":
    """Nearest velocity, in kinetic energy, that is tangent to all smooth and bilateral constraints at x.

    ``minimize ½|v − v̂|²_M  subject to  [N_𝕊(x) F(x)]ᵀv = 0  (μ, ξ)``,  with v̂ = M⁻¹D₂L_d(q, x).
    """
    import cvxpy as cp

    velocity = cp.Variable(len(mass), name="velocity")
    linear = cp.Parameter(len(mass), name="linear")  # −M v̂
    objective = 0.5 * cp.quad_form(velocity, np.diag(mass)) + linear @ velocity
    constraints = []
    if tangent_rows:
        tangents = cp.Parameter((tangent_rows, len(mass)), name="bilateral")
        constraints.append(tangents @ velocity == 0)
    return cp.Problem(cp.Minimize(objective), constraints)


class Projection:
    """Solves the momentum projections of a run.

    Equality rows only: one linear solve answers it exactly, so the model is solved only where ``skip`` is false.
    """

    def __init__(self, mass: np.ndarray, choice: SolverChoice, stats: StepStats, skip: bool) -> None:
        self._mass = mass
        self._stats = stats
        self._skip = skip
        self._no_rows = np.zeros((0, len(mass)))
        self.program = Program(PROJECTION, model, mass, choice, stats)

    def solve(self, momentum: np.ndarray, gradients: np.ndarray, bilateral: np.ndarray) -> np.ndarray:
        """Return the projected momentum.

        Parameters
        ----------
        momentum : (dof,) array
            D₂L_d(q, x).
        gradients, bilateral : (rows, dof) arrays
            N_𝕊(x) and F(x), one row a constraint.
        """
        rows = np.concatenate((gradients, bilateral)) if len(gradients) else bilateral
        if not self._skip:
            return self.program.solve(momentum, self._no_rows, None, rows).velocity * self._mass
        self._stats.skip(PROJECTION)
        if not len(rows):
            return momentum
        velocity, _ = EqualityProjection(rows, rows / self._mass).project(momentum / self._mass)
        return velocity * self._mass
