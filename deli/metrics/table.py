"""All metrics of a run, with units."""

import numpy as np
import xarray as xr

from deli.metrics.contact import complementarity, contacts, equality_residual, violation
from deli.metrics.energy import drift_per_impact, energy_drift, energy_range
from deli.metrics.members import by_member
from deli.metrics.momentum import angular_momentum_error, momentum_error
from deli.metrics.trajectory import has_all_steps, simulated_time, steps_taken, trajectory_error
from deli.metrics.uncalled import uncalled_note, uncalled_solvers
from deli.recording.schema import MEMBER, STATS, dataset_of


@by_member
def measure(run: xr.DataTree, reference: xr.DataTree | None = None) -> xr.Dataset:
    """Return all metrics of a run as scalars with units and long names; of an ensemble, as arrays along ``member``.

    Parameters
    ----------
    run : xarray.DataTree
    reference : xarray.DataTree, optional
        Run with the reference trajectory; without it, ``trajectory_error`` is nan.

    Returns
    -------
    xarray.Dataset
        ``energy_drift`` with ``energy_drift_error``; ``drift_per_impact``; ``energy_low``, ``energy_high`` and their
        difference ``energy_band``; ``momentum_error``, ``angular_momentum_error``; ``violation_worst``,
        ``violation_mean``; ``complementarity``, ``equality_residual``, ``trajectory_error``; ``smooth_contacts`` and
        ``reflected_contacts`` from `contacts`; the sums over subproblems of ``solves``, ``skipped``, ``iterations``,
        ``fallbacks``, ``claimed_solves`` (solved according to the solver), ``verified_solves`` (recomputed residuals
        within the tolerance), ``solver_time``, ``overhead_time``; ``uncalled_solvers``; ``wall_time``; ``steps``,
        ``simulated_time``. The attribute ``note`` is the text of `uncalled_note`, unless it is empty. Sums are nan if
        ``solver_stats`` were not recorded, or if rows or steps have been removed since. The wall time of a member of an
        ensemble is nan.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> found = deli.metrics.measure(run)
    >>> round(found["energy_band"].item(), 6), found["energy_band"].units
    (0.000778, 'M L2 T-2')
    """
    slope, low, worst = energy_drift(run), energy_range(run), violation(run)
    held, struck = contacts(run)
    stats = dataset_of(run, STATS) if STATS in run.children and has_all_steps(run) else None
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
        **{name: np.nan if stats is None else float(stats[part].values.sum()) for name, part in _SUMS.items()},
        "uncalled_solvers": float(len(uncalled_solvers(run))),
        "wall_time": np.nan if MEMBER in run.coords else float(run.attrs.get("wall_time", np.nan)),
        "steps": float(steps_taken(run)),
        "simulated_time": simulated_time(run),
    }
    return xr.Dataset(
        {
            name: xr.Variable((), value, {"units": METRICS[name][0], "long_name": METRICS[name][1]})
            for name, value in values.items()
        },
        attrs={"note": note} if (note := uncalled_note(run)) else {},
    )


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
    "drift_per_impact": ("M L2 T-2", "energy drift per reflected contact"),
    "energy_low": ("M L2 T-2", "smallest H - H(0)"),
    "energy_high": ("M L2 T-2", "largest H - H(0)"),
    "energy_band": ("M L2 T-2", "energy band, largest minus smallest H"),
    "momentum_error": ("M L T-1", "largest error of a conserved component of linear momentum"),
    "angular_momentum_error": ("M L2 T-1", "largest error of a conserved component of angular momentum"),
    "violation_worst": ("L", "worst violation of a unilateral constraint"),
    "violation_mean": ("L", "mean over rows of the worst violation"),
    "complementarity": ("1", "largest scaled complementarity residual"),
    "equality_residual": ("L", "largest residual of a bilateral constraint"),
    "trajectory_error": ("L", "largest root mean square distance from the reference"),
    "smooth_contacts": ("1", "mean number of smooth contacts"),
    "reflected_contacts": ("1", "number of contacts reflected by the accepted steps"),
    "solves": ("1", "calls of a solver, in all attempts at the steps"),
    "skipped": ("1", "subproblems answered without a solver"),
    "iterations": ("1", "iterations of the solvers"),
    "fallbacks": ("1", "members of solver chains that failed before one succeeded"),
    "claimed_solves": ("1", "calls with success claimed by the solver"),
    "verified_solves": ("1", "calls with recomputed residuals within the tolerance"),
    "solver_time": ("s", "time inside solvers"),
    "overhead_time": ("s", "time to pass problems to solvers and check their answers"),
    "uncalled_solvers": ("1", "number of chosen solvers that were never called"),
    "wall_time": ("s", "wall time of the run"),
    "steps": ("1", "integration steps"),
    "simulated_time": ("T", "time of the last recorded row"),
}
"""Units and long name of each metric that `measure` returns."""
