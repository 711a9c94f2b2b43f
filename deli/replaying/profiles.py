"""Comparison of backends over many problems: performance profiles and shifted geometric means."""

import numpy as np
import xarray as xr

SHIFT = 1e-5
"""Seconds added before logarithms are taken: times far below it count as equal."""


def ratios(data: xr.Dataset) -> np.ndarray:
    """Return the time of each backend over that of the fastest one that solved the problem; inf if it did not.

    The performance ratio of Dolan and Moré (2002), ``r = t / min t``, shape (problem, backend).
    """
    times = np.where(data["verified"].values, data["time"].values, np.inf)
    best = times.min(axis=1, keepdims=True)
    found = np.full(times.shape, np.inf)
    np.divide(times, best, out=found, where=np.isfinite(times))
    return found


def performance_profile(data: xr.Dataset) -> xr.DataArray:
    """Return the share of problems that each backend solves within a factor of the fastest, by that factor.

    Dolan and Moré (2002): ``ρ(τ) = |{problems with r <= τ}| / |problems|``, where r is the performance ratio. ρ(1) is
    the share of problems on which a backend is the fastest, and the limit of ρ the share that it solves at all.

    Parameters
    ----------
    data : xarray.Dataset
        From `deli.replay`.

    Returns
    -------
    xarray.DataArray
        By ``backend`` and ``ratio``: 1 and every ratio at which a share changes.
    """
    found = ratios(data)
    steps = np.unique(np.append(found[np.isfinite(found)], 1.0))
    counts = np.stack([np.searchsorted(np.sort(column), steps, side="right") for column in found.T])
    return xr.DataArray(
        counts / len(found),
        dims=("backend", "ratio"),
        coords={"backend": data["backend"].values, "ratio": steps},
        name="share",
        attrs={"units": "1", "long_name": "share of problems solved within the ratio of the fastest time"},
    )


def shifted_geometric_mean(times: np.ndarray, shift: float = SHIFT) -> np.ndarray:
    """Return ``exp(mean(log(t + shift))) − shift`` over the first axis, which no large or small outlier decides."""
    mean: np.ndarray = np.exp(np.mean(np.log(times + shift), axis=0)) - shift
    return mean


def charged_times(data: xr.Dataset) -> np.ndarray:
    """Return times, with the limit in place of the times of unsolved problems, shape (problem, backend)."""
    return np.where(data["verified"].values, data["time"].values, data.attrs["limit"])
