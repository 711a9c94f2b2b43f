"""A scene: masses, potential, constraints and an admissible initial state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, frozen, positive_array, real_array
from deli.mechanics.constraints import ConstraintFamily, ConstraintStack
from deli.mechanics.family import Layout
from deli.mechanics.initial import check_kinetic, check_momentum, check_position, check_potential
from deli.mechanics.parameters import check_parameters, check_text
from deli.mechanics.potential_sum import PotentialSum
from deli.mechanics.potentials import PotentialFamily
from deli.mechanics.symmetry import Conserved, conserved

SMALLEST_MASS = 1.0 / np.finfo(np.float64).max
TOLERANCE = 1e-9
"""Allowed violation of a constraint by an initial state, relative to the scene's length scale."""

Potentials = PotentialFamily | Sequence[PotentialFamily] | None
ConstraintFamilies = ConstraintFamily | Sequence[ConstraintFamily] | None


@dataclass(frozen=True, init=False, eq=False)
class Scene:
    """A mechanical system H(q, p) = p.M^-1 p / 2 + V(q) with g(q) >= 0 and f(q) = 0, and its initial state.

    Arrays are stored as read-only float64 copies, flat; ``dataclasses.replace`` makes checked variants.

    Parameters
    ----------
    mass
        One number, one for each body, or one for each degree of freedom; > 0.
    position, momentum
        Initial state, flat (dof,) or (bodies, dimension).
    potential
        A potential family, a list of them (summed), or None.
    unilateral, bilateral
        Constraint families g and f, each one family, a list of them (stacked), or None.
    dimension
        Dimension of space, 1, 2 or 3.
    name
        Name recorded with results.
    parameters
        Numbers, texts and flags recorded with results, by name; lists, arrays and tables of them too.

    Raises
    ------
    InputError
        If a number is not finite or a mass not positive, if lengths do not fit, if the initial position violates a
        constraint or the initial momentum F.M^-1 p = 0, if a supplied derivative is wrong, or if a parameter cannot be
        recorded.

    Examples
    --------
    >>> import deli
    >>> scene = deli.Scene(
    ...     mass=[1.0, 2.0],
    ...     position=[[0.0, 1.0], [3.0, 1.0]],
    ...     momentum=[[1.0, 0.0], [0.0, 0.0]],
    ...     potential=deli.Gravity([0.0, -9.8]),
    ...     unilateral=[deli.SpheresApart(pairs=[(0, 1)], distance=1.0), deli.Planes(normals=[0.0, 1.0], offsets=0.5)],
    ...     dimension=2,
    ... )
    >>> scene.bodies, scene.dof
    (2, 4)
    >>> scene.unilateral.value(scene.position)
    array([2. , 0.5, 0.5])
    >>> scene.symmetry.linear
    (True, False)
    """

    mass: Array
    position: Array
    momentum: Array
    potential: PotentialSum
    unilateral: ConstraintStack
    bilateral: ConstraintStack
    dimension: int
    name: str
    parameters: dict[str, Any]

    def __init__(
        self,
        mass: ArrayLike,
        position: ArrayLike,
        momentum: ArrayLike,
        potential: Potentials = None,
        unilateral: ConstraintFamilies = None,
        bilateral: ConstraintFamilies = None,
        dimension: int = 1,
        name: str = "custom",
        parameters: Mapping[str, Any] | None = None,
    ) -> None:
        if isinstance(dimension, bool) or dimension not in (1, 2, 3):
            raise InputError(f"dimension: found {dimension!r}; it must be 1, 2 or 3")
        q = _flat("position", position, dimension)
        p = _flat("momentum", momentum, dimension)
        if not q.size:
            raise InputError("position: found no entries; a scene needs at least one body")
        if p.size != q.size:
            raise InputError(f"momentum: found {p.size} entries, position has {q.size}; pass as many")
        layout = Layout(int(dimension), _masses(mass, q.size // dimension, dimension), q)
        self._set(mass=layout.mass, position=q, momentum=p, dimension=layout.dimension)
        given = dict(parameters or {})
        check_parameters("parameters", given)
        self._set(name=check_text("name", str(name)), parameters=given)
        self._set(potential=_joined("potential", potential, PotentialFamily, PotentialSum).bind(layout))
        self._set(unilateral=_joined("unilateral", unilateral, ConstraintFamily, ConstraintStack).bind(layout))
        self._set(bilateral=_joined("bilateral", bilateral, ConstraintFamily, ConstraintStack).bind(layout))
        check_potential(self.potential, q)
        check_kinetic(p, self.mass)
        check_position("unilateral", self.unilateral, q, TOLERANCE * self.length_scale)
        check_position("bilateral", self.bilateral, q, TOLERANCE * self.length_scale)
        check_momentum(self.bilateral, q, p / self.mass, TOLERANCE)

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def dof(self) -> int:
        """Number of degrees of freedom."""
        return self.position.size

    @property
    def bodies(self) -> int:
        """Number of bodies, dof / dimension."""
        return self.position.size // self.dimension

    @cached_property
    def length_scale(self) -> float:
        """Largest entry of the initial position in absolute value, 1.0 if that is 0."""
        return float(np.abs(self.position).max()) or 1.0

    @cached_property
    def symmetry(self) -> Conserved:
        """Components of the total momentum that the scene conserves."""
        layout = Layout(self.dimension, self.mass, self.position)
        return conserved(layout, (self.potential, self.unilateral, self.bilateral))


def _flat(name: str, value: ArrayLike, dimension: int) -> Array:
    array = np.atleast_1d(real_array(name, value))
    fits = array.shape[-1] == dimension if array.ndim == 2 else array.ndim == 1 and array.size % dimension == 0
    if not fits:
        raise InputError(
            f"{name}: found shape {array.shape}; in dimension {dimension} pass (bodies, {dimension}), or a flat vector "
            f"whose length is a multiple of {dimension}"
        )
    return frozen(array.reshape(-1))


def _masses(value: ArrayLike, bodies: int, dimension: int) -> Array:
    array = positive_array("mass", value)
    if np.min(array, initial=np.inf) < SMALLEST_MASS:
        raise InputError(f"mass: found {float(np.min(array))!r}; 1 / mass must be finite, so >= {SMALLEST_MASS:.3g}")
    if array.size == 1:
        return frozen(np.full(bodies * dimension, array.item()))
    if array.shape == (bodies,):
        return frozen(np.repeat(array, dimension))
    if array.size == bodies * dimension and array.shape in {(array.size,), (bodies, dimension)}:
        return frozen(array.reshape(-1))
    raise InputError(
        f"mass: found shape {array.shape}; pass one number, one for each of {bodies} bodies, or one for each of "
        f"{bodies * dimension} degrees of freedom"
    )


def _joined(name: str, value: Any, kind: type[Any], join: type[Any]) -> Any:
    if isinstance(value, join):
        return value
    if value is None:
        return join()
    listed = list(value) if isinstance(value, list | tuple) else [value]
    for family in listed:
        if not isinstance(family, kind):
            plain = "deli.Potential(energy=...)" if kind is PotentialFamily else "deli.Constraints(value=...)"
            raise InputError(
                f"{name}: found {family!r}; pass a family such as {plain} for plain functions, a list of them, or None"
            )
    return join(listed)
