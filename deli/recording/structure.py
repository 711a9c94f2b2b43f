"""Checks that a file holds a run: names, shapes, types and ranges, before its numbers are used."""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from deli.errors import InputError
from deli.recording.contents import COMMITTED, COMMITTED_PROBLEMS, Contents, Stored
from deli.recording.damage import Damaged, refuse
from deli.recording.decoding import PACKED, decoded, described, words_of
from deli.recording.schema import (
    AXES,
    CONVENTIONS,
    POSED,
    STATS,
    TRAJECTORY,
    UNDECIDED,
    Groups,
    Schema,
    Variable,
    VariableData,
    remembered,
)
from deli.recording.subproblems import COUNTED, LEFT_OUT, find_fault, places
from deli.subproblems.stats import STATUS_MEANINGS

TEXTS = ("title", "config", "deli_version", "backend_versions", "machine", "outcome", "start")
LATER_TEXTS = ("citation",)
"""Attributes that files of earlier versions do not have."""
MOMENTA = ("conserved_linear_momentum", "conserved_angular_momentum")


def run_of(contents: Contents, path: Path) -> Groups:
    """Return the run that a file holds.

    Another program may have written a finished run again: with rows left out, with variables added to deli's groups,
    with words of variable length, with its own marks of missing values. The file still holds a run if each of deli's
    variables is there, in its type.

    Returns
    -------
    groups : dict
        The variables, as (dims, values, attributes), by group and name.

    Raises
    ------
    InputError
        If the file holds none; the message names the contents found and those expected.
    """
    missing = [name for name in (TRAJECTORY, STATS) if name not in contents.groups]
    if COMMITTED not in contents.root and path.suffix == ".partial":
        missing.append(COMMITTED)
    if missing:
        raise InputError(
            f"{path} is a netCDF file, but not a run recorded by deli: it has no {' and no '.join(missing)}."
        )
    found = contents.attributes.get("Conventions")
    if found != CONVENTIONS:
        raise InputError(f"{path} follows the conventions {found!r}; this version of deli reads {CONVENTIONS!r}.")
    if not rewritten(contents, path):
        return _groups(contents, path)
    try:
        return _groups(contents, path)
    except Damaged as error:
        raise InputError(
            f"{path} was written by another program, and is no longer a run: {error.what}. Save every variable of the "
            "run, in its own type; rows may be left out."
        ) from error


def rewritten(contents: Contents, path: Path) -> bool:
    """Return whether another program has written a finished run again: rows are not counted, or fewer are there."""
    if COMMITTED not in contents.root:
        return True
    if contents.trusted or path.suffix == ".partial":
        return False
    return _count(contents.root[COMMITTED], COMMITTED, None, "time", path) > contents.sizes[TRAJECTORY].get("time", 0)


def _groups(contents: Contents, path: Path) -> Groups:
    require_attributes(contents.attributes, path)
    rows, steps = _lengths(contents, path)
    sizes = {"time": rows, "step": steps, **_sizes(contents, path)}
    memory = remembered(contents.groups[TRAJECTORY])
    schema = Schema(sizes["dof"], sizes["axis"], memory, POSED in contents.groups)
    groups = {
        group: {variable.name: _variable(contents, group, variable, sizes, path) for variable in variables}
        for group, variables in schema.groups.items()
        if group != POSED
    }
    constants = schema.constants()
    for group, variables in groups.items():
        for name, expected in constants[group].items():
            if not np.array_equal(variables[name][1], expected):
                refuse(path, f"{group}/{name} is {variables[name][1].tolist()!r:.80}, not {expected.tolist()!r:.80}")
    _require_order(groups, path, counted=not rewritten(contents, path))
    if not contents.trusted and (rows, steps) == _stored(contents):
        for group, variables in groups.items():
            variables |= _added(contents.groups[group], variables)
    if POSED in contents.groups:
        groups[POSED] = problems_of(contents, path)
    return groups


def _added(stored: Mapping[str, Stored], known: Mapping[str, VariableData]) -> dict[str, VariableData]:
    """Return the numeric variables that another program has added to a group of deli's."""
    return {
        name: (one.dims, decoded(one), described(one))
        for name, one in stored.items()
        if name not in known and one.values.dtype.kind in "iuf"
    }


