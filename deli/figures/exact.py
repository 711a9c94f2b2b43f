"""Motions that are known in closed form, to draw beside integrated ones."""

from collections.abc import Callable

import numpy as np

from deli.errors import InputError
from deli.mechanics.scene import Scene


def bouncing_ball(scene: Scene, time: np.ndarray) -> np.ndarray:
    """Return the height of `point_mass` over time, shape (time, 1): parabolas of equal height, end to end.

    Raises
    ------
    InputError
        If the scene is another.
    """
    if scene.name != "point_mass":
        raise InputError(f"solution 'bouncing_ball' is that of scene point_mass; found {scene.name}.")
    gravity = scene.parameters["gravity"]
    height, speed = scene.position.item(), (scene.momentum / scene.mass).item()
    impact = np.sqrt(speed**2 + 2.0 * gravity * height)
    since = (time - (speed + impact) / gravity) % (2.0 * impact / gravity)
    solution: np.ndarray = (impact * since - 0.5 * gravity * since**2)[:, np.newaxis]
    return solution


SOLUTIONS: dict[str, Callable[[Scene, np.ndarray], np.ndarray]] = {"bouncing_ball": bouncing_ball}
"""Closed forms by the name they have in a figure's config."""
