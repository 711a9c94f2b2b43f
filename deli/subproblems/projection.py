"""Momentum projection (7.5, 7.6, 7.9): momentum returns to the cotangent space of the constraints that stay active.

Equality rows only: one linear solve answers it exactly, so the model is solved only where ``skip`` is false.
"""

from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.rows import DENSE, Patterns, constant_metric, matrix

if TYPE_CHECKING:
    import cvxpy as cp


def model(mass: np.ndarray, _rows: int, tangent_rows: int, patterns: Patterns = DENSE) -> "cp.Problem":
    """Nearest velocity, in kinetic energy, that is tangent to all smooth and bilateral constraints at x.

    ``minimize ½|v − v̂|²_M  subject to  [N_𝕊(x) F(x)]ᵀv = 0  (μ, ξ)``,  with v̂ = M⁻¹D₂L_d(q, x).
    """
    import cvxpy as cp

    velocity = cp.Variable(len(mass), name="velocity")
    linear = cp.Parameter(len(mass), name="linear")  # −M v̂
    objective = 0.5 * cp.quad_form(velocity, constant_metric(mass)) + linear @ velocity
    constraints = []
    if tangent_rows:
        tangents = matrix("bilateral", tangent_rows, len(mass), patterns[1])
        constraints.append(tangents @ velocity == 0)
    return cp.Problem(cp.Minimize(objective), constraints)
