"""Potentials of pairs of bodies: springs and Lennard-Jones, with exact hessians."""

from __future__ import annotations

import abc
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, body_pairs, broadcast, real_array
from deli.mechanics.family import ArrayFamily, Invariance, Layout, outer_blocks
from deli.mechanics.pairs import Pairs
from deli.mechanics.potentials import PotentialFamily
from deli.mechanics.tables import LENNARD_JONES, SPRING, Terms, make_terms

SMALLEST_LENGTH = 1e-150
"""Substitute for the length of a spring whose ends coincide; its force is zero, because their difference is zero."""


class PairPotential(ArrayFamily, PotentialFamily):
    """Sum over pairs of a function phi of the distance r = |q_i - q_j|, given through s = r^2."""

    _pairs: Pairs

    @abc.abstractmethod
    def _energy(self, square: Array) -> Array:
        """Return phi."""

    @abc.abstractmethod
    def _slope(self, square: Array) -> Array:
        """Return phi' / r."""

    @abc.abstractmethod
    def _curvature(self, square: Array) -> Array:
        """Return phi''."""

    def energy(self, q: Array) -> Any:
        """Return V, shape (...,), of configurations of shape (..., dof)."""
        x = self._pairs.separations(q)
        return self._energy(np.vecdot(x, x)).sum(-1)

    def gradient(self, q: Array) -> Array:
        """Return the gradient of V at one configuration, shape (dof,)."""
        x = self._pairs.separations(q)
        return self._pairs.gradient(self._slope(np.vecdot(x, x))[:, None] * x)

    def hessian(self, q: Array) -> Array:
        """Return V'' at one configuration, shape (dof, dof)."""
        x, across, along = self._second_derivatives(q)
        blocks = across[:, None, None] * self._pairs.identity + along[:, None, None] * outer_blocks(x)
        return self._pairs.hessian(blocks)

    def _second_derivatives(self, q: Array) -> tuple[Array, Array, Array]:
        # separations x, a and b of each pair's block a I + b x x^T
        x = self._pairs.separations(q)
        square = np.vecdot(x, x)
        slope, curvature = self._slope(square), self._curvature(square)
        if not square.all():  # no direction at coincident bodies: the same curvature in all of them
            apart = square > 0.0
            slope, square = np.where(apart, slope, curvature), np.where(apart, square, 1.0)
        return x, slope, (curvature - slope) / square

    def curvature(self, q: Array, v: Array) -> float:
        """Return v . V''(q) v at one configuration."""
        x, across, along = self._second_derivatives(q)
        parted = self._pairs.separations(v)
        return float(across @ np.vecdot(parted, parted) + along @ np.vecdot(x, parted) ** 2)

    def _terms(self, kind: int, strength: Array, length: Array) -> Terms:
        layout, pairs = self.bound, self._pairs
        return make_terms(
            layout.dof,
            layout.dimension,
            kind=np.full(pairs.count, kind),
            first=pairs.first,
            second=pairs.second,
            strength=strength,
            length=length,
        )

    def invariance(self) -> Invariance:
        """Return every translation and rotation."""
        return Invariance.everything(self.bound.dimension)


