"""The energy that smooth steps keep."""

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
    """Shadow energy of every row [M L2 T-2]: what the smooth steps of the scheme keep where H oscillates by O(h²).

    Along smooth steps it oscillates by O(h^(order + 2)), so that it shows what impacts do to the energy.

    From (q₀, p₀) the scheme takes order/2 smooth steps of size h forwards and as many back, to (q_j, p_j), with the
    bilateral constraints and the contacts that rest. A modified Hamiltonian H̃ = p·q̇ − L̃ is constant on the smooth
    curve through these points, and its action over a step is the discrete Lagrangian, so that

        H̃ = 1/(2h) ( ∫ p·q̇ dt − L_d(q₋₁, q₀) − L_d(q₀, q₁) )

    over the two steps about q₀. q and p are replaced by the polynomials through all points, as by Skeel and Hardy
    (2001) and Engle, Skeel and Drees (2005). No derivative of V is needed but its gradient, and the forces of
    constraints are part of it: neither p·q̇ nor L_d sees them. All other unilateral constraints are passed through, so
    that V must be defined some steps beyond them.

    Parameters
    ----------
    run : xarray.DataTree
        Of a method that has a scheme.
    order : {2, 4, 6, 8, 10, 12}
        How far the expansion of H̃ in h is reproduced. What a reflection with ``energy="shadow4"`` does to the energy
        shows in orders above 4 only.
    scene : Scene, optional
        That of the run, where it is a user's own.

    Returns
    -------
    xarray.DataArray
        Along ``time``, with the run's times.

    Raises
    ------
    InputError
        For another order, a method without a scheme, a user's own scene that is not handed in, or a scene that is not
        the run's.
    StepError
        Where smooth steps from a row do not converge.
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
        raise InputError("the run's scene is a user's own: hand it in as scene=...")
    trajectory = dataset_of(run, TRAJECTORY)
    if "scheme" not in config["method"]:
        raise InputError(
            f"the run's method {config['method']['name']} has no scheme, and so no shadow energy is known of it."
        )
    recipe = Recipe(weights=get_scheme(config["method"]["scheme"]).weights, shadow=order)
    stepper = Stepper(scene, config["step_size"], recipe, contact_tolerance=config["contact_tolerance"])
    found = stepper.shadow_energies(trajectory["position"].values, trajectory["momentum"].values)
    about = {"units": "M L2 T-2", "long_name": f"shadow energy of order {order}"}
    return xr.DataArray(found, {"time": trajectory["time"]}, ("time",), "shadow_energy", about)
