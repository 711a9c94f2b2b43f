"""A gas of equal hard spheres in a periodic cube or in a box."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from deli.errors import InputError
from deli.mechanics.arrays import Array, body_count, positive_number, whole_number
from deli.mechanics.constraints import ConstraintFamily, Planes
from deli.mechanics.distances import SpheresApart
from deli.mechanics.scene import Scene
from deli.scenes.reading import between, jitter_of, one_of
from deli.scenes.registry import scene


@scene(step_size=0.01, duration=20.0, scheme="midpoint")
def hard_sphere_gas(
    *,
    spheres: int = 100,
    filled: float = 0.2,
    boundary: str = "periodic",
    radius: float = 1.0,
    mass: float = 1.0,
    temperature: float = 1.0,
    jitter: float = 0.5,
    seed: int = 1,
) -> Scene:
    """Return equal hard spheres moving freely in a cube of side L = (spheres 4/3 pi radius^3 / filled)^(1/3).

    The radius is given (1 by default), so that the density stays the same as the number of spheres grows. No two
    spheres overlap, |q_i - q_j| - 2 radius >= 0. With ``boundary="periodic"`` the distance is that to the nearest image
    in the cube [0, L), and positions are not wrapped back into the cube. With ``boundary="walls"`` spheres stay inside
    [0, L]: q_i - radius >= 0 and L - radius - q_i >= 0 along each axis.

    Spheres start near the sites of a lattice that fills the cube: the simple, the body-centred or the face-centred
    cubic lattice, whichever has the widest spacing for this number of spheres. Excess sites, chosen at random, stay
    empty. Random displacements are so small that no two spheres can meet. Velocities have Maxwell's distribution, less
    their mean: the total momentum is zero.

    Parameters
    ----------
    spheres
        Number of spheres, at least 2.
    filled
        Share of the cube's volume that the spheres fill, > 0. Its largest value depends on how nearly the number of
        spheres fills a lattice: at least 0.23 from 4 spheres up, at least 0.43 from 300 up, and above 0.5 for most
        numbers.
    boundary
        "periodic" or "walls".
    radius
        Radius of every sphere.
    mass
        Mass of every sphere.
    temperature
        Mean of mass v^2 along one axis.
    jitter
        Share of the room between lattice sites within which the initial positions are random, >= 0 and < 1.
    seed
        Seed of the random positions and velocities.

    Examples
    --------
    >>> import deli
    >>> scene = deli.scenes.hard_sphere_gas(spheres=8)
    >>> scene.bodies, scene.unilateral.rows
    (8, 28)
    >>> bool((scene.unilateral.value(scene.position) > 0.0).all())
    True
    """
    spheres = body_count("spheres of hard_sphere_gas", spheres, least=2)
    boundary = one_of("boundary of hard_sphere_gas", boundary, ("periodic", "walls"))
    radius = positive_number("radius of hard_sphere_gas", radius)
    mass = positive_number("mass of hard_sphere_gas", mass)
    temperature = positive_number("temperature of hard_sphere_gas", temperature)
    jitter = jitter_of("jitter of hard_sphere_gas", jitter)
    share = between("filled of hard_sphere_gas", filled, 0.0, 1.0)
    random = np.random.default_rng(whole_number("seed of hard_sphere_gas", seed))
    side = (spheres * 4.0 / 3.0 * math.pi / share) ** (1.0 / 3.0)  # in units of the radius
    lattice = max(_lattices(spheres), key=lambda lattice: lattice.spacing(side, boundary))
    spacing = lattice.spacing(side, boundary)
    if spacing <= 2.0 or side < 4.0:
        raise InputError(
            f"filled of hard_sphere_gas: found {filled!r}, which leaves no room to place {spheres} spheres on a "
            f"lattice in a cube of side {side:.3g} radii; take a smaller share, or more spheres"
        )
    chosen = np.sort(random.permutation(lattice.sites)[:spheres])
    reach = 0.5 * jitter * (spacing - 2.0)
    moves = reach / math.sqrt(3.0) * random.uniform(-1.0, 1.0, (spheres, 3))
    velocities = math.sqrt(temperature / mass) * random.standard_normal((spheres, 3))
    start = 0.0 if boundary == "periodic" else 0.5 * spacing
    position = radius * (start + spacing / lattice.widening * lattice.coordinates()[chosen] + moves)
    return Scene(
        mass=mass,
        position=position,
        momentum=mass * (velocities - velocities.mean(axis=0)),
        unilateral=_contacts(spheres, boundary, radius, radius * side),
        dimension=3,
    )


@dataclass(frozen=True)
class _Lattice:
    """Cubic cells with sites at the given corners and centres, in units of half the cell (the cell, if simple)."""

    cells: int
    per_cell: int
    corners: tuple[tuple[int, int, int], ...]
    widening: float
    """Distance of neighbouring sites in that unit."""

    @property
    def sites(self) -> int:
        return self.cells**3 * len(self.corners)

    def spacing(self, side: float, boundary: str) -> float:
        """Return the distance of neighbouring sites, in radii, in a cube of side ``side`` radii.

        The walls are half that distance away from the outermost sites.
        """
        steps = self.cells * self.per_cell
        return self.widening * side / (steps if boundary == "periodic" else steps - 1 + self.widening)

    def coordinates(self) -> Array:
        """Return all sites in whole numbers of units, shape (sites, 3)."""
        cell = np.stack(np.unravel_index(np.arange(self.cells**3), (self.cells,) * 3), axis=1)
        every: Array = (self.per_cell * cell[:, None] + np.array(self.corners)).reshape(-1, 3).astype(np.float64)
        return every


def _lattices(spheres: int) -> list[_Lattice]:
    """Return the smallest lattice of each kind with at least this many sites."""
    centred = ((0, 0, 0), (1, 1, 1))
    faces = ((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0))
    corners: tuple[tuple[int, int, int], ...]
    found = []
    for per_cell, corners, widening in (
        (1, centred[:1], 1.0),
        (2, centred, math.sqrt(3.0)),
        (2, faces, math.sqrt(2.0)),
    ):
        cells = 2 if per_cell == 1 else 1
        while cells**3 * len(corners) < spheres:
            cells += 1
        found.append(_Lattice(cells, per_cell, corners, widening))
    return found


def _contacts(spheres: int, boundary: str, radius: float, side: float) -> list[ConstraintFamily]:
    if boundary == "periodic":
        return [SpheresApart(pairs=None, distance=2.0 * radius, period=side)]
    inward = np.concatenate([np.eye(3), -np.eye(3)])
    offsets = np.repeat([radius, radius - side], 3)
    walls = Planes(np.tile(inward, (spheres, 1)), np.tile(offsets, spheres), np.repeat(np.arange(spheres), 6))
    return [SpheresApart(pairs=None, distance=2.0 * radius), walls]
