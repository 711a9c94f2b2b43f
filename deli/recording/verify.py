"""Checks of a recorded file: schema, committed rows, finite numbers, diagnostics that follow from the states."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from deli.integrators.registry import METHODS
from deli.recording import provenance, reading, structure
from deli.recording.ensemble_file import tree_of
from deli.recording.finding import AGREEMENT, Finding
from deli.recording.recorder import diagnose
from deli.recording.schema import POSED, STATS, TRAJECTORY, Groups, Schema, build_tree, dataset_of
from deli.recording.subproblems import LEFT_OUT, unpack
from deli.recording.verify_ensemble import verify_ensemble
from deli.subproblems.stats import RESIDUALS

MAY_BE_NAN = ("gap_min", "equality_residual", "primal_residual", "dual_residual", "complementarity")


def verify(path: Path) -> list[Finding]:
    """Check a file and return the findings.

    Raises
    ------
    InputError
        If the file cannot be read at all, or was not recorded by deli.
    """
    contents = reading.contents_of(path)
    if reading.holds_ensemble(contents):
        return verify_ensemble(tree_of(contents, path), contents.trusted)
    found = reading.examine(path, contents)
    groups, attributes = found.groups, found.attributes
    run = build_tree(groups, attributes)
    config = structure.config_of(attributes, path)
    findings = [Finding("outcome", None, attributes["outcome"])]
    findings += [_content(found), _schema(groups, config["method"]["name"]), _rows(path, run, found)]
    findings += [_finite(run), _times(run, config)]
    findings += [_problems(run)] if POSED in groups else []
    return findings + list(_diagnostics(run))


def _content(found: reading.Examined) -> Finding:
    """Check that a file's numbers are those that were recorded: by its digest, or by the checksums of its rows."""
    if found.broken:
        return Finding("content", False, f"checksums differ: {', '.join(found.broken)}")
    if found.sealed:
        return Finding("content", True, "the digest is that of the closed file")
    if found.broken is None:
        return Finding("content", None, "not sealed: another program wrote the file, without digest and checksums")
    return Finding("content", True, "the checksums of all rows agree; there is no digest")


def _schema(groups: Groups, method: str) -> Finding:
    dof, dimension = (len(groups[TRAJECTORY][name][1]) for name in ("dof", "axis"))
    memory = METHODS[method].MEMORY if method in METHODS else ()
    wrong = []
    for group, variables in Schema(dof, dimension, memory, POSED in groups).groups.items():
        for variable in variables:
            name = f"{group}/{variable.name}"
            if variable.name not in groups[group]:
                wrong.append(f"{name} is missing")
                continue
            dims, values, attributes = groups[group][variable.name]
            if dims != variable.dims:
                wrong.append(f"{name} has dimensions {dims}, not {variable.dims}")
            if variable.dtype != "str" and values.dtype != np.dtype(variable.dtype):
                wrong.append(f"{name} is of type {values.dtype}, not {np.dtype(variable.dtype)}")
            wrong += [f"{name} has no {key}" for key in ("units", "long_name") if not attributes.get(key)]
    return Finding("schema", not wrong, "; ".join(wrong) or "all variables, with units and long names")


def _rows(path: Path, run: xr.DataTree, found: reading.Examined) -> Finding:
    committed = dataset_of(run, TRAJECTORY).sizes["time"]
    if path.suffix == ".partial":
        return Finding("rows", committed >= 1, f"{committed} committed of {found.stored} begun")
    if not found.counted:
        steps = dataset_of(run, STATS).sizes["step"]
        return Finding(
            "rows", None, f"{committed} rows and {steps} steps; the program that wrote the file left no count"
        )
    return Finding("rows", committed == found.stored, f"{committed} committed, {found.stored} stored")


def _finite(run: xr.DataTree) -> Finding:
    wrong = []
    for group in (TRAJECTORY, STATS):
        for name, values in dataset_of(run, group).variables.items():
            if values.dtype.kind == "f":
                bad = np.isinf(values.values) if name in MAY_BE_NAN else ~np.isfinite(values.values)
                wrong += [f"{group}/{name} has {int(bad.sum())}"] if bad.any() else []
    return Finding("finite values", not wrong, "; ".join(wrong) or "no nan or infinity where numbers must be finite")


def _times(run: xr.DataTree, config: dict[str, float]) -> Finding:
    time = dataset_of(run, TRAJECTORY)["time"].values
    steps = time / config["step_size"]
    uneven = np.abs(steps - np.round(steps)) > 1e-6
    holds = not uneven.any() and bool((np.diff(np.round(steps)) > 0).all())
    return Finding("times", holds, f"{time[0]:.9g} to {time[-1]:.9g}, multiples of {config['step_size']}")


def _problems(run: xr.DataTree) -> Finding:
    """Check that the answers to recorded subproblems have the residuals that are recorded."""
    recorded = dataset_of(run, POSED)
    kept, left_out = recorded.sizes["problem"], int(recorded[LEFT_OUT])
    worst = 0.0
    if kept:
        problems = unpack({str(name): values.values for name, values in recorded.variables.items()})
        again = np.array([one.residuals(one.z, one.y) for one in problems])
        before = np.stack([recorded[name].values for name in RESIDUALS], axis=1)
        if not np.array_equal(np.isnan(again), np.isnan(before)):
            return Finding("subproblems", False, "some have an answer and no residual, or a residual and no answer")
        worst = float(np.nanmax(np.abs(again - before), initial=0.0))
    seen = f"{kept:,} kept, {left_out:,} left out; residuals recomputed from their numbers differ by {worst:.1e}"
    return Finding("subproblems", worst <= AGREEMENT, seen)


def _diagnostics(run: xr.DataTree) -> Iterator[Finding]:
    scene = provenance.scene_of(run)
    if scene is None:
        yield Finding("diagnostics", None, "not recomputed: the scene is a user's own")
        return
    trajectory = dataset_of(run, TRAJECTORY)
    again = diagnose(scene, trajectory["position"].values, trajectory["momentum"].values)
    for name, values in again.items():
        recorded = trajectory[name].values
        scale = max(float(np.nanmax(np.abs(values), initial=0.0)), 1.0)
        apart = np.abs(recorded - values)
        if np.isnan(values).all() and np.isnan(recorded).all():
            yield Finding(name, True, "nan: the scene has no such constraints")
        else:
            worst = float(apart.max())
            row = int(apart.reshape(len(apart), -1).max(axis=1).argmax())
            yield Finding(
                name, worst <= AGREEMENT * scale, f"recomputed from the states, differs by {worst:.1e} (row {row})"
            )
