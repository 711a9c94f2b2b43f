"""Figures for notebooks and files."""

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.plotting.history import draw_energy, draw_gaps, draw_history, draw_momenta, draw_residuals, set_time_axis
from deli.plotting.lines import Series, series_on
from deli.plotting.profiles import draw_profile, draw_replay
from deli.plotting.style import STYLE, check_folder, known_scene, new_figure, run_title
from deli.plotting.trajectory import draw_paths, draw_trajectory, tells_apart
from deli.recording.members import is_ensemble
from deli.recording.whole import replacing

SUFFIXES = (".png", ".pdf", ".svg")
DPI = 150


def history(run: xr.DataTree) -> Figure:
    """Draw energy error, momenta, gaps and solver residuals over time.

    Parameters
    ----------
    run : xarray.DataTree
        From `deli.simulate`, `deli.simulate_ensemble` or `deli.open_run`. Of an ensemble of up to eight members, each
        member is a line with its labels; a larger ensemble is drawn as its median and the band from its smallest to its
        largest value.

    Returns
    -------
    matplotlib.figure.Figure

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> [axes.get_title(loc="left").partition(" (")[0] for axes in deli.plotting.history(run).axes]
    ['energy error', 'momenta', 'smallest gap', 'solver residuals']
    """
    with matplotlib.rc_context(STYLE):
        figure = new_figure((8.0, 8.0))
        draw_history(figure, run)
        figure.suptitle(run_title(run), fontsize=10)
    return figure


def energy(
    run: xr.DataTree, ax: Axes | None = None, *, label: str | None = None, color: Any = None
) -> Figure | SubFigure:
    """Draw the energy error over time.

    Parameters
    ----------
    run : xarray.DataTree
        From `deli.simulate` or `deli.open_run`.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on, in addition to their present lines (default: a new figure's).
    label : str, optional
        Name of the run in a legend, for axes with several runs.
    color : optional
        Colour of the run's lines, as matplotlib takes it (default: the next colour that the axes do not have yet).

    Returns
    -------
    matplotlib.figure.Figure
        The axes' figure.

    Raises
    ------
    InputError
        If `label` is not a string, or `color` not a colour.

    Examples
    --------
    >>> import deli
    >>> from matplotlib.figure import Figure
    >>> axes = Figure().subplots()
    >>> for name in ("midpoint", "verlet"):
    ...     run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(name), step_size=0.1, steps=500)
    ...     figure = deli.plotting.energy(run, axes, label=name)
    >>> axes.get_legend_handles_labels()[1]
    ['midpoint', 'verlet']
    """
    return _panel(draw_energy, run, ax, label, color)


def momenta(
    run: xr.DataTree, ax: Axes | None = None, *, label: str | None = None, color: Any = None
) -> Figure | SubFigure:
    """Draw the errors of conserved momenta over time, or all momenta if none is conserved; see `energy`.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.plotting.momenta(run).axes[0].get_title(loc="left")
    'error of conserved momenta'
    """
    return _panel(draw_momenta, run, ax, label, color)


def gaps(
    run: xr.DataTree, ax: Axes | None = None, *, label: str | None = None, color: Any = None
) -> Figure | SubFigure:
    """Draw the smallest gap over time; see `energy`.

    Raises
    ------
    InputError
        If the run has no unilateral constraints.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.plotting.gaps(run).axes[0].get_title(loc="left").partition(" (")[0]
    'smallest gap'
    """
    return _panel(draw_gaps, run, ax, label, color)


def residuals(
    run: xr.DataTree, ax: Axes | None = None, *, label: str | None = None, color: Any = None
) -> Figure | SubFigure:
    """Draw the solvers' scaled residuals over time; see `energy`.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.newtons_cradle(), deli.GVI(), step_size=0.01, steps=20)
    >>> deli.plotting.residuals(run).axes[0].get_ylabel()
    'scaled residual'
    """
    return _panel(draw_residuals, run, ax, label, color)


def trajectory(
    run: xr.DataTree,
    scene: Scene | None = None,
    ax: Axes | None = None,
    *,
    label: str | None = None,
    color: Any = None,
) -> Figure | SubFigure:
    """Draw the trajectories of the bodies: paths in the plane or in space, or position over time in one dimension.

    Parameters
    ----------
    run : xarray.DataTree
        From `deli.simulate` or `deli.open_run`.
    scene : deli.Scene, optional
        Scene with walls, rods and radii (default: the run's, if it is one of deli's own).
    ax : matplotlib.axes.Axes, optional
        Axes to draw on, with ``projection="3d"`` for a run in space (default: a new figure's).
    label, color : optional
        As for `energy`; all bodies get the same colour.

    Returns
    -------
    matplotlib.figure.Figure
        The axes' figure.

    Raises
    ------
    InputError
        If the scene is not the run's, by the digest of its content, the axes have another dimension, or the run is an
        ensemble.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.spring_sphere(), deli.GVI(), step_size=0.1, steps=50)
    >>> deli.plotting.trajectory(run).axes[0].get_xlabel()
    'x [L]'
    """
    with matplotlib.rc_context(STYLE):
        if ax is not None:
            draw_paths(ax, run, known_scene(run, scene), series=series_on(ax, label, color))
            if tells_apart(ax):
                ax.legend()
            return ax.figure
        figure = new_figure((7.0, 7.0))
        draw_trajectory(figure, run, known_scene(run, scene), series_on(None, label, color))
        figure.suptitle(run_title(run), fontsize=10)
    return figure


