"""Trajectories of bodies: paths in the plane or in space, position over time in one dimension."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.plotting import shapes
from deli.plotting.lines import ALONE, COLORS, Series, color, draw_line, draw_track, legend_below, unit
from deli.recording.schema import TRAJECTORY, dataset_of

RECENT, CLOSE_UP, LONG = 400, 300, 6000


def draw_trajectory(figure: Figure | SubFigure, run: xr.DataTree, scene: Scene | None, series: Series = ALONE) -> None:
    """Draw a run's positions, with walls, rods, springs and radii if the scene is known."""
    recorded = dataset_of(run, TRAJECTORY)
    rows, dimension = recorded.sizes["time"], recorded.sizes["axis"]
    if dimension == 1 and rows > LONG:
        axes, close_up = figure.subplots(2, 1)
        draw_paths(axes, run, scene, series=series)
        draw_paths(close_up, run, scene, CLOSE_UP, series)
        close_up.set_title(f"the first {CLOSE_UP} rows")
    else:
        axes = figure.subplots(subplot_kw={"projection": "3d"} if dimension == 3 else {})
        draw_paths(axes, run, scene, series=series)
    if tells_apart(axes):
        legend_below(figure, axes)


def draw_paths(
    axes: Any, run: xr.DataTree, scene: Scene | None, rows: int | None = None, series: Series = ALONE
) -> None:
    """Draw a run's positions on axes; if `rows` is given, only the first rows.

    Raises
    ------
    InputError
        If the axes and the run do not have the same dimension.
    """
    recorded = dataset_of(run, TRAJECTORY).isel(time=slice(rows))
    position, time = recorded["position"], recorded["time"].values
    dimension = recorded.sizes["axis"]
    if (axes.name == "3d") != (dimension == 3):
        needed = 'projection="3d"' if dimension == 3 else "plain axes"
        raise InputError(f"ax: found {axes.name!r} axes; a run in {dimension} dimensions needs {needed}.")
    paths = position.values.reshape(len(time), -1, dimension)
    draw = {1: _draw_line, 2: _draw_plane, 3: _draw_space}[dimension]
    draw(axes, time, paths, scene, position.attrs["units"], series)


def tells_apart(axes: Axes) -> bool:
    """Tell whether each body has a colour of its own, so that a legend is useful."""
    return len(axes.get_legend_handles_labels()[1]) <= len(COLORS)


def _draw_line(
    axes: Axes, time: np.ndarray, paths: np.ndarray, scene: Scene | None, units: str, series: Series
) -> None:
    for body in range(paths.shape[1]):
        draw_line(axes, time, paths[:, body, 0], label=series.name(f"body {body}"), **series.looks(body))
    for normal, offset in shapes.planes(scene) if scene is not None else ():
        _shade_beyond(axes, float(normal[0]), offset)
    axes.set_ylabel(f"position{unit(units)}")
    axes.set_xlabel("time [T]")
    if len(time) > 1:
        low, high = axes.get_xlim() if series.beside else (time[0], time[-1])
        axes.set_xlim(min(low, time[0]), max(high, time[-1]))
    axes.set_title("position over time")


def _shade_beyond(axes: Axes, normal: float, offset: float) -> None:
    wall, (low, high) = offset / normal, axes.get_ylim()
    margin = 0.04 * (high - low)
    low, high = min(low, wall - margin), max(high, wall + margin)
    axes.axhline(wall, color="0.2", linewidth=1.0)
    axes.axhspan(low if normal > 0 else wall, wall if normal > 0 else high, color="0.85", zorder=0)
    axes.set_ylim(low, high)


def _draw_plane(
    axes: Axes, time: np.ndarray, paths: np.ndarray, scene: Scene | None, units: str, series: Series
) -> None:
    _draw_paths(axes, paths, series)
    draw_bodies(axes, scene, paths[-1])
    axes.set_xlabel(f"x{unit(units)}")
    axes.set_ylabel(f"y{unit(units)}")
    axes.set_title(_explanation(len(time)))


def draw_bodies(axes: Axes, scene: Scene | None, places: np.ndarray) -> None:
    """Draw bodies at the given places in the plane, shape (bodies, 2), with the walls of a known scene."""
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
    axes: Any, time: np.ndarray, paths: np.ndarray, scene: Scene | None, units: str, series: Series
) -> None:
    _draw_paths(axes, paths, series)
    if scene is not None:
        for centre, radius in shapes.containers_near(scene, paths):
            draw_container(axes, centre, radius)
        draw_links(axes, scene, paths[-1])
    axes.set_aspect("equal")
    axes.set_box_aspect(None, zoom=0.88)
    for name in "xyz":
        getattr(axes, f"set_{name}label")(f"{name}{unit(units)}")
    axes.set_title(_explanation(len(time)))


def draw_container(axes: Any, centre: np.ndarray, radius: float) -> None:
    """Draw the wall of a sphere in space."""
    axes.plot_wireframe(*(centre[:, None, None] + radius * sphere()), color="0.8", linewidth=0.3)


def sphere() -> np.ndarray:
    """Return a net of points on the unit sphere, shape (3, n, m)."""
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 37), np.linspace(0, np.pi, 19))
    return np.stack([np.sin(along) * np.cos(around), np.sin(along) * np.sin(around), np.cos(along)])


def _draw_paths(axes: Any, paths: np.ndarray, series: Series) -> None:
    """Draw each path pale and its last part strong, with an open marker at the start and a filled one at the end."""
    for body in range(paths.shape[1]):
        path, hue = paths[:, body], series.looks(body)["hue"]
        if len(paths) > RECENT:
            _draw_path(axes, path, hue, alpha=0.25, linewidth=0.4)
        _draw_path(axes, path[-RECENT:], hue, linewidth=0.9)
        axes.plot(*path[:1].T, color=hue, marker="o", markerfacecolor="none", markersize=5, linestyle="none")
        axes.plot(
            *path[-1:].T, color=hue, marker="o", markersize=5, linestyle="none", label=series.name(f"body {body}")
        )


def _draw_path(axes: Any, path: np.ndarray, hue: str, **style: Any) -> None:
    if path.shape[1] == 2:
        draw_track(axes, path, hue, **style)
    else:
        axes.plot(*path.T, color=hue, **style)


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
