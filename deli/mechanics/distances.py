"""Constraints on distances: spheres apart, spheres inside a sphere, rods between bodies and from pivots."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import (
    TINY,
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


@dataclass(frozen=True, eq=False)
class PairDistances(ArrayFamily, ConstraintFamily):
    """Distances of pairs of bodies less a target, |q_i - q_j| - target.

    Where two bodies are at one place the direction is undefined and the jacobian's row is zero.
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
        return lengths(self._pairs.separations(q)) - self._targets

    def jacobian(self, q: Array) -> Array:
        """Return unit vectors, + at body i and - at body j, shape (rows, dof)."""
        return self._pairs.jacobian(directions(self._pairs.separations(q)))

    def labels(self) -> list[str]:
        """Name each row for messages; bodies are counted from 0."""
        joined = zip(self._pairs.first, self._pairs.second, strict=True)
        return [f"{self._word} body {i} - body {j}" for i, j in joined]

    def invariance(self) -> Invariance:
        """Every translation and rotation."""
        return Invariance.everything(self.bound.dimension)


@dataclass(frozen=True, eq=False)
class SpheresApart(PairDistances):
    """Spheres that must not overlap, |q_i - q_j| - distance (8.5, 8.7, 8.9); as unilateral constraints.

    Parameters
    ----------
    pairs
        Pairs (i, j) of body numbers, counted from 0; None for all pairs i < j.
    distance
        Sum of the radii > 0, one number or one for each pair.
    """

    distance: ArrayLike

    _target = "distance"
    _word = "gap"


@dataclass(frozen=True, eq=False)
class Rods(PairDistances):
    """Rigid rods between bodies, |q_i - q_j| - length (8.8); as bilateral constraints.

    Parameters
    ----------
    pairs
        Pairs (i, j) of body numbers, counted from 0; None for all pairs i < j.
    length
        Length > 0 of the rod, one number or one for each pair.
    """

    length: ArrayLike

    _target = "length"
    _word = "rod"


@dataclass(frozen=True, eq=False)
class PointDistances(ArrayFamily, ConstraintFamily):
    """Distances of bodies from fixed points less a target, sign (|q_i - point_i| - target).

    At the point itself the direction is undefined and the jacobian's row is zero.
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

    def invariance(self) -> Invariance:
        """Rotations about an axis that contains all points; no translation."""
        return Invariance.of_vectors(self._points, free=False)


@dataclass(frozen=True, eq=False)
class SpheresInside(PointDistances):
    """Bodies inside a sphere, radius - |q_i - centre_i| (section 5.2, 8.11); as unilateral constraints.

    Parameters
    ----------
    radius
        Largest distance > 0 of a body's centre, one number or one for each row.
    centre
        One point of length dimension or one for each row; the origin if left out.
    bodies
        The body of each row, counted from 0; each body once if left out.
    """

    radius: ArrayLike
    centre: ArrayLike = 0.0

    _point = "centre"
    _target = "radius"
    _word = "container gap"
    _sign = -1.0


@dataclass(frozen=True, eq=False)
class AnchoredRods(PointDistances):
    """Rigid rods from fixed pivots, |q_i - pivot_i| - length (8.6); as bilateral constraints.

    Parameters
    ----------
    pivots
        One point of length dimension or one for each row.
    length
        Length > 0 of the rod, one number or one for each row.
    bodies
        The body of each row, counted from 0; each body once if left out.
    """

    pivots: ArrayLike
    length: ArrayLike

    _point = "pivots"
    _target = "length"
    _word = "anchored rod"
    _sign = 1.0


def lengths(x: Array) -> Array:
    """Return the euclidean length of each vector, shape (..., dimension) -> (...)."""
    result: Array = np.sqrt(np.vecdot(x, x))
    return result


def directions(x: Array) -> Array:
    """Return each row divided by its length, zero where the length is zero."""
    result: Array = x / np.maximum(lengths(x), TINY)[:, None]
    return result
