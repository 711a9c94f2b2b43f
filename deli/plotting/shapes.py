"""Walls, rods and radii of a scene, as shapes in the plane or in space."""

from collections.abc import Iterator

import numpy as np

from deli.mechanics.constraints import ConstraintFamily, Planes
from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside, SpheresOutside
from deli.mechanics.pair_potentials import Springs
from deli.mechanics.scene import Scene

Point = np.ndarray


def radii(scene: Scene) -> np.ndarray:
    """Return the radius of each body, half its smallest distance from another body; 0 without such a constraint."""
    found = np.full(scene.bodies, np.inf)
    for family in _families(scene):
        if isinstance(family, SpheresApart) and family.pairs is None and np.size(family.distance) == 1:
            found = np.minimum(found, np.asarray(family.distance, dtype=float).item() / 2.0)
        elif isinstance(family, SpheresApart):
            pairs = _pairs(family, scene)
            np.minimum.at(found, pairs, _spread(family.distance, len(pairs))[:, None] / 2.0)
    return np.where(np.isfinite(found), found, 0.0)


def period(scene: Scene) -> np.ndarray:
    """Return the length of the periodic box along each axis; 0 along an axis that is not periodic."""
    found = np.zeros(scene.dimension)
    for family in _families(scene):
        if isinstance(family, SpheresApart) and family.period is not None:
            found = np.maximum(found, np.asarray(family.period, dtype=float))
    return found


def containers(scene: Scene) -> Iterator[tuple[Point, float]]:
    """Yield centre and radius of each spherical wall, moved by the radii of bodies to touch their surfaces."""
    seen = set()
    size = radii(scene)
    for family in _families(scene):
        if isinstance(family, SpheresInside | SpheresOutside):
            outward = 1.0 if isinstance(family, SpheresInside) else -1.0
            bodies = _bodies(family, scene)
            centres = np.broadcast_to(np.asarray(family.centre, dtype=float), (len(bodies), scene.dimension))
            for body, centre, radius in zip(bodies, centres, _spread(family.radius, len(bodies)), strict=True):
                wall = (*centre, round(float(radius + outward * size[body]), 12))
                if wall not in seen:
                    seen.add(wall)
                    yield centre, wall[-1]


def containers_near(scene: Scene, paths: np.ndarray) -> Iterator[tuple[Point, float]]:
    """Yield the containers near the bodies; with a distant wall, the bodies would be drawn as a dot."""
    for centre, radius in containers(scene):
        if np.linalg.norm(paths - centre, axis=-1).max() >= 0.5 * radius:
            yield centre, radius


def planes(scene: Scene) -> Iterator[tuple[np.ndarray, float]]:
    """Yield unit normal and offset of each distinct plane, moved by the radii of bodies to touch their surfaces."""
    seen = set()
    size = radii(scene)
    for family in _families(scene):
        if isinstance(family, Planes):
            bodies = _bodies(family, scene)
            normals = np.broadcast_to(np.asarray(family.normals, dtype=float), (len(bodies), scene.dimension))
            length = np.linalg.norm(normals, axis=1)
            offsets = _spread(family.offsets, len(bodies)) / length - size[bodies]
            for normal, offset in zip(normals / length[:, None], offsets.round(12), strict=True):
                plane = (*normal, offset)
                if plane not in seen:
                    seen.add(plane)
                    yield normal, float(offset)


def rods(scene: Scene, bodies: np.ndarray) -> np.ndarray:
    """Return the ends of all rods, shape (rods, 2, dimension), with bodies at places of shape (bodies, dimension)."""
    found = [np.zeros((0, 2, scene.dimension))]
    for family in _families(scene):
        if isinstance(family, Rods):
            found.append(bodies[_pairs(family, scene)])
        if isinstance(family, AnchoredRods):
            chosen = _bodies(family, scene)
            found.append(np.stack([np.broadcast_to(family.pivots, bodies[chosen].shape), bodies[chosen]], axis=1))
    return np.concatenate(found)


def pivots(scene: Scene) -> np.ndarray:
    """Return all fixed pivots, shape (pivots, dimension)."""
    found = [np.zeros((0, scene.dimension))]
    for family in _families(scene):
        if isinstance(family, AnchoredRods):
            count = len(_bodies(family, scene))
            found.append(np.broadcast_to(np.asarray(family.pivots, dtype=float), (count, scene.dimension)))
    return np.concatenate(found)


def springs(scene: Scene, bodies: np.ndarray) -> np.ndarray:
    """Return the ends of all springs, shape (springs, 2, dimension), with bodies at the given places."""
    found = [np.zeros((0, 2, scene.dimension))]
    found += [bodies[_pairs(family, scene)] for family in scene.potential.families if isinstance(family, Springs)]
    return np.concatenate(found)


def _families(scene: Scene) -> tuple[ConstraintFamily, ...]:
    return (*scene.unilateral.families, *scene.bilateral.families)


def _pairs(family: SpheresApart | Rods | Springs, scene: Scene) -> np.ndarray:
    if family.pairs is None:
        return np.stack(np.triu_indices(scene.bodies, 1), axis=1)
    return np.asarray(family.pairs, dtype=int).reshape(-1, 2)


def _bodies(family: Planes | SpheresInside | SpheresOutside | AnchoredRods, scene: Scene) -> np.ndarray:
    return np.arange(scene.bodies) if family.bodies is None else np.asarray(family.bodies)


def _spread(value: object, count: int) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, dtype=float), (count,))
