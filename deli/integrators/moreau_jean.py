"""Moreau's time-stepping scheme, in the form of Jean."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from deli.errors import InputError

if TYPE_CHECKING:
    from deli.integrators.stepper import Stepper
    from deli.mechanics.scene import Scene


@dataclass(frozen=True)
class MoreauJean:
    """Moreau-Jean scheme: contacts at the level of velocities, with Newton's restitution (Moreau 1988, Jean 1999).

    With v = M⁻¹p and N over the constraints that g(q) + (h/2) ∇g(q)ᵀv ≤ 0 forecasts, one step solves

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

    theta: float = 0.5
    restitution: float = 1.0

    def __post_init__(self) -> None:
        for key, least in (("theta", 0.5), ("restitution", 0.0)):
            value = getattr(self, key)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= 1:
                raise InputError(f"MoreauJean: {key} is {value!r}; allowed: a number from {least:g} to 1.")

    def stepper(
        self,
        scene: "Scene",
        step_size: float,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
    ) -> "Stepper":
        """Bind the method to a scene; see `deli.integrators.stepper.Stepper`."""
        from deli.integrators.stepper import Stepper  # numba takes half a second to import
        from deli.kernels.codes import AFFINE
        from deli.kernels.direct import substitute

        theta = float(self.theta)
        weights = (1.0 - theta, 0.0, theta)
        return Stepper(
            scene,
            step_size,
            solvers,
            skip,
            contact_tolerance,
            substitute,
            weights=weights,
            later=weights,
            gain=1.0,
            share=theta,
            rows=AFFINE,
            restitution=float(self.restitution),
        )
