"""Direct substitution of constraint forces into the implicit midpoint method (Appendix B)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Choices, Integrator
from deli.integrators.recipe import Recipe
from deli.kernels.codes import MOVING


@dataclass(frozen=True)
class Direct(Integrator):
    """Implicit midpoint method with constraint forces substituted directly (Kaufman and Pai 2012, B.3 to B.5).

    With y = (q + x)/2, or y = x where constrained at the endpoint, one step solves

        M(x − q)/h = p − (h/2) ∇V((q + x)/2) + N(y)λ + F(y)ν,   0 ≤ λ ⊥ g(y) ≥ 0,   f(y) = 0

    and sets p⁺ = (2/h) M(x − q) − p (B.15). At the midpoint, x is a stationary point of (B.14). For nonlinear g, f and
    V a step solves a sequence of convex programs; the first is exact if V is quadratic and g is linear. The energy
    after an impact depends on the time of the impact within the step: with constraints at the midpoint it may rise or
    fall, with constraints at the endpoint it cannot rise (Theorem B.1).

    Parameters
    ----------
    constraint : {"midpoint", "endpoint"}
        Point at which the constraints hold, and at which their gradients are taken.

    Raises
    ------
    InputError
        For another name.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.point_mass(), deli.Direct(constraint="endpoint"), step_size=0.1, steps=50)
    >>> energy = run["trajectory"].hamiltonian
    >>> [round(float(energy[step]), 2) for step in (0, 50)]  # impacts dissipate
    [9.8, 0.08]
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
