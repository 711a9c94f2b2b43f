"""Direct substitution of constraint forces into the implicit midpoint method (Appendix B)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Choices, Integrator
from deli.integrators.recipe import Recipe
from deli.kernels.codes import MOVING


@dataclass(frozen=True)
class Direct(Integrator):
    """Implicit midpoint with the constraints' forces substituted for forces (Kaufman and Pai 2012, B.3 to B.5).

    With y = (q + x)/2, or y = x where constrained at the endpoint, one step solves

        M(x − q)/h = p − (h/2) ∇V((q + x)/2) + N(y)λ + F(y)ν,   0 ≤ λ ⊥ g(y) ≥ 0,   f(y) = 0

    and sets p⁺ = (2/h) M(x − q) − p (B.15). At the midpoint, x is a stationary point of (B.14). Nonlinear g, f and V
    are met by a sequence of convex programs, of which the first is exact where V is quadratic and g is linear.
    Impacts give back an amount of energy that depends on where in the step they fall: at the midpoint too much or too
    little, at the endpoint at most all of it (Theorem B.1).

    Parameters
    ----------
    constraint : {"midpoint", "endpoint"}
        Where the constraints hold, and where their gradients are taken.

    Raises
    ------
    InputError
        For another name.
    """

    CHOICES: ClassVar[Choices] = {"constraint": ("midpoint", "endpoint")}

    constraint: str = "midpoint"

    def recipe(self) -> Recipe:
        """Return the numbers of (B.3) to (B.5)."""
        return Recipe(
            unit="deli.kernels.direct.substitute",
            weights=(0.0, 0.5, 0.0),
            later=(0.0, 1.0, 0.0),
            gain=2.0,
            place=0.5 if self.constraint == "midpoint" else 1.0,
            rows=MOVING,
        )
