"""How well a run kept its constraints, and what touched."""

import numpy as np
import xarray as xr

from deli.metrics.members import by_member
from deli.metrics.trajectory import intervals
from deli.recording.schema import STATS, TRAJECTORY, dataset_of


@by_member
def violation(run: xr.DataTree) -> tuple[float, float]:
    """Worst and mean violation max(0, -g) of the smallest gap over the rows [L]; nan without unilateral constraints."""
    gap = dataset_of(run, TRAJECTORY)["gap_min"].values
    depth = np.where(np.isnan(gap), np.nan, np.maximum(-gap, 0.0))
    return float(depth.max()), float(depth.mean())


@by_member
def complementarity(run: xr.DataTree) -> float:
    """Largest scaled complementarity residual, recomputed from the answers; nan where none was measured.

    That of the position update is the residual of the nonlinear system (7.3), (7.4), (7.8).
    """
    if STATS not in run.children:
        return np.nan
    return _largest(dataset_of(run, STATS)["complementarity"].values)


@by_member
def equality_residual(run: xr.DataTree) -> float:
    """Largest |f(q)| of the bilateral constraints over the rows [L]; nan without any."""
    return _largest(dataset_of(run, TRAJECTORY)["equality_residual"].values)


@by_member
def contacts(run: xr.DataTree) -> tuple[float, float]:
    """Mean number of smooth contacts over the recorded steps, and the number of reflected contacts of all steps.

    They tell a contact that lasts from one that bounces; nan and 0 for a run without a step. Both are of the steps as
    they were taken: attempts that a closed loop discards count nothing. Where rows have been left out since the run was
    recorded, their reflections are, too, and the number is nan.
    """
    trajectory = dataset_of(run, TRAJECTORY)
    held, struck = trajectory["smooth_contacts"].values[1:], trajectory["reflected_contacts"].values
    whole = len(struck) == intervals(run) + 1
    return float(held.mean()) if held.size else np.nan, float(struck.sum()) if whole else np.nan


def _largest(values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(known.max()) if known.size else np.nan
