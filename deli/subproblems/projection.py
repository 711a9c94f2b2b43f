"""Momentum projection (7.5, 7.6, 7.9): momentum returns to the cotangent space of the constraints that stay active.

If there are only equality rows, one linear solve is the exact answer, and the model is solved only if ``skip`` is
false. Inequality rows occur in methods whose contacts have a law of restitution in the velocities.
"""

from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.rows import DENSE, Patterns, constant_metric, matrix

if TYPE_CHECKING:
    import cvxpy as cp


def model(mass: np.ndarray, rows: int, tangent_rows: int, patterns: Patterns = DENSE) -> "cp.Problem":
    """Return the model of the nearest velocity, in kinetic energy, tangent to smooth and bilateral constraints at x.

    ``minimize ½|v − v̂|²_M  subject to  [N_𝕊(x) F(x)]ᵀv = 0  (μ, ξ)``,  with v̂ = M⁻¹D₂L_d(q, x).

    In the nonsmooth generalized-alpha method v̂ = ṽ, and contacts closed at x add  G(x)ᵀv ≥ −e G(q)ᵀv(q)  (Λ ≥ 0).
    """
    import cvxpy as cp

    velocity = cp.Variable(len(mass), name="velocity")
    linear = cp.Parameter(len(mass), name="linear")  # −M v̂
    objective = 0.5 * cp.quad_form(velocity, constant_metric(mass)) + linear @ velocity
    constraints = []
    if rows:
        gradients = matrix("gradients", rows, len(mass), patterns[0])
        bounds = cp.Parameter(rows, name="bounds")
        constraints.append(gradients @ velocity >= bounds)
    if tangent_rows:
        tangents = matrix("bilateral", tangent_rows, len(mass), patterns[1])
        constraints.append(tangents @ velocity == 0)
    return cp.Problem(cp.Minimize(objective), constraints)
