"""Potential families: energy, gradient and exact hessian from arrays, vectorized over bodies and pairs."""

from __future__ import annotations

import abc
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import TINY, Array, Indices, body_indices, one_vector_each, real_array
from deli.mechanics.family import (
    ArrayFamily,
    Family,
    Invariance,
    Layout,
    chosen_bodies,
    outer_blocks,
)
from deli.mechanics.tables import Terms, make_terms


class PotentialFamily(Family):
    """A potential energy V(q) with its derivatives, q the flat configuration of length dof."""

    constant_hessian: bool = False

    @abc.abstractmethod
    def energy(self, q: Array) -> Any:
        """Return V, shape (...,), of configurations of shape (..., dof)."""

    @abc.abstractmethod
    def gradient(self, q: Array) -> Array:
        """Return the gradient of V at one configuration, shape (dof,)."""

    @abc.abstractmethod
    def hessian(self, q: Array) -> Array | None:
        """Return V'' at one configuration, shape (dof, dof), or None if there is no hessian."""

    def curvature(self, q: Array, v: Array) -> float | None:
        """Return v . V''(q) v at one configuration, or None if there is no hessian."""
        hessian = self.hessian(q)
        return None if hessian is None else float(v @ hessian @ v)

    def terms_table(self) -> Terms | None:
        """Return the potential as a table of terms, or None for a potential without a table."""
        return None


@dataclass(frozen=True, eq=False)
class Gravity(ArrayFamily, PotentialFamily):
    """Uniform gravity, V(q) = -sum_i m_i a . q_i, with the scene's masses.

    Parameters
    ----------
    acceleration
        Vector of length dimension, e.g. ``[0, -9.8]``; a number in one dimension.

    Examples
    --------
    >>> import deli
    >>> gravity = deli.Gravity([0.0, -9.8])
    >>> ball = deli.Scene(mass=2.0, position=[0.0, 5.0], momentum=[0.0, 0.0], potential=gravity, dimension=2)
    >>> float(ball.potential.energy(ball.position))
    98.0
    """

    acceleration: ArrayLike
    _weight: Array = field(init=False, repr=False)

    constant_hessian = True

    def _read(self) -> None:
        self._set(acceleration=np.atleast_1d(real_array("acceleration of Gravity", self.acceleration)))

    def _prepare(self, layout: Layout) -> None:
        acceleration = np.asarray(self.acceleration)
        if acceleration.shape != (layout.dimension,):
            raise InputError(
                f"acceleration of Gravity: found shape {acceleration.shape}; the scene has dimension "
                f"{layout.dimension}: pass a vector of that length"
            )
        self._set(_weight=-layout.mass * np.tile(acceleration, layout.bodies))

    def energy(self, q: Array) -> Any:
        """Return V, shape (...,), of configurations of shape (..., dof)."""
        return q @ self._weight

    def gradient(self, q: Array) -> Array:
        """Return the gradient of V at one configuration, shape (dof,)."""
        return self._weight

    def hessian(self, q: Array) -> Array:
        """Return V'' at one configuration, shape (dof, dof)."""
        return np.zeros((q.size, q.size))

    def curvature(self, q: Array, v: Array) -> float:
        """Return v . V''(q) v at one configuration."""
        return 0.0

    def terms_table(self) -> Terms:
        """Return the potential as a table of terms."""
        return make_terms(self.bound.dof, self.bound.dimension, weight=self._weight)

    def invariance(self) -> Invariance:
        """Return the translations perpendicular to the acceleration, and the rotations about an axis along it."""
        return Invariance.of_vectors(np.asarray(self.acceleration)[None], free=True)


