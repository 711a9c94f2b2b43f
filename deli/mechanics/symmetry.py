"""Momentum: linear, angular, and which components a scene conserves (Noether, Theorem 5.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from deli.mechanics.arrays import Array

if TYPE_CHECKING:
    from deli.mechanics.scene import Scene


@dataclass(frozen=True)
class Conserved:
    """Which components of the total momentum a scene conserves.

    Parameters
    ----------
    linear
        One entry for each axis.
    angular
        About the origin: none in 1-D, one entry in 2-D, one for each axis in 3-D.
    """

    linear: tuple[bool, ...]
    angular: tuple[bool, ...]


def conserved(scene: Scene) -> Conserved:
    """Return the conserved components, from the invariances the scene's families declare.

    The kinetic energy is invariant under translations always, and under a rotation where each body's mass is
    the same along both axes that the rotation mixes.
    """
    common = scene.potential.invariance() & scene.unilateral.invariance() & scene.bilateral.invariance()
    mass = scene.mass.reshape(scene.bodies, scene.dimension)
    mixed = {1: [], 2: [(0, 1)], 3: [(1, 2), (2, 0), (0, 1)]}[scene.dimension]
    isotropic = [bool((mass[:, i] == mass[:, j]).all()) for i, j in mixed]
    angular = tuple(a and b for a, b in zip(common.rotations, isotropic, strict=True))
    return Conserved(common.translations, angular)


def linear_momentum(scene: Scene, p: Array) -> Array:
    """Return sum_i p_i, shape (..., dof) -> (..., dimension)."""
    total: Array = p.reshape(*p.shape[:-1], scene.bodies, scene.dimension).sum(axis=-2)
    return total


def angular_momentum(scene: Scene, q: Array, p: Array) -> Array | None:
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
