"""Moreau's time-stepping scheme, in the form of Jean."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Integrator, Ranges
from deli.integrators.recipe import Recipe
from deli.kernels.codes import AFFINE


@dataclass(frozen=True)
class MoreauJean(Integrator):
    """Moreau-Jean scheme: contacts at the level of velocities, with Newton's restitution (Moreau 1988, Jean 1999).

    With v = M⁻¹p, one step solves the equations below, where N holds the gradients of the active set: of the
    constraints with the forecast g(q) + (h/2) ∇g(q)ᵀv ≤ 0, and of those that touch and do not open, g(q) = 0 and
    ∇g(q)ᵀv ≤ 0 to the contact tolerance.

        M(v⁺ − v) = −h [(1 − θ) ∇V(q) + θ ∇V(x)] + N(q)λ + F(q)ν,   x = q + h [θ v⁺ + (1 − θ) v]
        0 ≤ λ ⊥ N(q)ᵀ(v⁺ + e v) ≥ 0,   F(q)ᵀv⁺ = 0

    Positions are not corrected: gaps may become negative by O(h), and equalities drift in proportion to h and to their
    curvature.

    Parameters
    ----------
    theta : float
        ½ ≤ θ ≤ 1; ½ conserves the energy of a linear system without contacts, and 1 dissipates it.
    restitution : float
        Coefficient of restitution, 0 ≤ e ≤ 1.

    Raises
    ------
    InputError
        For θ or e out of range.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.quartic_wall(), deli.MoreauJean(restitution=0.5), step_size=0.01, steps=500)
    >>> energy = run["trajectory"].hamiltonian
    >>> [round(float(energy[step]), 3) for step in (0, 500)]  # one impact leaves a quarter of the energy
    [0.25, 0.063]
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