def problems_of(contents: Contents, path: Path) -> dict[str, VariableData]:
    """Return the committed subproblems of a run or of a library.

    Raises
    ------
    InputError
        If the file holds none; the message names the contents found and those expected.
    """
    lengths = contents.sizes[POSED]
    count = lengths.get("problem", 0)
    if COMMITTED_PROBLEMS in contents.root:
        count = _count(contents.root[COMMITTED_PROBLEMS], COMMITTED_PROBLEMS, count, "problem", path)
    schema = {variable.name: variable for variable in Schema(1, 1, (), True).groups[POSED]}
    sizes = {"problem": count}
    counts = {name: _variable(contents, POSED, schema[name], sizes, path)[1] for name in COUNTED.values()}
    for dimension, name in COUNTED.items():
        least, most = int(counts[name].min(initial=0)), lengths.get(dimension, 0)
        if least < 0 or float(counts[name].sum(dtype=float)) > most:
            refuse(path, f"{POSED}/{name} counts {least} or more than the {most} places along {dimension}")
    sizes |= places(counts, count)
    found = {name: _variable(contents, POSED, variable, sizes, path) for name, variable in schema.items()}
    fault = find_fault({name: values for name, (_, values, _) in found.items()})
    if fault:
        refuse(path, f"{POSED}/{fault}")
    if int(found[LEFT_OUT][1]) < 0:
        refuse(path, f"{POSED}/{LEFT_OUT} is {int(found[LEFT_OUT][1])}, a number of subproblems")
    return found


def require_schema(groups: Groups, schema: Schema, path: Path) -> None:
    """Refuse a run whose system is not that of a schema.

    Raises
    ------
    InputError
        If a variable is missing, or has another shape.
    """
    for group, variables in schema.groups.items():
        for variable in variables:
            name = f"{group}/{variable.name}"
            if variable.name not in groups.get(group, {}):
                refuse(path, f"{name} is missing")
            values = groups[group][variable.name][1]
            for dim, length in zip(variable.dims, values.shape, strict=True):
                if length != schema.sizes.get(dim, length):
                    refuse(path, f"{name} has {length} along {dim}, not {schema.sizes[dim]}")


def number_of(root: Mapping[str, Stored], name: str, path: Path) -> float:
    """Return a number from the root of a file.

    Raises
    ------
    InputError
        If there is no finite number >= 0 of that name.
    """
    found = root[name].values if name in root else np.array(())
    if found.shape or not np.isfinite(found) or found < 0:
        refuse(path, f"{name} is {found.tolist()!r:.80}, not one finite number >= 0")
    return float(found)


def require_attributes(attributes: dict[str, Any], path: Path) -> None:
    """Refuse a file whose root does not state the configuration, the software and the outcome of a run.

    Raises
    ------
    InputError
        If an attribute is missing, or has a value that is not allowed.
    """
    for name in (*TEXTS, *MOMENTA):
        if not isinstance(attributes.get(name), str):
            refuse(path, f"its attribute {name} is {attributes.get(name)!r:.80}, not a text")
    for name in LATER_TEXTS:
        if not isinstance(attributes.get(name, ""), str):
            refuse(path, f"its attribute {name} is {attributes[name]!r:.80}, not a text")
    for name in MOMENTA:
        if not set(attributes[name].split()) <= {*AXES, "none"}:
            refuse(path, f"its attribute {name} is {attributes[name]!r:.80}; allowed are none, and {' '.join(AXES)}")
    components = [f"{symbol}_{axis}" for symbol in "pL" for axis in AXES]
    undecided = attributes.get(UNDECIDED, "none")
    if not isinstance(undecided, str) or not set(undecided.split()) <= {*components, "none"}:
        refuse(path, f"its attribute {UNDECIDED} is {undecided!r:.80}; allowed are none, and {' '.join(components)}")


