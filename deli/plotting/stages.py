"""Moving bodies, rods and springs of a film: artists that are made once and change their places."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PathCollection, PolyCollection
from matplotlib.patches import Circle
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from deli.mechanics.scene import Scene
from deli.plotting import shapes
from deli.plotting.lines import color
from deli.plotting.trajectory import draw_container

ROD: Any = {"gid": "rods", "colors": "0.25", "linewidths": 1.4, "zorder": 2}
SPRING: Any = {"gid": "springs", "colors": "0.25", "linewidths": 0.9, "linestyles": (0, (2, 1.5)), "zorder": 2}
WALL = "0.2"
POINT, FINEST, FEW = 50.0, 3.0, 8
"""Marker areas in square points of a body without a radius (few bodies, very many), and the number of few bodies."""
BAR = 0.56
MANY = 200
"""The number of bodies beyond which outlines are thin."""


class Stage(ABC):
    """The moving artists of one pair of axes.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes with their limits set and, in space, laid out.
    scene : Scene or None
        Scene with the rods and springs.
    radius : numpy.ndarray
        Radius of each body, 0 for a point.

    Attributes
    ----------
    artists : list of Artist
        All moving artists; their gid is bars, discs, balls, points, rods or springs.
    """

    def __init__(self, axes: Axes, scene: Scene | None, radius: np.ndarray) -> None:
        self._scene = scene
        self._sized, self._points = np.flatnonzero(radius > 0.0), np.flatnonzero(radius <= 0.0)
        self._links = [self._segments(axes, style) for style in (ROD, SPRING)]
        self._bodies = self._draw_bodies(axes, radius)
        self.artists: list[Artist] = [*self._links, *self._bodies]

    def show(self, bodies: np.ndarray) -> None:
        """Move all artists to the places of the bodies, shape (bodies, dimension)."""
        if self._scene is not None:
            for artist, links in zip(self._links, (shapes.rods, shapes.springs), strict=True):
                artist.set_segments(self._ends(links(self._scene, bodies)))
        self._move(bodies)

    def _segments(self, axes: Axes, style: Any) -> Any:
        links = LineCollection([], **style)
        axes.add_collection(links, autolim=False)
        return links

    def _ends(self, segments: np.ndarray) -> np.ndarray:
        return segments

    @abstractmethod
    def _draw_bodies(self, axes: Axes, radius: np.ndarray) -> list[Any]: ...

    @abstractmethod
    def _move(self, bodies: np.ndarray) -> None: ...


class LineStage(Stage):
    """Bodies one above the other: bars as long as their diameters, or points."""

    def _draw_bodies(self, axes: Axes, radius: np.ndarray) -> list[Any]:
        self._corners = np.zeros((len(self._sized), 4, 2))
        self._corners[:, :, 0] = 0.5 + 0.5 * BAR * np.array([-1.0, -1.0, 1.0, 1.0])
        self._half = radius[self._sized, None] * np.array([-1.0, 1.0, 1.0, -1.0])
        bars = PolyCollection(list(self._corners), **_looks(self._sized), zorder=3, gid="bars")
        axes.add_collection(bars, autolim=False)
        return [bars, _scatter(axes, self._points)]

    def _ends(self, segments: np.ndarray) -> np.ndarray:
        return np.concatenate([np.full_like(segments, 0.5), segments], axis=2)

    def _move(self, bodies: np.ndarray) -> None:
        self._corners[:, :, 1] = bodies[self._sized] + self._half
        self._bodies[0].set_verts(self._corners)
        self._bodies[1].set_offsets(np.column_stack([np.full(len(self._points), 0.5), bodies[self._points]]))


class PlaneStage(Stage):
    """Bodies in the plane: discs, or points."""

    def _draw_bodies(self, axes: Axes, radius: np.ndarray) -> list[Any]:
        size = 2.0 * radius[self._sized]
        discs = EllipseCollection(
            size,
            size,
            np.zeros_like(size),
            units="xy",
            offsets=np.zeros((len(size), 2)),
            offset_transform=axes.transData,
            zorder=3,
            gid="discs",
            **_looks(self._sized),
        )
        axes.add_collection(discs, autolim=False)
        return [discs, _scatter(axes, self._points)]

    def _move(self, bodies: np.ndarray) -> None:
        self._bodies[0].set_offsets(bodies[self._sized])
        self._bodies[1].set_offsets(bodies[self._points])


class SpaceStage(Stage):
    """Bodies in space: balls as large as they are seen in parallel projection, or points."""

    def _segments(self, axes: Any, style: Any) -> Any:
        links = Line3DCollection([], **style)
        axes.add_collection3d(links, autolim=False)
        return links

    def _draw_bodies(self, axes: Any, radius: np.ndarray) -> list[Any]:
        area = np.where(radius > 0.0, (2.0 * radius * _points_per_unit(axes)) ** 2, _point(len(radius)))
        places = np.zeros((3, len(radius)))
        looks = _looks(np.arange(len(radius)))
        return [axes.scatter(*places, s=area, depthshade=False, zorder=3, gid="balls", **looks)]

    def _move(self, bodies: np.ndarray) -> None:
        self._bodies[0].set_offsets(bodies[:, :2])
        self._bodies[0].set_3d_properties(bodies[:, 2], "z")


STAGES: dict[int, Callable[[Axes, Scene | None, np.ndarray], Stage]] = {1: LineStage, 2: PlaneStage, 3: SpaceStage}


def _looks(bodies: np.ndarray) -> dict[str, Any]:
    """Return the colours of the bodies, as in plots; outlines are white, and thin for many bodies."""
    faces = [color(int(body)) for body in bodies]
    return {"facecolors": faces, "edgecolors": "white", "linewidths": 0.8 if len(bodies) <= MANY else 0.15}


def _point(bodies: int) -> float:
    return max(FINEST, POINT * min(1.0, FEW / max(bodies, 1)))


def _scatter(axes: Axes, bodies: np.ndarray) -> PathCollection:
    return axes.scatter(
        np.zeros(len(bodies)), np.zeros(len(bodies)), s=_point(len(bodies)), zorder=4, gid="points", **_looks(bodies)
    )


def _points_per_unit(axes: Any) -> float:
    """Return the length on paper, in points, of a unit of length in parallel projection."""
    projection = axes.get_proj()
    pixels = axes.transData.get_matrix()[:2, :2] @ projection[:2, :3] / projection[3, 3]
    return float(np.linalg.svd(pixels, compute_uv=False)[0]) * 72.0 / axes.get_figure(root=True).dpi


def draw_walls(axes: Any, scene: Scene, low: np.ndarray, high: np.ndarray, paths: np.ndarray) -> None:
    """Draw the fixed parts of a scene within the limits ``low`` and ``high``: containers, planes, pivots."""
    if scene.dimension == 1:
        for normal, offset in shapes.planes(scene):
            wall, beyond = offset / normal[0], low[0] if normal[0] > 0.0 else high[0]
            axes.axhline(wall, color=WALL, linewidth=1.0)
            axes.axhspan(min(wall, beyond), max(wall, beyond), color="0.85", zorder=0)
        return
    flat = scene.dimension == 2
    for centre, radius in shapes.containers_near(scene, paths):
        if flat:
            axes.add_patch(Circle(tuple(centre), radius, fill=False, edgecolor=WALL, linewidth=1.2))
        else:
            draw_container(axes, centre, radius)
    planes = list(shapes.planes(scene))
    if flat:
        for normal, offset in planes:
            axes.axline(tuple(offset * normal), tuple(offset * normal + [-normal[1], normal[0]]), color=WALL, lw=1.2)
    else:
        _draw_sides(axes, planes, low.copy(), high.copy())
    axes.plot(*shapes.pivots(scene).T, color=WALL, marker="^", linestyle="none", markersize=5)


def _draw_sides(axes: Any, planes: list[tuple[np.ndarray, float]], low: np.ndarray, high: np.ndarray) -> None:
    """Draw planes in space, cut off at the planes that are perpendicular to an axis."""
    for normal, offset in planes:
        for axis in np.flatnonzero(np.abs(normal) == 1.0):
            wall = offset * normal[axis]
            if low[axis] < wall < high[axis]:
                (low if normal[axis] > 0.0 else high)[axis] = wall
    for normal, offset in planes:
        corners = _section(normal, offset, low, high)
        if len(corners) > 2:
            axes.add_collection3d(Poly3DCollection([corners], facecolors="0.5", edgecolors="0.3", alpha=0.06))


def _section(normal: np.ndarray, offset: float, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the corners, in order, of the polygon that a plane cuts out of a box."""
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
    first, second = np.nonzero(np.triu((corners[:, None] != corners).sum(axis=2) == 1))
    side = corners @ normal - offset
    cut = side[first] * side[second] <= 0.0
    one, other, rest = corners[first[cut]], corners[second[cut]], (side[first] - side[second])[cut]
    share = np.divide(side[first[cut]], rest, out=np.zeros_like(rest), where=rest != 0.0)
    found = np.unique((one + share[:, None] * (other - one)).round(12), axis=0)
    if len(found) < 3:
        return found
    frame = np.linalg.svd(normal[None])[2][1:]
    around = (found - found.mean(axis=0)) @ frame.T
    return found[np.argsort(np.arctan2(around[:, 1], around[:, 0]))]
