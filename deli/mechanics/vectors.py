"""Lengths, directions and nearest periodic images of many vectors at once."""

from __future__ import annotations

import numpy as np

from deli.mechanics.arrays import TINY, Array


def lengths(x: Array) -> Array:
    """Return the euclidean length of each vector, shape (..., dimension) -> (...)."""
    result: Array = np.sqrt(np.vecdot(x, x))
    return result


def directions(x: Array) -> Array:
    """Return each row divided by its length, zero where the length is zero."""
    result: Array = x / np.maximum(lengths(x), TINY)[:, None]
    return result


def nearest_images(x: Array, period: Array) -> Array:
    """Return x - period round(x/period), each separation's nearest periodic image, shape (..., dimension).

    An axis with period 0 is not periodic; along it x is unchanged.
    """
    if not period.any():
        return x
    inverse = np.divide(1.0, period, out=np.zeros_like(period), where=period > 0.0)
    image: Array = x - period * np.rint(x * inverse)
    return image
