"""The common parts of all figures: style, title, folder, and scene."""

import os
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from deli.errors import InputError
from deli.mechanics.scene import Scene
from deli.plotting.lines import plain
from deli.recording.members import count_members, is_ensemble, name_of
from deli.recording.paths import check_name
from deli.recording.provenance import scene_of
from deli.recording.scene_record import require_scene_of
from deli.recording.schema import MEMBER

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


def new_figure(size: tuple[float, float]) -> Figure:
    """Return an empty figure of a size in inches, laid out when it is drawn."""
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def run_title(run: xr.DataTree) -> str:
    """Return the title of a run, with its outcome if it is not complete."""
    title, outcome = run.attrs["title"], run.attrs["outcome"]
    if MEMBER in run.coords and not is_ensemble(run):
        title, outcome = f"{title}; {plain(name_of(run))}", str(run.variables["outcome"].values)
    if outcome == "complete":
        return str(title)
    return f"{title}\n{outcome if len(outcome) < 120 else outcome[:117] + '...'}"


def known_scene(run: xr.DataTree, scene: Scene | None) -> Scene | None:
    """Return the scene to draw: the given scene, or the scene of the run, or None for a user's own scene.

    Raises
    ------
    InputError
        If the given scene is not the run's, or the run is an ensemble.
    """
    if is_ensemble(run):
        raise InputError(
            f"the run is an ensemble of {count_members(run)} members, each at another place; draw one of them, "
            "run.isel(member=0), on the command line with --member 0."
        )
    if scene is None:
        return scene_of(run)
    require_scene_of(run, scene)
    return scene


def check_folder(word: str, path: Path) -> None:
    """Refuse a file whose folder is missing or unwritable.

    Raises
    ------
    InputError
        With ``word`` and the path of the file.
    """
    check_name(word, path)
    folder = path.resolve().parent
    if not folder.is_dir() or not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{word} {path}: the folder {folder} does not exist or is not writable; name another.")
