"""Constraint families: values and jacobians, one row a constraint, vectorized over rows.

The same families serve both sides: unilateral rows demand value >= 0, bilateral rows value = 0.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from operator import is_
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, Indices, body_indices, broadcast, frozen, one_vector_each, real_array
from deli.mechanics.family import ArrayFamily, Family, Invariance, Layout, chosen_bodies, common_invariance
from deli.mechanics.tables import PLANE, Rows, make_rows, other_rows, stacked

LARGEST_MATRIX = 1_000_000
"""Largest number of entries for which planes keep their normals as a matrix of shape (rows, dof)."""


class ConstraintFamily(Family):
    """Scalar constraints c(q) with their jacobian, q the flat configuration of length dof."""

    constant_jacobian: bool = False
    searched: bool = False
    """Whether further rows, besides the fixed ones, are found by a search among all pairs of bodies."""
    rows: int
    """Number of fixed rows."""

    @abc.abstractmethod
    def value(self, q: Array) -> Array:
        """Return c, shape (..., rows), of configurations of shape (..., dof)."""

    @abc.abstractmethod
    def jacobian(self, q: Array) -> Array:
        """Return the jacobian at one configuration, shape (rows, dof)."""

    @abc.abstractmethod
    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""

    def rows_table(self) -> Rows | None:
        """Return the fixed rows as a table, in the order of ``value``, or None for a family without a table."""
        return None


class SearchedFamily(ConstraintFamily):
    """A family that finds its rows by search if ``searched`` is true."""

    distance: ArrayLike
    """Smallest allowed distance of two bodies."""

    @abc.abstractmethod
    def neighbours(self, q: Array, reach: float) -> Rows:
        """Return the rows whose value is at most ``reach`` at one configuration."""

    @abc.abstractmethod
    def nearest(self, q: Array) -> Rows:
        """Return the row with the smallest value at one configuration."""

    @abc.abstractmethod
    def least(self, q: Array) -> float:
        """Return the smallest value over all rows at one configuration, inf if there is none."""


@dataclass(frozen=True, eq=False)
class Planes(ArrayFamily, ConstraintFamily):
    """Half-spaces, normal . q_i - offset; the jacobian is constant.

    Parameters
    ----------
    normals
        One vector of length dimension for all rows, or one for each row; not zero.
    offsets
        One number for all rows, or one for each row.
    bodies
        The body of each row, counted from 0; a body may have several planes. By default each body has one plane.

    Examples
    --------
    >>> import deli
    >>> box = deli.Planes(normals=[[0.0, 1.0], [1.0, 0.0]], offsets=0.5, bodies=[0, 0])  # a floor and a wall
    >>> scene = deli.Scene(mass=1.0, position=[1.0, 2.0], momentum=[0.0, 0.0], unilateral=box, dimension=2)
    >>> scene.unilateral.value(scene.position)
    array([1.5, 0.5])
    """

    normals: ArrayLike
    offsets: ArrayLike = 0.0
    bodies: ArrayLike | None = None
    rows: int = field(init=False, repr=False)
    _index: Indices = field(init=False, repr=False)
    _normals: Array = field(init=False, repr=False)
    _matrix: Array | None = field(init=False, repr=False)
    _offsets: Array = field(init=False, repr=False)

    constant_jacobian = True

    def _read(self) -> None:
        normals = np.atleast_1d(real_array("normals of Planes", self.normals))
        self._set(normals=normals, offsets=real_array("offsets of Planes", self.offsets))
        if self.bodies is not None:
            self._set(bodies=body_indices("bodies of Planes", self.bodies))

    def _prepare(self, layout: Layout) -> None:
        index = chosen_bodies("bodies of Planes", self.bodies, layout)
        shape = (index.size, layout.dimension)
        normals = one_vector_each("normals of Planes", np.asarray(self.normals), *shape)
        flat = np.flatnonzero(~normals.any(axis=1))
        if flat.size:
            raise InputError(f"normals of Planes: row {int(flat[0])} is zero; a normal must not be zero")
        offsets = broadcast("offsets of Planes", np.asarray(self.offsets), shape[:1], "for each row")
        self._set(rows=index.size, _index=index, _normals=normals, _offsets=offsets)
        self._set(_matrix=self._spread(layout) if index.size * layout.dof <= LARGEST_MATRIX else None)

    def _spread(self, layout: Layout) -> Array:
        matrix = np.zeros((self.rows, layout.bodies, layout.dimension))
        matrix[np.arange(self.rows), self._index] = self._normals
        return matrix.reshape(self.rows, layout.dof)

    def value(self, q: Array) -> Array:
        """Return normal . q_i - offset, shape (..., rows)."""
        if self._matrix is not None:
            return q @ self._matrix.T - self._offsets
        x = q.reshape(*q.shape[:-1], -1, self.bound.dimension).take(self._index, axis=-2)
        value: Array = np.vecdot(x, self._normals) - self._offsets
        return value

    def jacobian(self, q: Array) -> Array:
        """Return the normals in their body's columns, shape (rows, dof)."""
        return self._spread(self.bound) if self._matrix is None else self._matrix

    def rows_table(self) -> Rows:
        """Return the rows as a table, in the order of ``value``."""
        return make_rows(PLANE, self._index, self._normals, self._offsets)

    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""
        return [f"plane under body {body}" for body in self._index]

    def invariance(self) -> Invariance:
        """Return the translations along all planes, and the rotations about an axis perpendicular to all planes."""
        return Invariance.of_vectors(self._normals, free=True)


