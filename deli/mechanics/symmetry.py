"""Linear and angular momentum, and their components that a scene conserves (Noether, Theorem 5.1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from deli.mechanics.arrays import Array
from deli.mechanics.family import ROTATION_PLANES, Family, Layout, both, common_invariance


class Bodies(Protocol):
    """Bodies in a space, such as a `Scene`."""

    @property
    def bodies(self) -> int:
        """Number of bodies."""

    @property
    def dimension(self) -> int:
        """Dimension of space."""


@dataclass(frozen=True)
class Conserved:
    """Conservation of the components of a scene's total momentum: True, False, or None for unknown.

    Parameters
    ----------
    linear
        One entry for each axis.
    angular
        About the origin: none in 1-D, one entry in 2-D, one for each axis in 3-D.
    """

    linear: tuple[bool | None, ...]
    angular: tuple[bool | None, ...]


def conserved(layout: Layout, families: Iterable[Family]) -> Conserved:
    """Return the conserved components, from the invariances of potentials and constraints.

    The kinetic energy is always invariant under translations. It is invariant under a rotation if each body's mass is
    the same along both axes that the rotation mixes.
    """
    common = common_invariance(families, layout)
    mass = layout.mass.reshape(layout.bodies, layout.dimension)
    isotropic = [bool((mass[:, i] == mass[:, j]).all()) for i, j in ROTATION_PLANES[layout.dimension]]
    return Conserved(common.translations, tuple(map(both, common.rotations, isotropic)))


def linear_momentum(scene: Bodies, p: Array) -> Array:
    """Return sum_i p_i, shape (..., dof) -> (..., dimension)."""
    total: Array = p.reshape(*p.shape[:-1], scene.bodies, scene.dimension).sum(axis=-2)
    return total


def angular_momentum(scene: Bodies, q: Array, p: Array) -> Array | None:
    """Return sum_i q_i x p_i about the origin: shape (...,) in 2-D, (..., 3) in 3-D, None in 1-D."""
    if scene.dimension == 1:
        return None
    shape = (*q.shape[:-1], scene.bodies, scene.dimension)
    x, y = q.reshape(shape), p.reshape(shape)
    if scene.dimension == 3:
        total: Array = np.cross(x, y).sum(axis=-2)
        return total
    flat: Array = (x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]).sum(axis=-1)
    return flat
