"""The Discrete-Smooth Integrator (5.6-5.9)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Choices, Integrator
from deli.integrators.recipe import Recipe
from deli.mechanics.schemes import SCHEMES, get_scheme


@dataclass(frozen=True)
class DiscreteSmooth(Integrator):
    """Discrete-Smooth Integrator (Kaufman and Pai 2012, section 5.1).

    A step is the position update with complementarity on all constraints active at q (5.6, 5.7), and then the momentum
    projection (5.8, 5.9). It is symplectic and conserves momentum maps (Theorem 5.1) along smooth trajectories, on
    which every active constraint is met tangentially. There are no reflections: a constraint that is met at speed is
    violated, as the recorded gaps show; use `GVI` there.

    Parameters
    ----------
    scheme : {"midpoint", "verlet"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).

    Raises
    ------
    InputError
        For an unknown scheme.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.DiscreteSmooth(), step_size=0.1, steps=100)
    >>> energy = run["trajectory"].hamiltonian
    >>> bool(abs(energy - energy[0]).max() < 0.1)
    True
    """

    CHOICES: ClassVar[Choices] = {"scheme": tuple(SCHEMES)}

    scheme: str = "midpoint"

    def recipe(self) -> Recipe:
        """Return the weights of the scheme."""
        return Recipe(weights=get_scheme(self.scheme).weights)
