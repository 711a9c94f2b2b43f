"""What a run did to the energy."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.metrics.contact import contacts
from deli.metrics.members import by_member
from deli.metrics.trajectory import simulated_time
from deli.recording.schema import TRAJECTORY, dataset_of

DRIFT_BLOCKS = 20


class Drift(NamedTuple):
    """A slope over time and its standard error."""

    slope: float
    error: float


@by_member
def energy_drift(run: xr.DataTree) -> Drift:
    """Slope of the energy over time and its standard error [M L2 T-3]; see `drift`."""
    trajectory = dataset_of(run, TRAJECTORY)
    return drift(trajectory["time"].values, trajectory["hamiltonian"].values)


@by_member
def energy_range(run: xr.DataTree) -> tuple[float, float]:
    """Smallest and largest H - H(0) [M L2 T-2]; the width of the energy band is their difference."""
    energy = dataset_of(run, TRAJECTORY)["hamiltonian"].values
    return float((energy - energy[0]).min()), float((energy - energy[0]).max())


@by_member
def drift_per_impact(run: xr.DataTree) -> float:
    """Drift of the energy over the whole run by the number of reflected contacts [M L2 T-2]; nan without any.

    A reflection moves the energy that a symplectic method nearly conserves: by O(h^2) where it conserves H, by O(h^4)
    where it conserves the second-order numerical energy.
    """
    struck = contacts(run)[1]
    return energy_drift(run).slope * simulated_time(run) / struck if struck else np.nan


def drift(time: np.ndarray, energy: np.ndarray) -> Drift:
    """Slope of the energy over time and its standard error.

    The energy of a symplectic method oscillates, so neighbouring rows are far from independent; the line is fitted
    to the means of `DRIFT_BLOCKS` blocks and the error comes from their scatter. An error as large as the slope means
    that no drift is seen.

    Returns
    -------
    Drift
        In units of energy by time; nan where there are fewer than two rows a block.

    Raises
    ------
    InputError
        If there is not one energy for each time.
    """
    if time.shape != energy.shape or time.ndim != 1:
        raise InputError(
            f"drift: found times of shape {time.shape} and energies of shape {energy.shape}; pass one row."
        )
    if len(time) < 2 * DRIFT_BLOCKS:
        return Drift(np.nan, np.nan)
    t = np.array([block.mean() for block in np.array_split(time, DRIFT_BLOCKS)])
    e = np.array([block.mean() for block in np.array_split(energy - energy[0], DRIFT_BLOCKS)])
    centred = t - t.mean()
    spread = centred @ centred
    slope = centred @ e / spread
    residual = e - e.mean() - slope * centred
    return Drift(float(slope), float(np.sqrt(residual @ residual / (DRIFT_BLOCKS - 2) / spread)))
