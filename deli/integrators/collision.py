"""Collision integrators: steps that are cut at the times when they meet a constraint."""

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
    R is the generalized reflection (Algorithm 2) off all constraints that touch and approach. It changes p by impulses
    along their gradients and so conserves momentum maps. The energy that R conserves is

    - "hamiltonian": H (Houndonougbo, Laird and Leimkuhler 2000);
    - "numerical": the scheme's second-order numerical Hamiltonian of step size h (Bond and Leimkuhler 2007);
    - "discrete": E_d = −∂L_d/∂h, of the part before the event and of the part from it to the end of the step, by
      p″ = p′ + a d with d the impulse for H and a > ½ the root nearest 1. For a single contact this is the variational
      collision integrator (Fetecau, Marsden, Ortiz and West 2003), which is symplectic.

    Parts of steps vary in size, so no modified Hamiltonian is conserved, and energy drifts. A constraint that is
    violated and left again within one part is not detected. A step fails with a StepError if contacts rest or slide, if
    impacts accumulate, or if an impact is so slow that no a exists. Impacts accumulate with "numerical" if a force
    presses on a grazing contact, and with "discrete" if a ≠ 1 leaves one of several contacts approaching. `GVI`
    continues in all these cases.

    Parameters
    ----------
    scheme : {"verlet", "midpoint"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).
    energy : {"hamiltonian", "discrete", "numerical"}
        Energy that a reflection conserves.
    order : {2, 4}
        Order of the steps to and from events. Steps of order 4 are the symmetric composition of three steps of the
        scheme, of which the second goes back in time. Steps without events are the scheme's own, and conserve another
        modified Hamiltonian: over many events energy may drift more than with order 2.

    Raises
    ------
    InputError
        For a value that is not in these lists.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.point_mass(), deli.Collision(), step_size=0.1, steps=50)
    >>> int(run["trajectory"].reflected_contacts.sum())  # impacts
    6
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
        """Return the weights of the scheme, and the energy that reflections conserve."""
        scheme = get_scheme(self.scheme)
        return Recipe(
            unit="deli.kernels.collision.collide",
            weights=scheme.weights,
            reflects=True,
            numerical=scheme if self.energy == "numerical" else None,
            event_order=self.order,
            discrete=self.energy == "discrete",
        )
