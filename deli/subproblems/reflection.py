"""Generalized reflection (6.6-6.9, Algorithms 2 and 3): approaching contacts separate, and energy is conserved.

The models of one pass; the passes are in `deli.kernels.reflection`.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from deli.subproblems.rows import DENSE, Patterns, constant_metric, matrix

if TYPE_CHECKING:
    import cvxpy as cp

OPERATORS = ("generalized", "moreau", "sequential")
ORDERS = ("index", "fastest")
SELECTIONS = (("generalized", "index"), ("moreau", "index"), ("sequential", "index"), ("sequential", "fastest"))
"""Operator and order by their number in kernels; only the sequential operator has an order."""
SHADOWS = {"shadow2": 2, "shadow4": 4, "shadow6": 6, "shadow8": 8}
"""Orders of the shadow energies, by name."""
ENERGIES = ("hamiltonian", "numerical", *SHADOWS)


def model(mass: np.ndarray, rows: int, bilateral_rows: int, patterns: Patterns = DENSE) -> "cp.Problem":
    """Return the model of Algorithm 2, line 9, with E = H: the nearest velocity to 2v that approaches no contact of 𝕍.

    ``minimize ½|v* − 2v|²_M  subject to  G_𝕍ᵀv* ≥ 0 (λ),  Fᵀv* = 0 (ν)``,  then p⁺ = p + G_𝕍λ + Fν.

    Complementarity λᵀG_𝕍ᵀv* = 0 is the conservation of energy, |v* − v|_M = |v|_M; λ solves (A.1).
    """
    return _projection(len(mass), rows, bilateral_rows, constant_metric(mass), patterns)


def numerical_model(mass: np.ndarray, rows: int, bilateral_rows: int, patterns: Patterns = DENSE) -> "cp.Problem":
    """Return the model for an energy ½pᵀWp (theory: second-order numerical Hamiltonians), in the metric A = W⁻¹.

    ``minimize ½|u − 2Wp|²_A  subject to  Ĝ_𝕍ᵀu ≥ 0 (λ)``,  then p⁺ = p + Ĝ_𝕍λ, where Ĝ_𝕍 is projected as in (7.7).
    """
    import cvxpy as cp

    metric = cp.Parameter((len(mass), len(mass)), PSD=True, name="metric")
    return _projection(len(mass), rows, bilateral_rows, metric, patterns)


def _projection(
    dof: int, rows: int, bilateral_rows: int, metric: "sparse.dia_array | cp.Parameter", patterns: Patterns
) -> "cp.Problem":
    import cvxpy as cp

    velocity = cp.Variable(dof, name="velocity")
    linear = cp.Parameter(dof, name="linear")  # −2p
    constraints = []
    if rows:
        gradients = matrix("gradients", rows, dof, patterns[0])
        bounds = cp.Parameter(rows, name="bounds")  # zero, except in padding rows
        constraints.append(gradients @ velocity >= bounds)
    if bilateral_rows:
        bilateral = matrix("bilateral", bilateral_rows, dof, patterns[1])
        constraints.append(bilateral @ velocity == 0)
    return cp.Problem(cp.Minimize(0.5 * cp.quad_form(velocity, metric) + linear @ velocity), constraints)
