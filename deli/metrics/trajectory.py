"""Extent of a run in steps and time, and its distance from another run."""

import tomllib

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.metrics.members import by_member
from deli.recording.schema import STATS, TRAJECTORY, dataset_of


@by_member
def trajectory_error(run: xr.DataTree, reference: xr.DataTree) -> float:
    """Return the largest error of the trajectory over the times that both runs recorded [L].

    The error at one time is the root mean square of q - q_ref over the degrees of freedom.

    Raises
    ------
    InputError
        If the runs have different degrees of freedom, or only their start in common.

    Examples
    --------
    >>> import deli
    >>> coarse = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.02, steps=50)
    >>> fine = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=100)
    >>> round(deli.metrics.trajectory_error(coarse, fine), 4)
    0.0843
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


def common_times(mine: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of the rows of two runs at equal times, to a billionth of the longer run."""
    nearest = np.clip(np.searchsorted(other, mine), 1, max(len(other) - 1, 1))
    nearest -= mine - other[nearest - 1] < np.abs(other[np.minimum(nearest, len(other) - 1)] - mine)
    same = np.abs(other[nearest] - mine) <= 1e-9 * max(mine[-1], other[-1])
    return np.flatnonzero(same), nearest[same]


@by_member
def steps_taken(run: xr.DataTree) -> int:
    """Return the number of integration steps until the last recorded row, also if not every step was recorded.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50, every=10)
    >>> deli.metrics.steps_taken(run), run["trajectory"].sizes["time"]
    (50, 6)
    """
    step_size = tomllib.loads(run.attrs["config"])["step_size"]
    return round(simulated_time(run) / step_size)


def intervals(run: xr.DataTree) -> int:
    """Return the number of intervals between rows as they were recorded, also if rows have been removed since."""
    every = tomllib.loads(run.attrs["config"]).get("record", {}).get("every", 1)
    return -(-steps_taken(run) // every)


def has_all_steps(run: xr.DataTree) -> bool:
    """Tell whether the solver's statistics are of exactly the steps until the last row."""
    return np.array_equal(dataset_of(run, STATS)["step"].values, np.arange(intervals(run)))


def step_times(run: xr.DataTree) -> np.ndarray:
    """Return the time at the end of each ``step`` of the solver's statistics [T], also if rows have been removed."""
    time, step = dataset_of(run, TRAJECTORY)["time"].values, dataset_of(run, STATS)["step"].values
    if len(step) == len(time) - 1 and has_all_steps(run):
        return time[1:]
    config = tomllib.loads(run.attrs["config"])
    return (step + 1.0) * config.get("record", {}).get("every", 1) * config["step_size"]


@by_member
def simulated_time(run: xr.DataTree) -> float:
    """Return the time of the last recorded row [T]."""
    return float(dataset_of(run, TRAJECTORY)["time"].values[-1])
