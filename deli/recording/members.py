"""Members of an ensemble, each a run like any other."""

from typing import TYPE_CHECKING

import numpy as np

from deli.errors import InputError
from deli.recording.schema import MEMBER, TRAJECTORY, reached

if TYPE_CHECKING:
    import xarray as xr

FEW = 8
"""Largest number of members that figures show one by one."""


def is_ensemble(run: "xr.DataTree") -> bool:
    """Return whether a run has members."""
    return MEMBER in run.children[TRAJECTORY].dims


def count_members(run: "xr.DataTree") -> int:
    """Return the number of members of an ensemble."""
    return int(run.children[TRAJECTORY].sizes[MEMBER])


def member_of(run: "xr.DataTree", member: int) -> "xr.DataTree":
    """Return one member as a run, by its place.

    Raises
    ------
    InputError
        If the run is no ensemble, or has no such member.
    """
    if not is_ensemble(run):
        raise InputError(f"member is {member}, but the run is not an ensemble; leave it out.")
    members = count_members(run)
    if not -members <= member < members:
        raise InputError(f"member is {member}; the ensemble has members 0 to {members - 1}.")
    return run.isel({MEMBER: member})


def rows_of(run: "xr.DataTree", member: int) -> int:
    """Return the number of rows that a member of an ensemble has reached."""
    return reached(run.children[TRAJECTORY].variables["position"].values[member])


def name_of(run: "xr.DataTree", member: int | None = None) -> str:
    """Return the labels of a member, or its number if it has none.

    Parameters
    ----------
    run : xarray.DataTree
        An ensemble, or a member of one.
    member : int, optional
        Its place in the ensemble.
    """
    coords = run.coords if member is None else run.isel({MEMBER: member}).coords
    labels = {str(name): values.values[()] for name, values in coords.items() if str(name) != MEMBER}
    said = {name: f"{value:.6g}" if isinstance(value, np.floating) else str(value) for name, value in labels.items()}
    return ", ".join(f"{name} {value}" for name, value in said.items()) or f"{MEMBER} {coords[MEMBER].values[()]}"
