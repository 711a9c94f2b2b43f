"""What a run is judged by: how well it kept energy, momenta and constraints, and what its solvers cost.

Each function takes a run from `deli.simulate` or `deli.open_run`, and works from its recorded rows alone, so that a run
that stopped early is measured until where it got. `measure` collects them all. Units are in the scene's own
length L, mass M and time T, as in the dataset; times of solvers are in seconds.
"""

import tomllib
from typing import NamedTuple

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.integrators.recipe import Recipe
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import get_scheme
from deli.mechanics.shadow import ORDERS
from deli.recording.provenance import scene_of
from deli.recording.schema import STATS, TRAJECTORY, dataset_of

DRIFT_BLOCKS = 20


class Drift(NamedTuple):
    """A slope over time and its standard error."""

    slope: float
    error: float


def energy_drift(run: xr.DataTree) -> Drift:
    """Slope of the energy over time and its standard error [M L2 T-3]; see `drift`."""
    trajectory = dataset_of(run, TRAJECTORY)
    return drift(trajectory["time"].values, trajectory["hamiltonian"].values)


def energy_range(run: xr.DataTree) -> tuple[float, float]:
    """Smallest and largest H - H(0) [M L2 T-2]; the width of the energy band is their difference."""
    energy = dataset_of(run, TRAJECTORY)["hamiltonian"].values
    return float((energy - energy[0]).min()), float((energy - energy[0]).max())


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
        For another order, a method without a scheme, or a user's own scene that is not handed in.
    StepError
        Where smooth steps from a row do not converge.
    """
    from deli.integrators.stepper import Stepper  # numba takes half a second to import

    if order not in ORDERS or isinstance(order, bool):
        raise InputError(f"order is {order!r}; allowed: {', '.join(map(str, ORDERS))}.")
    config = tomllib.loads(run.attrs["config"])
    scene = scene_of(run) if scene is None else scene
    if scene is None:
        raise InputError("the run's scene is a user's own: hand it in as scene=...")
    trajectory = dataset_of(run, TRAJECTORY)
    if scene.dof != trajectory.sizes["dof"]:
        raise InputError(
            f"scene has {scene.dof} degrees of freedom and the run has {trajectory.sizes['dof']}; hand in its own."
        )
    if "scheme" not in config["method"]:
        raise InputError(
            f"the run's method {config['method']['name']} has no scheme, and so no shadow energy is known of it."
        )
    recipe = Recipe(weights=get_scheme(config["method"]["scheme"]).weights, shadow=order)
    stepper = Stepper(scene, config["step_size"], recipe, contact_tolerance=config["contact_tolerance"])
    found = stepper.shadow_energies(trajectory["position"].values, trajectory["momentum"].values)
    about = {"units": "M L2 T-2", "long_name": f"shadow energy of order {order}"}
    return xr.DataArray(found, {"time": trajectory["time"]}, ("time",), "shadow_energy", about)


def momentum_error(run: xr.DataTree) -> float:
    """Largest |p - p(0)| of a component of the linear momentum that the scene conserves [M L T-1]; nan without any."""
    return _worst_momentum(run, "p")


def angular_momentum_error(run: xr.DataTree) -> float:
    """Largest |L - L(0)| of a component that the scene conserves [M L2 T-1]; nan without any."""
    return _worst_momentum(run, "L")


def violation(run: xr.DataTree) -> tuple[float, float]:
    """Worst and mean violation max(0, -g) of the smallest gap over the rows [L]; nan without unilateral constraints."""
    gap = dataset_of(run, TRAJECTORY)["gap_min"].values
    depth = np.where(np.isnan(gap), np.nan, np.maximum(-gap, 0.0))
    return float(depth.max()), float(depth.mean())


def complementarity(run: xr.DataTree) -> float:
    """Largest scaled complementarity residual, recomputed from the answers; nan where none was measured.

    That of the position update is the residual of the nonlinear system (7.3), (7.4), (7.8).
    """
    return _largest(dataset_of(run, STATS)["complementarity"].values)


def equality_residual(run: xr.DataTree) -> float:
    """Largest |f(q)| of the bilateral constraints over the rows [L]; nan without any."""
    return _largest(dataset_of(run, TRAJECTORY)["equality_residual"].values)


def contacts(run: xr.DataTree) -> tuple[float, float]:
    """Mean number of smooth contacts over the recorded steps, and the number of reflected contacts of all steps.

    They tell a contact that lasts from one that bounces; nan and 0 for a run without a step.
    """
    trajectory = dataset_of(run, TRAJECTORY)
    held = trajectory["smooth_contacts"].values[1:]
    return float(held.mean()) if held.size else np.nan, float(trajectory["reflected_contacts"].values.sum())


def drift_per_impact(run: xr.DataTree) -> float:
    """Drift of the energy over the whole run by the number of reflected contacts [M L2 T-2]; nan without any.

    A reflection moves the energy that a symplectic method nearly conserves: by O(h^2) where it conserves H, by O(h^4)
    where it conserves the second-order numerical energy.
    """
    struck = contacts(run)[1]
    return energy_drift(run).slope * _simulated_time(run) / struck if struck else np.nan


def trajectory_error(run: xr.DataTree, reference: xr.DataTree) -> float:
    """Largest root mean square over the degrees of freedom of q - q_ref, over the times that both recorded [L].

    Raises
    ------
    InputError
        If the two have other degrees of freedom, or no time in common but the start.
    """
    mine, other = dataset_of(run, TRAJECTORY), dataset_of(reference, TRAJECTORY)
    if mine.sizes["dof"] != other.sizes["dof"]:
        raise InputError(
            f"the reference has {other.sizes['dof']} degrees of freedom and the run has {mine.sizes['dof']}; "
            "compare runs of one scene."
        )
    here, there = common_times(mine["time"].values, other["time"].values)
    if len(here) < 2 <= mine.sizes["time"]:
        raise InputError(
            "the run and its reference recorded no time in common but the start; choose step_size and record.every so "
            "that the rows of one are among those of the other."
        )
    away = mine["position"].values[here] - other["position"].values[there]
    return float(np.sqrt(np.mean(away**2, axis=1)).max())


def measure(run: xr.DataTree, reference: xr.DataTree | None = None) -> xr.Dataset:
    """Every metric of a run, as a dataset of scalars with units and long names.

    Parameters
    ----------
    run : xarray.DataTree
    reference : xarray.DataTree, optional
        What to compare the trajectory with; without it ``trajectory_error`` is nan.

    Returns
    -------
    xarray.Dataset
        ``energy_drift`` with ``energy_drift_error``; ``drift_per_impact``; ``energy_low``, ``energy_high`` and their
        difference ``energy_band``; ``momentum_error``, ``angular_momentum_error``; ``violation_worst``,
        ``violation_mean``; ``complementarity``, ``equality_residual``, ``trajectory_error``; ``smooth_contacts`` and
        ``reflected_contacts`` as `contacts` gives them; summed over subproblems ``solves``, ``skipped``,
        ``iterations``, ``fallbacks``, ``claimed_solves`` (the solver says so), ``verified_solves`` (recomputed
        residuals say so), ``solver_time``, ``overhead_time``; ``wall_time``; ``steps``, ``simulated_time``.
    """
    slope, low, worst = energy_drift(run), energy_range(run), violation(run)
    held, struck = contacts(run)
    stats = dataset_of(run, STATS)
    values: dict[str, float] = {
        "energy_drift": slope.slope,
        "energy_drift_error": slope.error,
        "drift_per_impact": drift_per_impact(run),
        "energy_low": low[0],
        "energy_high": low[1],
        "energy_band": low[1] - low[0],
        "momentum_error": momentum_error(run),
        "angular_momentum_error": angular_momentum_error(run),
        "violation_worst": worst[0],
        "violation_mean": worst[1],
        "complementarity": complementarity(run),
        "equality_residual": equality_residual(run),
        "trajectory_error": np.nan if reference is None else trajectory_error(run, reference),
        "smooth_contacts": held,
        "reflected_contacts": struck,
        **{name: float(stats[recorded].values.sum()) for name, recorded in _SUMS.items()},
        "wall_time": float(run.attrs.get("wall_time", np.nan)),
        "steps": float(steps_taken(run)),
        "simulated_time": _simulated_time(run),
    }
    return xr.Dataset(
        {
            name: xr.Variable((), value, {"units": METRICS[name][0], "long_name": METRICS[name][1]})
            for name, value in values.items()
        }
    )


def drift(time: np.ndarray, energy: np.ndarray) -> Drift:
    """Slope of the energy over time and its standard error.

    The energy of a symplectic method oscillates, so neighbouring rows are far from independent; the line is fitted
    to the means of `DRIFT_BLOCKS` blocks and the error comes from their scatter. An error as large as the slope means
    that no drift is seen.

    Returns
    -------
    Drift
        In units of energy by time; nan where there are fewer than two rows a block.
    """
    if len(time) < 2 * DRIFT_BLOCKS:
        return Drift(np.nan, np.nan)
    t = np.array([block.mean() for block in np.array_split(time, DRIFT_BLOCKS)])
    e = np.array([block.mean() for block in np.array_split(energy - energy[0], DRIFT_BLOCKS)])
    centred = t - t.mean()
    spread = centred @ centred
    slope = centred @ e / spread
    residual = e - e.mean() - slope * centred
    return Drift(float(slope), float(np.sqrt(residual @ residual / (DRIFT_BLOCKS - 2) / spread)))


def momentum_errors(run: xr.DataTree) -> dict[str, float]:
    """Largest deviation from the initial value of each momentum component that the scene conserves."""
    return {
        name: float(np.abs(values - values[0]).max())
        for name, values in momentum_components(run, conserved=True).items()
    }


def momentum_components(run: xr.DataTree, conserved: bool) -> dict[str, np.ndarray]:
    """Components of linear and angular momentum over time, by name such as ``p_x`` and ``L_z``.

    Parameters
    ----------
    run : xarray.DataTree
    conserved : bool
        Whether to return those that the scene conserves, or those that it does not.
    """
    trajectory = dataset_of(run, TRAJECTORY)
    found: dict[str, np.ndarray] = {}
    for kind, symbol in (("linear", "p"), ("angular", "L")):
        if f"{kind}_momentum" not in trajectory:
            continue
        values = trajectory[f"{kind}_momentum"]
        axes = [str(axis) for axis in values["axis"].values] if values.ndim == 2 else ["z"]
        kept = run.attrs[f"conserved_{kind}_momentum"].split()
        columns = values.values.reshape(len(values), len(axes))
        for index, axis in enumerate(axes):
            if (axis in kept) == conserved:
                found[f"{symbol}_{axis}"] = columns[:, index]
    return found


def common_times(mine: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the rows of two runs that are of one time, to a billionth of the longer run."""
    nearest = np.clip(np.searchsorted(other, mine), 1, max(len(other) - 1, 1))
    nearest -= mine - other[nearest - 1] < np.abs(other[np.minimum(nearest, len(other) - 1)] - mine)
    same = np.abs(other[nearest] - mine) <= 1e-9 * max(mine[-1], other[-1])
    return np.flatnonzero(same), nearest[same]


