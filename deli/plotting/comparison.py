"""Plots that compare the cases of a study by their metrics; each draws on given axes or on new ones."""

import sys
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patches import Patch, Rectangle

from deli.errors import InputError
from deli.numerals import numeral
from deli.plotting.lines import COLORS, color, draw_line, plain, unit
from deli.plotting.style import STYLE, new_figure
from deli.recording.schema import TRAJECTORY, dataset_of

MARKERS = "osD^vPX*"
MOST_WORDS = 8  # the most columns of a heat map with numbers in its cells
WIDTH = 40  # characters in a line of a label
FLOOR = 1e-17  # the value at which zeros are drawn on a logarithmic axis


def pareto(data: xr.Dataset, x: str, y: str, by: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw cases as points in two metrics, and join the cases that no other case beats in both metrics.

    A case without a point is not completed, or one of its metrics is unknown; the legend gives the number of points if
    it is not the number of cases.

    Parameters
    ----------
    data : xarray.Dataset
        Metrics on the axes of a study, as in ``deli.open_study(DIR)``.
    x, y : str
        Metrics, the smaller the better, such as ``solver_time`` and ``energy_band``; magnitudes are drawn.
    by : str, optional
        Axis that determines the colour of points.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on (default: a new figure's).

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    The metrics of two runs stand for the dataset of a study.

    >>> import xarray as xr
    >>> import deli
    >>> runs = [deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=h, duration=5.0) for h in (0.1, 0.05)]
    >>> steps = xr.DataArray([0.1, 0.05], dims="step_size", name="step_size")
    >>> data = xr.concat([deli.metrics.measure(run) for run in runs], steps)
    >>> data["state"] = "step_size", ["done", "done"]
    >>> deli.plotting.pareto(data, "wall_time", "energy_band").get_xlabel()
    'wall time of the run [s]'
    """
    axes = _axes(ax, data, x, y)
    points: list[tuple[float, float]] = []
    for index, (label, part) in enumerate(_parts(data, by)):
        across, up = _finished(part, x, y)
        cases = int((part["state"] != "excluded").sum())
        if label is not None and len(across) < cases:
            label = f"{label} ({len(across):,} of {cases:,} cases)"
        axes.plot(across, up, color=color(index), marker=_marker(index), linestyle="none", markersize=4, label=label)
        points.extend(zip(across, up, strict=True))
    front = _front(np.array(points).reshape(-1, 2))
    axes.plot(*front.T, color="0.4", linewidth=0.9, drawstyle="steps-post", zorder=0.5, label="best")
    return _finish(axes)


def work_precision(
    data: xr.Dataset, cost: str, error: str, along: str, by: str | None = None, ax: Axes | None = None
) -> Axes:
    """Draw error against cost, one line for each label of an axis; lower left is better.

    A point is the geometric mean over all other axes, and all points are means of the same cases. Cases in which the
    two metrics are known at no point are ignored; a point that lacks one of the other cases is left out. The legend
    gives the number of cases behind a point, and the number of points of an incomplete line.

    Parameters
    ----------
    data : xarray.Dataset
        Metrics on the axes of a study.
    cost, error : str
        Metrics, such as ``wall_time`` or ``solves`` and ``trajectory_error``; magnitudes are drawn.
    along : str
        Axis that a line runs along, such as ``step_size``.
    by : str, optional
        Axis with one line for each of its labels.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on (default: a new figure's).

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If an axis or a metric does not exist.

    Examples
    --------
    The metrics of two runs stand for the dataset of a study.

    >>> import xarray as xr
    >>> import deli
    >>> runs = [deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=h, duration=5.0) for h in (0.1, 0.05)]
    >>> steps = xr.DataArray([0.1, 0.05], dims="step_size", name="step_size")
    >>> data = xr.concat([deli.metrics.measure(run) for run in runs], steps)
    >>> data["state"] = "step_size", ["done", "done"]
    >>> deli.plotting.work_precision(data, "steps", "energy_band", "step_size").lines[0].get_xdata().round(6).tolist()
    [50.0, 100.0]
    """
    axes = _axes(ax, data, cost, error)
    _require(data, along)
    others = [str(name) for name in data[error].dims if name not in (along, by)]
    known = _complete(data) & data[cost].notnull() & data[error].notnull()
    tried = known.any([name for name in known.dims if name not in others])
    whole = known.where(tried, other=True).all(others)
    for index, (label, part) in enumerate(_parts(data.assign(_whole=whole), by)):
        values = abs(part[[cost, error]]).clip(min=FLOOR).where(tried & part["_whole"])
        means = values.map(np.log).mean(others).map(np.exp)
        points = int(part["_whole"].sum())
        if label is not None and points < part.sizes[along]:
            label = f"{label} ({points} of {part.sizes[along]} points)"
        axes.plot(
            means[cost].values,
            means[error].values,
            color=color(index),
            marker=_marker(index),
            markersize=4,
            label=label,
        )
    _finish(axes)
    if others and (count := int(tried.sum())) != 1 and (legend := axes.get_legend()) is not None:
        legend.set_title(f"means of {count:,} cases")
    return axes


def heat_map(data: xr.Dataset, x: str, y: str, value: str, ax: Axes | None = None) -> Axes:
    """Draw a metric over two axes of a study on a logarithmic colour scale.

    Cells with incomplete cases are crossed out, and zero has no colour; a key explains both. Numbers are written into
    the cells of narrow maps.

    Parameters
    ----------
    data : xarray.Dataset
        Metrics on the axes of a study; a cell shows the largest magnitude over all axes other than `x` and `y`.
    x, y : str
        Axes.
    value : str
        Metric, whose magnitude is drawn.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on (default: a new figure's).

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    The metrics of two runs stand for the dataset of a study.

    >>> import xarray as xr
    >>> import deli
    >>> runs = [deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=h, duration=5.0) for h in (0.1, 0.05)]
    >>> steps = xr.DataArray([0.1, 0.05], dims="step_size", name="step_size")
    >>> data = xr.concat([deli.metrics.measure(run) for run in runs], steps)
    >>> data["state"] = "step_size", ["done", "done"]
    >>> axes = deli.plotting.heat_map(data.expand_dims(scene=["sphere"]), "step_size", "scene", "energy_band")
    >>> [text.get_text() for text in axes.texts]
    ['7.78e-4', '1.95e-4']
    """
    axes = _axes(ax, data, value, value)
    for name in (x, y):
        _require(data, name)
    others = [str(name) for name in data[value].dims if name not in (x, y)]
    complete = _complete(data)
    worst: np.ndarray = abs(data[value]).where(complete).max(others).transpose(y, x).values
    failed = (~complete & (data["state"] != "excluded")).any(others).transpose(y, x).values
    positive = worst[np.isfinite(worst) & (worst > 0.0)]
    low, high = (float(positive.min()), float(positive.max())) if positive.size else (FLOOR, 1.0)
    norm = LogNorm(low, max(high, 10.0 * low))
    mesh = axes.pcolormesh(np.where(worst > 0.0, worst, np.nan), cmap="cividis", norm=norm, edgecolors="white")
    for row, column in np.argwhere(np.isfinite(worst) & ~failed) if data.sizes[x] <= MOST_WORDS else ():
        number = float(worst[row, column])
        style: Any = {"ha": "center", "va": "center", "fontsize": 7}
        hue = "white" if number > 0.0 and float(norm(number)) < 0.5 else "black"
        axes.text(column + 0.5, row + 0.5, numeral(number, 3), color=hue, **style)
    crossed: Any = {"facecolor": "0.88", "edgecolor": "0.45", "hatch": "xx", "linewidth": 0.5}
    for row, column in np.argwhere(failed):
        axes.add_patch(Rectangle((column, row), 1, 1, **crossed))
    keys = [Patch(**crossed, label="not done")] if failed.any() else []
    if (worst == 0.0).any():
        keys.append(Patch(facecolor="white", edgecolor="0.45", linewidth=0.5, label="zero"))
    if keys:
        axes.legend(handles=keys, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    for name, ticks, label in ((x, axes.set_xticks, axes.set_xlabel), (y, axes.set_yticks, axes.set_ylabel)):
        words = [_word(entry) for entry in data[name].values.tolist()]
        ticks(np.arange(len(words)) + 0.5, words)
        label(name)
    axes.tick_params(axis="x", labelrotation=45 if data.sizes[x] > 5 else 0)
    axes.grid(visible=False)
    count = (data["state"] != "excluded").sum(others)
    fewest, most = int(count.where(count > 0).min()), int(count.max())
    of = f"\nworst of {most if fewest == most else f'{fewest} to {most}'} cases" if most > 1 else ""
    axes.figure.colorbar(mesh, ax=axes, label=f"{_label(data, value)}{of}")
    return axes


def energy_traces(runs: Mapping[str, xr.DataTree], ax: Axes | None = None) -> Axes:
    """Draw the energy error H - H(0) of several runs over time.

    Parameters
    ----------
    runs : mapping
        Runs by their labels in the legend.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on (default: a new figure's).

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.plotting.energy_traces({"midpoint": run}).get_ylabel()
    'H − H(0) [M L² T⁻²]'
    """
    axes = _new_axes() if ax is None else ax
    for index, (label, run) in enumerate(runs.items()):
        trajectory = dataset_of(run, TRAJECTORY)
        energy = trajectory["hamiltonian"].values
        draw_line(axes, trajectory["time"].values, energy - energy[0], color(index), plain(label))
        axes.set_xlabel(f"time{unit(trajectory['time'].attrs['units'])}")
        axes.set_ylabel(f"H − H(0){unit(trajectory['hamiltonian'].attrs['units'])}")
    _legend(axes)
    return axes


def _new_axes() -> Axes:
    with matplotlib.rc_context(STYLE):
        axes: Axes = new_figure((6.4, 4.4)).subplots()
    return axes


def _axes(ax: Axes | None, data: xr.Dataset, x: str, y: str) -> Axes:
    for name in (x, y):
        _require(data, name)
    axes = _new_axes() if ax is None else ax
    axes.set_xlabel(_label(data, x))
    axes.set_ylabel(_label(data, y))
    return axes


def _require(data: xr.Dataset, name: str) -> None:
    if name not in data.variables:
        known = ", ".join(str(known) for known in (*data.coords, *data.data_vars))
        raise InputError(f"the study has no axis or metric {name!r}; it has {known}.")


def _label(data: xr.Dataset, name: str) -> str:
    attributes = data[name].attrs
    return textwrap.fill(f"{attributes.get('long_name', name)}{unit(attributes.get('units', '1'))}", WIDTH)


def _parts(data: xr.Dataset, by: str | None) -> Iterator[tuple[str | None, xr.Dataset]]:
    if by is None:
        yield None, data
        return
    _require(data, by)
    for entry in data[by].values:
        yield _word(entry), data.sel({by: entry})


def _word(entry: Any) -> str:
    return numeral(float(entry)) if isinstance(entry, float | np.floating) else plain(str(entry))


def _complete(data: xr.Dataset) -> xr.DataArray:
    return data["state"] == "done"


def _finished(data: xr.Dataset, x: str, y: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the magnitudes of two metrics of the completed cases, zeros replaced by `FLOOR` for a logarithmic axis."""
    arrays = xr.broadcast(abs(data[x]), abs(data[y]), _complete(data))
    across, up, complete = (array.values.ravel() for array in arrays)
    known = complete & np.isfinite(across) & np.isfinite(up)
    return np.maximum(across[known], FLOOR), np.maximum(up[known], FLOOR)


def _front(points: np.ndarray) -> np.ndarray:
    """Return the points that no other point beats in both coordinates, from left to right."""
    ordered = points[np.lexsort((points[:, 1], points[:, 0]))]
    best = np.minimum.accumulate(ordered[:, 1]) if len(ordered) else ordered[:, 1]
    first = np.diff(best, prepend=np.inf) < 0.0
    front: np.ndarray = ordered[first]
    return front


def _marker(index: int) -> str:
    """Return a marker that changes when colours repeat."""
    return MARKERS[(index + index // len(COLORS)) % len(MARKERS)]


def _finish(axes: Axes) -> Axes:
    """Give points logarithmic scales and a legend, or write that there are none."""
    points = np.concatenate([np.empty((0, 2)), *(np.array(line.get_xydata(), dtype=float) for line in axes.lines)])
    points = points[np.isfinite(points).all(axis=1)]
    if len(points):
        for axis, values in zip("xy", points.T, strict=True):
            low, high = float(values.min()), float(values.max())
            if high - low <= 1e-9 * high:  # matplotlib finds no limits for differences of rounding
                axes.set(**{f"{axis}lim": (0.1 * low, min(10.0 * high, sys.float_info.max))})
            axes.set(**{f"{axis}scale": "log"})
        _legend(axes)
    else:
        axes.text(0.5, 0.5, "no case has both metrics", transform=axes.transAxes, ha="center", color="0.4", fontsize=9)
    return axes


def _legend(axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(handles, labels, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2, markerscale=1.2)
