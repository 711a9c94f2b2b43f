"""Pictures of figures from their datasets: panels over time, or bodies in space."""

import math
import tomllib
from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from deli import scenes
from deli.figures.model import DrawnRunTable, FigureConfig, PanelTable
from deli.figures.quantities import QUANTITIES
from deli.mechanics.scene import Scene
from deli.plotting import shapes
from deli.plotting.lines import color, draw_line, legend_above, plain, unit
from deli.plotting.style import STYLE, new_figure
from deli.plotting.trajectory import draw_bodies, draw_container, draw_links, sphere
from deli.recording.schema import dataset_of

FLAT = 1e-6
HUES = {"blue": color(0), "red": color(1), "green": color(2), "purple": color(3), "orange": color(4), "black": color(6)}
WIDTH, PANEL_HEIGHT, SNAPSHOT_COLUMNS = 8.0, 2.6, 4


def draw(config: FigureConfig, data: xr.DataTree) -> Figure:
    """Draw a figure from its dataset, with one group a run."""
    with matplotlib.rc_context(STYLE):
        if config.table.view is None:
            figure = _draw_panels(config, data)
        elif config.table.view.times is None:
            figure = _draw_paths(data)
        else:
            figure = _draw_snapshots(data)
        shortened = " (quick: shorter runs)" if data.attrs["quick"] and config.table.quick else ""
        figure.suptitle(f"{plain(config.name)}  {plain(config.table.title)}{shortened}", fontsize=11)
    return figure


def _draw_panels(config: FigureConfig, data: xr.DataTree) -> Figure:
    panels = config.table.panels
    figure = new_figure((WIDTH, 0.9 + PANEL_HEIGHT * max(len(panels), 1.5)))
    column = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, panel in zip(column, panels, strict=True):
        _draw_panel(axes, panel, config.table.runs, data)
    column[-1].set_xlabel("time [T]")
    end = max(float(dataset_of(data, run)["time"][-1]) for run in config.table.runs)
    if end > 0.0:  # zero if the first step failed
        column[-1].set_xlim(0.0, end)
    figure.align_ylabels(column)
    return figure


def _draw_panel(axes: Axes, panel: PanelTable, runs: Mapping[str, DrawnRunTable], data: xr.DataTree) -> None:
    chosen = panel.runs or list(runs)
    for run in chosen:
        shown, drawn = dataset_of(data, run), runs[run]
        label = plain(drawn.label) + _reservations(shown)
        time = shown["time"].values
        lines = [line for name in panel.quantities for line in _lines(name, shown[name])]
        for index, (symbol, values) in enumerate(lines):
            words = [label] if len(lines) == 1 else [symbol] if len(chosen) == 1 else [label, symbol]
            hue = color(index) if len(lines) > 1 and len(chosen) == 1 else HUES[drawn.color]
            draw_line(axes, time, values, hue, ", ".join(words), linestyle=drawn.style, linewidth=0.8)
        if len(lines) > 1 and len(chosen) == 1:
            axes.set_title(label)
    labels = [
        (values.attrs["long_name"], unit(values.attrs["units"])) for values in (shown[q] for q in panel.quantities)
    ]
    axes.set_ylabel("\n".join(words + units for words, units in labels))
    axes.ticklabel_format(axis="y", useOffset=False)
    _set_limits(axes, panel)
    legend_above(axes)


def _reservations(shown: xr.Dataset) -> str:
    """Return remarks on a run that its line does not show: the interval of recorded steps, and an early end."""
    words = []
    if (every := tomllib.loads(shown.attrs["config"])["record"]["every"]) > 1:
        words.append(f"one step in {every}")
    if shown.attrs["outcome"] != "complete":
        words.append(f"stopped at time {float(shown['time'][-1]):.6g}")
    return f" ({', '.join(words)})" if words else ""


def _set_limits(axes: Axes, panel: PanelTable) -> None:
    """Set the panel's limits of the values, or limits in which values that are constant to rounding look constant."""
    low, high = axes.dataLim.intervaly
    scale = max(abs(low), abs(high))
    if panel.limits is not None:
        axes.set_ylim(*panel.limits)
    elif high - low <= FLAT * scale:
        axes.set_ylim(low - 0.1 * scale, high + 0.1 * scale)


def _lines(name: str, values: xr.DataArray) -> list[tuple[str, np.ndarray]]:
    """Return a quantity's components over time, each with its symbol."""
    symbol = QUANTITIES[name].symbol
    if values.ndim == 1:
        return [(f"${symbol}$", values.values)]
    closing = symbol[-1] if symbol[-1] == "|" else ""
    stem = symbol.removesuffix("|")
    return [(f"${stem}_{index + 1}{closing}$", column) for index, column in enumerate(values.values.T)]


def _draw_paths(data: xr.DataTree) -> Figure:
    scene, time, places = _bodies(data)
    figure = new_figure((7.0, 7.0))
    axes = _spaces(figure, 1, 1, scene)[0]
    for body in range(scene.bodies):
        axes.plot(*places[:, body].T, color=color(body), linewidth=0.25, label=f"body {body + 1}")
    _draw_walls(axes, scene)
    (shown,) = (dataset_of(data, name) for name in data.children)
    axes.set_title(f"time {time[0]:.6g} to {time[-1]:.6g}{_reservations(shown)}")
    legend = axes.legend(loc="upper right")
    for line in legend.get_lines():
        line.set_linewidth(1.5)
    return figure


def _draw_snapshots(data: xr.DataTree) -> Figure:
    scene, time, places = _bodies(data)
    columns = min(SNAPSHOT_COLUMNS, len(places))
    rows = math.ceil(len(places) / columns)
    figure = new_figure((7.0, 7.0) if len(places) == 1 else (3.0 * columns, 0.7 + 1.4 * rows))
    for axes, bodies, moment in zip(_spaces(figure, rows, columns, scene), places, time, strict=False):
        if scene.dimension == 2:
            draw_bodies(axes, scene, bodies)
        else:
            draw_links(axes, scene, bodies)
            for body, radius in enumerate(shapes.radii(scene)):
                ball = bodies[body][:, np.newaxis, np.newaxis] + radius * sphere()
                axes.plot_surface(*ball, color=color(body), linewidth=0)
            _draw_walls(axes, scene)
        axes.set_title(f"time {moment:.6g}")
    return figure


def _bodies(data: xr.DataTree) -> tuple[Scene, np.ndarray, np.ndarray]:
    """Return the scene, the times and the bodies' places, shape (time, bodies, dimension), of the run of a view."""
    (name,) = data.children
    shown, config = dataset_of(data, name), tomllib.loads(data.children[name].attrs["config"])
    scene = scenes.get(config["scene"].pop("name"))(**config["scene"])
    return scene, shown["time"].values, shown["position"].values.reshape(-1, scene.bodies, scene.dimension)


def _spaces(figure: Figure, rows: int, columns: int, scene: Scene) -> list[Any]:
    """Return axes in the plane or in space, with common limits."""
    space: Any = {"subplot_kw": {"projection": "3d"}} if scene.dimension == 3 else {}
    found = list(figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False, **space).flat)
    for axes in found:
        for name in "xyz"[: scene.dimension]:
            getattr(axes, f"set_{name}label")(f"{name} [L]")
        axes.label_outer()
    return found


def _draw_walls(axes: Any, scene: Scene) -> None:
    for centre, radius in shapes.containers(scene):
        draw_container(axes, centre, radius)
    axes.set_aspect("equal")
