"""Pairs of bodies: their separations, and sums of their contributions to the bodies that they join."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from deli.mechanics.arrays import Array, Indices, body_pairs, check_range, frozen
from deli.mechanics.family import Layout
from deli.memory import require_memory

BYTES_A_PAIR = 500
"""Memory in bytes that a scene and a stepper need for each pair."""
LARGEST_DENSE = 40_000
"""Largest number of entries for which the matrix of differences is faster dense than sparse."""


class Pairs:
    """Pairs (i, j) of a layout's bodies, and the matrix D of differences, D q = (q_i - q_j) over all pairs.

    Parameters
    ----------
    name
        Name of the pairs in error messages.
    pairs
        Body numbers, shape (pairs, 2), or None for all pairs i < j.
    layout
        The scene's layout.
    """

    def __init__(self, name: str, pairs: Indices | None, layout: Layout) -> None:
        if pairs is None:
            what, count = f"{name}: all pairs of {layout.bodies:,} bodies", layout.bodies**2 / 2
            require_memory(what, BYTES_A_PAIR * count, "list the pairs that interact, or take fewer bodies")
            pairs = np.stack(np.triu_indices(layout.bodies, 1), axis=1)
        pairs = body_pairs(name, pairs)
        check_range(name, pairs, layout.bodies)
        self.first: Indices = frozen(np.ascontiguousarray(pairs[:, 0]))
        self.second: Indices = frozen(np.ascontiguousarray(pairs[:, 1]))
        self.count, self.dimension, self.dof = len(pairs), layout.dimension, layout.dof
        self.identity = frozen(np.identity(self.dimension))
        axes, size = np.arange(self.dimension), self.count * self.dimension
        columns = np.stack([pairs[:, :1] * self.dimension + axes, pairs[:, 1:] * self.dimension + axes])
        signs = np.repeat([1.0, -1.0], size)
        rows = np.tile(np.arange(size), 2)
        self._sparse = sparse.csr_array((signs, (rows, columns.reshape(-1))), shape=(size, self.dof))
        self._dense: Array | None = None
        if size * self.dof <= LARGEST_DENSE:
            self._dense = frozen(self._sparse.toarray())
            self._blocks = self._dense.reshape(self.count, self.dimension, self.dof)
            self._transposed = self._dense.T

    def separations(self, q: Array) -> Array:
        """Return q_i - q_j, shape (..., dof) -> (..., pairs, dimension)."""
        shape = (*q.shape[:-1], self.count, self.dimension)
        if self._dense is not None:
            difference: Array = (q @ self._transposed).reshape(shape)
            return difference
        x = q.reshape(*q.shape[:-1], -1, self.dimension)
        difference = x.take(self.first, axis=-2) - x.take(self.second, axis=-2)
        return difference

    def gradient(self, forces: Array) -> Array:
        """Add +forces at i and -forces at j, shape (pairs, dimension) -> (dof,)."""
        if self._dense is not None:
            return forces.reshape(-1) @ self._dense
        total: Array = self._sparse.T @ forces.reshape(-1)
        return total

    def hessian(self, blocks: Array) -> Array:
        """Add each pair's second derivative in q_i - q_j, shape (pairs, dimension, dimension) -> (dof, dof)."""
        if self._dense is not None:
            total: Array = self._transposed @ (blocks @ self._blocks).reshape(-1, self.dof)
            return total
        number = np.arange(self.count + 1)
        diagonal = sparse.bsr_array((blocks, number[:-1], number))
        total = (self._sparse.T @ diagonal @ self._sparse).toarray()
        return total

    def jacobian(self, directions: Array) -> Array:
        """Put each pair's direction in its row, + at i and - at j, shape (pairs, dimension) -> (pairs, dof)."""
        if self._dense is not None:
            rows: Array = (directions[:, None, :] @ self._blocks)[:, 0]
            return rows
        rows = np.zeros((self.count, self.dof // self.dimension, self.dimension))
        number = np.arange(self.count)
        rows[number, self.first] = directions
        rows[number, self.second] = -directions
        return rows.reshape(self.count, self.dof)
