"""Invariances of plain Python functions, measured at a few states because users do not declare them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from deli.mechanics.arrays import Array
from deli.mechanics.family import ROTATION_PLANES, Invariance, Layout

SPREADS = (1e-3, 0.1, 1.0, 10.0)
"""Distances of states from the initial one, and sizes of motions, in the scene's extent or radians, smallest first."""
KEPT = 1e-12
"""Largest relative change that counts as rounding: the motion leaves the function unchanged."""
BROKEN = 1e-6
"""Relative change above which the motion changes the function; between the two bounds it is unknown."""
OFF_LATTICE = 0.7310585786300049
"""Factor of all distances, so that no translation is a period of the functions."""

Motion = tuple[int, ...]
"""An axis to translate along, or the two axes of a plane to rotate in."""


def measure_invariance(
    layout: Layout, values: Callable[[Array], Array], derivatives: Callable[[Array], Array]
) -> Invariance:
    """Measure which rigid motions of all bodies leave functions of the configuration unchanged.

    The states are random, at distances between 1/1000 of the scene's extent and ten times the extent from the initial
    state, and the same in every process. The motions are as large, in both directions. The values c(q) are compared
    with those of the moved state, and the derivative along the motion, Σᵢ ∂c/∂qᵢ·ξ(qᵢ), with zero. Changes are relative
    to the size of the terms that rounding acts on.

    A motion is an invariance (True) if no change exceeds rounding (`KEPT`), and it is none (False) if a change exceeds
    `BROKEN`. It is unknown (None) if the largest change lies between the two, if the functions fail or are not finite
    at the states nearest to the initial one, or if a function does not vary at all. States farther away at which
    functions fail are left out.

    Parameters
    ----------
    layout
        The scene's layout.
    values
        c(q), shape (rows,).
    derivatives
        The derivative of c, shape (rows, dof).

    Returns
    -------
    Invariance
    """
    motions: list[Motion] = [*((axis,) for axis in range(layout.dimension)), *ROTATION_PLANES[layout.dimension]]
    changes = np.full((len(SPREADS), len(motions), 3), np.nan)  # derivative along the motion, and both directions
    rows = values(layout.position).shape
    varied = np.zeros(rows, dtype=bool)
    with np.errstate(all="ignore"):
        for number, (spread, length, q) in enumerate(_states(layout)):
            at, slopes = _evaluated(values, q, rows), _evaluated(derivatives, q, (*rows, layout.dof))
            if at is None or slopes is None:
                continue
            varied |= slopes.any(axis=1)
            for place, motion in enumerate(motions):
                changes[number, place, 0] = _along(slopes, _field(layout, q, motion))
                for way, sign in enumerate((1.0, -1.0), start=1):
                    moved = _moved(layout, q, motion, sign * (spread if len(motion) == 2 else length))
                    there = _evaluated(values, moved, rows)
                    if there is not None:
                        changes[number, place, way] = _between(at, there, slopes, q, moved)
    verdicts = [_verdict(changes[:, place], bool(varied.all())) for place in range(len(motions))]
    return Invariance(tuple(verdicts[: layout.dimension]), tuple(verdicts[layout.dimension :]))


def _verdict(changes: Array, varies: bool) -> bool | None:
    """Judge a motion by its relative changes, the nearest state's first; nan where functions fail."""
    worst = float(changes[np.isfinite(changes)].max(initial=0.0))
    if worst > BROKEN:
        return False
    return True if varies and worst <= KEPT and np.isfinite(changes[0]).all() else None


def _states(layout: Layout) -> Iterator[tuple[float, float, Array]]:
    """Yield each spread, its length, and a state at that distance from the initial one."""
    random = np.random.default_rng(0)
    q = layout.position.reshape(layout.bodies, layout.dimension)
    extent = float(np.ptp(q, axis=0).max()) or float(np.abs(q).max()) or 1.0
    for spread in SPREADS:
        length = OFF_LATTICE * spread * extent
        yield spread, length, layout.position + length * random.uniform(-1.0, 1.0, layout.dof)


def _moved(layout: Layout, q: Array, motion: Motion, amount: float) -> Array:
    """Translate all bodies by a distance, or rotate them about the origin by an angle."""
    x = q.reshape(layout.bodies, layout.dimension).copy()
    if len(motion) == 1:
        x[:, motion[0]] += amount
    else:
        i, j = motion
        x[:, [i, j]] = x[:, [i, j]] @ [[np.cos(amount), np.sin(amount)], [-np.sin(amount), np.cos(amount)]]
    return x.reshape(-1)


def _field(layout: Layout, q: Array, motion: Motion) -> Array:
    """Return the velocity ξ(q) of a motion, shape (dof,)."""
    x = q.reshape(layout.bodies, layout.dimension)
    field = np.zeros_like(x)
    if len(motion) == 1:
        field[:, motion[0]] = 1.0
    else:
        i, j = motion
        field[:, i], field[:, j] = -x[:, j], x[:, i]
    return field.reshape(-1)


def _along(slopes: Array, field: Array) -> float:
    """Return |Σ ∂c/∂q ξ| over Σ |∂c/∂q ξ|, the largest of all rows."""
    return _largest(np.abs(slopes @ field), np.abs(slopes) @ np.abs(field))


def _between(at: Array, there: Array, slopes: Array, q: Array, moved: Array) -> float:
    """Return |c' - c| over the size of the terms that rounding of q and c acts on, the largest of all rows."""
    place = np.abs(q).max() + np.abs(moved).max()
    return _largest(np.abs(there - at), np.abs(at) + np.abs(there) + place * np.abs(slopes).sum(axis=1))


def _largest(change: Array, size: Array) -> float:
    return float(np.divide(change, size, out=np.zeros_like(change), where=size > 0.0).max(initial=0.0))


def _evaluated(function: Callable[[Array], Array], q: Array, shape: tuple[int, ...]) -> Array | None:
    """Return a function's values at q, or None where it fails or is not finite."""
    try:
        found = np.asarray(function(q), dtype=np.float64)
    except Exception:  # a user's function may raise any exception outside its domain
        return None
    return found if found.shape == shape and np.isfinite(found).all() else None
