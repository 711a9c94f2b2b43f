"""Pairs of near bodies among many, by a k-d tree, in a periodic box or in free space."""

from __future__ import annotations

from typing import Any

import numpy as np

from deli.mechanics.arrays import Array, Indices
from deli.mechanics.vectors import lengths, nearest_images

SLACK = 1e-12
"""Relative excess of a search's radius, so that rounding loses no pair; callers drop pairs that are too far apart."""


def pairs_within(bodies: Array, radius: float, period: Array) -> tuple[Indices, Indices]:
    """Return all pairs i < j at most ``radius`` apart, and none much farther, in lexicographic order.

    Parameters
    ----------
    bodies
        Places, shape (bodies, dimension), anywhere in space.
    radius
        A length.
    period
        Length of the periodic box along each axis, 0 along one that is not periodic.
    """
    wide = radius + SLACK * (abs(radius) + float(np.abs(bodies).max(initial=0.0)))
    if wide < 0.0 or len(bodies) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    found = _tree(bodies, period).query_pairs(wide, output_type="ndarray")
    keys = np.sort(found[:, 0] * len(bodies) + found[:, 1])
    first, second = np.divmod(keys, len(bodies))
    return first, second


def closest_pair(bodies: Array, period: Array) -> tuple[Indices, Indices]:
    """Return the two closest bodies i < j, each as an array of one entry; empty arrays for fewer than two bodies."""
    if len(bodies) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    _, nearest = _tree(bodies, period).query(_wrapped(bodies, period), k=2)
    number, other = np.repeat(np.arange(len(bodies)), 2), nearest.reshape(-1)
    number, other = number[number != other], other[number != other]
    best = np.argmin(lengths(nearest_images(bodies[number] - bodies[other], period)))
    pair = np.sort([number[best], other[best]])
    return pair[:1], pair[1:]


def _tree(bodies: Array, period: Array) -> Any:
    from scipy.spatial import cKDTree  # slow to import, and only large scenes search

    box = period if period.any() else None
    return cKDTree(_wrapped(bodies, period), boxsize=box, balanced_tree=False, compact_nodes=False)


def _wrapped(bodies: Array, period: Array) -> Array:
    if not period.any():
        return bodies
    wrapped = np.mod(bodies, period, out=bodies.copy(), where=period > 0.0)
    # the remainder of a tiny negative number rounds to the period itself
    wrapped[(wrapped >= period) & (period > 0.0)] = 0.0
    return wrapped
