"""Newmark's methods with substituted constraint forces (Appendix B)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from deli.errors import InputError

if TYPE_CHECKING:
    from deli.integrators.stepper import Stepper
    from deli.mechanics.scene import Scene


@dataclass(frozen=True)
class Newmark:
    """Newmark's family with the constraints' forces substituted for forces (Kaufman and Pai 2012, B.6 to B.11).

    With r = N(x)λ + F(x)ν, 0 ≤ λ ⊥ g(x) ≥ 0 and f(x) = 0, one step solves

        M(x − q)/h = p − (h/2) [(1 − 2β) ∇V(q) + 2β ∇V(x)] + r
        p⁺         = p −  h    [(1 − γ) ∇V(q) +  γ ∇V(x)] + c r

    where r is βh times a force at x and c = γ/β (B.8, B.9), or, in the implicit-explicit variant of Kane et al.
    (1999), r is h/2 times a force at x and c = 2 (B.10, B.11). Of the forces at q that (B.8) allows as well, which are
    those of any element of ∂I(q), zero is taken. With β = 0 (B.8) has forces at q only: there r = N(q)λ + F(q)ν over
    the constraints with g(q) ≤ 0, and c = 2(1 − γ); what is met within a step is seen at the next.

    Parameters
    ----------
    beta, gamma : float
        0 ≤ β ≤ ½ and 0 ≤ γ ≤ 1. β = ¼, γ = ½ is the trapezoidal rule, β = 0, γ = ½ the explicit method; of second order
        in free flight if and only if γ = ½.
    imex : bool
        Constraint forces at x, as with β = ½ and γ = 1, whatever β and γ are for the others.

    Raises
    ------
    InputError
        For β or γ out of range.
    """

    beta: float = 0.25
    gamma: float = 0.5
    imex: bool = False

    def __post_init__(self) -> None:
        for key, most in (("beta", 0.5), ("gamma", 1.0)):
            value = getattr(self, key)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 <= value <= most:
                raise InputError(f"Newmark: {key} is {value!r}; allowed: a number from 0 to {most:g}.")
        if not isinstance(self.imex, bool):
            raise InputError(f"Newmark: imex is {self.imex!r}; allowed: true or false.")

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
        from deli.kernels.codes import FROZEN, MOVING
        from deli.kernels.direct import substitute

        beta, gamma = float(self.beta), float(self.gamma)
        here = beta == 0.0 and not self.imex
        return Stepper(
            scene,
            step_size,
            solvers,
            skip,
            contact_tolerance,
            substitute,
            weights=(0.5 - beta, 0.0, beta),
            later=(1.0 - gamma, 0.0, gamma),
            gain=2.0 if self.imex else 2.0 * (1.0 - gamma) if here else gamma / beta,
            rows=FROZEN if here else MOVING,
        )
