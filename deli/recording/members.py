"""Members of an ensemble, each a run like any other."""

from typing import TYPE_CHECKING

import numpy as np

from deli.errors import InputError
from deli.recording.schema import MEMBER, TRAJECTORY, reached

if TYPE_CHECKING:
    import xarray as xr

FEW = 8
"""Members up to which figures show each."""


def is_ensemble(run: "xr.DataTree") -> bool:
    """Whether a run has members, rather than being one."""
    return MEMBER in run.children[TRAJECTORY].dims


def count_members(run: "xr.DataTree") -> int:
    """Return how many members an ensemble has."""
    return int(run.children[TRAJECTORY].sizes[MEMBER])


def member_of(run: "xr.DataTree", member: int) -> "xr.DataTree":
    """Return one member as a run, by its place.

    Raises
    ------
    InputError
        If the run is no ensemble, or has no such member.
    """
    if not is_ensemble(run):
        raise InputError(f"member is {member}, and the run is no ensemble; leave it out.")
    members = count_members(run)
    if not -members <= member < members:
        raise InputError(f"member is {member}; the ensemble has members 0 to {members - 1}.")
    return run.isel({MEMBER: member})


def rows_of(run: "xr.DataTree", member: int) -> int:
    """Return how many rows a member of an ensemble has got to."""
    return reached(run.children[TRAJECTORY].variables["position"].values[member])


def name_of(run: "xr.DataTree", member: int | None = None) -> str:
    """Return what tells a member from others: its labels, or its number.

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
