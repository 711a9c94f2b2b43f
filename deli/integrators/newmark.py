"""Newmark's methods with substituted constraint forces (Appendix B)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Integrator, Ranges
from deli.integrators.recipe import Recipe
from deli.kernels.codes import FROZEN, MOVING


@dataclass(frozen=True)
class Newmark(Integrator):
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

    RANGES: ClassVar[Ranges] = {"beta": (0.0, 0.5), "gamma": (0.0, 1.0)}

    beta: float = 0.25
    gamma: float = 0.5
    imex: bool = False

    def recipe(self) -> Recipe:
        """Return the numbers of (B.8) to (B.11)."""
        beta, gamma = float(self.beta), float(self.gamma)
        here = beta == 0.0 and not self.imex
        return Recipe(
            unit="deli.kernels.direct.substitute",
            weights=(0.5 - beta, 0.0, beta),
            later=(1.0 - gamma, 0.0, gamma),
            gain=2.0 if self.imex else 2.0 * (1.0 - gamma) if here else gamma / beta,
            rows=FROZEN if here else MOVING,
        )
