"""Base families of constraints on distances, between pairs of bodies and from fixed points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import (
    Array,
    Indices,
    body_indices,
    body_pairs,
    broadcast,
    one_vector_each,
    positive_array,
    real_array,
)
from deli.mechanics.constraints import ConstraintFamily
from deli.mechanics.family import ArrayFamily, Invariance, Layout, chosen_bodies
from deli.mechanics.pairs import Pairs
from deli.mechanics.tables import PAIR, POINT, Rows, make_rows
from deli.mechanics.vectors import directions, lengths


@dataclass(frozen=True, eq=False)
class PairDistances(ArrayFamily, ConstraintFamily):
    """Distances of pairs of bodies, less a target, |q_i - q_j| - target.

    The direction between coincident bodies is undefined, and their row of the jacobian is zero.
    """

    pairs: ArrayLike | None
    rows: int = field(init=False, repr=False)
    _pairs: Pairs = field(init=False, repr=False)
    _targets: Array = field(init=False, repr=False)

    _target: ClassVar[str]
    _word: ClassVar[str]

    def _read(self) -> None:
        name = type(self).__name__
        if self.pairs is not None:
            self._set(pairs=body_pairs(f"pairs of {name}", self.pairs))
        self._set(**{self._target: positive_array(f"{self._target} of {name}", getattr(self, self._target))})

    def _prepare(self, layout: Layout) -> None:
        name = type(self).__name__
        pairs = Pairs(f"pairs of {name}", None if self.pairs is None else np.asarray(self.pairs), layout)
        target = getattr(self, self._target)
        targets = broadcast(f"{self._target} of {name}", target, (pairs.count,), "for each pair")
        self._set(rows=pairs.count, _pairs=pairs, _targets=targets)

    def value(self, q: Array) -> Array:
        """Return |q_i - q_j| - target, shape (..., rows)."""
        return lengths(self._separations(q)) - self._targets

    def jacobian(self, q: Array) -> Array:
        """Return unit vectors, + at body i and - at body j, shape (rows, dof)."""
        return self._pairs.jacobian(directions(self._separations(q)))

    def _separations(self, q: Array) -> Array:
        return self._pairs.separations(q)

    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""
        joined = zip(self._pairs.first, self._pairs.second, strict=True)
        return [f"{self._word} body {i} - body {j}" for i, j in joined]

    def rows_table(self) -> Rows:
        """Return the rows as a table, in the order of ``value``."""
        nowhere = np.zeros(self.bound.dimension)
        return make_rows(PAIR, self._pairs.first, nowhere, self._targets, second=self._pairs.second)

    def invariance(self) -> Invariance:
        """Return every translation and rotation."""
        return Invariance.everything(self.bound.dimension)


@dataclass(frozen=True, eq=False)
class PointDistances(ArrayFamily, ConstraintFamily):
    """Distances of bodies from fixed points, less a target, sign (|q_i - point_i| - target).

    At the point itself the direction is undefined, and the row of the jacobian is zero.
    """

    bodies: ArrayLike | None = field(default=None, kw_only=True)
    rows: int = field(init=False, repr=False)
    _index: Indices = field(init=False, repr=False)
    _row_numbers: Indices = field(init=False, repr=False)
    _points: Array = field(init=False, repr=False)
    _targets: Array = field(init=False, repr=False)

    _point: ClassVar[str]
    _target: ClassVar[str]
    _word: ClassVar[str]
    _sign: ClassVar[float]

    def _read(self) -> None:
        name = type(self).__name__
        self._set(**{self._target: positive_array(f"{self._target} of {name}", getattr(self, self._target))})
        self._set(**{self._point: real_array(f"{self._point} of {name}", getattr(self, self._point))})
        if self.bodies is not None:
            self._set(bodies=body_indices(f"bodies of {name}", self.bodies))

    def _prepare(self, layout: Layout) -> None:
        name = type(self).__name__
        index = chosen_bodies(f"bodies of {name}", self.bodies, layout)
        shape = (index.size, layout.dimension)
        target, point = getattr(self, self._target), getattr(self, self._point)
        targets = broadcast(f"{self._target} of {name}", target, shape[:1], "for each body")
        points = one_vector_each(f"{self._point} of {name}", point, *shape)
        self._set(rows=index.size, _index=index, _row_numbers=np.arange(index.size))
        self._set(_points=points, _targets=targets)

    def _offsets(self, q: Array) -> Array:
        layout = self.bound
        x = q.reshape(*q.shape[:-1], layout.bodies, layout.dimension)
        offsets: Array = x.take(self._index, axis=-2) - self._points
        return offsets

    def value(self, q: Array) -> Array:
        """Return sign (|q_i - point_i| - target), shape (..., rows)."""
        return self._sign * (lengths(self._offsets(q)) - self._targets)

    def jacobian(self, q: Array) -> Array:
        """Return unit vectors from the points, times sign, shape (rows, dof)."""
        layout = self.bound
        rows = np.zeros((self.rows, layout.bodies, layout.dimension))
        rows[self._row_numbers, self._index] = self._sign * directions(self._offsets(q))
        return rows.reshape(self.rows, layout.dof)

    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""
        return [f"{self._word} body {body}" for body in self._index]

    def rows_table(self) -> Rows:
        """Return the rows as a table, in the order of ``value``."""
        return make_rows(POINT, self._index, self._points, self._targets, sign=self._sign)

    def invariance(self) -> Invariance:
        """Return the rotations about an axis that contains all points, and no translation."""
        return Invariance.of_vectors(self._points, free=False)
