"""Walls, rods and radii of a scene, as shapes in the plane or in space."""

from collections.abc import Iterator

import numpy as np

from deli.mechanics.constraints import ConstraintFamily, Planes
from deli.mechanics.distances import AnchoredRods, Rods, SpheresApart, SpheresInside, SpheresOutside
from deli.mechanics.pair_potentials import Springs
from deli.mechanics.scene import Scene

Point = np.ndarray
Segment = tuple[Point, Point]


def radii(scene: Scene) -> np.ndarray:
    """Return the radius of each body, half the smallest distance it keeps from another; 0 where there is none."""
    found = np.full(scene.bodies, np.inf)
    for family in _families(scene):
        if isinstance(family, SpheresApart) and family.pairs is None and np.size(family.distance) == 1:
            found = np.minimum(found, np.asarray(family.distance, dtype=float).item() / 2.0)
        elif isinstance(family, SpheresApart):
            pairs = _pairs(family, scene)
            for (first, second), distance in zip(pairs, _spread(family.distance, len(pairs)), strict=True):
                found[[first, second]] = np.minimum(found[[first, second]], distance / 2.0)
    return np.where(np.isfinite(found), found, 0.0)


def containers(scene: Scene) -> Iterator[tuple[Point, float]]:
    """Yield centre and radius of each sphere that keeps bodies in or out, its wall where the bodies' surfaces end."""
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


def planes(scene: Scene) -> Iterator[tuple[np.ndarray, float]]:
    """Yield unit normal and offset of each distinct plane."""
    seen = set()
    for family in _families(scene):
        if isinstance(family, Planes):
            count = family.rows
            normals = np.broadcast_to(np.asarray(family.normals, dtype=float), (count, scene.dimension))
            for normal, offset in zip(normals, _spread(family.offsets, count), strict=True):
                length = float(np.linalg.norm(normal))
                plane = (*(normal / length), float(offset) / length)
                if plane not in seen:
                    seen.add(plane)
                    yield np.array(plane[:-1]), plane[-1]


def rods(scene: Scene, bodies: np.ndarray) -> Iterator[Segment]:
    """Yield the ends of each rod, with bodies at the given places, shape (bodies, dimension)."""
    for family in _families(scene):
        if isinstance(family, Rods):
            yield from ((bodies[i], bodies[j]) for i, j in _pairs(family, scene))
        if isinstance(family, AnchoredRods):
            chosen = _bodies(family, scene)
            pivots = np.broadcast_to(np.asarray(family.pivots, dtype=float), (len(chosen), scene.dimension))
            yield from zip(pivots, bodies[chosen], strict=True)


def pivots(scene: Scene) -> np.ndarray:
    """Return all fixed pivots, shape (pivots, dimension)."""
    found = [np.zeros((0, scene.dimension))]
    for family in _families(scene):
        if isinstance(family, AnchoredRods):
            count = len(_bodies(family, scene))
            found.append(np.broadcast_to(np.asarray(family.pivots, dtype=float), (count, scene.dimension)))
    return np.concatenate(found)


def springs(scene: Scene, bodies: np.ndarray) -> Iterator[Segment]:
    """Yield the ends of each spring, with bodies at the given places."""
    for family in scene.potential.families:
        if isinstance(family, Springs):
            yield from ((bodies[i], bodies[j]) for i, j in _pairs(family, scene))


def _families(scene: Scene) -> tuple[ConstraintFamily, ...]:
    return (*scene.unilateral.families, *scene.bilateral.families)


def _pairs(family: SpheresApart | Rods | Springs, scene: Scene) -> list[tuple[int, int]]:
    if family.pairs is None:
        return [(i, j) for i in range(scene.bodies) for j in range(i + 1, scene.bodies)]
    return [(int(i), int(j)) for i, j in np.asarray(family.pairs)]


def _bodies(family: SpheresInside | SpheresOutside | AnchoredRods, scene: Scene) -> np.ndarray:
    return np.arange(scene.bodies) if family.bodies is None else np.asarray(family.bodies)


def _spread(value: object, count: int) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, dtype=float), (count,))
