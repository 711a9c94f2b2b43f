"""Newton's cradle (Fig. 8.4)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import body_count, positive_number, real_number, whole_number
from deli.mechanics.distances import AnchoredRods, SpheresApart
from deli.mechanics.potentials import Gravity
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=60.0, scheme="midpoint")
def newtons_cradle(
    *,
    balls: int = 5,
    pulled: int = 2,
    angle: float = -math.pi / 5.0,
    mass: ArrayLike = 1.0,
    radius: float = 0.25,
    length: float = 1.0,
    gravity: float = 9.8,
) -> Scene:
    """Return a row of touching pendulums in the plane, the leftmost ones pulled back, at rest (section 8.1.1).

    Pivots are 2 radius apart on a horizontal line centred at the origin; each ball hangs on a rod,
    f_i(q) = |q_i - pivot_i| - length = 0 (8.6), and neighbours do not overlap,
    g(q) = |q_i - q_j| - 2 radius >= 0 (8.7). Pulled balls touch each other, and so do hanging balls. The paper
    states neither gravity (here 9.8, as in other scenes) nor the duration (here 60 time units).

    Parameters
    ----------
    balls
        Number of balls, at least 1.
    pulled
        Number of balls, counted from the left, that start at ``angle``.
    angle
        Angle from rest in radians, negative to the left.
    mass
        One number or one for each ball.
    radius
        Radius of every ball.
    length
        Length of every rod.
    gravity
        Downward acceleration.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.newtons_cradle(balls=3, pulled=1)
    >>> abs(scene.unilateral.value(scene.position)).round(3)
    array([0.604, 0.   ])
    """
    balls = body_count("balls of newtons_cradle", balls, least=1)
    pulled = whole_number("pulled of newtons_cradle", pulled)
    if pulled > balls:
        raise InputError(f"pulled of newtons_cradle: found {pulled}; there are {balls} balls: pass 0 to {balls}")
    radius = positive_number("radius of newtons_cradle", radius)
    length = positive_number("length of newtons_cradle", length)
    number = np.arange(balls)
    angles = np.where(number < pulled, real_number("angle of newtons_cradle", angle), 0.0)
    pivots = np.stack([2.0 * radius * (number - 0.5 * (balls - 1)), np.zeros(balls)], axis=1)
    return Scene(
        mass=mass,
        position=pivots + length * np.stack([np.sin(angles), -np.cos(angles)], axis=1),
        momentum=np.zeros((balls, 2)),
        potential=[Gravity([0.0, -real_number("gravity of newtons_cradle", gravity)])],
        unilateral=[SpheresApart(pairs=np.stack([number[:-1], number[1:]], axis=1), distance=2.0 * radius)],
        bilateral=[AnchoredRods(pivots=pivots, length=length)],
        dimension=2,
    )
