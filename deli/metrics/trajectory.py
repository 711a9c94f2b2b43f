"""Where a run got to, and how far from another."""

import tomllib

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.metrics.members import by_member
from deli.recording.schema import STATS, TRAJECTORY, dataset_of


@by_member
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


def common_times(mine: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the rows of two runs that are of one time, to a billionth of the longer run."""
    nearest = np.clip(np.searchsorted(other, mine), 1, max(len(other) - 1, 1))
    nearest -= mine - other[nearest - 1] < np.abs(other[np.minimum(nearest, len(other) - 1)] - mine)
    same = np.abs(other[nearest] - mine) <= 1e-9 * max(mine[-1], other[-1])
    return np.flatnonzero(same), nearest[same]


@by_member
def steps_taken(run: xr.DataTree) -> int:
    """Integration steps until the last recorded row, however many lie between two rows."""
    step_size = tomllib.loads(run.attrs["config"])["step_size"]
    return round(simulated_time(run) / step_size)


def intervals(run: xr.DataTree) -> int:
    """Intervals between rows until the last one as they were recorded, whatever has been left out of them since."""
    every = tomllib.loads(run.attrs["config"]).get("record", {}).get("every", 1)
    return -(-steps_taken(run) // every)


def has_all_steps(run: xr.DataTree) -> bool:
    """Whether the solver's statistics are of all steps until the last row, and of no others."""
    return np.array_equal(dataset_of(run, STATS)["step"].values, np.arange(intervals(run)))


def step_times(run: xr.DataTree) -> np.ndarray:
    """Time at the end of each ``step`` of the solver's statistics [T], also where rows have been left out since."""
    time, step = dataset_of(run, TRAJECTORY)["time"].values, dataset_of(run, STATS)["step"].values
    if len(step) == len(time) - 1 and has_all_steps(run):
        return time[1:]
    config = tomllib.loads(run.attrs["config"])
    return (step + 1.0) * config.get("record", {}).get("every", 1) * config["step_size"]


@by_member
def simulated_time(run: xr.DataTree) -> float:
    """Time of the last recorded row [T]."""
    return float(dataset_of(run, TRAJECTORY)["time"].values[-1])
