"""Checks of an ensemble's file, which holds only the common part of its members' scenes."""

import tomllib
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from deli.recording.finding import AGREEMENT, Finding
from deli.recording.members import count_members, rows_of
from deli.recording.schema import MEMBER, STATS, TRAJECTORY, dataset_of

MAY_BE_NAN = ("gap_min", "equality_residual")


def verify_ensemble(run: xr.DataTree, sealed: bool) -> list[Finding]:
    """Check an ensemble whose structure holds, and return the findings."""
    config = tomllib.loads(run.attrs["config"])
    rows = np.array([rows_of(run, member) for member in range(count_members(run))])
    content = "the digest is that of the closed file" if sealed else "not sealed: another program wrote the file"
    stats = "" if STATS in run.children else "; solver_stats were left out"
    return [
        Finding("outcome", None, run.attrs["outcome"]),
        Finding("content", True if sealed else None, content),
        Finding("schema", True, f"all variables of {len(rows)} members{stats}"),
        _rows(run, config, rows),
        _finite(run, rows),
        _times(run, config),
        *_sums(run),
    ]


def _rows(run: xr.DataTree, config: dict[str, Any], rows: np.ndarray) -> Finding:
    """Check that members have the rows that belong to the steps they took."""
    steps, every = config["steps"], config.get("record", {}).get("every", 1)
    taken = run.variables["steps_taken"].values
    due = taken // every + 1 + ((taken == steps) & (taken % every > 0))
    wrong = np.flatnonzero((rows != due) & ((rows > 0) | (taken > 0)))
    if len(wrong):
        first = wrong[0]
        name = run.coords[MEMBER].values[first]
        return Finding("rows", False, f"member {name} took {taken[first]} steps and has {rows[first]} rows")
    return Finding("rows", True, f"{rows.min()} to {rows.max()} a member, as many as belong to its steps")


def _finite(run: xr.DataTree, rows: np.ndarray) -> Finding:
    trajectory, wrong = dataset_of(run, TRAJECTORY), []
    got = np.arange(trajectory.sizes["time"]) < rows[:, np.newaxis]
    for name, values in trajectory.data_vars.items():
        if values.dtype.kind == "f":
            bad = np.isinf(values.values) if name in MAY_BE_NAN else ~np.isfinite(values.values)
            bad &= got.reshape(got.shape + (1,) * (bad.ndim - 2))
            wrong += [f"{name} has {int(bad.sum())}"] if bad.any() else []
    return Finding("finite values", not wrong, "; ".join(wrong) or "no nan or infinity in rows that members reached")


def _times(run: xr.DataTree, config: dict[str, float]) -> Finding:
    time = dataset_of(run, TRAJECTORY)["time"].values
    steps = time / config["step_size"]
    uneven = np.abs(steps - np.round(steps)) > 1e-6
    return Finding("times", not uneven.any(), f"0 to {time[-1]:.9g}, multiples of {config['step_size']}")


def _sums(run: xr.DataTree) -> Iterator[Finding]:
    """Check the quantities that follow without a scene: momenta from the states, and the energy from its parts."""
    trajectory = dataset_of(run, TRAJECTORY)
    position, momentum = trajectory["position"].values, trajectory["momentum"].values
    shape = (*position.shape[:2], -1, trajectory.sizes["axis"])
    q, p = position.reshape(shape), momentum.reshape(shape)
    again = {
        "hamiltonian": trajectory["kinetic_energy"].values + trajectory["potential_energy"].values,
        "linear_momentum": p.sum(axis=2),
    }
    if trajectory.sizes["axis"] == 2:
        again["angular_momentum"] = (q[..., 0] * p[..., 1] - q[..., 1] * p[..., 0]).sum(axis=2)
    elif trajectory.sizes["axis"] == 3:
        again["angular_momentum"] = np.cross(q, p).sum(axis=2)
    for name, values in again.items():
        apart = np.abs(trajectory[name].values - values)
        worst = float(np.nanmax(apart, initial=0.0))
        scale = max(float(np.nanmax(np.abs(values), initial=0.0)), 1.0)
        source = "its parts" if name == "hamiltonian" else "the states"
        yield Finding(name, worst <= AGREEMENT * scale, f"recomputed from {source}, differs by {worst:.1e}")
    yield Finding("other diagnostics", None, "not recomputed: the members' scenes are not in the file")
