"""How backends compare over many problems: performance profiles and shifted geometric means."""

import numpy as np
import xarray as xr

SHIFT = 1e-5
"""Seconds added before logarithms are taken: times far below it count as equal."""


def ratios(data: xr.Dataset) -> np.ndarray:
    """Time of each backend over that of the fastest one that solved the problem; inf where it did not.

    The performance ratio of Dolan and Moré (2002), ``r = t / min t``, shape (problem, backend).
    """
    times = np.where(data["verified"].values, data["time"].values, np.inf)
    best = times.min(axis=1, keepdims=True)
    found = np.full(times.shape, np.inf)
    np.divide(times, best, out=found, where=np.isfinite(times))
    return found


def performance_profile(data: xr.Dataset) -> xr.DataArray:
    """Share of the problems that each backend solves within a factor of the fastest, by that factor.

    Dolan and Moré (2002): ``ρ(τ) = |{problems with r <= τ}| / |problems|``, where r is the performance ratio. ρ(1) is
    how often a backend is the fastest, its limit how often it solves a problem at all.

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
    """``exp(mean(log(t + shift))) − shift`` over the first axis: neither outlier large nor small decides it."""
    mean: np.ndarray = np.exp(np.mean(np.log(times + shift), axis=0)) - shift
    return mean


def charged_times(data: xr.Dataset) -> np.ndarray:
    """Times, with the limit in place of those of problems that were not solved, shape (problem, backend)."""
    return np.where(data["verified"].values, data["time"].values, data.attrs["limit"])
