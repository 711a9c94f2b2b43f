"""Violations, residuals and contacts of a run."""

import numpy as np
import xarray as xr

from deli.metrics.members import by_member
from deli.metrics.trajectory import intervals
from deli.recording.schema import STATS, TRAJECTORY, dataset_of


@by_member
def violation(run: xr.DataTree) -> tuple[float, float]:
    """Return worst and mean violation max(0, -g) of the smallest gap over the rows [L].

    Both are nan without unilateral constraints.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.metrics.violation(run)
    (0.0, 0.0)
    """
    gap = dataset_of(run, TRAJECTORY)["gap_min"].values
    depth = np.where(np.isnan(gap), np.nan, np.maximum(-gap, 0.0))
    return float(depth.max()), float(depth.mean())


@by_member
def complementarity(run: xr.DataTree) -> float:
    """Return the largest scaled complementarity residual, recomputed from the answers; nan if none was measured.

    For the position update it is the residual of the nonlinear system (7.3), (7.4), (7.8).

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> bool(deli.metrics.complementarity(run) < 1e-9)
    True
    """
    if STATS not in run.children:
        return np.nan
    return _largest(dataset_of(run, STATS)["complementarity"].values)


@by_member
def equality_residual(run: xr.DataTree) -> float:
    """Return the largest |f(q)| of the bilateral constraints over the rows [L]; nan without bilateral constraints.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.newtons_cradle(), deli.GVI(), step_size=0.01, steps=20)
    >>> bool(deli.metrics.equality_residual(run) < 1e-9)
    True
    """
    return _largest(dataset_of(run, TRAJECTORY)["equality_residual"].values)


@by_member
def contacts(run: xr.DataTree) -> tuple[float, float]:
    """Return the mean number of smooth contacts over recorded steps, and the number of reflected contacts of all steps.

    The two numbers distinguish sliding and resting contacts from bouncing ones. They are nan and 0 for a run without a
    step. Both count the accepted steps alone, not attempts that a closed loop discards. If rows have been removed since
    the run was recorded, the number of reflected contacts is nan, because the reflections of removed rows are unknown.

    Examples
    --------
    Two masses slide along a circle; a pogo stick bounces.

    >>> import deli
    >>> sliding = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.metrics.contacts(sliding)
    (2.0, 0.0)
    >>> bouncing = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.metrics.contacts(bouncing)
    (0.0, 11.0)
    """
    trajectory = dataset_of(run, TRAJECTORY)
    held, struck = trajectory["smooth_contacts"].values[1:], trajectory["reflected_contacts"].values
    whole = len(struck) == intervals(run) + 1
    return float(held.mean()) if held.size else np.nan, float(struck.sum()) if whole else np.nan


def _largest(values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan
