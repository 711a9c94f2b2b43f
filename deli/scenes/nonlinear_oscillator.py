"""Two discs in a nonlinear radial potential (Fig. 8.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import positive_number, real_number
from deli.mechanics.distances import SpheresApart
from deli.mechanics.potentials import RadialPowers
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.1, duration=300.0, scheme="midpoint")
def nonlinear_oscillator(
    *,
    mass: ArrayLike = 1.0,
    radius: float = 1.0,
    strength: float = 1.0,
    well: float = 1.0,
    clearance: float = 0.4,
    speed: float = 1.0,
    position: ArrayLike | None = None,
    momentum: ArrayLike | None = None,
) -> Scene:
    """Return two discs bouncing off each other in the plane, g(q) = |q_1 - q_2| - 2 radius >= 0 (8.5).

    V(q) = strength sum_i |q_i|^2 (|q_i|^2 - well^2)^2 (8.4). The discs start at q_1 = (0, -radius - clearance) and
    q_2 = -q_1 with momenta p_1 = (speed, 0) and p_2 = -p_1, a counterclockwise rotation: by default
    q_1 = (0, -1.4) and H = 4.613.

    Parameters
    ----------
    mass
        One number or one for each disc.
    radius
        Radius of both discs.
    strength, well
        Factor of the potential, and the distance from the origin of its minimum.
    clearance
        Distance of each disc's edge from the origin at the start.
    speed
        Length of each initial momentum.
    position, momentum
        An initial state of your own, shape (2, 2), in place of the one above.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.nonlinear_oscillator()
    >>> scene.position
    array([ 0. , -1.4,  0. ,  1.4])
    """
    radius = positive_number("radius of nonlinear_oscillator", radius)
    strength = real_number("strength of nonlinear_oscillator", strength)
    square = real_number("well of nonlinear_oscillator", well) ** 2
    if position is None:
        height = radius + real_number("clearance of nonlinear_oscillator", clearance)
        position = np.array([[0.0, -height], [0.0, height]])
    if momentum is None:
        momentum = real_number("speed of nonlinear_oscillator", speed) * np.array([[1.0, 0.0], [-1.0, 0.0]])
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        potential=[
            RadialPowers(
                coefficients=[strength, -2.0 * strength * square, strength * square**2], exponents=[6.0, 4.0, 2.0]
            )
        ],
        unilateral=[SpheresApart(pairs=[(0, 1)], distance=2.0 * radius)],
        dimension=2,
    )
