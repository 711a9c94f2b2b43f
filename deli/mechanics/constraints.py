"""Constraint families: values and jacobians, one row a constraint, vectorized over rows.

The same families serve both sides: unilateral rows demand value >= 0, bilateral rows value = 0.
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, Indices, body_indices, broadcast, one_vector_each, real_array
from deli.mechanics.family import ArrayFamily, Family, Invariance, Layout, chosen_bodies, common_invariance


class ConstraintFamily(Family):
    """Scalar constraints c(q) with their jacobian, q the flat configuration of length dof."""

    constant_jacobian: bool = False
    rows: int

    @abc.abstractmethod
    def value(self, q: Array) -> Array:
        """Return c, shape (..., rows), of configurations of shape (..., dof)."""

    @abc.abstractmethod
    def jacobian(self, q: Array) -> Array:
        """Return the jacobian at one configuration, shape (rows, dof)."""

    @abc.abstractmethod
    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""


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
        The body of each row, counted from 0; a body may have several planes. Each body once if left out.
    """

    normals: ArrayLike
    offsets: ArrayLike = 0.0
    bodies: ArrayLike | None = None
    rows: int = field(init=False, repr=False)
    _index: Indices = field(init=False, repr=False)
    _normals: Array = field(init=False, repr=False)
    _matrix: Array = field(init=False, repr=False)
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
        matrix = np.zeros((index.size, layout.bodies, layout.dimension))
        matrix[np.arange(index.size), index] = normals
        self._set(rows=index.size, _index=index, _normals=normals, _offsets=offsets)
        self._set(_matrix=matrix.reshape(index.size, layout.dof))

    def value(self, q: Array) -> Array:
        """Return normal . q_i - offset, shape (..., rows)."""
        return q @ self._matrix.T - self._offsets

    def jacobian(self, q: Array) -> Array:
        """Return the normals in their body's columns, shape (rows, dof)."""
        return self._matrix

    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""
        return [f"plane under body {body}" for body in self._index]

    def invariance(self) -> Invariance:
        """Translations along all planes; rotations about an axis to which all are perpendicular."""
        return Invariance.of_vectors(self._normals, free=True)


class ConstraintStack(ConstraintFamily):
    """Several families, row under row; of none, no rows.

    Parameters
    ----------
    families
        The constraint families, in the order of their rows.
    layout
        The layout they are bound to, or None.
    """

    def __init__(self, families: Sequence[ConstraintFamily] = (), layout: Layout | None = None) -> None:
        self.families = tuple(families)
        self.layout = layout
        self.constant_jacobian = all(family.constant_jacobian for family in self.families)
        if layout is not None:
            self.rows = sum(family.rows for family in self.families)

    def __repr__(self) -> str:
        return f"ConstraintStack({list(self.families)})"

    def bind(self, layout: Layout) -> Self:
        """Return the stack with every family bound to ``layout``."""
        return type(self)([family.bind(layout) for family in self.families], layout)

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

    def invariance(self) -> Invariance:
        """Return the rigid motions that leave every family unchanged."""
        return common_invariance(self.families, self.layout)
