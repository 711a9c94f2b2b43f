"""A mass in a quartic potential, thrown against a wall."""

from __future__ import annotations

from numpy.typing import ArrayLike

from deli.mechanics.arrays import real_number
from deli.mechanics.constraints import Planes
from deli.mechanics.potentials import RadialPowers
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.05, duration=1000.0, scheme="midpoint")
def quartic_wall(
    *,
    mass: float = 1.0,
    stiffness: float = 1.0,
    wall: float = 0.0,
    position: ArrayLike = 1.0,
    momentum: ArrayLike = 0.0,
) -> Scene:
    """Return a mass on a line that V(q) = stiffness q^4 / 4 pulls against a wall, g(q) = q - wall >= 0.

    The force vanishes at q = 0, the default place of the wall, and grows with the cube of q, so that the period depends
    on the energy. The scene is not from the paper: it is the smallest one in which a nonlinear force drives impacts
    without end.

    Parameters
    ----------
    mass
        m.
    stiffness
        Factor of the potential.
    wall
        Position of the wall.
    position, momentum
        Initial state; by default at rest at q = 1, with H = 1/4.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.quartic_wall()
    >>> float(scene.potential.energy(scene.position))
    0.25
    """
    quarter = 0.25 * real_number("stiffness of quartic_wall", stiffness)
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        potential=[RadialPowers(coefficients=[quarter], exponents=[4])],
        unilateral=[Planes(normals=[1.0], offsets=[real_number("wall of quartic_wall", wall)])],
    )
