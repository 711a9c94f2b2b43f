"""The base of potentials and constraint families: binding to a scene's layout, and invariances."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Iterable
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from deli.mechanics.arrays import Array, Indices, check_range, frozen

ROTATION_PLANES: dict[int, list[tuple[int, ...]]] = {1: [], 2: [(0, 1)], 3: [(1, 2), (2, 0), (0, 1)]}
"""The two axes that each rotation mixes, by dimension; in 3-D in the order of the axes of rotation."""


@dataclasses.dataclass(frozen=True, eq=False)
class Layout:
    """The part of a scene on which its families depend.

    Parameters
    ----------
    dimension
        Dimension of space: 1, 2 or 3.
    mass
        Mass of each degree of freedom, shape (dof,).
    position
        Initial configuration, shape (dof,).
    """

    dimension: int
    mass: Array
    position: Array

    @property
    def dof(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.size

    @property
    def bodies(self) -> int:
        """Number of bodies, dof / dimension."""
        return self.mass.size // self.dimension

    def differs(self, other: Layout) -> bool:
        """Return whether dimension, bodies or masses differ from those of ``other``; positions do not count."""
        if self.mass is other.mass:
            return self.dimension != other.dimension
        return self.dimension != other.dimension or not np.array_equal(self.mass, other.mass)


@dataclasses.dataclass(frozen=True)
class Invariance:
    """Rigid motions of all bodies together that leave a family unchanged: True, False, or None for unknown.

    Parameters
    ----------
    translations
        One entry for each axis of space.
    rotations
        Rotations about the origin: none in 1-D, one entry in 2-D, one for each axis in 3-D.
    """

    translations: tuple[bool | None, ...]
    rotations: tuple[bool | None, ...]

    @classmethod
    def everything(cls, dimension: int) -> Invariance:
        """Return every translation and every rotation."""
        return cls((True,) * dimension, (True,) * len(ROTATION_PLANES[dimension]))

    @classmethod
    def nothing(cls, dimension: int) -> Invariance:
        """Return no translation and no rotation."""
        return cls((False,) * dimension, (False,) * len(ROTATION_PLANES[dimension]))

    @classmethod
    def of_vectors(cls, vectors: Array, free: bool) -> Invariance:
        """Return the invariances of a family built on fixed vectors (rows): directions if ``free``, else points.

        A field of directions is invariant under translations along an axis perpendicular to all of them; a set of
        points is invariant under no translation. Both are invariant under rotations about an axis that contains all
        vectors.
        """
        zero = vectors == 0.0
        dimension = vectors.shape[1]
        translations = tuple(bool(free and zero[:, axis].all()) for axis in range(dimension))
        if dimension < 3:
            return cls(translations, (bool(zero.all()),) * len(ROTATION_PLANES[dimension]))
        across = [[other for other in range(3) if other != axis] for axis in range(3)]
        return cls(translations, tuple(bool(zero[:, others].all()) for others in across))

    def __and__(self, other: Invariance) -> Invariance:
        """Return the motions that are in both."""
        return Invariance(
            tuple(map(both, self.translations, other.translations)),
            tuple(map(both, self.rotations, other.rotations)),
        )


def both(one: bool | None, other: bool | None) -> bool | None:
    """Return whether both statements hold: False if one is False, else None (unknown) if one is None."""
    if one is False or other is False:
        return False
    return None if one is None or other is None else True


class Family(abc.ABC):
    """A potential or a set of constraints, usable once it is bound to a layout.

    ``Scene`` binds its families; outside a scene, call ``bind`` with a ``Layout``.
    """

    layout: Layout | None

    @abc.abstractmethod
    def bind(self, layout: Layout) -> Self:
        """Return the family bound to ``layout``, whether or not it is bound to another one already."""

    @abc.abstractmethod
    def invariance(self) -> Invariance:
        """Return the rigid motions that leave this family unchanged."""


@dataclasses.dataclass(frozen=True, eq=False)
class ArrayFamily(Family):
    """A family that is a dataclass of arrays; ``_prepare`` derives the arrays of its formulas from the layout.

    Layouts that differ only in their position share a bound family, so derived arrays must not depend on the position.
    """

    layout: Layout | None = dataclasses.field(default=None, kw_only=True, repr=False)

    def __post_init__(self) -> None:
        self._read()
        if self.layout is not None:
            self._prepare(self.layout)

    @abc.abstractmethod
    def _read(self) -> None:
        """Check the fields that do not depend on the scene and turn them into read-only arrays."""

    @abc.abstractmethod
    def _prepare(self, layout: Layout) -> None:
        """Check the fields against the layout and derive the arrays of the formulas."""

    def bind(self, layout: Layout) -> Self:
        """Return a copy bound to ``layout``, or the family itself if it is bound to an equal one."""
        if self.layout is not None and not self.layout.differs(layout):
            return self
        return dataclasses.replace(self, layout=layout)

    @property
    def bound(self) -> Layout:
        """The layout this family is bound to."""
        if self.layout is None:
            raise AttributeError(self._unbound())
        return self.layout

    def _unbound(self) -> str:
        name = type(self).__name__
        return f"{name} is not bound to a scene yet: pass it to deli.Scene(...), or call {name}.bind(layout)"

    def __getattr__(self, name: str) -> Any:
        # Reached only where ordinary lookup fails: a derived field of a family that is not bound yet.
        if (name == "bound" or name in type(self).__dataclass_fields__) and self.__dict__.get("layout") is None:
            raise AttributeError(self._unbound())
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    def _set(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, frozen(value) if isinstance(value, np.ndarray) else value)


def outer_blocks(vectors: Array) -> NDArray[np.float64]:
    """Return the outer product of each row with itself, shape (rows, dimension, dimension)."""
    return vectors[:, :, None] * vectors[:, None, :]


def chosen_bodies(name: str, bodies: Any, layout: Layout) -> Indices:
    """Return the chosen body numbers, all of the layout's if ``bodies`` is None."""
    if bodies is None:
        return np.arange(layout.bodies)
    check_range(name, bodies, layout.bodies)
    chosen: Indices = bodies
    return chosen


def common_invariance(families: Iterable[Family], layout: Layout | None) -> Invariance:
    """Return the rigid motions that leave all families unchanged: every motion if there are no families."""
    if layout is None:
        raise AttributeError("not bound to a scene yet: pass it to deli.Scene(...), or call .bind(layout)")
    common = Invariance.everything(layout.dimension)
    for family in families:
        common = common & family.invariance()
    return common
