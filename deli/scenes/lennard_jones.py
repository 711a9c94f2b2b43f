"""A chain of spheres on rods under a Lennard-Jones potential, in a spherical container (Fig. 8.5)."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, body_count, positive_number, real_array, real_number
from deli.mechanics.distances import Rods, SpheresApart, SpheresInside
from deli.mechanics.pair_potentials import LennardJones
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=2000.0, scheme="verlet")
def lennard_jones(
    *,
    spheres: int = 6,
    mass: ArrayLike = 1.0,
    epsilon: float = 1.0,
    sigma: float = 0.6,
    radius: float = 0.3,
    container: float = 5.0,
    length: float = 1.0,
    turn: float = math.pi / 2.0,
    rise: float = 0.5,
    speed: float = 1.0,
    position: ArrayLike | None = None,
    momentum: ArrayLike | None = None,
) -> Scene:
    """Return a chain of spheres in three dimensions under a Lennard-Jones potential (section 8.1.2, Fig. 8.5).

    Neighbours are joined by rods, f(q) = |q_i - q_j| - length = 0 (8.8); no two spheres overlap,
    g(q) = |q_i - q_j| - 2 radius >= 0 (8.9); all pairs interact (8.10); a sphere about the origin contains them,
    g(q) = container - radius - |q_i| >= 0 (8.11). The paper gives sigma/2 = radius = 0.3.

    The paper leaves the initial state and epsilon open. By default epsilon = 1 and the chain is a helix about the
    z axis, centred at the origin, that turns by ``turn`` and climbs by ``rise`` from one sphere to the next. Sphere
    i (from 0) starts with the velocity speed (cos 2i, sin 3i, cos(i + 1)), less the part that would stretch a rod:
    momenta are projected onto F.M^-1 p = 0 in the metric M^-1. Linear and angular momentum are not zero.

    Parameters
    ----------
    spheres
        Number of spheres, at least 2.
    mass
        One number or one for each sphere.
    epsilon, sigma
        Depth of the potential's well, and the distance at which the potential is zero.
    radius
        Radius of every sphere.
    container
        Radius of the containing sphere.
    length
        Length of every rod.
    turn, rise
        Angle in radians and height from one sphere to the next; |rise| < length.
    speed
        Factor of the initial velocities before the projection.
    position, momentum
        An initial state of your own, shape (spheres, 3), in place of the one above.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.lennard_jones()
    >>> scene.bodies, scene.unilateral.rows, scene.bilateral.rows
    (6, 21, 5)
    >>> scene.symmetry.angular
    (True, True, True)
    """
    spheres = body_count("spheres of lennard_jones", spheres, least=2)
    radius = positive_number("radius of lennard_jones", radius)
    length = positive_number("length of lennard_jones", length)
    if position is None:
        position = _helix(spheres, length, real_number("turn of lennard_jones", turn), _rise(rise, length))
    number = np.arange(spheres)
    at_rest = Scene(
        mass=mass,
        position=position,
        momentum=np.zeros(3 * spheres),
        potential=[LennardJones(epsilon=epsilon, sigma=sigma)],
        unilateral=[
            SpheresApart(pairs=None, distance=2.0 * radius),
            SpheresInside(radius=_room(container, radius)),
        ],
        bilateral=[Rods(pairs=np.stack([number[:-1], number[1:]], axis=1), length=length)],
        dimension=3,
    )
    if momentum is not None:
        return dataclasses.replace(at_rest, momentum=real_array("momentum", momentum))
    pattern = np.stack([np.cos(2.0 * number), np.sin(3.0 * number), np.cos(number + 1.0)], axis=1)
    velocity = real_number("speed of lennard_jones", speed) * pattern.reshape(-1)
    return dataclasses.replace(at_rest, momentum=_stretching_removed(at_rest, velocity))


def _room(container: float, radius: float) -> float:
    room = real_number("container of lennard_jones", container) - radius
    if room <= 0:
        raise InputError(
            f"container of lennard_jones: found {container!r}; it must be > the spheres' radius {radius!r}"
        )
    return room


def _rise(rise: float, length: float) -> float:
    rise = real_number("rise of lennard_jones", rise)
    if abs(rise) >= length:
        raise InputError(f"rise of lennard_jones: found {rise!r}; it must be smaller than the rod length {length!r}")
    return rise


def _helix(spheres: int, length: float, turn: float, rise: float) -> Array:
    chord = 2.0 * abs(math.sin(0.5 * turn))
    if chord < 1e-6:
        raise InputError(f"turn of lennard_jones: found {turn!r}; a full turn leaves no helix, choose e.g. pi/2")
    number = np.arange(spheres)
    winding = math.sqrt(length**2 - rise**2) / chord
    helix = np.stack([winding * np.cos(turn * number), winding * np.sin(turn * number), rise * number], axis=1)
    centred: Array = helix - helix.mean(axis=0)
    return centred


def _stretching_removed(at_rest: Scene, velocity: Array) -> Array:
    jacobian = at_rest.bilateral.jacobian(at_rest.position)
    momentum = at_rest.mass * velocity
    multipliers = np.linalg.solve(jacobian / at_rest.mass @ jacobian.T, jacobian @ velocity)
    projected: Array = momentum - jacobian.T @ multipliers
    return projected
