"""Range and drift of a run's energy."""

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
    """A slope over time and its standard error.

    Examples
    --------
    >>> import deli
    >>> slope, error = deli.metrics.Drift(slope=1e-6, error=2e-7)
    >>> abs(slope) > 4 * error
    True
    """

    slope: float
    error: float


@by_member
def energy_drift(run: xr.DataTree) -> Drift:
    """Return the slope of the energy over time and its standard error [M L2 T-3]; see `drift`.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=500)
    >>> slope, error = deli.metrics.energy_drift(run)
    >>> bool(abs(slope) < 1e-9)
    True
    """
    trajectory = dataset_of(run, TRAJECTORY)
    return drift(trajectory["time"].values, trajectory["hamiltonian"].values)


@by_member
def energy_range(run: xr.DataTree) -> tuple[float, float]:
    """Return the smallest and the largest H - H(0) [M L2 T-2]; their difference is the energy band.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> low, high = deli.metrics.energy_range(run)
    >>> f"{low:.1e} to {high:.1e}"
    '-6.4e-04 to 1.3e-04'
    """
    energy = dataset_of(run, TRAJECTORY)["hamiltonian"].values
    return float((energy - energy[0]).min()), float((energy - energy[0]).max())


@by_member
def drift_per_impact(run: xr.DataTree) -> float:
    """Return the energy drift over the whole run, divided by the number of reflected contacts [M L2 T-2].

    It is nan without reflected contacts. A symplectic method nearly conserves a numerical energy. A reflection that
    conserves H changes this energy by O(h^2), a reflection that conserves the second-order numerical energy by O(h^4).

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=500)
    >>> bool(abs(deli.metrics.drift_per_impact(run)) < 1e-9)
    True
    """
    struck = contacts(run)[1]
    return energy_drift(run).slope * simulated_time(run) / struck if struck else np.nan


def drift(time: np.ndarray, energy: np.ndarray) -> Drift:
    """Return the slope of the energy over time and its standard error.

    The energy of a symplectic method oscillates, so that neighbouring rows are not independent. The line is therefore
    fitted to the means of `DRIFT_BLOCKS` blocks, and the standard error is computed from their scatter. A slope no
    larger than its error is no evidence of a drift.

    Parameters
    ----------
    time, energy : numpy.ndarray
        Shape (rows,).

    Returns
    -------
    Drift
        In units of energy by time; nan with fewer than two rows a block.

    Raises
    ------
    InputError
        If there is not one energy for each time.

    Examples
    --------
    >>> import numpy as np
    >>> import deli
    >>> time = np.linspace(0.0, 10.0, 200)
    >>> slope, error = deli.metrics.drift(time, 0.01 * time + 1e-3 * np.sin(40.0 * time))
    >>> f"{slope:.4f}, error {error:.0e}"
    '0.0100, error 4e-06'
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