def steps_taken(run: xr.DataTree) -> int:
    """Integration steps until the last recorded row, however many lie between two rows."""
    step_size = tomllib.loads(run.attrs["config"])["step_size"]
    return round(_simulated_time(run) / step_size)


def _simulated_time(run: xr.DataTree) -> float:
    return float(dataset_of(run, TRAJECTORY)["time"].values[-1])


def _worst_momentum(run: xr.DataTree, symbol: str) -> float:
    errors = [error for name, error in momentum_errors(run).items() if name.startswith(symbol)]
    return max(errors, default=np.nan)


def _largest(values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan


_SUMS = {
    "solves": "solves",
    "skipped": "skipped",
    "iterations": "iterations",
    "fallbacks": "fallbacks",
    "claimed_solves": "claimed",
    "verified_solves": "verified",
    "solver_time": "solve_time",
    "overhead_time": "overhead_time",
}
METRICS = {
    "energy_drift": ("M L2 T-3", "slope of the energy over time"),
    "energy_drift_error": ("M L2 T-3", "standard error of the slope of the energy"),
    "drift_per_impact": ("M L2 T-2", "drift of the energy by reflected contact"),
    "energy_low": ("M L2 T-2", "smallest H - H(0)"),
    "energy_high": ("M L2 T-2", "largest H - H(0)"),
    "energy_band": ("M L2 T-2", "largest minus smallest energy"),
    "momentum_error": ("M L T-1", "largest error of a conserved component of linear momentum"),
    "angular_momentum_error": ("M L2 T-1", "largest error of a conserved component of angular momentum"),
    "violation_worst": ("L", "worst violation of a unilateral constraint"),
    "violation_mean": ("L", "mean over rows of the worst violation"),
    "complementarity": ("1", "largest scaled complementarity residual"),
    "equality_residual": ("L", "largest residual of a bilateral constraint"),
    "trajectory_error": ("L", "largest root mean square distance from the reference"),
    "smooth_contacts": ("1", "mean number of smooth contacts"),
    "reflected_contacts": ("1", "contacts reflected, summed over steps"),
    "solves": ("1", "calls of a solver"),
    "skipped": ("1", "subproblems answered without a solver"),
    "iterations": ("1", "iterations of the solvers"),
    "fallbacks": ("1", "members of solver chains that failed before one succeeded"),
    "claimed_solves": ("1", "calls that the solver says were solved"),
    "verified_solves": ("1", "calls whose recomputed residuals are within the tolerance"),
    "solver_time": ("s", "time inside solvers"),
    "overhead_time": ("s", "time to hand problems to solvers and check their answers"),
    "wall_time": ("s", "wall time of the run"),
    "steps": ("1", "integration steps"),
    "simulated_time": ("T", "time that the run got to"),
}
"""Units and long name of each metric that `measure` returns."""
