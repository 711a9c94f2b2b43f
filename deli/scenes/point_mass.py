"""A ball on a floor (Fig. 1.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import real_number
from deli.mechanics.constraints import Planes
from deli.mechanics.potentials import Gravity
from deli.mechanics.scene import Scene
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=20.0, scheme="midpoint")
def point_mass(
    *, mass: float = 1.0, gravity: float = 9.8, position: ArrayLike = 1.0, momentum: ArrayLike = 0.0
) -> Scene:
    """Return a ball falling on a floor in one dimension, V = m gravity q, g(q) = q >= 0 (section 1.3.1, Fig. 1.3).

    The paper does not state the step size of Fig. 1.3; h = 0.01 over 20 time units is this project's choice.

    Parameters
    ----------
    mass
        m.
    gravity
        Downward acceleration.
    position, momentum
        Initial height and momentum.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.point_mass(position=2.0)
    >>> scene.unilateral.value(scene.position)
    array([2.])
    >>> scene.parameters
    {'mass': 1.0, 'gravity': 9.8, 'position': 2.0, 'momentum': 0.0}
    """
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        potential=[Gravity(np.array([-real_number("gravity", gravity)]))],
        unilateral=[Planes(normals=[1.0])],
    )
