"""Collision integrators: steps that are interrupted where they meet a constraint."""

from dataclasses import dataclass
from typing import ClassVar

from deli.integrators.integrator import Choices, Integrator
from deli.integrators.recipe import Recipe
from deli.mechanics.schemes import SCHEMES, get_scheme


@dataclass(frozen=True)
class Collision(Integrator):
    """Collision integrator: steps that are cut at events (Kaufman and Pai 2012, section 1.3.2).

    With Φ_t the scheme's step of size t from (q, p), constrained to f(x) = 0 alone, and s < h the first time at which
    g_i(Φ_s) = 0 for some i, one step of size h is

        (q′, p′) = Φ_s(q, p),   p″ = R(q′, p′),   (x, p⁺) = Φ_{h−s}(q′, p″)

    where the last part is cut again at the next event, as often as needed. s is found to rounding by Brent's method.
    R turns all constraints that touch and approach by the generalized reflection (Algorithm 2), so it changes p by
    impulses along their gradients, which keeps momentum maps. What R conserves is

    - "hamiltonian": H (Houndonougbo, Laird and Leimkuhler 2000);
    - "numerical": the scheme's second-order numerical Hamiltonian of step size h (Bond and Leimkuhler 2007);
    - "discrete": E_d = −∂L_d/∂h, of the part before the event and of the part from it to the end of the step, by
      p″ = p′ + a d with d the impulse for H and a > ½ the root nearest 1. For a single contact this is the variational
      collision integrator (Fetecau, Marsden, Ortiz and West 2003), which is symplectic.

    Parts of steps vary in size, so no modified Hamiltonian is conserved, and energy drifts. A constraint that is
    violated and left again within one part is not seen. A step ends with a StepError where contacts rest or slide, or
    impacts accumulate, as they do with "numerical" where a force presses on a contact that grazes, and with "discrete"
    where a ≠ 1 leaves one of several contacts approaching; or where an impact is so slow that no a exists. `GVI` goes
    on there.

    Parameters
    ----------
    scheme : {"verlet", "midpoint"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).
    energy : {"hamiltonian", "discrete", "numerical"}
        What a reflection conserves.
    order : {2, 4}
        Of the steps to and from events; of order 4 they are the symmetric composition of three steps of the scheme, of
        which the second goes back in time. Steps without events are the scheme's own, and conserve another modified
        Hamiltonian: over many events energy may drift more than with order 2.

    Raises
    ------
    InputError
        For a value that is not in these lists.
    """

    CHOICES: ClassVar[Choices] = {
        "scheme": tuple(SCHEMES),
        "energy": ("hamiltonian", "discrete", "numerical"),
        "order": (2, 4),
    }

    scheme: str = "verlet"
    energy: str = "hamiltonian"
    order: int = 2

    def recipe(self) -> Recipe:
        """Return the weights of the scheme, and what reflections conserve."""
        scheme = get_scheme(self.scheme)
        return Recipe(
            unit="deli.kernels.collision.collide",
            weights=scheme.weights,
            reflects=True,
            numerical=scheme if self.energy == "numerical" else None,
            event_order=self.order,
            discrete=self.energy == "discrete",
        )
