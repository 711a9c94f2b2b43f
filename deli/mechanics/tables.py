"""Scenes as arrays: constraint rows and potential terms in the form that compiled code reads.

The arrays of a table are int64 or float64 and C-contiguous. They are copies, so that changing them leaves the scene
unchanged.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np

from deli.errors import InputError
from deli.mechanics.arrays import Array, Indices
from deli.mechanics.vectors import directions, lengths, nearest_images

PLANE, PAIR, POINT, OTHER = 0, 1, 2, 3
"""Kinds of a constraint row."""

SPRING, LENNARD_JONES = 0, 1
"""Kinds of a pair term."""


class Rows(NamedTuple):
    """Scalar constraints, one an entry, each on one body or on two.

    With x the separation of the row's bodies (`PAIR`: q_first - q_second, its nearest periodic image) or of its
    body from a point (`POINT`: q_first - vector), the values are

    - `PLANE`: vector . q_first - target, gradient `vector` at the body;
    - `PAIR` and `POINT`: sign (|x| - target), gradient sign x/|x| at the first body, minus that at the second;
    - `OTHER`: entry `first` of the values of a family of Python functions, with a full gradient.

    Attributes
    ----------
    kind, first, second : (rows,) int64 arrays
        Kind, and numbers of the bodies; `second` is -1 in a row on one body.
    vector : (rows, dimension) array
        Normal of a plane, or centre of a point; zero otherwise.
    target, sign : (rows,) arrays
    period : (dimension,) array
        Length of a periodic box along each axis, 0 where it is not periodic.
    """

    kind: Indices
    first: Indices
    second: Indices
    vector: Annotated[Array, 2]
    target: Array
    sign: Array
    period: Array


class Terms(NamedTuple):
    """A potential energy: constant forces, pair terms, and powers of the distance to a point.

    ``V(q) = weight . q + sum of pair terms phi(|q_first - q_second|) + sum_k c_k |q_body - centre|^e_k``, where phi is
    ``strength/2 (r - length)^2`` for a `SPRING` and ``strength ((length/r)^12 - (length/r)^6)`` for a
    `LENNARD_JONES` pair.

    Attributes
    ----------
    weight : (dof,) array
    kind, first, second : (pairs,) int64 arrays
    strength, length : (pairs,) arrays
    body : (powers,) int64 array
    centre : (powers, dimension) array
    coefficient, exponent : (powers,) arrays
        One entry for each body and power.
    """

    weight: Array
    kind: Indices
    first: Indices
    second: Indices
    strength: Array
    length: Array
    body: Indices
    centre: Annotated[Array, 2]
    coefficient: Array
    exponent: Array


def make_rows(kind: int, first: Any, vector: Any, target: Any, second: Any = -1, sign: float = 1.0) -> Rows:
    """Return rows of one kind without a period; `second` and `vector` may be the same for all rows."""
    first = np.array(first, dtype=np.int64)
    count, vector = first.size, np.asarray(vector, dtype=np.float64)
    return Rows(
        kind=np.full(count, kind, dtype=np.int64),
        first=first,
        second=np.array(np.broadcast_to(second, (count,)), dtype=np.int64, order="C"),
        vector=np.array(np.broadcast_to(vector, (count, vector.shape[-1])), order="C"),
        target=np.array(np.broadcast_to(target, (count,)), dtype=np.float64, order="C"),
        sign=np.full(count, sign),
        period=np.zeros(vector.shape[-1]),
    )


def other_rows(count: int, dimension: int) -> Rows:
    """Return `count` rows of kind `OTHER`, numbered from 0."""
    return make_rows(OTHER, np.arange(count), np.zeros(dimension), 0.0)


def stacked(tables: Sequence[Rows], dimension: int) -> Rows:
    """Return the tables' rows one after the other, rows of kind `OTHER` numbered anew from 0.

    Raises
    ------
    InputError
        If the pairs of two tables have different periods: a table has one period.
    """
    parts = [other_rows(0, dimension), *tables]
    *columns, _ = zip(*parts, strict=True)
    kind, first, second, vector, target, sign = (np.concatenate(column) for column in columns)
    first[kind == OTHER] = np.arange((kind == OTHER).sum())
    periods = [table.period for table in tables if (table.kind == PAIR).any() or table.period.any()]
    for period in periods[1:]:
        if not np.array_equal(period, periods[0]):
            raise InputError(
                f"period: found pairs with period {periods[0].tolist()} beside pairs with period {period.tolist()}; "
                "give all families of pairs on one side of a scene the same period"
            )
    period = (periods[0] if periods else parts[0].period).copy()
    return Rows(kind, first, second, vector, target, sign, period)


def make_terms(dof: int, dimension: int, **columns: Any) -> Terms:
    """Return terms with the given columns; the others are zero forces, no pairs, no powers."""
    empty: dict[str, Any] = {name: np.zeros(0) for name in Terms._fields}
    empty |= {"weight": np.zeros(dof), "centre": np.zeros((0, dimension))}
    whole = ("kind", "first", "second", "body")
    arrays: dict[str, Any] = {
        name: np.array(value, np.int64 if name in whole else np.float64, order="C")
        for name, value in (empty | columns).items()
    }
    return Terms(**arrays)


def summed(tables: Sequence[Terms], dof: int, dimension: int) -> Terms:
    """Return the terms of all tables: weights added, pairs and powers one after the other."""
    parts = [make_terms(dof, dimension), *tables]
    weights, *columns = zip(*parts, strict=True)
    return Terms(np.sum(weights, axis=0), *(np.concatenate(column) for column in columns))


def table_values(rows: Rows, q: Array) -> Array:
    """Return the value of each row at one configuration, shape (rows,); nan for rows of kind `OTHER`."""
    bodies = q.reshape(-1, rows.vector.shape[1])
    values = np.full(rows.kind.size, np.nan)
    plane, apart = rows.kind == PLANE, _measures_distance(rows)
    if plane.any():
        values[plane] = np.vecdot(rows.vector[plane], bodies[rows.first[plane]]) - rows.target[plane]
    if apart.any():
        values[apart] = rows.sign[apart] * (lengths(_separations(rows, bodies, apart)) - rows.target[apart])
    return values


def table_rates(rows: Rows, q: Array, v: Array) -> Array:
    """Return gradient . v of each row, v of shape (dof,); nan for rows of kind `OTHER`."""
    bodies, velocities = (x.reshape(-1, rows.vector.shape[1]) for x in (q, v))
    rates = np.full(rows.kind.size, np.nan)
    plane, apart = rows.kind == PLANE, _measures_distance(rows)
    rates[plane] = np.vecdot(rows.vector[plane], velocities[rows.first[plane]])
    relative = velocities[rows.first[apart]]
    relative[rows.kind[apart] == PAIR] -= velocities[rows.second[rows.kind == PAIR]]
    rates[apart] = rows.sign[apart] * np.vecdot(directions(_separations(rows, bodies, apart)), relative)
    return rates


def table_norms(rows: Rows, q: Array) -> Array:
    """Return the length of each row's gradient in all degrees of freedom; nan for rows of kind `OTHER`.

    That is the length of a plane's normal, sqrt(2) for a pair, 1 for a point, and 0 where there is no direction.
    """
    bodies = q.reshape(-1, rows.vector.shape[1])
    norms = np.full(rows.kind.size, np.nan)
    plane, apart = rows.kind == PLANE, _measures_distance(rows)
    norms[plane] = lengths(rows.vector[plane])
    if not apart.any():
        return norms
    distinct = _separations(rows, bodies, apart).any(axis=1)
    norms[apart] = np.where(distinct, np.where(rows.kind[apart] == PAIR, np.sqrt(2.0), 1.0), 0.0)
    return norms


def _measures_distance(rows: Rows) -> np.ndarray:
    return (rows.kind == PAIR) | (rows.kind == POINT)


def _separations(rows: Rows, bodies: Array, chosen: np.ndarray) -> Array:
    x = bodies[rows.first[chosen]] - rows.vector[chosen]
    pair = rows.kind[chosen] == PAIR
    x[pair] = nearest_images(x[pair] - bodies[rows.second[rows.kind == PAIR]], rows.period)
    return x