@dataclass(frozen=True, eq=False)
class RadialPowers(ArrayFamily, PotentialFamily):
    """Powers of the distance to a centre, V(q) = sum_i sum_k c_k |q_i - centre_i|^e_k.

    ``50/|q|^2`` (section 5.2) is ``coefficients=[50], exponents=[-2]`` and ``|q|^2 (|q|^2 - 1)^2`` (8.4) is
    ``coefficients=[1, -2, 1], exponents=[6, 4, 2]``. Negative exponents are singular at the centre.

    Parameters
    ----------
    coefficients, exponents
        c_k and e_k, lists of one length.
    bodies
        Body numbers, counted from 0; all bodies if left out.
    centre
        One point of length dimension, or one for each body; the origin if left out.

    Examples
    --------
    >>> import deli
    >>> repulsion = deli.RadialPowers(coefficients=[50.0], exponents=[-2.0])
    >>> scene = deli.Scene(mass=1.0, position=[3.0, 4.0], momentum=[0.0, 0.0], potential=repulsion, dimension=2)
    >>> float(scene.potential.energy(scene.position))
    2.0
    >>> scene.potential.gradient(scene.position).round(2)
    array([-0.48, -0.64])
    """

    coefficients: ArrayLike
    exponents: ArrayLike
    bodies: ArrayLike | None = None
    centre: ArrayLike = 0.0
    _index: Indices = field(init=False, repr=False)
    _centre: Array = field(init=False, repr=False)
    _first: Array = field(init=False, repr=False)
    _second: Array = field(init=False, repr=False)
    _halved: Array = field(init=False, repr=False)
    _identity: Array = field(init=False, repr=False)

    def _read(self) -> None:
        c = np.atleast_1d(real_array("coefficients of RadialPowers", self.coefficients))
        e = np.atleast_1d(real_array("exponents of RadialPowers", self.exponents))
        if c.ndim != 1 or c.shape != e.shape:
            raise InputError(
                f"RadialPowers: found coefficients of shape {c.shape} and exponents of shape {e.shape}; "
                "pass two lists of one length"
            )
        self._set(coefficients=c, exponents=e, centre=real_array("centre of RadialPowers", self.centre))
        self._set(_first=c * e, _second=c * e * (e - 2.0), _halved=0.5 * e - 1.0)
        if self.bodies is not None:
            self._set(bodies=body_indices("bodies of RadialPowers", self.bodies, distinct=True))

    def _prepare(self, layout: Layout) -> None:
        index = chosen_bodies("bodies of RadialPowers", self.bodies, layout)
        shape = (index.size, layout.dimension)
        centre = one_vector_each("centre of RadialPowers", np.asarray(self.centre), *shape)
        self._set(_index=index, _centre=centre, _identity=np.identity(layout.dimension))

    def _offsets(self, q: Array) -> tuple[Array, Array]:
        layout = self.bound
        x = q.reshape(*q.shape[:-1], layout.bodies, layout.dimension)
        if self.bodies is not None:
            x = x.take(self._index, axis=-2)
        x = x - self._centre
        return x, np.vecdot(x, x)

    def energy(self, q: Array) -> Any:
        """Return V, shape (...,), of configurations of shape (..., dof)."""
        _, square = self._offsets(q)
        return (square[..., None] ** (0.5 * np.asarray(self.exponents)) @ np.asarray(self.coefficients)).sum(-1)

    def gradient(self, q: Array) -> Array:
        """Return the gradient of V at one configuration, shape (dof,)."""
        x, square = self._offsets(q)
        slope = square[:, None] ** self._halved @ self._first
        forces: Array = slope[:, None] * x
        if self.bodies is not None:
            layout = self.bound
            total = np.zeros((layout.bodies, layout.dimension))
            total[self._index] = forces
            return total.reshape(-1)
        return forces.reshape(-1)

    def hessian(self, q: Array) -> Array:
        """Return V'' at one configuration, shape (dof, dof)."""
        layout = self.bound
        n, d = layout.bodies, layout.dimension
        x, across, along = self._second_derivatives(q)
        total = np.zeros((n, d, n, d))
        blocks = across[:, None, None] * self._identity + along[:, None, None] * outer_blocks(x)
        total[self._index, :, self._index, :] = blocks
        return total.reshape(n * d, n * d)

    def _second_derivatives(self, q: Array) -> tuple[Array, Array, Array]:
        # offsets x, a and b of each body's block a I + b x x^T
        x, square = self._offsets(q)
        powers = square[:, None] ** self._halved
        return x, powers @ self._first, (powers @ self._second) / np.maximum(square, TINY)

    def curvature(self, q: Array, v: Array) -> float:
        """Return v . V''(q) v at one configuration."""
        x, across, along = self._second_derivatives(q)
        moved = v.reshape(-1, self.bound.dimension)[self._index]
        return float(across @ np.vecdot(moved, moved) + along @ np.vecdot(x, moved) ** 2)

    def terms_table(self) -> Terms:
        """Return the potential as a table of terms."""
        count, powers = self._index.size, np.size(self.exponents)
        return make_terms(
            self.bound.dof,
            self.bound.dimension,
            body=np.repeat(self._index, powers),
            centre=np.repeat(self._centre, powers, axis=0),
            coefficient=np.tile(np.asarray(self.coefficients), count),
            exponent=np.tile(np.asarray(self.exponents), count),
        )

    def invariance(self) -> Invariance:
        """Return the rotations about an axis that contains all centres, and no translation."""
        return Invariance.of_vectors(self._centre, free=False)
