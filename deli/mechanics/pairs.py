"""Pairs of bodies: separations, and adding what each pair contributes to the bodies it joins."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from deli.mechanics.arrays import Array, Indices, body_pairs, check_range, frozen
from deli.mechanics.family import Layout

LARGEST_DENSE = 40_000
"""Entries up to which an incidence matrix is faster dense than sparse."""


class Pairs:
    """Incidence of pairs (i, j) with bodies, shape of space included.

    Parameters
    ----------
    name
        What to call the pairs in error messages.
    pairs
        Body numbers, shape (pairs, 2), or None for all pairs i < j.
    layout
        The scene's layout.
    """

    def __init__(self, name: str, pairs: Indices | None, layout: Layout) -> None:
        if pairs is None:
            pairs = np.stack(np.triu_indices(layout.bodies, 1), axis=1)
        pairs = body_pairs(name, pairs)
        check_range(name, pairs, layout.bodies)
        self.first: Indices = frozen(np.ascontiguousarray(pairs[:, 0]))
        self.second: Indices = frozen(np.ascontiguousarray(pairs[:, 1]))
        self.count = len(pairs)
        self.bodies, self.dimension = layout.bodies, layout.dimension
        self._rows = frozen(np.arange(self.count))
        number = self._rows
        one = np.ones(self.count)
        ends = np.concatenate([self.first, self.second])
        self._scatter = _incidence(ends, np.tile(number, 2), np.concatenate([one, -one]), self.bodies, self.count)
        i, j, n = self.first, self.second, self.bodies
        cells = np.concatenate([i * n + i, j * n + j, i * n + j, j * n + i])
        signs = np.concatenate([one, one, -one, -one])
        self._scatter_blocks = _incidence(cells, np.tile(number, 4), signs, n * n, self.count)

    def separations(self, q: Array) -> Array:
        """Return q_i - q_j, shape (..., pairs, dimension)."""
        x = q.reshape(*q.shape[:-1], self.bodies, self.dimension)
        difference: Array = x.take(self.first, axis=-2) - x.take(self.second, axis=-2)
        return difference

    def gradient(self, forces: Array) -> Array:
        """Add +forces at i and -forces at j, shape (pairs, dimension) -> (dof,)."""
        total: Array = self._scatter @ forces
        return total.reshape(-1)

    def hessian(self, blocks: Array) -> Array:
        """Add the second derivative in q_i - q_j of each pair, (pairs, d, d) -> (dof, dof)."""
        n, d = self.bodies, self.dimension
        cells: Array = self._scatter_blocks @ blocks.reshape(self.count, d * d)
        return cells.reshape(n, n, d, d).swapaxes(1, 2).reshape(n * d, n * d)

    def jacobian(self, directions: Array) -> Array:
        """Put each pair's direction in its row, + at i and - at j, (pairs, d) -> (pairs, dof)."""
        rows = np.zeros((self.count, self.bodies, self.dimension))
        rows[self._rows, self.first] = directions
        rows[self._rows, self.second] = -directions
        return rows.reshape(self.count, self.bodies * self.dimension)


def _incidence(rows: Indices, columns: Indices, values: Array, height: int, width: int) -> Any:
    matrix = sparse.csr_array((values, (rows, columns)), shape=(height, width))
    return matrix if height * width > LARGEST_DENSE else frozen(matrix.toarray())
