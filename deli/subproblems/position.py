"""Position update with complementarity (7.3, 7.4, 7.8), solved as a sequence of metric projections.

The models of one linearization; the iteration is in `deli.kernels.position`.
"""

from typing import TYPE_CHECKING

import numpy as np

from deli.subproblems.rows import DENSE, Patterns, constant_metric, matrix

if TYPE_CHECKING:
    import cvxpy as cp


def model(mass: np.ndarray, rows: int, bilateral_rows: int, patterns: Patterns = DENSE) -> "cp.Problem":
    """Return one linearization of the position update about x_j, with gradients frozen at q, where the forces act.

    ``minimize ½vᵀA v − ŵᵀv  subject to  N_𝕊(q)ᵀv ≥ b (λ),  F(q)ᵀv = c (ν)``,  then x_{j+1} = q + h v, with::

        b = (−g(x_j) + N(q)ᵀ(x_j − q)) / h        c = (−f(x_j) + F(q)ᵀ(x_j − q)) / h
        A = M,  ŵ = p + φ(q, x_j)       or, by Newton,      A = M + (h²/4)V″,  ŵ = p + φ(q, x_j) + (h²/4)V″v_j

    At x_{j+1} = x_j the linearization is exact: (x, λ, ν) solves the asymmetric system (7.3, 7.4, 7.8) itself.
    """
    return _linearization(mass, rows, bilateral_rows, patterns)


def newton_model(mass: np.ndarray, rows: int, bilateral_rows: int, patterns: Patterns = DENSE) -> "cp.Problem":
    """Return `model` with the Newton metric A as a parameter."""
    return _linearization(mass, rows, bilateral_rows, patterns, newton=True)


def _linearization(
    mass: np.ndarray, rows: int, bilateral_rows: int, patterns: Patterns, newton: bool = False
) -> "cp.Problem":
    import cvxpy as cp

    dof = len(mass)
    velocity = cp.Variable(dof, name="velocity")
    linear = cp.Parameter(dof, name="linear")  # −ŵ
    metric = cp.Parameter((dof, dof), PSD=True, name="metric") if newton else constant_metric(mass)
    constraints = []
    if rows:
        gradients = matrix("gradients", rows, dof, patterns[0])
        bounds = cp.Parameter(rows, name="bounds")
        constraints.append(gradients @ velocity >= bounds)
    if bilateral_rows:
        bilateral = matrix("bilateral", bilateral_rows, dof, patterns[1])
        targets = cp.Parameter(bilateral_rows, name="targets")
        constraints.append(bilateral @ velocity == targets)
    return cp.Problem(cp.Minimize(0.5 * cp.quad_form(velocity, metric) + linear @ velocity), constraints)
