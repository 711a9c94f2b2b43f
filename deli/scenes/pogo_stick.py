"""Two masses on a vertical spring above a floor (Figs. 1.4 and 6.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import real_number
from deli.mechanics.constraints import Planes
from deli.mechanics.pair_potentials import Springs
from deli.mechanics.potentials import Gravity
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.1, duration=1000.0, scheme="verlet")
def pogo_stick(
    *,
    mass: ArrayLike = 1.0,
    stiffness: float = 10.0,
    rest_length: float = 5.0,
    gravity: float = 9.8,
    position: ArrayLike = (6.0, 1.0),
    momentum: ArrayLike = (0.0, 0.0),
) -> Scene:
    """Return the pogo stick of section 6.1.1: q = (top, bottom) in one dimension, g(q) = q_2 >= 0.

    V(q) = gravity (m q_1 + m q_2) + k/2 (|q_1 - q_2| - l)^2. The paper leaves the initial state open; the default
    is q = (6, 1), p = 0: the spring at rest length, one unit above the floor, H = 68.6. Gravity is 9.8213 in Fig. 1.4
    and 9.8 in section 6.1.1; the default is 9.8.

    Parameters
    ----------
    mass
        m, one number or (top, bottom).
    stiffness, rest_length
        k and l of the spring.
    gravity
        Downward acceleration.
    position, momentum
        Initial state, (top, bottom).

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.pogo_stick(position=[7.0, 1.0])
    >>> round(float(scene.potential.energy(scene.position)), 6)
    83.4
    """
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        potential=[
            Gravity(np.array([-real_number("gravity", gravity)])),
            Springs(pairs=[(0, 1)], stiffness=stiffness, rest_length=rest_length),
        ],
        unilateral=[Planes(normals=[1.0], bodies=[1])],
    )
