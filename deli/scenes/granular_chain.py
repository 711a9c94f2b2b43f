"""A line of touching beads of unequal mass, struck at one end."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import ArrayLike

from deli.errors import InputError
from deli.mechanics.arrays import Array, body_count, positive_number, real_number, whole_number
from deli.mechanics.distances import SpheresApart
from deli.mechanics.scene import Scene
from deli.scenes.reading import one_of
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=10.0, scheme="midpoint")
def granular_chain(
    *,
    beads: int = 20,
    masses: str = "random",
    light: float = 1.0,
    heavy: float = 2.0,
    radius: float = 0.5,
    gap: float = 0.0,
    speed: float = 1.0,
    seed: int = 1,
    mass: ArrayLike | None = None,
) -> Scene:
    """Return beads in a row on a line; the first bead moves towards the others, which touch and rest.

    Neighbours do not overlap, |q_i - q_(i+1)| - 2 radius >= 0; there is no potential and no wall. Bead i is at
    2 radius i, the first one at -gap: by default it touches its neighbour and strikes it at once.

    Parameters
    ----------
    beads
        Number of beads, at least 2.
    masses
        "random": masses are drawn uniformly between ``light`` and ``heavy``; "alternating": ``heavy`` and ``light``
        in turn, the first bead heavy.
    light, heavy
        Smallest and largest mass, > 0.
    radius
        Radius of every bead.
    gap
        Distance >= 0 of the first bead from the second one's surface at the start.
    speed
        Initial velocity of the first bead.
    seed
        Seed of the random masses.
    mass
        Masses of your own, one number or one for each bead, in place of the masses above.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.granular_chain(beads=4, masses="alternating")
    >>> scene.mass
    array([2., 1., 2., 1.])
    >>> scene.momentum
    array([2., 0., 0., 0.])
    """
    beads = body_count("beads of granular_chain", beads, least=2)
    radius = positive_number("radius of granular_chain", radius)
    gap = real_number("gap of granular_chain", gap)
    if gap < 0.0:
        raise InputError(f"gap of granular_chain: found {gap!r}; it must be >= 0")
    if mass is None:
        mass = _masses(beads, masses, light, heavy, whole_number("seed of granular_chain", seed))
    number = np.arange(beads)
    position = 2.0 * radius * number
    position[0] -= gap
    velocity = np.where(number == 0, real_number("speed of granular_chain", speed), 0.0)
    at_rest = Scene(
        mass=mass,
        position=position,
        momentum=np.zeros(beads),
        unilateral=[SpheresApart(pairs=np.stack([number[:-1], number[1:]], axis=1), distance=2.0 * radius)],
    )
    return dataclasses.replace(at_rest, momentum=at_rest.mass * velocity)


def _masses(beads: int, pattern: str, light: float, heavy: float, seed: int) -> Array:
    pattern = one_of("masses of granular_chain", pattern, ("random", "alternating"))
    light = positive_number("light of granular_chain", light)
    heavy = positive_number("heavy of granular_chain", heavy)
    if heavy < light:
        raise InputError(f"heavy of granular_chain: found {heavy!r}; it must be >= light, which is {light!r}")
    if pattern == "random":
        return np.random.default_rng(seed).uniform(light, heavy, beads)
    return np.where(np.arange(beads) % 2 == 0, heavy, light)
