"""A reflection without a step around it."""

import numpy as np

from deli.errors import InputError
from deli.integrators.gvi import GVI
from deli.mechanics.scene import Scene
from deli.subproblems.reflection import ENERGIES


def reflect(
    scene: Scene,
    position: np.ndarray,
    momentum: np.ndarray,
    operator: str = "generalized",
    energy: str = "hamiltonian",
    *,
    order: str = "index",
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
    energy : {"hamiltonian", "numerical", "shadow2", "shadow4", "shadow6", "shadow8"}
        The conserved energy, see `deli.GVI`; all but H depend on `scheme` and `step_size`.
    order : {"index", "fastest"}
        The choice of the next contact by ``"sequential"``, see `deli.GVI`.
    scheme, step_size
        Not used with ``energy="hamiltonian"``.
    solvers, skip, contact_tolerance
        As for `deli.simulate`.

    Returns
    -------
    (dof,) array
        p⁺; the inputs are left as they were.

    Raises
    ------
    InputError
        For an unknown name, an `order` that the operator does not take, a state of the wrong length or not finite, or
        an energy other than H without a step size.
    StepError
        If the reflection does not end, or a solver fails.

    Examples
    --------
    The lower mass of a pogo stick hits the floor, and leaves it with the opposite momentum:

    >>> import deli
    >>> from deli.reflect import reflect
    >>> reflect(deli.scenes.pogo_stick(), position=[5.0, 0.0], momentum=[-1.0, -2.0]).round(9)
    array([-1.,  2.])
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
    if energy != "hamiltonian" and step_size is None:
        raise InputError(f"reflect: energy={energy!r} needs a step_size, because that energy depends on it.")
    stepper = GVI(scheme=scheme, reflection=operator, energy=energy, order=order).stepper(
        scene, 1.0 if step_size is None else step_size, solvers, skip, contact_tolerance
    )
    return stepper.reflect(*state)
