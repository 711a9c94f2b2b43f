"""The Discrete-Smooth Integrator (5.6-5.9)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Choices, Integrator
from deli.integrators.recipe import Recipe
from deli.mechanics.schemes import SCHEMES, get_scheme


@dataclass(frozen=True)
class DiscreteSmooth(Integrator):
    """Discrete-Smooth Integrator (Kaufman and Pai 2012, section 5.1).

    Position update with complementarity on all constraints active at q (5.6, 5.7), then the momentum projection (5.8,
    5.9). It is symplectic and conserves momentum maps (Theorem 5.1) along smooth trajectories, where every active
    constraint is met tangentially. It has no reflections: a constraint met at speed is not kept, and the recorded gaps
    show it; use `GVI` there.

    Parameters
    ----------
    scheme : {"midpoint", "verlet"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).

    Raises
    ------
    InputError
        For an unknown scheme.
    """

    CHOICES: ClassVar[Choices] = {"scheme": tuple(SCHEMES)}

    scheme: str = "midpoint"

    def recipe(self) -> Recipe:
        """Return the weights of the scheme."""
        return Recipe(weights=get_scheme(self.scheme).weights)
