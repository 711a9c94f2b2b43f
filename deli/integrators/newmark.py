"""Newmark's methods with substituted constraint forces (Appendix B)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Integrator, Ranges
from deli.integrators.recipe import Recipe
from deli.kernels.codes import FROZEN, MOVING


@dataclass(frozen=True)
class Newmark(Integrator):
    """Newmark's family of methods with constraint forces substituted directly (Kaufman and Pai 2012, B.6 to B.11).

    With r = N(x)λ + F(x)ν, 0 ≤ λ ⊥ g(x) ≥ 0 and f(x) = 0, one step solves

        M(x − q)/h = p − (h/2) [(1 − 2β) ∇V(q) + 2β ∇V(x)] + r
        p⁺         = p −  h    [(1 − γ) ∇V(q) +  γ ∇V(x)] + c r

    where r is βh times a force at x and c = γ/β (B.8, B.9), or, in the implicit-explicit variant of Kane et al.
    (1999), r is h/2 times a force at x and c = 2 (B.10, B.11). (B.8) also allows forces at q, of any element of ∂I(q);
    here they are zero. With β = 0, (B.8) has forces at q only: then r = N(q)λ + F(q)ν over the constraints with
    g(q) ≤ 0, and c = 2(1 − γ), so that a constraint met within a step acts in the next step.

    Parameters
    ----------
    beta, gamma : float
        0 ≤ β ≤ ½ and 0 ≤ γ ≤ 1. β = ¼, γ = ½ is the trapezoidal rule, and β = 0, γ = ½ is the explicit method. The
        order in free flight is two if and only if γ = ½.
    imex : bool
        Whether constraint forces are taken at x, as with β = ½ and γ = 1, with β and γ for the other forces only.

    Raises
    ------
    InputError
        For β or γ out of range.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.point_mass(), deli.Newmark(), step_size=0.1, steps=50)
    >>> energy = run["trajectory"].hamiltonian
    >>> [round(float(energy[step]), 2) for step in (0, 50)]  # impacts dissipate
    [9.8, 0.08]
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
