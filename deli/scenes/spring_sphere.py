"""Two masses joined by a spring inside a circle (Figs. 5.1 and 8.3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, positive_number, real_array, real_number
from deli.mechanics.distances import SpheresInside
from deli.mechanics.pair_potentials import Springs
from deli.mechanics.potentials import RadialPowers
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene

STARTS = {"smooth": [(0.8, -0.6), (0.6, -0.8)], "mixed": [(0.8, -0.2), (0.6, -0.8)]}
"""Initial positions in units of the radius: both masses on the circle, or the first one inside it."""


@scene(step_size=0.5, duration=1000.0, scheme="midpoint")
def spring_sphere(
    *,
    start: str = "smooth",
    mass: ArrayLike = 1.0,
    radius: float = 5.0,
    repulsion: float = 50.0,
    stiffness: float = 1.0,
    rest_length: float = 2.0 * math.sqrt(2.0),
    speed: float = 1.0,
    position: ArrayLike | None = None,
    momentum: ArrayLike | None = None,
) -> Scene:
    """Return two masses in a circle, g_i(q) = radius - |q_i| >= 0, pushed outward and joined by a spring.

    V(q) = sum_i repulsion/|q_i|^2 + k/2 (|q_1 - q_2| - l)^2 (section 5.2). With ``start="smooth"`` both masses start on
    the circle, q = ((4, -3), (3, -4)) (Fig. 5.1, H = 6). With ``start="mixed"`` the first mass starts inside,
    q_1 = (4, -1), and bounces while the second one slides (Fig. 8.3, H = 5.997). Both starts scale with the radius.
    Momenta point counterclockwise, perpendicular to the position.

    Parameters
    ----------
    start
        "smooth" or "mixed".
    mass
        One number or one for each body.
    radius
        Radius of the circle.
    repulsion
        Coefficient of the outward potential.
    stiffness, rest_length
        k and l of the spring.
    speed
        Length of each initial momentum.
    position, momentum
        An initial state of your own, shape (2, 2), in place of the one that ``start`` and ``speed`` give.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.spring_sphere(start="mixed")
    >>> scene.position
    array([ 4., -1.,  3., -4.])
    >>> scene.symmetry.angular
    (True,)
    """
    if not isinstance(start, str) or start not in STARTS:
        raise InputError(f"start of spring_sphere: found {start!r}; choose one of {', '.join(map(repr, STARTS))}")
    radius = positive_number("radius of spring_sphere", radius)
    speed = real_number("speed of spring_sphere", speed)
    if position is None:
        position = radius * np.array(STARTS[start])
    if momentum is None:
        x, y = _bodies(position).T
        momentum = speed * np.stack([-y, x], axis=1) / np.hypot(x, y)[:, None]
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        potential=[
            RadialPowers(coefficients=[repulsion], exponents=[-2.0]),
            Springs(pairs=[(0, 1)], stiffness=stiffness, rest_length=rest_length),
        ],
        unilateral=[SpheresInside(radius=radius)],
        dimension=2,
    )


def _bodies(position: ArrayLike) -> Array:
    found = real_array("position of spring_sphere", position)
    if found.size != 4:
        raise InputError(f"position of spring_sphere: found shape {found.shape}; pass two points, shape (2, 2)")
    bodies: Array = found.reshape(2, 2)
    if not bodies.any(axis=1).all():
        raise InputError(
            "position of spring_sphere: found a body at the origin, where the potential is infinite; move it"
        )
    return bodies