@dataclass(frozen=True, eq=False)
class Springs(PairPotential):
    """Linear springs, V(q) = sum_(i,j) k/2 (|q_i - q_j| - l)^2, in one dimension too.

    A spring between coincident bodies has an undefined direction, and no force.

    Parameters
    ----------
    pairs
        Pairs (i, j) of body numbers, counted from 0.
    stiffness
        k, one number or one for each pair.
    rest_length
        l >= 0, one number or one for each pair.

    Examples
    --------
    >>> import deli
    >>> spring = deli.Springs(pairs=[(0, 1)], stiffness=10.0, rest_length=5.0)
    >>> scene = deli.Scene(mass=1.0, position=[6.0, 0.0], momentum=[0.0, 0.0], potential=spring)
    >>> float(scene.potential.energy(scene.position))
    5.0
    >>> scene.potential.gradient(scene.position)
    array([ 10., -10.])
    """

    pairs: ArrayLike
    stiffness: ArrayLike
    rest_length: ArrayLike = 0.0
    _pairs: Pairs = field(init=False, repr=False)
    _stiffness: Array = field(init=False, repr=False)
    _rest_length: Array = field(init=False, repr=False)

    def _read(self) -> None:
        self._set(
            pairs=body_pairs("pairs of Springs", self.pairs),
            stiffness=real_array("stiffness of Springs", self.stiffness),
            rest_length=real_array("rest_length of Springs", self.rest_length),
        )
        if np.min(np.asarray(self.rest_length), initial=0.0) < 0:
            raise InputError(f"rest_length of Springs: found {self.rest_length}; it must be >= 0")

    def _prepare(self, layout: Layout) -> None:
        pairs = Pairs("pairs of Springs", np.asarray(self.pairs), layout)
        shape = (pairs.count,)
        stiffness = broadcast("stiffness of Springs", np.asarray(self.stiffness), shape, "for each pair")
        length = broadcast("rest_length of Springs", np.asarray(self.rest_length), shape, "for each pair")
        self._set(_pairs=pairs, _stiffness=stiffness, _rest_length=length)

    def terms_table(self) -> Terms:
        """Return the potential as a table of terms."""
        return self._terms(SPRING, self._stiffness, self._rest_length)

    def _energy(self, square: Array) -> Array:
        stretch: Array = np.sqrt(square) - self._rest_length
        return 0.5 * self._stiffness * stretch * stretch

    def _slope(self, square: Array) -> Array:
        length = np.maximum(np.sqrt(square), SMALLEST_LENGTH)
        slope: Array = self._stiffness - self._stiffness * self._rest_length / length
        return slope

    def _curvature(self, square: Array) -> Array:
        return self._stiffness


@dataclass(frozen=True, eq=False)
class LennardJones(PairPotential):
    """Lennard-Jones potential (8.10), V(q) = sum_(i<j) 4 epsilon ((sigma/r)^12 - (sigma/r)^6), r = |q_i - q_j|.

    Parameters
    ----------
    epsilon
        Depth of the well, one number or one for each pair.
    sigma
        Distance > 0 at which the potential is zero, one number or one for each pair.
    pairs
        Pairs (i, j) of body numbers, counted from 0; all pairs i < j if left out.

    Examples
    --------
    >>> import deli
    >>> potential = deli.LennardJones(epsilon=1.0, sigma=1.0)
    >>> scene = deli.Scene(mass=1.0, position=[0.0, 2.0 ** (1 / 6)], momentum=[0.0, 0.0], potential=potential)
    >>> round(float(scene.potential.energy(scene.position)), 6)  # the bottom of the well
    -1.0
    """

    epsilon: ArrayLike
    sigma: ArrayLike
    pairs: ArrayLike | None = None
    _pairs: Pairs = field(init=False, repr=False)
    _depth: Array = field(init=False, repr=False)
    _length: Array = field(init=False, repr=False)
    _square: Array = field(init=False, repr=False)

    def _read(self) -> None:
        epsilon = real_array("epsilon of LennardJones", self.epsilon)
        sigma = real_array("sigma of LennardJones", self.sigma)
        if np.min(sigma, initial=np.inf) <= 0:
            raise InputError(f"sigma of LennardJones: found {sigma}; it must be > 0")
        self._set(epsilon=epsilon, sigma=sigma)
        if self.pairs is not None:
            self._set(pairs=body_pairs("pairs of LennardJones", self.pairs))

    def _prepare(self, layout: Layout) -> None:
        chosen = None if self.pairs is None else np.asarray(self.pairs)
        pairs = Pairs("pairs of LennardJones", chosen, layout)
        shape = (pairs.count,)
        depth = broadcast("epsilon of LennardJones", np.asarray(self.epsilon), shape, "for each pair")
        sigma = broadcast("sigma of LennardJones", np.asarray(self.sigma), shape, "for each pair")
        self._set(_pairs=pairs, _depth=4.0 * depth, _length=sigma, _square=sigma * sigma)

    def terms_table(self) -> Terms:
        """Return the potential as a table of terms."""
        return self._terms(LENNARD_JONES, self._depth, self._length)

    def _energy(self, square: Array) -> Array:
        sixth = _cube(self._square / square)
        energy: Array = self._depth * sixth * (sixth - 1.0)
        return energy

    def _slope(self, square: Array) -> Array:
        sixth = _cube(self._square / square)
        slope: Array = self._depth * sixth * (6.0 - 12.0 * sixth) / square
        return slope

    def _curvature(self, square: Array) -> Array:
        sixth = _cube(self._square / square)
        curvature: Array = self._depth * sixth * (156.0 * sixth - 42.0) / square
        return curvature


def _cube(x: Array) -> Array:
    # numpy's power is slower than two products
    cube: Array = x * x * x
    return cube
