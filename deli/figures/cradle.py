"""The duration for which Newton's cradle keeps its cycle, from the share of the energy in the swinging balls."""

import numpy as np
import xarray as xr

from deli.errors import InputError
from deli.mechanics.scene import Scene

CLEAN = 0.9


def swinging_share(scene: Scene, trajectory: xr.Dataset) -> np.ndarray:
    """Return the share of the energy above rest in the balls at one end, the end with more energy, shape (time,).

    The balls at an end are as many as were pulled, with the energy |p_i|²/2m_i + m_i gravity (y_i + length) each. While
    the cradle keeps its cycle, the share is one, except while an impact passes through the balls over several steps.

    Parameters
    ----------
    scene
        A `newtons_cradle`.
    trajectory
        Group ``trajectory`` of the scene's run, with all momenta.

    Raises
    ------
    InputError
        If the scene is not a `newtons_cradle`, or no ball was pulled.
    """
    share: np.ndarray = _ends(scene, _energies(scene, trajectory)).max(axis=1)
    return share


def clean_swings(scene: Scene, trajectory: xr.Dataset, least: float = CLEAN) -> int:
    """Return the number of clean swings at the beginning of the run.

    The two ends swing in turn. A swing is clean if the balls of its end have at least the share ``least`` of the energy
    above rest at the turning point, where the potential energy is largest. The start is the first swing; a cycle has
    two swings.

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
    """Refuse a scene other than a `newtons_cradle` with a pulled ball, with an InputError."""
    if scene.name != "newtons_cradle" or not scene.parameters["pulled"]:
        raise InputError(f"swings need scene newtons_cradle with a pulled ball; found {scene.name}.")


def _energies(scene: Scene, trajectory: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Return the potential energies above rest and the kinetic energies, shape (time, balls)."""
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
