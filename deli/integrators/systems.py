"""Many scenes of the same shape bound to a scheme at once: the arrays of kernels, with the scene as the first axis."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from deli.integrators.binding import bind_system, components
from deli.kernels.machine import MACHINE
from deli.kernels.record import Records
from deli.mechanics.scene import Scene
from deli.mechanics.tables import PLANE, Rows, Terms


def shape_of(scene: Scene) -> tuple[int, ...] | None:
    """Return the sizes that scenes must share for `bind_systems`, or None for a scene that it cannot bind."""
    potential, unilateral, bilateral = scene.potential, scene.unilateral, scene.bilateral
    if unilateral.searched or potential.others or unilateral.others or bilateral.others:
        return None
    terms = potential.table
    return unilateral.table.kind.size, bilateral.table.kind.size, terms.kind.size, terms.body.size


def bind_systems(scenes: Sequence[Scene], implicit: bool) -> Records:
    """Return the arrays of scenes of one shape, equal to the bit to those of `bind_system` for each scene."""
    length: Any = np.array([scene.length_scale for scene in scenes])
    mass = _column([scene.mass for scene in scenes])
    free, held = (
        _columns([getattr(scene, side).table for scene in scenes], Rows) for side in ("unilateral", "bilateral")
    )
    tables = [Rows._make(column[k] for column in held) for k in range(len(held.kind))]
    system = bind_system(scenes[0], implicit)._replace(
        mass=mass,
        inverse=1.0 / mass,
        root=np.sqrt(mass),
        unilateral=free,
        bilateral=held,
        gap_scale=length[:, np.newaxis] * _plane_sizes(free),
        bilateral_scale=length[:, np.newaxis] * _plane_sizes(held),
        terms=_columns([scene.potential.table for scene in scenes], Terms),
        component=_column([components(scenes[0].bodies, table) for table in tables]),
        length=length,
        reference=np.zeros((1, 0)),
    )
    return Records(MACHINE.nested["system"], system, len(scenes))


def _column(arrays: list[np.ndarray]) -> np.ndarray:
    """Return the arrays stacked along a new first axis; a view if all of them are the same array."""
    first = arrays[0]
    if all(array is first for array in arrays):
        return first[np.newaxis]
    return np.concatenate(arrays).reshape(len(arrays), *first.shape)


def _columns(tables: list[Any], kind: Any) -> Any:
    if all(table is tables[0] for table in tables):
        return kind._make(column[np.newaxis] for column in tables[0])
    return kind._make(_column(list(columns)) for columns in zip(*tables, strict=True))


def _plane_sizes(rows: Rows) -> np.ndarray:
    sizes = np.where(rows.kind == PLANE, np.linalg.norm(rows.vector, axis=-1), 1.0)
    sizes[sizes == 0.0] = 1.0
    return sizes
