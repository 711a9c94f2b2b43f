"""Moreau's time-stepping scheme, in the form of Jean."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Integrator, Ranges
from deli.integrators.recipe import Recipe
from deli.kernels.codes import AFFINE


@dataclass(frozen=True)
class MoreauJean(Integrator):
    """Moreau-Jean scheme: contacts at the level of velocities, with Newton's restitution (Moreau 1988, Jean 1999).

    With v = M⁻¹p and N over the constraints that g(q) + (h/2) ∇g(q)ᵀv ≤ 0 forecasts, or that touch and do not open,
    g(q) = 0 and ∇g(q)ᵀv ≤ 0 to the contact tolerance, one step solves

        M(v⁺ − v) = −h [(1 − θ) ∇V(q) + θ ∇V(x)] + N(q)λ + F(q)ν,   x = q + h [θ v⁺ + (1 − θ) v]
        0 ≤ λ ⊥ N(q)ᵀ(v⁺ + e v) ≥ 0,   F(q)ᵀv⁺ = 0

    Positions are not corrected: gaps may become negative by O(h), and equalities drift by O(h) of the curvature.

    Parameters
    ----------
    theta : float
        ½ ≤ θ ≤ 1; ½ conserves the energy of a linear system without contacts, 1 dissipates.
    restitution : float
        0 ≤ e ≤ 1.

    Raises
    ------
    InputError
        For θ or e out of range.
    """

    RANGES: ClassVar[Ranges] = {"theta": (0.5, 1.0), "restitution": (0.0, 1.0)}

    theta: float = 0.5
    restitution: float = 1.0

    def recipe(self) -> Recipe:
        """Return the numbers of the θ-method."""
        theta = float(self.theta)
        weights = (1.0 - theta, 0.0, theta)
        return Recipe(
            unit="deli.kernels.direct.substitute",
            weights=weights,
            later=weights,
            gain=1.0,
            share=theta,
            rows=AFFINE,
            restitution=float(self.restitution),
        )
