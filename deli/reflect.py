"""One reflection, without a step around it."""

from collections.abc import Callable

import numpy as np

from deli.errors import InputError
from deli.integrators.contacts import Contacts
from deli.mechanics.energies import reflection_metric
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import get_scheme
from deli.subproblems.choices import parse_choices
from deli.subproblems.reflection import ENERGIES, Reflection
from deli.subproblems.stats import StepStats


def reflect(
    scene: Scene,
    position: np.ndarray,
    momentum: np.ndarray,
    operator: str = "generalized",
    energy: str = "hamiltonian",
    *,
    scheme: str = "midpoint",
    step_size: float | None = None,
    solvers: object = "auto",
    skip: bool = True,
    contact_tolerance: float = 1e-8,
) -> np.ndarray:
    """Reflect a momentum off all contacts that touch (6.6-6.9).

    Returns ``p⁺ = p + G_𝔸(q)λ + F(q)ν`` with λ ≥ 0, no contact approaching, and E(q, p⁺) = E(q, p), where 𝔸 holds the
    constraints with g(q) = 0.

    Parameters
    ----------
    scene : Scene
    position, momentum : array_like
        State, flat (dof,) or (bodies, dimension). It need not be the scene's initial state.
    operator : {"generalized", "moreau", "sequential"}
    energy : {"hamiltonian", "numerical"}
        What is conserved; the numerical Hamiltonian belongs to a `scheme` and a `step_size`.
    scheme, step_size
        Used with ``energy="numerical"`` only.
    solvers, skip, contact_tolerance
        As for `deli.simulate`.

    Returns
    -------
    (dof,) array
        p⁺; the inputs are left as they were.

    Raises
    ------
    InputError
        For an unknown name, a state of the wrong length or not finite, or a numerical energy without a step size.
    StepError
        If the reflection does not end or a solver fails.
    """
    if energy not in ENERGIES:
        raise InputError(f"reflect: energy {energy!r} is unknown; allowed: {', '.join(ENERGIES)}.")
    state = [np.array(array, dtype=float).ravel() for array in (position, momentum)]
    for name, array in zip(("position", "momentum"), state, strict=True):
        if array.shape != (scene.dof,) or not np.isfinite(array).all():
            raise InputError(
                f"reflect: {name} has {array.size} entries ({int(np.isfinite(array).sum())} finite); "
                f"the scene has {scene.dof} degrees of freedom and needs that many finite numbers."
            )
    metric: Callable[[np.ndarray], np.ndarray] | None = None
    if energy == "numerical":
        if step_size is None:
            raise InputError("reflect: energy='numerical' needs a step_size, since that Hamiltonian depends on it.")
        h, slots = step_size, get_scheme(scheme)

        def metric(at: np.ndarray) -> np.ndarray:
            return reflection_metric(scene, slots, at, h)

    contacts = Contacts(scene, contact_tolerance)
    reflection = Reflection(scene.mass, operator, metric, parse_choices(solvers)["reflection"], StepStats(), skip)
    q, p = state
    gradients = contacts.gradients(q)[contacts.touching(q)]
    if not len(gradients):
        return p
    reflected, _ = reflection.apply(
        q, p, gradients, contacts.bilateral(q), contacts.velocity_zero(gradients, p, np.zeros_like(p))
    )
    return reflected
