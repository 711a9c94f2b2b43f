"""A chain draped over a horizontal cylinder."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import body_count, positive_number, real_number
from deli.mechanics.distances import Rods, SpheresOutside
from deli.mechanics.potentials import Gravity
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.002, duration=2.0, scheme="midpoint")
def chain_on_cylinder(
    *,
    masses: int = 20,
    mass: ArrayLike = 1.0,
    radius: float = 1.0,
    arc: float = 1.6,
    shift: float = 0.1,
    speed: float = 0.0,
    gravity: float = 9.8,
) -> Scene:
    """Return masses joined by rods on a horizontal cylinder under gravity, seen along its axis, in the plane.

    Masses stay outside the circle about the origin, g_i(q) = |q_i| - radius >= 0, and neighbours are joined by rods,
    f_i(q) = |q_i - q_(i+1)| - l = 0. All masses start on the circle, mass i at the angle
    shift + (i/(masses - 1) - 1/2) arc from the top, positive to the right; rods are chords,
    l = 2 radius sin(arc / (2 (masses - 1))). All masses move along the circle with the same speed, positive to the
    right, which changes no gap and no rod: contacts start smooth.

    The chain starts on the upper half of the circle. At shift = 0 and speed = 0 it is in unstable equilibrium;
    otherwise it slides off, and its masses leave the circle one after the other.

    Parameters
    ----------
    masses
        Number of masses, at least 2.
    mass
        One number or one for each mass.
    radius
        Radius of the cylinder.
    arc
        Angle in radians from the first mass to the last one.
    shift
        Angle in radians of the chain's middle from the top; |shift| + arc/2 < pi/2.
    speed
        Initial speed of every mass along the circle.
    gravity
        Downward acceleration.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.chain_on_cylinder(masses=5)
    >>> scene.unilateral.rows, scene.bilateral.rows
    (5, 4)
    """
    masses = body_count("masses of chain_on_cylinder", masses, least=2)
    radius = positive_number("radius of chain_on_cylinder", radius)
    arc = positive_number("arc of chain_on_cylinder", arc)
    shift = real_number("shift of chain_on_cylinder", shift)
    if abs(shift) + 0.5 * arc >= 0.5 * math.pi:
        raise InputError(
            f"arc of chain_on_cylinder: found arc {arc!r} and shift {shift!r}; |shift| + arc/2 must be < pi/2, so that "
            "the whole chain lies on the upper half of the cylinder"
        )
    number = np.arange(masses)
    angle = shift + arc * (number / (masses - 1) - 0.5)
    outward = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    along = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    velocity = real_number("speed of chain_on_cylinder", speed) * along
    at_rest = Scene(
        mass=mass,
        position=radius * outward,
        momentum=np.zeros((masses, 2)),
        potential=[Gravity([0.0, -real_number("gravity of chain_on_cylinder", gravity)])],
        unilateral=[SpheresOutside(radius=radius)],
        bilateral=[
            Rods(
                pairs=np.stack([number[:-1], number[1:]], axis=1),
                length=2.0 * radius * math.sin(0.5 * arc / (masses - 1)),
            )
        ],
        dimension=2,
    )
    return dataclasses.replace(at_rest, momentum=at_rest.mass * velocity.reshape(-1))
