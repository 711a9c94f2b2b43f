"""Files of ensembles: written as a whole and sealed, read with a check of their structure."""

from pathlib import Path

import numpy as np
import xarray as xr

from deli.recording.contents import DAMAGE, LIBRARY, Contents
from deli.recording.schema import MEMBER, STATS, TRAJECTORY, Schema, Variable, coordinates, remembered
from deli.recording.seal import seal
from deli.recording.structure import config_of, refuse, require_attributes
from deli.recording.whole import replacing

ENSEMBLE = "ensemble"
"""The name of an ensemble's scene in the config."""
STEPS_TAKEN, OUTCOME = "steps_taken", "outcome"


def write(path: Path, run: xr.DataTree) -> None:
    """Write an ensemble as a whole, see `replacing`."""
    with replacing(path) as fresh:
        with LIBRARY:
            run.to_netcdf(fresh, engine="netcdf4")
        seal(fresh)


def store_as_letters(run: xr.DataTree) -> xr.DataTree:
    """Set the encoding of words to letters, as in files of runs, for every later writing; return the run."""
    for node in run.subtree:
        for variable in node.variables.values():
            variable.encoding = {"dtype": "S1"} if variable.dtype.kind == "U" else {}
    return run


def tree_of(contents: Contents, path: Path) -> xr.DataTree:
    """Return the ensemble that a file holds.

    Raises
    ------
    InputError
        If the file holds none; the message names the contents found and those expected.
    """
    require_attributes(contents.attributes, path)
    if config_of(contents.attributes, path)["scene"]["name"] != ENSEMBLE:
        refuse(path, f"it has members, but in its attribute config scene.name is not {ENSEMBLE!r}")
    try:
        datasets = {group: _decoded(contents, group) for group in ("/", TRAJECTORY, STATS) if group in contents.groups}
        datasets["/"].attrs = dict(contents.attributes)
        labels = [str(name) for name, values in datasets["/"].variables.items() if values.dims == (MEMBER,)]
        coords = {"/": [name for name in labels if name not in (STEPS_TAKEN, OUTCOME)]}
        for group in datasets.keys() - {"/"}:
            coords[group] = [name for name in (*labels, *coordinates(group)) if name in datasets[group]]
        run = xr.DataTree.from_dict({name: dataset.set_coords(coords[name]) for name, dataset in datasets.items()})
        store_as_letters(run)
    except DAMAGE as error:
        refuse(path, f"it cannot be decoded ({type(error).__name__}: {error})")
    _require_structure(run, path)
    return run


def _decoded(contents: Contents, group: str) -> xr.Dataset:
    stored = {name: xr.Variable(one.dims, one.values, one.attributes) for name, one in contents.groups[group].items()}
    found = xr.decode_cf(xr.Dataset(stored)).load()
    for name, variable in found.variables.items():
        if variable.dtype.kind == "O":
            found[name] = variable.astype(str)
        elif variable.dtype.kind == "S":  # by a program that does not state the encoding of letters
            found[name] = variable.dims, np.char.decode(variable.values, "utf-8"), variable.attrs
    return found


def _require_structure(run: xr.DataTree, path: Path) -> None:
    members, trajectory = run.sizes[MEMBER], run.children[TRAJECTORY].to_dataset()
    for name, kind in ((MEMBER, None), (STEPS_TAKEN, "i"), (OUTCOME, "U")):
        column = run.variables.get(name)
        if column is None or column.dims != (MEMBER,) or (kind is not None and column.dtype.kind != kind):
            refuse(path, f"{name} is missing, or is not one value of its type for each of the {members} members")
    sizes = {name: trajectory.sizes.get(name, 0) for name in ("time", "dof", "axis")}
    if not 1 <= sizes["axis"] <= 3 or not sizes["dof"] or sizes["dof"] % sizes["axis"] or not sizes["time"]:
        refuse(path, f"it has {sizes['time']} rows of {sizes['dof']} degrees of freedom in {sizes['axis']} dimensions")
    schema = Schema(sizes["dof"], sizes["axis"], remembered(str(name) for name in trajectory.variables))
    sizes |= schema.sizes | {MEMBER: members, "step": sizes["time"] - 1}
    for group in run.children:
        found = run.children[group].to_dataset()
        for variable in schema.groups[group]:
            _require_variable(found, group, variable, sizes, path)
        for name, expected in schema.constants()[group].items():
            if not np.array_equal(found[name].values, expected):
                refuse(path, f"{group}/{name} is not {expected.tolist()!r:.80}")
    time = trajectory["time"].values
    if not np.isfinite(time).all() or (np.diff(time) <= 0.0).any():
        refuse(path, f"{TRAJECTORY}/time is not finite, or does not rise")


def _require_variable(found: xr.Dataset, group: str, variable: Variable, sizes: dict[str, int], path: Path) -> None:
    name = f"{group}/{variable.name}"
    if variable.name not in found.variables:
        refuse(path, f"{name} is missing, or of a type that deli does not write")
    values, dims = found.variables[variable.name], member_dims(variable, group)
    if values.dims != dims:
        refuse(
            path, f"{name} has the dimensions {', '.join(map(str, values.dims)) or '-'}, not {', '.join(dims) or '-'}"
        )
    kinds = "U" if variable.dtype == "str" else np.dtype(variable.dtype).kind
    if values.dtype.kind != kinds:
        refuse(path, f"{name} is of the type {values.dtype}, not {variable.dtype}")
    if values.shape != tuple(sizes[dim] for dim in dims):
        refuse(path, f"{name} has the shape {values.shape}, not {tuple(sizes[dim] for dim in dims)}")


def member_dims(variable: Variable, group: str) -> tuple[str, ...]:
    """Return the dimensions of a variable in an ensemble: members share coordinates and variables that do not grow."""
    shared = not variable.grows or variable.name in coordinates(group)
    return variable.dims if shared else (MEMBER, *variable.dims)