def _panel(
    draw: Callable[[Axes, xr.DataTree, Series], None],
    run: xr.DataTree,
    ax: Axes | None,
    label: str | None,
    color: Any,
) -> Figure | SubFigure:
    with matplotlib.rc_context(STYLE):
        series = series_on(ax, label, color)
        axes = new_figure((8.0, 3.0)).subplots() if ax is None else ax
        draw(axes, run, series)
        set_time_axis(axes, run, wider=series.beside)
        if ax is None:
            axes.figure.suptitle(run_title(run), fontsize=10)
    return axes.figure


def save(run: xr.DataTree, path: str | os.PathLike[str], scene: Scene | None = None) -> None:
    """Draw history and trajectory side by side into a file; of an ensemble, draw the history only.

    Raises
    ------
    InputError
        If the file cannot be written, its format is unknown, or the scene is not the run's.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import deli
    >>> run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.1, steps=50)
    >>> with TemporaryDirectory() as folder:
    ...     deli.plotting.save(run, Path(folder, "pogo.svg"))
    """
    check_picture(Path(path))
    # Margins of logarithmic axes about the largest numbers overflow, and matplotlib handles that.
    with matplotlib.rc_context(STYLE), np.errstate(over="ignore"):
        if is_ensemble(run):
            write_picture(history(run), Path(path))
            return
        figure = new_figure((13.5, 7.6))
        left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1.0), wspace=0.04, squeeze=False)[0]
        draw_history(left, run)
        draw_trajectory(right, run, known_scene(run, scene))
        figure.suptitle(run_title(run), fontsize=11)
        write_picture(figure, Path(path))


def performance_profile(data: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the share of problems that each backend solves within a factor of the least time (Dolan and Moré 2002).

    Parameters
    ----------
    data : xarray.Dataset
        From `deli.replay`.
    ax : matplotlib.axes.Axes, optional
        Axes to draw on (default: a new figure's).

    Returns
    -------
    matplotlib.axes.Axes

    Examples
    --------
    Times of two backends on two problems stand for the results of `deli.replay`.

    >>> import xarray as xr
    >>> import deli
    >>> axes = ("problem", "backend")
    >>> values = {"time": (axes, [[1e-5, 3e-5], [2e-5, 2e-5]]), "verified": (axes, [[True, True], [True, False]])}
    >>> data = xr.Dataset(values, {"backend": ["native", "daqp"]}, {"tolerance": 1e-9})
    >>> [float(line.get_ydata()[-1]) for line in deli.plotting.performance_profile(data).lines]
    [1.0, 0.5]
    """
    if ax is not None:
        draw_profile(ax, data)
        return ax
    with matplotlib.rc_context(STYLE):
        axes: Axes = new_figure((7.0, 4.5)).subplots()
        draw_profile(axes, data)
        axes.legend(loc="lower right")
    return axes


def save_replay(data: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Draw performance profile and errors of `deli.replay` side by side into a file.

    Raises
    ------
    InputError
        If the file cannot be written or its format is unknown.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import xarray as xr
    >>> import deli
    >>> values = {"time": 1e-5, "verified": True, "error": 1e-14}
    >>> data = xr.Dataset(values, attrs={"title": "one problem", "tolerance": 1e-9, "polish": 1})
    >>> data = data.expand_dims(problem=1).expand_dims(backend=["native"], axis=-1)
    >>> with TemporaryDirectory() as folder:
    ...     deli.plotting.save_replay(data, Path(folder, "backends.svg"))
    """
    check_picture(Path(path))
    with matplotlib.rc_context(STYLE):
        figure = new_figure((11.0, 4.8))
        draw_replay(figure, data)
        figure.suptitle(data.attrs["title"], fontsize=10)
        write_picture(figure, Path(path))


def write_picture(figure: Figure, path: Path, dpi: float = DPI) -> None:
    """Draw a figure into a file, which is replaced as a whole or not at all.

    Raises
    ------
    RecordingError
        If the file cannot be written; an earlier file is then left unchanged.
    """
    with replacing(path) as fresh, warnings.catch_warnings():
        warnings.filterwarnings("ignore", "constrained_layout not applied")  # if labels leave no room for axes
        figure.savefig(fresh, dpi=dpi, format=path.suffix[1:].lower())


def check_picture(path: Path, *, overwrite: bool = True) -> None:
    """Refuse a picture that cannot be written, or that exists and may not be overwritten.

    Raises
    ------
    InputError
        If the folder is missing or unwritable, the suffix is none of .png, .pdf and .svg, or the file exists and
        `overwrite` is not set.

    Examples
    --------
    >>> from pathlib import Path
    >>> import deli
    >>> deli.plotting.check_picture(Path("run.bmp"))
    Traceback (most recent call last):
    ...
    deli.errors.InputError: picture run.bmp: found the suffix '.bmp'; allowed: .png, .pdf, .svg.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"picture {path}: found the suffix {path.suffix!r}; allowed: {', '.join(SUFFIXES)}.")
    check_folder("picture", path)
    if path.exists() and not overwrite:
        raise InputError(f"picture {path} exists; name another, or replace it (--overwrite).")
