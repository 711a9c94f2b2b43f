"""Random perturbations of initial states, for ensembles: the same for the same seed, on every machine."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from deli.errors import InputError
from deli.mechanics.arrays import real_number, whole_number
from deli.mechanics.scene import Scene

DEFAULTS: dict[str, Any] = {"seed": 0, "position": 0.0, "momentum": 0.0}
"""Keys of a perturbation: the seed, and the standard deviations of the noise in each coordinate."""


def read_perturbation(name: str, found: Any) -> dict[str, Any]:
    """Read a perturbation's table, with defaults for missing keys.

    Raises
    ------
    InputError
        For an unknown key or a value out of range; the message names the key, the value found and the allowed ones.
    """
    if not isinstance(found, Mapping) or not set(found) <= set(DEFAULTS):
        raise InputError(f"{name}: found {found!r}; pass a table with some of the keys {', '.join(DEFAULTS)}")
    table = {**DEFAULTS, **found}
    read: dict[str, Any] = {"seed": whole_number(f"{name}.seed", table["seed"])}
    for key in ("position", "momentum"):
        read[key] = real_number(f"{name}.{key}", table[key])
        if read[key] < 0.0:
            raise InputError(f"{name}.{key}: found {table[key]!r}; it must be >= 0")
    return read


def perturb(scene: Scene, table: Mapping[str, Any]) -> Scene:
    """Return a scene that starts at q + s_q x, p + s_p y with independent standard normal x and y.

    x and y are the first and second `dof` numbers of ``numpy.random.default_rng(seed)``, so neither depends on the
    scales s_q and s_p. With bilateral constraints, y is projected off their gradients in the metric of M^-1.

    Raises
    ------
    InputError
        If the scene cannot start there: bodies overlap, or bilateral constraints are missed.
    """
    x, y = np.random.default_rng(table["seed"]).standard_normal((2, scene.dof))
    position = scene.position + table["position"] * x
    try:
        moved = dataclasses.replace(scene, position=position, momentum=np.zeros(scene.dof))
        momentum = scene.momentum + _tangential(moved, table["momentum"] * y)
        return dataclasses.replace(moved, momentum=momentum)
    except InputError as error:
        raise InputError(
            f"perturbation (seed {table['seed']}): {error}; or perturb less, or the momentum only"
        ) from error


def _tangential(scene: Scene, y: np.ndarray) -> np.ndarray:
    """Return y without its part along bilateral gradients: y - F^T w with F M^-1 (y - F^T w) = 0."""
    families = scene.bilateral.families
    if not families:
        return y
    jacobian = np.concatenate([family.jacobian(scene.position) for family in families])
    root = np.sqrt(scene.mass)
    scaled = jacobian / root
    multipliers = np.linalg.lstsq(scaled.T, y / root, rcond=None)[0]
    return y - jacobian.T @ multipliers