class ConstraintStack(ConstraintFamily):
    """A stack of constraint families, the rows of each below those of the family before; without families, no rows.

    Parameters
    ----------
    families
        The constraint families, in the order of their rows.
    layout
        The layout they are bound to, or None.
    """

    def __init__(self, families: Sequence[ConstraintFamily] = (), layout: Layout | None = None) -> None:
        parts = (part.families if isinstance(part, ConstraintStack) else (part,) for part in families)
        self.families: tuple[ConstraintFamily, ...] = tuple(family for part in parts for family in part)
        self.layout = layout
        self.constant_jacobian = all(family.constant_jacobian for family in self.families)
        if layout is not None:
            self.rows = sum(family.rows for family in self.families)
            self.searched = any(family.searched for family in self.families)

    def __repr__(self) -> str:
        return f"ConstraintStack({list(self.families)})"

    def bind(self, layout: Layout) -> Self:
        """Return a stack with every family bound to ``layout``, or the stack itself if all of them are already."""
        families = [family.bind(layout) for family in self.families]
        if self.layout is not None and all(map(is_, families, self.families)) and not self.layout.differs(layout):
            return self
        bound = type(self)(families, layout)
        _ = bound.table  # refuses families that do not fit together
        return bound

    def value(self, q: Array) -> Array:
        """Return c, shape (..., rows), of configurations of shape (..., dof)."""
        if len(self.families) == 1:
            return self.families[0].value(q)
        empty = np.zeros((*q.shape[:-1], 0))
        return np.concatenate([empty, *(family.value(q) for family in self.families)], axis=-1)

    def jacobian(self, q: Array) -> Array:
        """Return the jacobian at one configuration, shape (rows, dof)."""
        if len(self.families) == 1:
            return self.families[0].jacobian(q)
        empty = np.zeros((0, q.size))
        return np.concatenate([empty, *(family.jacobian(q) for family in self.families)])

    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""
        return [label for family in self.families for label in family.labels()]

    def rows_table(self) -> Rows:
        """Return the fixed rows of all families as one table, in the order of ``value``.

        Rows of families that have no table are of kind `OTHER`, numbered from 0 through the whole stack.
        """
        return Rows._make(column.copy() for column in self.table)

    @cached_property
    def table(self) -> Rows:
        """The table of `rows_table`, read-only and shared."""
        dimension = self._bound.dimension
        tables = (family.rows_table() or other_rows(family.rows, dimension) for family in self.families)
        return Rows._make(map(frozen, stacked(list(tables), dimension)))

    def neighbours(self, q: Array, reach: float) -> Rows:
        """Return the table of all fixed rows, followed by the rows that searched families find.

        Parameters
        ----------
        q
            Configuration, shape (dof,).
        reach
            Largest value, a length, of the pairs that searched families find.
        """
        found = [family.neighbours(q, reach) for family in self.searched_families]
        return stacked([self.table, *found], self._bound.dimension)

    @cached_property
    def others(self) -> tuple[ConstraintFamily, ...]:
        """The families without a table, whose rows are of kind `OTHER`."""
        return tuple(family for family in self.families if family.rows_table() is None)

    @property
    def searched_families(self) -> tuple[SearchedFamily, ...]:
        """The families whose rows are found by search."""
        return tuple(family for family in self.families if isinstance(family, SearchedFamily) and family.searched)

    @property
    def _bound(self) -> Layout:
        if self.layout is None:
            raise AttributeError("not bound to a scene yet: pass it to deli.Scene(...), or call .bind(layout)")
        return self.layout

    def invariance(self) -> Invariance:
        """Return the rigid motions that leave every family unchanged."""
        return common_invariance(self.families, self.layout)
