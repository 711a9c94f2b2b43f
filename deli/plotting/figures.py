"""Figures for notebooks and files."""

import os
from pathlib import Path
from typing import Any

import matplotlib
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.plotting.history import draw_history
from deli.plotting.profiles import draw_profile, draw_replay
from deli.plotting.trajectory import draw_trajectory
from deli.recording.provenance import scene_of

SUFFIXES = (".png", ".pdf", ".svg")
DPI = 150
STYLE: Any = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.labelsize": 9,
    "axes.formatter.use_mathtext": True,
    "grid.color": "0.92",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
}


def history(run: xr.DataTree) -> Figure:
    """Draw energy error, momenta, gaps and solver residuals over time.

    Parameters
    ----------
    run : xarray.DataTree
        From `deli.simulate` or `deli.open_run`.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = new_figure((8.0, 8.0))
        draw_history(figure, run)
        figure.suptitle(_title(run), fontsize=10)
    return figure


def trajectory(run: xr.DataTree, scene: Scene | None = None) -> Figure:
    """Draw where the bodies go: paths in space, or height over time in one dimension.

    Parameters
    ----------
    run : xarray.DataTree
        From `deli.simulate` or `deli.open_run`.
    scene : deli.Scene, optional
        Where walls, rods and radii come from; scenes of deli's own are found by name.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with matplotlib.rc_context(STYLE):
        figure = new_figure((7.0, 7.0))
        draw_trajectory(figure, run, scene or scene_of(run))
        figure.suptitle(_title(run), fontsize=10)
    return figure


def save(run: xr.DataTree, path: str | os.PathLike[str], scene: Scene | None = None) -> None:
    """Draw history and trajectory side by side into a file.

    Raises
    ------
    InputError
        If the file cannot be written or its format is unknown.
    """
    check_picture(Path(path))
    with matplotlib.rc_context(STYLE):
        figure = new_figure((13.5, 7.6))
        left, right = figure.subfigures(1, 2, width_ratios=(1.15, 1.0), wspace=0.04, squeeze=False)[0]
        draw_history(left, run)
        draw_trajectory(right, run, scene or scene_of(run))
        figure.suptitle(_title(run), fontsize=11)
        figure.savefig(path, dpi=DPI)


def performance_profile(data: xr.Dataset, axes: Axes | None = None) -> Axes:
    """Draw the share of problems that each backend solves within a factor of the fastest (Dolan and Moré 2002).

    Parameters
    ----------
    data : xarray.Dataset
        From `deli.replay`.
    axes : matplotlib.axes.Axes, optional
        Where to draw; axes of a new figure, ``axes.figure``, if left out.

    Returns
    -------
    matplotlib.axes.Axes
    """
    if axes is not None:
        draw_profile(axes, data)
        return axes
    with matplotlib.rc_context(STYLE):
        axes = new_figure((7.0, 4.5)).subplots()
        draw_profile(axes, data)
        axes.legend(loc="lower right")
    return axes


def save_replay(data: xr.Dataset, path: str | os.PathLike[str]) -> None:
    """Draw performance profile and errors of `deli.replay` side by side into a file.

    Raises
    ------
    InputError
        If the file cannot be written or its format is unknown.
    """
    check_picture(Path(path))
    with matplotlib.rc_context(STYLE):
        figure = new_figure((11.0, 4.8))
        draw_replay(figure, data)
        figure.suptitle(data.attrs["title"], fontsize=10)
        figure.savefig(path, dpi=DPI)


def check_picture(path: Path) -> None:
    """Refuse a picture that cannot be written.

    Raises
    ------
    InputError
        If the folder is missing or unwritable, or the suffix is none of .png, .pdf and .svg.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"picture {path}: found the suffix {path.suffix!r}; allowed: {', '.join(SUFFIXES)}.")
    folder = path.resolve().parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"picture {path}: the folder {folder} does not exist or is not writable; name another.")


def new_figure(size: tuple[float, float]) -> Figure:
    """Return an empty figure of a size in inches, laid out when it is drawn."""
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _title(run: xr.DataTree) -> str:
    title, outcome = run.attrs["title"], run.attrs["outcome"]
    if outcome == "complete":
        return str(title)
    return f"{title}\n{outcome if len(outcome) < 120 else outcome[:117] + '...'}"
