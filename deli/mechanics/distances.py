"""Constraints on distances: spheres apart, inside and outside a sphere, rods between bodies and from pivots."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, Indices, broadcast, real_array
from deli.mechanics.constraints import SearchedFamily
from deli.mechanics.distance_rows import PairDistances, PointDistances
from deli.mechanics.family import Invariance, Layout
from deli.mechanics.search import closest_pair, pairs_within
from deli.mechanics.tables import PAIR, Rows, make_rows, table_values
from deli.mechanics.vectors import nearest_images

SEARCH_ABOVE = 200
"""Largest number of bodies of which all pairs are listed; pairs among more bodies are found by search."""


@dataclass(frozen=True, eq=False)
class SpheresApart(PairDistances, SearchedFamily):
    """Spheres that must not overlap, |q_i - q_j| - distance (8.5, 8.7, 8.9); as unilateral constraints.

    In a periodic box |q_i - q_j| is the distance to the nearest image, |x - period round(x/period)| with
    x = q_i - q_j; positions need not stay inside the box. With ``pairs=None``, one distance and more than SEARCH_ABOVE
    bodies, the pairs are not listed: the family is ``searched``, has no fixed rows, and finds near pairs with
    ``neighbours``.

    Parameters
    ----------
    pairs
        Pairs (i, j) of body numbers, counted from 0; None for all pairs i < j.
    distance
        Sum of the radii > 0, one number or one for each pair.
    period
        Length of a periodic box, one number or one for each axis, at least twice the largest distance; 0 along an
        axis that is not periodic, None if no axis is periodic.

    Examples
    --------
    >>> import deli
    >>> contacts = deli.SpheresApart(pairs=[(0, 1), (1, 2)], distance=1.0)
    >>> scene = deli.Scene(mass=1.0, position=[0.0, 1.0, 2.5], momentum=[1.0, 0.0, 0.0], unilateral=contacts)
    >>> scene.unilateral.value(scene.position)
    array([0. , 0.5])

    In a periodic box of length 10 the nearest images count:

    >>> contacts = deli.SpheresApart(pairs=None, distance=0.5, period=10.0)
    >>> scene = deli.Scene(mass=1.0, position=[0.5, 9.5], momentum=[0.0, 0.0], unilateral=contacts)
    >>> scene.unilateral.value(scene.position)
    array([0.5])
    """

    distance: ArrayLike
    period: ArrayLike | None = None
    searched: bool = field(init=False, repr=False)
    _period: Array = field(init=False, repr=False)

    _target = "distance"
    _word = "gap"

    def _read(self) -> None:
        super()._read()
        if self.period is not None:
            self._set(period=real_array("period of SpheresApart", self.period))

    def _prepare(self, layout: Layout) -> None:
        given = np.zeros(()) if self.period is None else np.asarray(self.period)
        period = broadcast("period of SpheresApart", given, (layout.dimension,), "for each axis")
        largest = float(np.max(np.asarray(self.distance), initial=0.0))
        wrong = (period != 0.0) & (period < 2.0 * largest)
        if wrong.any():
            raise InputError(
                f"period of SpheresApart: found {float(period[wrong][0])}; it must be at least twice the distance "
                f"{largest}, so that no sphere touches two images of another, or 0 along an axis that is not periodic"
            )
        searched = self.pairs is None and np.size(self.distance) == 1 and layout.bodies > SEARCH_ABOVE
        self._set(_period=period, searched=searched)
        if searched:
            self._set(rows=0)
        else:
            super()._prepare(layout)

    def value(self, q: Array) -> Array:
        """Return |q_i - q_j| - distance, shape (..., rows)."""
        self._check_listed("value")
        return super().value(q)

    def jacobian(self, q: Array) -> Array:
        """Return unit vectors, + at body i and - at body j, shape (rows, dof)."""
        self._check_listed("jacobian")
        return super().jacobian(q)

    def labels(self) -> list[str]:
        """Name each fixed row for messages; bodies are counted from 0."""
        return [] if self.searched else super().labels()

    def rows_table(self) -> Rows:
        """Return the fixed rows as a table, in the order of ``value``; a searched family has none."""
        none = np.zeros(0, dtype=np.intp)
        return self._table(none, none) if self.searched else super().rows_table()._replace(period=self._period.copy())

    def neighbours(self, q: Array, reach: float) -> Rows:
        """Return the pairs i < j with |q_i - q_j| - distance <= reach, in lexicographic order.

        Parameters
        ----------
        q
            Configuration, shape (dof,).
        reach
            A length; no pair has a value below -distance.
        """
        bodies = q.reshape(-1, self.bound.dimension)
        first, second = pairs_within(bodies, self._one_distance() + reach, self._period)
        rows = self._table(first, second)
        near = table_values(rows, q) <= reach
        return rows if near.all() else self._table(first[near], second[near])

    def nearest(self, q: Array) -> Rows:
        """Return the pair i < j with the smallest |q_i - q_j| at one configuration, none for one body."""
        return self._table(*closest_pair(q.reshape(-1, self.bound.dimension), self._period))

    def least(self, q: Array) -> float:
        """Return the smallest |q_i - q_j| - distance over all pairs at one configuration, inf if there is no pair."""
        return float(np.min(table_values(self.nearest(q), q), initial=np.inf))

    def invariance(self) -> Invariance:
        """Return every translation, and the rotations that mix no periodic axis with another."""
        everything = Invariance.everything(self.bound.dimension)
        return Invariance(everything.translations, Invariance.of_vectors(np.diag(self._period), free=True).rotations)

    def _separations(self, q: Array) -> Array:
        return nearest_images(super()._separations(q), self._period)

    def _table(self, first: Indices, second: Indices) -> Rows:
        nowhere = np.zeros(self.bound.dimension)
        rows = make_rows(PAIR, first, nowhere, self._one_distance(), second=second)
        return rows._replace(period=self._period.copy())

    def _one_distance(self) -> float:
        distance = np.asarray(self.distance)
        if self.pairs is not None or distance.size != 1:
            raise InputError("SpheresApart: only all pairs (pairs=None) at one distance are searched; use value")
        return float(distance.item())

    def _check_listed(self, method: str) -> None:
        if self.searched:
            raise InputError(
                f"{method} of SpheresApart: all pairs of {self.bound.bodies} bodies are not listed (more than "
                f"{SEARCH_ABOVE} bodies); find the near ones with neighbours(q, reach), the smallest gap with least(q)"
            )


@dataclass(frozen=True, eq=False)
class Rods(PairDistances):
    """Rigid rods between bodies, |q_i - q_j| - length (8.8); as bilateral constraints.

    Parameters
    ----------
    pairs
        Pairs (i, j) of body numbers, counted from 0; None for all pairs i < j.
    length
        Length > 0 of the rod, one number or one for each pair.

    Examples
    --------
    >>> import deli
    >>> rod = deli.Rods(pairs=[(0, 1)], length=5.0)
    >>> scene = deli.Scene(mass=1.0, position=[[0.0, 0.0], [3.0, 4.0]], momentum=[0.0] * 4, bilateral=rod, dimension=2)
    >>> scene.bilateral.value(scene.position)
    array([0.])
    >>> scene.bilateral.jacobian(scene.position)
    array([[-0.6, -0.8,  0.6,  0.8]])
    """

    length: ArrayLike

    _target = "length"
    _word = "rod"


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

    Examples
    --------
    >>> import deli
    >>> container = deli.SpheresInside(radius=6.0)
    >>> scene = deli.Scene(mass=1.0, position=[3.0, 4.0], momentum=[0.0, 0.0], unilateral=container, dimension=2)
    >>> scene.unilateral.value(scene.position)
    array([1.])
    """

    radius: ArrayLike
    centre: ArrayLike = 0.0

    _point = "centre"
    _target = "radius"
    _word = "container gap"
    _sign = -1.0


