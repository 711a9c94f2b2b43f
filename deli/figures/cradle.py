"""How long Newton's cradle keeps its cycle: which balls have the energy that the pulled ones start with."""

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.mechanics.scene import Scene

CLEAN = 0.9


def swinging_share(scene: Scene, trajectory: xr.Dataset) -> np.ndarray:
    """Return the share of the energy above rest that the balls at one end have, the end with more, shape (time,).

    These are as many balls as were pulled, with |p_i|²/2m_i + m_i gravity (y_i + length) each. While the cradle keeps
    its cycle they have all of it, except while a blow is handed on from one step to the next.

    Parameters
    ----------
    scene
        A `newtons_cradle`.
    trajectory
        Group ``trajectory`` of its run, with all momenta.

    Raises
    ------
    InputError
        If the scene is another, or no ball was pulled.
    """
    share: np.ndarray = _ends(scene, _energies(scene, trajectory)).max(axis=1)
    return share


def clean_swings(scene: Scene, trajectory: xr.Dataset, least: float = CLEAN) -> int:
    """Return how many swings the cradle begins with that are clean.

    A swing is clean if at its turning point, where the potential energy is largest, the balls of the end whose turn it
    is have at least the share ``least`` of the energy above rest. The start is the first swing; a cycle has two.

    Raises
    ------
    InputError
        As for `swinging_share`.
    """
    energies = _energies(scene, trajectory)
    potential, total = energies[0].sum(axis=1), np.add(*energies).sum(axis=1)
    inner = potential[1:-1]
    turning = (inner >= potential[:-2]) & (inner > potential[2:]) & (inner > 0.5 * total[1:-1])
    rows = np.concatenate([[0], 1 + np.flatnonzero(turning)])
    share = _ends(scene, energies)[rows, np.arange(len(rows)) % 2]
    spoilt = np.flatnonzero(share < least)
    return int(spoilt[0]) if len(spoilt) else len(rows)


def check_cradle(scene: Scene) -> None:
    """Refuse what is no cradle that swings, with an InputError."""
    if scene.name != "newtons_cradle" or not scene.parameters["pulled"]:
        raise InputError(f"swings are those of scene newtons_cradle with a ball that is pulled; found {scene.name}.")


def _energies(scene: Scene, trajectory: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Potential energies above rest and kinetic ones, shape (time, balls)."""
    check_cradle(scene)
    shape = (-1, scene.bodies, scene.dimension)
    height = trajectory["position"].values.reshape(shape)[..., 1] + scene.parameters["length"]
    square = (trajectory["momentum"].values ** 2 / scene.mass).reshape(shape).sum(axis=2)
    mass = scene.mass.reshape(scene.bodies, scene.dimension)[:, 0]
    return mass * scene.parameters["gravity"] * height, 0.5 * square


def _ends(scene: Scene, energies: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    energy, pulled = np.add(*energies), scene.parameters["pulled"]
    ends = np.stack([energy[:, :pulled].sum(axis=1), energy[:, -pulled:].sum(axis=1)], axis=1)
    shares: np.ndarray = ends / energy.sum(axis=1, keepdims=True)
    return shares
