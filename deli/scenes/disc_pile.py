"""A hexagonal pile of touching discs at rest in a box."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import body_count, positive_number, real_number
from deli.mechanics.constraints import Planes
from deli.mechanics.distances import SpheresApart
from deli.mechanics.potentials import Gravity
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=5.0, scheme="midpoint")
def disc_pile(
    *, rows: int = 10, columns: int = 10, radius: float = 0.5, mass: ArrayLike = 1.0, gravity: float = 9.8
) -> Scene:
    """Return equal discs in hexagonal packing under gravity in the plane, at rest, every contact closed.

    The box has a floor, q_y - radius >= 0, and two walls 2 radius columns apart, q_x - radius >= 0 and
    (2 columns - 1) radius - q_x >= 0. Rows of ``columns`` discs, which reach from wall to wall, alternate with rows
    of ``columns - 1``, which lie in the hollows between them, sqrt(3) radius higher; the lowest row is a wide one.
    No two discs overlap, |q_i - q_j| - 2 radius >= 0. All gaps of neighbours, of the lowest row to the floor and of
    wide rows to the walls are zero to rounding. The pile stays at rest, because every disc lies on two discs, on one
    disc and a wall, or on the floor. Its contact forces are not unique.

    Parameters
    ----------
    rows
        Number of rows, at least 1.
    columns
        Number of discs in a wide row, at least 2.
    radius
        Radius of every disc.
    mass
        One number or one for each disc, row by row from below, from left to right.
    gravity
        Downward acceleration.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.disc_pile(rows=2, columns=2)
    >>> scene.bodies
    3
    """
    rows = body_count("rows of disc_pile", rows, least=1)
    columns = body_count("columns of disc_pile", columns, least=2)
    radius = positive_number("radius of disc_pile", radius)
    body_count("rows and columns of disc_pile", rows * columns)
    row, column = (index.reshape(-1) for index in np.indices((rows, columns)))
    narrow = row % 2
    placed = column < columns - narrow
    row, column, narrow = row[placed], column[placed], narrow[placed]
    position = np.stack([radius * (2 * column + 1 + narrow), radius + math.sqrt(3.0) * radius * row], axis=1)
    discs = len(position)
    inward = np.array([[0.0, 1.0], [1.0, 0.0], [-1.0, 0.0]])
    offsets = np.array([radius, radius, -radius * (2 * columns - 1)])
    return Scene(
        mass=mass,
        position=position,
        momentum=np.zeros((discs, 2)),
        potential=[Gravity([0.0, -real_number("gravity of disc_pile", gravity)])],
        unilateral=[
            SpheresApart(pairs=None, distance=2.0 * radius),
            Planes(np.tile(inward, (discs, 1)), np.tile(offsets, discs), np.repeat(np.arange(discs), 3)),
        ],
        dimension=2,
    )
