"""Simultaneous impacts for `deli.reflect`: bodies that touch and rest, and a striker that hits them.

Balls and discs have diameter 1 and mass 1. The striker is body 0 and has velocity 1 along the first axis.
"""

import numpy as np

from deli.mechanics.arrays import positive_number, whole_number
from deli.mechanics.distances import SpheresApart
from deli.mechanics.scene import Scene

__all__ = ["bernoulli", "cradle", "rack"]

_TOUCHING = 1.0 + 1e-9


def cradle(balls: int = 5) -> Scene:
    """Return Newton's cradle at the moment of impact, without its strings: balls in a row on a line.

    In the known outcome the last ball moves on alone, with the striker's velocity.

    Parameters
    ----------
    balls
        Number of balls, the striker included, at least 2.

    Raises
    ------
    InputError
        For a number that is not allowed.

    Examples
    --------
    >>> import deli
    >>> scene = deli.impacts.cradle()
    >>> deli.reflect(scene, scene.position, scene.momentum).round(6) + 0.0
    array([0., 0., 0., 0., 1.])
    """
    balls = whole_number("balls of cradle", balls, least=2)
    return _struck(np.arange(balls, dtype=float)[:, None], 1.0)


def bernoulli(striker: float = 1.0) -> Scene:
    """Return Bernoulli's problem: a disc strikes two touching discs at once, symmetrically, in the plane.

    The normals make angles ±30° with the striker's path, and each disc gets an impulse λ along its normal. By symmetry
    the two impulses are equal, and ``½M v² = ½M (v − 2λ cos 30°/M)² + λ²/m`` gives
    ``λ = 2v cos 30° / (2 cos² 30°/M + 1/m)``.

    Parameters
    ----------
    striker
        Mass M of the striker; the two discs have mass m = 1.

    Raises
    ------
    InputError
        For a mass that is not > 0.

    Examples
    --------
    >>> import deli
    >>> scene = deli.impacts.bernoulli()
    >>> after = deli.reflect(scene, scene.position, scene.momentum)
    >>> after.reshape(3, 2).round(6) + 0.0
    array([[-0.2    ,  0.     ],
           [ 0.6    , -0.34641],
           [ 0.6    ,  0.34641]])
    """
    return _struck(_triangle(2), positive_number("striker of bernoulli", striker))


def rack(rows: int = 4) -> Scene:
    """Return the break of a rack of discs: a triangle, struck head on at its tip.

    Energy, momentum and symmetry do not determine the outcome.

    Parameters
    ----------
    rows
        Number of rows of the triangle, at least 2: 3 rows are 6 discs and 4 rows are 10, besides the striker.

    Raises
    ------
    InputError
        For a number that is not allowed.

    Examples
    --------
    >>> import deli
    >>> scene = deli.impacts.rack(rows=2)
    >>> scene.bodies, scene.unilateral.rows
    (4, 4)
    >>> after = deli.reflect(scene, scene.position, scene.momentum)
    >>> round(float(after @ after), 6)  # energy is conserved, with masses 1 and speed 1
    1.0
    """
    triangle = _triangle(whole_number("rows of rack", rows, least=2))
    return _struck(np.vstack([[-1.0, 0.0], triangle]), 1.0)


def _triangle(rows: int) -> np.ndarray:
    return np.array([(row * np.sqrt(0.75), place - row / 2) for row in range(rows) for place in range(row + 1)])


def _struck(position: np.ndarray, striker: float) -> Scene:
    """Return bodies that touch at the distance of one diameter; the first one moves along the first axis."""
    bodies, dimension = position.shape
    distances = np.linalg.norm(position[:, None] - position, axis=2)
    mass, momentum = np.ones(bodies), np.zeros(position.shape)
    mass[0] = momentum[0, 0] = striker
    return Scene(
        mass=mass,
        position=position,
        momentum=momentum,
        unilateral=SpheresApart(pairs=np.argwhere(np.triu(distances < _TOUCHING, 1)), distance=1.0),
        dimension=dimension,
    )
