"""The Discrete-Smooth Integrator (5.6-5.9)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from deli.integrators.choices import Choices, check_choices
from deli.mechanics.schemes import SCHEMES, get_scheme

if TYPE_CHECKING:
    from deli.integrators.stepper import Stepper
    from deli.mechanics.scene import Scene


@dataclass(frozen=True)
class DiscreteSmooth:
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

    def __post_init__(self) -> None:
        check_choices(self)

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

        return Stepper(scene, step_size, solvers, skip, contact_tolerance, weights=get_scheme(self.scheme).weights)
