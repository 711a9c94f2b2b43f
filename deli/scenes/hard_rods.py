"""Equal hard rods on a line or a ring: exactly solvable."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from deli.mechanics.arrays import body_count, positive_number, real_array, real_number, whole_number
from deli.mechanics.constraints import ConstraintFamily, Planes
from deli.mechanics.distances import SpheresApart
from deli.mechanics.scene import Scene
from deli.scenes.reading import between, jitter_of, one_of
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=20.0, scheme="midpoint")
def hard_rods(
    *,
    rods: int = 10,
    boundary: str = "walls",
    size: float = 1.0,
    filled: float = 0.5,
    mass: float = 1.0,
    speed: float = 1.0,
    jitter: float = 0.5,
    seed: int = 1,
    position: ArrayLike | None = None,
    momentum: ArrayLike | None = None,
) -> Scene:
    """Return equal hard rods moving freely on a line of length L = rods size / filled, in one dimension.

    Neighbours do not overlap, |q_i - q_(i+1)| - size >= 0. With ``boundary="walls"`` the line is [0, L]: the first
    and the last rod keep q_0 - size/2 >= 0 and L - size/2 - q_last >= 0. With ``boundary="ring"`` it is closed, and
    the last rod is the first one's neighbour.

    Equal rods exchange their velocities, so the motion is that of free particles (Jepsen 1965): y_i = q_i -
    (i + 1/2) size are points on a line of length L - rods size that pass through each other and bounce at its
    ends. The rods are these points in ascending order at all times.

    By default, rod i is displaced at random from the middle of its share of the line, and velocities are normally
    distributed.

    Parameters
    ----------
    rods
        Number of rods, at least 2.
    boundary
        "walls" or "ring".
    size
        Length of every rod.
    filled
        Share of the line that the rods take up, > 0 and < 1.
    mass
        Mass of every rod.
    speed
        Standard deviation of the initial velocities.
    jitter
        Share of the free space within which the initial positions are random, >= 0 and < 1.
    seed
        Seed of the random positions and velocities.
    position, momentum
        An initial state of your own, shape (rods,), positions in ascending order, in place of the random one.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.hard_rods(rods=4, boundary="ring", jitter=0.0)
    >>> scene.unilateral.value(scene.position)
    array([1., 1., 1., 1.])
    """
    rods = body_count("rods of hard_rods", rods, least=2)
    boundary = one_of("boundary of hard_rods", boundary, ("walls", "ring"))
    size = positive_number("size of hard_rods", size)
    length = rods * size / between("filled of hard_rods", filled, 0.0, 1.0)
    jitter = jitter_of("jitter of hard_rods", jitter)
    random = np.random.default_rng(whole_number("seed of hard_rods", seed))
    number = np.arange(rods)
    moves, velocities = random.uniform(-0.5, 0.5, rods), random.standard_normal(rods)
    if position is None:
        position = (number + 0.5) * (length / rods) + jitter * (length / rods - size) * moves
    if momentum is None:
        momentum = positive_number("mass of hard_rods", mass) * real_number("speed of hard_rods", speed) * velocities
    neighbours = np.stack([number[:-1], number[1:]], axis=1)
    contacts: list[ConstraintFamily]
    if boundary == "walls":
        ends = Planes(normals=[[1.0], [-1.0]], offsets=[0.5 * size, 0.5 * size - length], bodies=[0, rods - 1])
        contacts = [SpheresApart(pairs=neighbours, distance=size), ends]
    else:
        around = np.concatenate([neighbours, [[rods - 1, 0]]]) if rods > 2 else neighbours
        contacts = [SpheresApart(pairs=around, distance=size, period=length)]
    return Scene(
        mass=positive_number("mass of hard_rods", mass),
        position=real_array("position", position),
        momentum=momentum,
        unilateral=contacts,
    )
