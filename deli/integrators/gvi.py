"""The Generalized Variational Integrator: Algorithm 1 with bilateral constraints (7.8, 7.9)."""

from dataclasses import dataclass
from typing import ClassVar

from deli.errors import InputError
from deli.integrators.integrator import Choices, Integrator
from deli.integrators.recipe import Recipe
from deli.kernels.codes import AFFINE, FROZEN
from deli.mechanics.schemes import SCHEMES, get_scheme
from deli.subproblems.reflection import ENERGIES, OPERATORS, ORDERS, SELECTIONS, SHADOWS

PREDICTORS = ("forward", "closed_loop")


@dataclass(frozen=True)
class GVI(Integrator):
    """Generalized Variational Integrator (Kaufman and Pai 2012, Algorithm 1).

    Each step reflects the momentum off the extended active set 𝔸 (6.4), moves to x with complementarity on the smooth
    set 𝕊 (7.1, 7.8), and projects the momentum (7.9). On smooth intervals the map is symplectic, conserves momentum
    maps and is of second order (Theorem 5.1); with impacts it is of first order.

    Parameters
    ----------
    scheme : {"midpoint", "verlet"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).
    reflection : {"generalized", "moreau", "sequential"}
        Reflection operator: Algorithm 2, Algorithm 3, or one contact at a time.
    energy : {"hamiltonian", "numerical", "shadow2", "shadow4", "shadow6", "shadow8"}
        Energy that a reflection conserves: H, the scheme's second-order numerical Hamiltonian, or its shadow energy of
        order 2, 4, 6 or 8 (`deli.metrics.shadow_energy`), which needs no hessian and includes constraint forces. A
        reflection changes the energy that the smooth steps conserve by O(h²), O(h⁴), and O(h^(order + 2)).
    predictor : {"forward", "closed_loop"}
        Origin of 𝔸: the unconstrained step (8.1), or the step's own result, repeated until it violates nothing. With
        the latter, a contact that a reflection cannot keep open for a whole step lands: it keeps its gap,
        ``0 <= λ ⊥ g(x) - g(q) >= 0``, and the energy of its momentum along ∇g. A step then ends with g(x) >= -tolerance
        or with a `StepError`; see ``docs/explanation/closed_loop.md``.
    linearized : bool
        Whether a step replaces every constraint by its tangent at the prediction qᵖ, g(y) ≈ g(qᵖ) + ∇g(qᵖ)ᵀ(y − qᵖ),
        for the comparison of Fig. 8.2d: energy stays bounded, but angular momentum is lost, because a tangent does not
        turn with the bodies.
    order : {"index", "fastest"}
        Order in which ``reflection="sequential"`` takes approaching contacts: by index after the last one, or by the
        largest approach speed ``−∇gᵀv / ‖∇g‖``, in the norm of M⁻¹; among equal speeds, the first by index.

    Raises
    ------
    InputError
        For a name that is not in these lists, or ``order="fastest"`` with an operator that has no order.

    Notes
    -----
    With ``energy="hamiltonian"`` every pass of every operator is ``p⁺ = p + 2 P_I``, where P_I is the impulse of a
    frictionless perfectly plastic collision at the contacts that the operator selects. Passes are repeated until no
    contact approaches. At a single contact this is the collision law of Chatterjee and Ruina (1998),
    ``P = (1 + e_n) P_I + (1 + e_t)(P_II − P_I)``, without friction and with e_n = 1. Their law is for a single
    contact. Applied to several contacts one after the other, always to the fastest approach until none is left, it is
    ``reflection="sequential", order="fastest"``; with P_I taken at all contacts that do not separate, it is
    ``"moreau"``.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.quartic_wall(), deli.GVI(), step_size=0.1, steps=100)
    >>> energy = run["trajectory"].hamiltonian
    >>> bool(abs(energy - energy[0]).max() < 1e-3)
    True
    >>> bool(run["trajectory"].gap_min.min() > 0.0)
    True
    """

    CHOICES: ClassVar[Choices] = {
        "scheme": tuple(SCHEMES),
        "reflection": OPERATORS,
        "energy": ENERGIES,
        "predictor": PREDICTORS,
        "order": ORDERS,
    }

    scheme: str = "midpoint"
    reflection: str = "generalized"
    energy: str = "hamiltonian"
    predictor: str = "forward"
    linearized: bool = False
    order: str = "index"

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.reflection, self.order) not in SELECTIONS:
            raise InputError(
                f"GVI: order {self.order!r} is for reflection 'sequential', which reflects one contact at a time; "
                f"reflection is {self.reflection!r}."
            )

    def recipe(self) -> Recipe:
        """Return the recipe of Algorithm 1 with these settings."""
        scheme = get_scheme(self.scheme)
        return Recipe(
            weights=scheme.weights,
            rows=AFFINE if self.linearized else FROZEN,
            reflects=True,
            operator=self.reflection,
            numerical=scheme if self.energy == "numerical" else None,
            shadow=SHADOWS.get(self.energy, 0),
            closed_loop=self.predictor == "closed_loop",
            order=self.order,
        )
