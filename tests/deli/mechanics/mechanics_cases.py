"""Every family in every dimension it makes sense in, and configurations away from its singular points."""

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from deli.mechanics.constraints import Planes
from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside, SpheresOutside
from deli.mechanics.family import Layout
from deli.mechanics.pair_potentials import LennardJones, Springs
from deli.mechanics.potentials import Gravity, RadialPowers

BODIES = 4

POTENTIALS: dict[str, Callable[[int], Any]] = {
    "gravity down": lambda d: Gravity([0.0] * (d - 1) + [-9.8]),
    "gravity aslant": lambda d: Gravity(np.arange(1.0, d + 1.0)),
    "springs": lambda d: Springs(
        pairs=[(0, 1), (1, 2), (3, 0)], stiffness=[1.0, 2.5, 0.3], rest_length=[0.0, 1.3, 7.0]
    ),
    "one spring": lambda d: Springs(pairs=[(2, 0)], stiffness=10.0, rest_length=5.0),
    "inverse square": lambda d: RadialPowers(coefficients=[50.0], exponents=[-2.0]),
    "wells": lambda d: RadialPowers(coefficients=[1.0, -2.0, 1.0], exponents=[6.0, 4.0, 2.0]),
    "some wells": lambda d: RadialPowers([0.5, 1.0], [3.0, 1.0], bodies=[3, 1], centre=-np.arange(1.0, d + 1.0)),
    "lennard-jones": lambda d: LennardJones(epsilon=1.2, sigma=0.9),
    "some lennard-jones": lambda d: LennardJones(epsilon=[1.0, 2.0], sigma=[1.1, 0.8], pairs=[(0, 3), (2, 1)]),
}

CONSTRAINTS: dict[str, Callable[[int], Any]] = {
    "floor": lambda d: Planes(normals=[0.0] * (d - 1) + [2.0], offsets=-3.0),
    "some planes": lambda d: Planes(np.arange(1.0, 3.0 * d + 1.0).reshape(3, d), offsets=[1, 2, 3], bodies=[1, 1, 3]),
    "all apart": lambda d: SpheresApart(pairs=None, distance=0.4),
    "some apart": lambda d: SpheresApart(pairs=[(0, 1), (3, 2)], distance=[0.1, 0.2]),
    "apart in a box": lambda d: SpheresApart(pairs=[(0, 3), (1, 2), (0, 1)], distance=[0.4, 0.5, 0.6], period=6.0),
    "apart in a slab": lambda d: SpheresApart([(0, 3), (2, 1)], distance=0.4, period=[0.0] * (d - 1) + [6.0]),
    "inside": lambda d: SpheresInside(radius=9.0),
    "some inside": lambda d: SpheresInside(radius=[8.0, 9.0], centre=-np.arange(1.0, d + 1.0), bodies=[2, 0]),
    "outside": lambda d: SpheresOutside(radius=0.5),
    "some outside": lambda d: SpheresOutside(radius=[0.4, 0.6], centre=-np.arange(1.0, d + 1.0), bodies=[1, 2]),
    "rods": lambda d: Rods(pairs=[(0, 1), (1, 2)], length=[1.5, 0.7]),
    "pendulums": lambda d: AnchoredRods(
        pivots=-np.arange(1.0, BODIES * d + 1.0).reshape(BODIES, d), length=[1.0, 2.0, 3.0, 4.0]
    ),
    "axis pendulum": lambda d: AnchoredRods(pivots=[0.0] * (d - 1) + [-2.0], length=2.0, bodies=[1]),
}

DIMENSIONS = (1, 2, 3)


def spread(dimension: int) -> np.ndarray:
    """Bodies in a row, 1.5 apart, the first one 1.5 from the origin."""
    return np.repeat(1.5 * np.arange(1.0, BODIES + 1.0)[:, None], dimension, axis=1).reshape(-1)


def layout(dimension: int) -> Layout:
    mass = np.repeat([1.0, 2.0, 0.5, 3.0], dimension)
    return Layout(dimension, mass, spread(dimension))


def configurations(dimension: int, batch: tuple[int, ...] = ()) -> st.SearchStrategy[np.ndarray]:
    """Read-only configurations in which no body meets another one or the origin."""
    shape = (*batch, BODIES * dimension)
    moves = hnp.arrays(np.float64, shape, elements=st.floats(-0.4, 0.4))
    return moves.map(lambda move: read_only(spread(dimension) + move))


def read_only(array: np.ndarray) -> np.ndarray:
    array.setflags(write=False)
    return array


def derivative(function: Callable[[np.ndarray], Any], q: np.ndarray, step: float = 1e-3) -> np.ndarray:
    """Central differences of sixth order, the coordinate as last axis."""
    weights = {1: 45.0 / 60.0, 2: -9.0 / 60.0, 3: 1.0 / 60.0}
    columns = []
    for k in range(q.size):
        unit = np.zeros(q.size)
        unit[k] = step
        columns.append(sum(w * (function(q + m * unit) - function(q - m * unit)) for m, w in weights.items()) / step)
    return np.stack(columns, axis=-1)


def translated(q: np.ndarray, dimension: int, axis: int, distance: float) -> np.ndarray:
    x = q.reshape(-1, dimension).copy()
    x[:, axis] += distance
    return x.reshape(-1)


def rotated(q: np.ndarray, dimension: int, axis: int, angle: float) -> np.ndarray:
    """Rotate about the origin; in three dimensions about ``axis``."""
    i, j = (0, 1) if dimension == 2 else [(1, 2), (2, 0), (0, 1)][axis]
    x = q.reshape(-1, dimension).copy()
    x[:, [i, j]] = x[:, [i, j]] @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return x.reshape(-1)


def motions(invariance: Any, dimension: int) -> list[tuple[str, bool, Callable[[np.ndarray, float], np.ndarray]]]:
    """Every translation and rotation: its name, whether it is declared, and the motion by an amount."""
    return [
        (f"translation {axis}", declared, lambda q, amount, axis=axis: translated(q, dimension, axis, amount))
        for axis, declared in enumerate(invariance.translations)
    ] + [
        (f"rotation {axis}", declared, lambda q, amount, axis=axis: rotated(q, dimension, axis, amount))
        for axis, declared in enumerate(invariance.rotations)
    ]