def config_of(attributes: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the config that a file records.

    Raises
    ------
    InputError
        If the attribute is not the config of a run.
    """
    try:
        config = tomllib.loads(attributes.get("config", ""))
    except (TypeError, ValueError, RecursionError) as error:
        refuse(path, f"its attribute config is not TOML ({error})")
    for table in ("scene", "method"):
        if not isinstance(config.get(table), dict) or not isinstance(config[table].get("name"), str):
            refuse(path, f"its attribute config has no {table}.name")
    size = config.get("step_size")
    if isinstance(size, bool) or not isinstance(size, int | float) or not 0 < size < math.inf:
        refuse(path, f"its attribute config says that step_size is {size!r:.80}, which is not a finite number > 0")
    record = config.get("record", {})
    every = record.get("every", 1) if isinstance(record, dict) else record
    if isinstance(every, bool) or not isinstance(every, int) or every < 1:
        refuse(path, f"its attribute config says that record.every is {every!r:.80}, which is not a whole number >= 1")
    if not isinstance(config.get("solvers"), dict):
        refuse(path, "its attribute config has no table solvers")
    return config


def _stored(contents: Contents) -> tuple[int, int]:
    """Return the numbers of rows and steps in a file, committed or not."""
    return contents.sizes[TRAJECTORY].get("time", 0), contents.sizes[STATS].get("step", 0)


def _lengths(contents: Contents, path: Path) -> tuple[int, int]:
    """Return the numbers of rows and steps of a run."""
    stored = _stored(contents)
    if rewritten(contents, path):
        if not stored[0]:
            refuse(path, f"{TRAJECTORY} has no rows")
        return stored
    rows = _count(contents.root[COMMITTED], COMMITTED, stored[0], "time", path)
    if rows - 1 > stored[1]:
        refuse(path, f"{COMMITTED} is {rows}, but there are {stored[1]} steps; at least {rows - 1} lead to them")
    return rows, max(rows - 1, 0)


def _count(stored: Stored, name: str, most: int | None, dimension: str, path: Path) -> int:
    if stored.values.shape or stored.values.dtype.kind != "i":
        refuse(path, f"{name} has the shape {stored.values.shape} and the type {stored.values.dtype}, not one integer")
    count = int(stored.values)
    if count < 0 or (most is not None and count > most):
        refuse(path, f"{name} is {count}, but there are {most} along {dimension}; allowed are 0 to that number")
    return count


def _sizes(contents: Contents, path: Path) -> dict[str, int]:
    found = {name: contents.sizes[TRAJECTORY].get(name, 0) for name in ("dof", "axis")}
    if not 1 <= found["axis"] <= len(AXES) or not found["dof"] or found["dof"] % found["axis"]:
        refuse(path, f"it has {found['dof']} degrees of freedom in {found['axis']} dimensions")
    return {**found, "subproblem": contents.sizes[STATS].get("subproblem", 0)}


def _variable(contents: Contents, group: str, variable: Variable, sizes: dict[str, int], path: Path) -> VariableData:
    name, words = f"{group}/{variable.name}", variable.dtype == "str"
    stored = contents.groups[group].get(variable.name)
    if stored is None or (stored.values.dtype.kind == "S") != words:
        refuse(path, f"{name} is missing, or of a type that deli does not write")
    attributes = described(stored)
    dims = stored.dims[:-1] if words else stored.dims
    if dims != variable.dims:
        refuse(path, f"{name} has the dimensions {', '.join(dims) or '-'}, not {', '.join(variable.dims) or '-'}")
    if words:
        return dims, words_of(stored, name, path), attributes
    packed = [key for key in PACKED if key in stored.attributes]
    if packed:
        refuse(path, f"{name} is packed, by its attribute {packed[0]}")
    values = decoded(stored)
    if values.dtype != np.dtype(variable.dtype):
        refuse(path, f"{name} is of the type {values.dtype}, not {np.dtype(variable.dtype)}")
    length = sizes.get(dims[0], 0) if dims else 0
    values = values[:length] if dims else values
    shape = tuple(sizes.get(dim, 0) for dim in dims)
    if values.shape != shape:
        refuse(path, f"{name} has the shape {values.shape}, not {shape}")
    return dims, values, attributes


def _require_order(groups: Groups, path: Path, counted: bool) -> None:
    time, step, status = groups[TRAJECTORY]["time"][1], groups[STATS]["step"][1], groups[STATS]["status"][1]
    wrong = ~np.isfinite(time)
    wrong[1:] |= time[1:] <= time[:-1]
    if wrong.any():
        row = int(wrong.argmax())
        refuse(path, f"{TRAJECTORY}/time is {time[row]} in row {row}; times are finite, and each larger than the last")
    if not counted:
        jumbled = np.flatnonzero(np.diff(step, prepend=-1) < 1)
        if len(jumbled):
            refuse(path, f"{STATS}/step is {step[jumbled[0]]} at place {jumbled[0]}; each is larger than the last")
    elif not np.array_equal(step, np.arange(len(step))):
        refuse(path, f"{STATS}/step does not count from 0 to {len(step) - 1}")
    if len(status) and not 0 <= status.min() <= status.max() < len(STATUS_MEANINGS):
        refuse(path, f"{STATS}/status is {status.min()} to {status.max()}; allowed are 0 to {len(STATUS_MEANINGS) - 1}")
