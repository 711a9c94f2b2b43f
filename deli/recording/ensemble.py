"""Rows of many runs of one shape: arrays with the member as first dimension, and the tree that users get."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.kernels.advance import BLOCK, Block
from deli.kernels.record import Record, Records
from deli.mechanics.scene import Scene
from deli.memory import available_memory
from deli.recording.ensemble_file import member_dims, store_as_letters
from deli.recording.recorder import STAT_NAMES, named_diagnostics
from deli.recording.schema import MEMBER, STATS, TRAJECTORY, Schema, Variable, coordinates
from deli.subproblems.stats import COUNTS, UNUSED


class Gathering:
    """The arrays into which steppers write the rows of all members.

    Parameters
    ----------
    members, rows : int
    schema : Schema
    stats : bool
        Whether to keep the solvers' statistics.

    Raises
    ------
    InputError
        If the rows need more memory than there is.
    """

    def __init__(self, members: int, rows: int, schema: Schema, stats: bool = True) -> None:
        dimension = schema.dimension
        columns, counted = 4 + dimension + {1: 0, 2: 1, 3: 3}[dimension], rows if stats else 0
        shapes: dict[str, tuple[tuple[int, ...], Any]] = {
            "progress": ((2,), np.int64),
            "steps": ((rows,), np.int64),
            "position": ((rows, schema.dof), np.float64),
            "momentum": ((rows, schema.dof), np.float64),
            "memory": ((rows, len(schema.memory), schema.dof), np.float64),
            "diagnostics": ((rows, columns), np.float64),
            "counts": ((counted, len(COUNTS), 3), np.int64),
            "times": ((counted, 2, 3), np.float64),
            "residuals": ((counted, 3, 3), np.float64),
            "status": ((counted, 3), np.int64),
            "contacts": ((rows, 2), np.int64),
        }
        entries = sum(int(np.prod(shape)) for shape, _ in shapes.values())
        _require_memory(members, rows, 8 * members * (entries + 2 * rows))
        self.fields = Block(**{name: np.zeros((members, *shape), dtype) for name, (shape, dtype) in shapes.items()})
        self._schema, self._stats = schema, stats
        self._records = Records(BLOCK, self.fields, members)

    def block(self, member: int) -> Record:
        """Return the record into which a member's rows go."""
        return self._records[member]

    @property
    def steps_taken(self) -> np.ndarray:
        """Number of steps that each member has taken."""
        return self.fields.progress[:, 0]

    def tree(
        self, time: np.ndarray, labels: Mapping[str, Any], outcomes: Sequence[str], attributes: Mapping[str, Any]
    ) -> xr.DataTree:
        """Return all rows as a tree; in rows that a member has not reached, numbers are nan and counts are zero."""
        self._pad()
        fields = self.fields
        columns = [fields.counts[:, 1:, k] for k in range(len(COUNTS))] + [fields.times[:, 1:, k] for k in range(2)]
        columns += [fields.residuals[:, 1:, k] for k in range(3)] + [fields.status[:, 1:].astype(np.int8)]
        values = {
            "time": time,
            "position": fields.position,
            "momentum": fields.momentum,
            **{name: fields.memory[:, :, k] for k, name in enumerate(self._schema.memory)},
            **named_diagnostics(fields.diagnostics, self._schema.dimension),
            "smooth_contacts": fields.contacts[..., 0],
            "reflected_contacts": fields.contacts[..., 1],
            "step": np.arange(len(time) - 1),
            **dict(zip(STAT_NAMES, columns, strict=True)),
        }
        named = {name: xr.Variable(MEMBER, column) for name, column in labels.items()}
        root = {
            MEMBER: xr.Variable(MEMBER, np.arange(len(outcomes))),
            **named,
            "outcome": xr.Variable(MEMBER, np.array(outcomes), {"long_name": "how the member's run ended"}),
            "steps_taken": xr.Variable(MEMBER, self.steps_taken.copy(), {"units": "1", "long_name": "steps taken"}),
        }
        datasets = {"/": xr.Dataset(root, attrs=dict(attributes)).set_coords([MEMBER, *named])}
        constants = self._schema.constants()
        groups = self._schema.groups if self._stats else {TRAJECTORY: self._schema.groups[TRAJECTORY]}
        for group, variables in groups.items():
            found = named | {
                variable.name: _variable(variable, group, constants[group] | values) for variable in variables
            }
            names = [*named, *(name for name in coordinates(group) if name in found)]
            datasets[f"/{group}"] = xr.Dataset(found).set_coords(names)
        return store_as_letters(xr.DataTree.from_dict(datasets))

    def _pad(self) -> None:
        fields, rows = self.fields, self.fields.steps.shape[1]
        for member in np.flatnonzero(fields.progress[:, 1] < rows):
            rest = slice(int(fields.progress[member, 1]), None)
            for array in (fields.position, fields.momentum, fields.memory, fields.diagnostics):
                array[member, rest] = np.nan
            fields.times[member, rest], fields.residuals[member, rest] = np.nan, np.nan
            fields.counts[member, rest], fields.contacts[member, rest] = 0, 0
            fields.status[member, rest] = UNUSED


def check_labels(labels: Mapping[str, Any] | None, members: int, schema: Schema) -> dict[str, np.ndarray]:
    """Return the labels as arrays.

    Raises
    ------
    InputError
        If a label does not have one value for each member, or has the name of a variable of the run.
    """
    taken = {variable.name for variables in schema.groups.values() for variable in variables}
    taken |= {"outcome", "steps_taken", TRAJECTORY, STATS, *schema.sizes}
    found = {}
    for name, values in ({} if labels is None else labels).items():
        array = np.asarray(values)
        if array.shape != (members,):
            raise InputError(
                f"labels: {name!r} has shape {array.shape}; pass one value for each of the {members} scenes"
            )
        if not isinstance(name, str) or name in taken:
            raise InputError(f"labels: {name!r} names something else in the run, or is not a string; use another name")
        found[name] = array
    return found


def same(scenes: Sequence[Scene], name: str) -> bool:
    """Return whether all scenes have the same attribute: by value if it is an array or a name, else by identity."""
    first = getattr(scenes[0], name)
    others = [getattr(scene, name) for scene in scenes]
    if isinstance(first, np.ndarray):
        return bool((np.concatenate(others).reshape(len(others), -1) == first).all())
    return all(other is first or (isinstance(first, str) and other == first) for other in others)


def _variable(variable: Variable, group: str, values: Mapping[str, np.ndarray]) -> xr.Variable:
    return xr.Variable(member_dims(variable, group), values[variable.name], variable.attributes)


def _require_memory(members: int, rows: int, needed: int) -> None:
    available = available_memory()
    if needed > available:
        raise InputError(
            f"scenes: {members} members of {rows} rows each need {needed / 1e9:.3g} GB of memory, and "
            f"{available / 1e9:.3g} GB are available; record fewer rows (a larger every), or pass fewer scenes at once."
        )
