"""The shadow energy, which smooth steps nearly conserve."""

import tomllib

import xarray as xr

from deli.errors import InputError
from deli.integrators.recipe import Recipe
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import get_scheme
from deli.mechanics.shadow import ORDERS
from deli.metrics.members import by_member
from deli.recording.provenance import scene_of
from deli.recording.scene_record import require_scene_of
from deli.recording.schema import TRAJECTORY, dataset_of


@by_member
def shadow_energy(run: xr.DataTree, order: int = 4, scene: Scene | None = None) -> xr.DataArray:
    """Return the shadow energy of every row [M L2 T-2], which the smooth steps of the scheme nearly conserve.

    Along smooth steps H oscillates by O(h²), the shadow energy only by O(h^(order + 2)). It therefore shows the effect
    of impacts on the energy.

    From (q₀, p₀) the scheme takes order/2 smooth steps of size h forwards and as many backwards, to (q_j, p_j), with
    the bilateral constraints and the resting contacts. A modified Hamiltonian H̃ = p·q̇ − L̃ is constant on the smooth
    curve through these points, and its action over a step is the discrete Lagrangian, so that

        H̃ = 1/(2h) ( ∫ p·q̇ dt − L_d(q₋₁, q₀) − L_d(q₀, q₁) )

    over the two steps about q₀. q and p are replaced by the polynomials through all points, as by Skeel and Hardy
    (2001) and Engle, Skeel and Drees (2005). Only the gradient of V is needed, and no higher derivative. The forces of
    constraints are included, because they appear neither in p·q̇ nor in L_d. The steps ignore all other unilateral
    constraints, so that V must be defined some steps beyond them.

    Parameters
    ----------
    run : xarray.DataTree
        Run of a method with a scheme.
    order : {2, 4, 6, 8, 10, 12}
        Order in h of the expansion of H̃. The effect of a reflection with ``energy="shadow4"`` on the energy appears in
        orders above 4 only.
    scene : Scene, optional
        Scene of the run; required for a user's own scene.

    Returns
    -------
    xarray.DataArray
        Along ``time``, with the run's times.

    Raises
    ------
    InputError
        If the order is not allowed, the method has no scheme, a user's own scene is not passed, or the scene is not the
        run's.
    StepError
        If smooth steps from a row do not converge.

    Examples
    --------
    >>> import numpy as np
    >>> import deli
    >>> run = deli.simulate(deli.scenes.nonlinear_oscillator(), deli.GVI(), step_size=0.1, steps=50)
    >>> shadow, energy = deli.metrics.shadow_energy(run), run["trajectory"]["hamiltonian"]
    >>> f"{np.ptp(shadow.values):.4f} instead of {np.ptp(energy.values):.4f}"
    '0.0067 instead of 0.1110'
    """
    from deli.integrators.stepper import Stepper  # numba takes half a second to import

    if order not in ORDERS or isinstance(order, bool):
        raise InputError(f"order is {order!r}; allowed: {', '.join(map(str, ORDERS))}.")
    config = tomllib.loads(run.attrs["config"])
    if scene is None:
        scene = scene_of(run)
    else:
        require_scene_of(run, scene)
    if scene is None:
        raise InputError("the run's scene is a user's own: pass it as scene=...")
    trajectory = dataset_of(run, TRAJECTORY)
    if "scheme" not in config["method"]:
        raise InputError(
            f"the run's method {config['method']['name']} has no scheme, and therefore no known shadow energy."
        )
    recipe = Recipe(weights=get_scheme(config["method"]["scheme"]).weights, shadow=order)
    stepper = Stepper(scene, config["step_size"], recipe, contact_tolerance=config["contact_tolerance"])
    found = stepper.shadow_energies(trajectory["position"].values, trajectory["momentum"].values)
    about = {"units": "M L2 T-2", "long_name": f"shadow energy of order {order}"}
    return xr.DataArray(found, {"time": trajectory["time"]}, ("time",), "shadow_energy", about)
