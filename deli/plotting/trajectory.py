"""Where the bodies go: paths in the plane or in space, height over time on a line."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle

from deli.mechanics.scene import Scene
from deli.plotting import shapes
from deli.plotting.lines import POINTS, color, draw_line, legend_below, unit
from deli.recording.schema import TRAJECTORY, dataset_of

RECENT, CLOSE_UP, PATH_POINTS = 400, 300, 20_000


def draw_trajectory(figure: Figure | SubFigure, run: xr.DataTree, scene: Scene | None) -> None:
    """Draw a run's positions with the scene's walls, rods, springs and radii, as far as they are known."""
    recorded = dataset_of(run, TRAJECTORY)
    position, time = recorded["position"], recorded["time"].values
    dimension = recorded.sizes["axis"]
    paths = position.values.reshape(len(time), -1, dimension)
    {1: _draw_line, 2: _draw_plane, 3: _draw_space}[dimension](figure, time, paths, scene, position.attrs["units"])


def _draw_line(
    figure: Figure | SubFigure, time: np.ndarray, paths: np.ndarray, scene: Scene | None, units: str
) -> None:
    long = len(time) > POINTS
    panels = figure.subplots(2 if long else 1, 1, squeeze=False)[:, 0]
    for axes, end in zip(panels, (len(time), CLOSE_UP), strict=False):
        for body in range(paths.shape[1]):
            draw_line(axes, time[:end], paths[:end, body, 0], color(body), f"body {body}")
        for normal, offset in shapes.planes(scene) if scene is not None else ():
            _shade_beyond(axes, float(normal[0]), offset)
        axes.set_ylabel(f"position{unit(units)}")
        axes.set_xlabel("time [T]")
        if len(time) > 1:
            axes.set_xlim(time[0], time[end - 1])
    panels[0].set_title("position over time")
    legend_below(figure, panels[0])
    if long:
        panels[1].set_title(f"the first {CLOSE_UP} rows")


def _shade_beyond(axes: Axes, normal: float, offset: float) -> None:
    wall, (low, high) = offset / normal, axes.get_ylim()
    margin = 0.04 * (high - low)
    low, high = min(low, wall - margin), max(high, wall + margin)
    axes.axhline(wall, color="0.2", linewidth=1.0)
    axes.axhspan(low if normal > 0 else wall, wall if normal > 0 else high, color="0.85", zorder=0)
    axes.set_ylim(low, high)


def _draw_plane(
    figure: Figure | SubFigure, time: np.ndarray, paths: np.ndarray, scene: Scene | None, units: str
) -> None:
    axes = figure.subplots()
    _draw_paths(axes, paths)
    draw_bodies(axes, scene, paths[-1])
    axes.set_xlabel(f"x{unit(units)}")
    axes.set_ylabel(f"y{unit(units)}")
    axes.set_title(_explanation(len(time)))
    legend_below(figure, axes)


def draw_bodies(axes: Axes, scene: Scene | None, places: np.ndarray) -> None:
    """Draw bodies at the given places in the plane, shape (bodies, 2), among what is known of the scene's walls."""
    size = np.zeros(len(places)) if scene is None else shapes.radii(scene)
    if scene is not None:
        for centre, radius in shapes.containers(scene):
            axes.add_patch(Circle(tuple(centre), radius, fill=False, edgecolor="0.2", linewidth=1.2))
        draw_links(axes, scene, places)
        pivots = shapes.pivots(scene)
        axes.plot(*pivots.T, color="0.2", marker="^", linestyle="none", markersize=5)
    for body, place in enumerate(places):
        if size[body] > 0:
            axes.add_patch(Circle(tuple(place), size[body], facecolor=color(body), alpha=0.25, edgecolor=color(body)))
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.08)
    axes.autoscale_view()
    for normal, offset in shapes.planes(scene) if scene is not None else ():
        axes.axline(tuple(offset * normal), slope=_slope(normal), color="0.2", linewidth=1.2)


def _draw_space(
    figure: Figure | SubFigure, time: np.ndarray, paths: np.ndarray, scene: Scene | None, units: str
) -> None:
    axes: Any = figure.subplots(subplot_kw={"projection": "3d"})
    _draw_paths(axes, paths)
    if scene is not None:
        for centre, radius in shapes.containers_near(scene, paths):
            draw_container(axes, centre, radius)
        draw_links(axes, scene, paths[-1])
    axes.set_aspect("equal")
    axes.set_box_aspect(None, zoom=0.88)
    for name in "xyz":
        getattr(axes, f"set_{name}label")(f"{name}{unit(units)}")
    axes.set_title(_explanation(len(time)))
    legend_below(figure, axes)


def draw_container(axes: Any, centre: np.ndarray, radius: float) -> None:
    """Draw the wall of a sphere in space."""
    axes.plot_wireframe(*(centre[:, None, None] + radius * sphere()), color="0.8", linewidth=0.3)


def sphere() -> np.ndarray:
    """Return a net of points on the unit sphere, shape (3, n, m)."""
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 37), np.linspace(0, np.pi, 19))
    return np.stack([np.sin(along) * np.cos(around), np.sin(along) * np.sin(around), np.cos(along)])


def _draw_paths(axes: Any, paths: np.ndarray) -> None:
    """Draw the whole of each path palely, its last part strongly, its start open and its end filled."""
    stride = max(1, len(paths) // PATH_POINTS)
    for body in range(paths.shape[1]):
        path, hue = paths[:, body], color(body)
        if len(paths) > RECENT:
            axes.plot(*path[::stride].T, color=hue, alpha=0.25, linewidth=0.4)
        axes.plot(*path[-RECENT:].T, color=hue, linewidth=0.9)
        axes.plot(*path[:1].T, color=hue, marker="o", markerfacecolor="none", markersize=5, linestyle="none")
        axes.plot(*path[-1:].T, color=hue, marker="o", markersize=5, linestyle="none", label=f"body {body}")


def draw_links(axes: Any, scene: Scene, bodies: np.ndarray) -> None:
    """Draw a scene's rods and springs between bodies at the given places, shape (bodies, dimension)."""
    for one, other in shapes.rods(scene, bodies):
        axes.plot(*np.stack([one, other]).T, color="0.25", linewidth=1.4)
    for one, other in shapes.springs(scene, bodies):
        axes.plot(*np.stack([one, other]).T, color="0.25", linewidth=0.9, linestyle=(0, (2, 1.5)))


def _slope(normal: np.ndarray) -> float:
    return float("inf") if normal[1] == 0 else float(-normal[0] / normal[1])


def _explanation(rows: int) -> str:
    strong = f"; strong: the last {RECENT} rows" if rows > RECENT else ""
    return f"paths (open: start, filled: end{strong})"
