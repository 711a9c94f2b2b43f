"""A point that falls into a wedge, whose walls can be many, nearly parallel or repeated."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import body_count, real_number
from deli.mechanics.constraints import Planes
from deli.mechanics.potentials import Gravity
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=20.0, scheme="midpoint")
def wedge(
    *,
    walls: int = 2,
    copies: int = 1,
    spread: float = np.pi / 2.0,
    mass: float = 1.0,
    gravity: float = 1.0,
    position: ArrayLike = (0.1, 1.0),
    momentum: ArrayLike = (0.0, 0.0),
) -> Scene:
    """Return the wedge billiard (Lehtihet and Miller 1986), V = m gravity y, g_i(q) = n_i . q >= 0.

    All walls meet in the origin. Their unit normals n_i = (sin a_i, cos a_i) have angles a_i equally spaced over
    ``[-spread / 2, spread / 2]``: the defaults are two walls at right angles. In the apex all walls are met at once;
    with a small spread they are nearly parallel, and with copies they depend on each other. Every scheme is exact in
    flight and each reflection conserves energy, so every error of the energy comes from the solver or the reflection
    operator.

    Parameters
    ----------
    walls
        Number of directions of walls.
    copies
        Number of copies of each wall.
    spread
        Angle between the first and the last normal, at least 0 and below pi.
    mass
        m.
    gravity
        Downward acceleration.
    position, momentum
        Initial state, (x, y).

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.wedge(copies=2)
    >>> scene.unilateral.value(scene.position).round(3)
    array([0.636, 0.636, 0.778, 0.778])
    """
    directions, repeats = (
        body_count("walls of wedge", walls, least=1),
        body_count("copies of wedge", copies, least=1),
    )
    body_count("walls and copies of wedge", directions * repeats)
    opening = real_number("spread of wedge", spread)
    if not 0.0 <= opening < np.pi:
        raise InputError(
            f"spread of wedge: found {opening!r}; it must be >= 0 and < pi, so that the wedge is open above"
        )
    angles = np.linspace(-0.5 * opening, 0.5 * opening, directions) if directions > 1 else np.zeros(1)
    normals = np.repeat(np.stack([np.sin(angles), np.cos(angles)], axis=1), repeats, axis=0)
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        potential=[Gravity([0.0, -real_number("gravity of wedge", gravity)])],
        unilateral=[Planes(normals=normals, bodies=np.zeros(len(normals), dtype=int))],
        dimension=2,
    )