@dataclass(frozen=True, eq=False)
class SpheresOutside(PointDistances):
    """Bodies outside a fixed sphere, |q_i - centre_i| - radius; as unilateral constraints.

    In the plane the sphere is a circle: the cross-section of a cylinder.

    Parameters
    ----------
    radius
        Smallest distance > 0 of a body's centre, one number or one for each row.
    centre
        One point of length dimension or one for each row; the origin if left out.
    bodies
        The body of each row, counted from 0; each body once if left out.

    Examples
    --------
    >>> import deli
    >>> obstacle = deli.SpheresOutside(radius=2.0)
    >>> scene = deli.Scene(mass=1.0, position=[3.0, 4.0], momentum=[0.0, 0.0], unilateral=obstacle, dimension=2)
    >>> scene.unilateral.value(scene.position)
    array([3.])
    """

    radius: ArrayLike
    centre: ArrayLike = 0.0

    _point = "centre"
    _target = "radius"
    _word = "obstacle gap"
    _sign = 1.0


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

    Examples
    --------
    >>> import deli
    >>> rod = deli.AnchoredRods(pivots=[0.0, 5.0], length=5.0)
    >>> pendulum = deli.Scene(mass=1.0, position=[3.0, 1.0], momentum=[0.0, 0.0], bilateral=rod, dimension=2)
    >>> pendulum.bilateral.value(pendulum.position)
    array([0.])
    >>> pendulum.bilateral.jacobian(pendulum.position)
    array([[ 0.6, -0.8]])
    """

    pivots: ArrayLike
    length: ArrayLike

    _point = "pivots"
    _target = "length"
    _word = "anchored rod"
    _sign = 1.0
