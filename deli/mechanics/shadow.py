"""Weights of shadow energies: integrals of products of Lagrange polynomials."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.polynomial import Polynomial

from deli.mechanics.arrays import Array, frozen

ORDERS = (2, 4, 6, 8, 10, 12)
"""Orders of the shadow energies that can be measured; at higher orders rounding and the window of steps dominate."""


@cache
def shadow_weights(order: int) -> Array:
    """Return B_jk = ½ ∫₋₁¹ ℓ_j ℓ_k′ dt, shape (order + 1, order + 1), of the nodes −order/2, …, order/2.

    With q and p given at the nodes, Σ B_jk p_j · q_k is ½ ∫₋₁¹ p · q′ dt of their interpolants. Order 0 has no weights.
    """
    nodes = np.arange(-(order // 2), order // 2 + 1, dtype=float)
    if order == 0:
        return frozen(np.zeros((0, 0)))
    lagrange = []
    for j, node in enumerate(nodes):
        others = np.delete(nodes, j)
        lagrange.append(Polynomial.fromroots(others) / np.prod(node - others))
    primitives = [[(one * other.deriv()).integ() for other in lagrange] for one in lagrange]
    return frozen(np.array([[0.5 * (each(1.0) - each(-1.0)) for each in row] for row in primitives]))
