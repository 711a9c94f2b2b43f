"""Motions in closed form, to draw beside integrated motions or to measure their errors."""

from collections.abc import Callable

import numpy as np

from deli.errors import InputError
from deli.mechanics.scene import Scene


def bouncing_ball(scene: Scene, time: np.ndarray) -> np.ndarray:
    """Return the height of `point_mass` over time, shape (time, 1): consecutive parabolas of equal height.

    Raises
    ------
    InputError
        If the scene is not a `point_mass`.
    """
    _check(scene, "bouncing_ball", "point_mass")
    gravity = scene.parameters["gravity"]
    height, speed = scene.position.item(), (scene.momentum / scene.mass).item()
    impact = np.sqrt(speed**2 + 2.0 * gravity * height)
    since = (time - (speed + impact) / gravity) % (2.0 * impact / gravity)
    solution: np.ndarray = (impact * since - 0.5 * gravity * since**2)[:, np.newaxis]
    return solution


def passing_points(scene: Scene, time: np.ndarray) -> np.ndarray:
    """Return the positions of `hard_rods` over time, shape (time, rods): free points in their order (Jepsen 1965).

    With y_i = q_i − (i + ½) size, the rods are points on a line of the free length. Two points that meet exchange their
    velocities, as if they passed through each other and exchanged their names. Positions are therefore the sorted
    positions of free points; the velocity of a single rod is known only away from impacts.

    Raises
    ------
    InputError
        If the scene is not `hard_rods`.
    """
    _check(scene, "passing_points", "hard_rods")
    size, rods = scene.parameters["size"], scene.bodies
    free = rods * size / scene.parameters["filled"] - rods * size
    shift = size * (np.arange(rods) + 0.5)
    points = scene.position - shift + np.multiply.outer(time, scene.momentum / scene.mass)
    if scene.parameters["boundary"] == "walls":
        folded = np.mod(points, 2.0 * free)
        inside: np.ndarray = np.sort(np.minimum(folded, 2.0 * free - folded), axis=1)
        return inside + shift
    turns = np.floor(points / free)
    places = np.sort(points - turns * free, axis=1)
    # Ranks on the unrolled ring move on by one for each point that passes the origin.
    rank = np.arange(rods) + turns.sum(axis=1, keepdims=True).astype(int)
    around: np.ndarray = np.take_along_axis(places, rank % rods, axis=1) + free * (rank // rods)
    return around + shift


def _check(scene: Scene, solution: str, of: str) -> None:
    if scene.name != of:
        raise InputError(f"solution '{solution}' belongs to scene {of}; found {scene.name}.")


SOLUTIONS: dict[str, Callable[[Scene, np.ndarray], np.ndarray]] = {
    "bouncing_ball": bouncing_ball,
    "passing_points": passing_points,
}
"""Closed forms by their names in a figure's config."""
