"""The Generalized Variational Integrator: Algorithm 1 with bilateral constraints (7.8, 7.9)."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from deli.integrators.choices import Choices, check_choices
from deli.mechanics.schemes import SCHEMES, get_scheme
from deli.subproblems.reflection import ENERGIES, OPERATORS

if TYPE_CHECKING:
    from deli.integrators.stepper import Stepper
    from deli.mechanics.scene import Scene

PREDICTORS = ("forward", "closed_loop")


@dataclass(frozen=True)
class GVI:
    """Generalized Variational Integrator (Kaufman and Pai 2012, Algorithm 1).

    Each step reflects the momentum off the extended active set 𝔸 (6.4), moves to x with complementarity on the smooth
    set 𝕊 (7.1, 7.8), and projects the momentum (7.9). On smooth intervals the map is symplectic, conserves momentum
    maps and is of second order (Theorem 5.1); with impacts it is of first order.

    Parameters
    ----------
    scheme : {"midpoint", "verlet"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).
    reflection : {"generalized", "moreau", "sequential"}
        Reflection operator: Algorithm 2, Algorithm 3, or one contact at a time in index order.
    energy : {"hamiltonian", "numerical"}
        What a reflection conserves: H, or the scheme's second-order numerical Hamiltonian.
    predictor : {"forward", "closed_loop"}
        Where 𝔸 comes from: the unconstrained step (8.1), or the step's own result, repeated until it violates nothing
        that a reflection or a complementarity of this step can prevent.

    Raises
    ------
    InputError
        For a name that is not in these lists.
    """

    CHOICES: ClassVar[Choices] = {
        "scheme": tuple(SCHEMES),
        "reflection": OPERATORS,
        "energy": ENERGIES,
        "predictor": PREDICTORS,
    }

    scheme: str = "midpoint"
    reflection: str = "generalized"
    energy: str = "hamiltonian"
    predictor: str = "forward"

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

        scheme = get_scheme(self.scheme)
        return Stepper(
            scene,
            step_size,
            solvers,
            skip,
            contact_tolerance,
            weights=scheme.weights,
            reflects=True,
            operator=self.reflection,
            numerical=scheme if self.energy == "numerical" else None,
            closed_loop=self.predictor == "closed_loop",
        )
