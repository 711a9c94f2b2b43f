"""The making of a figure's dataset and picture from its config, with recorded runs."""

import dataclasses
import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import tomli_w
import xarray as xr

from deli.errors import InputError
from deli.figures.cradle import check_cradle
from deli.figures.drawing import draw
from deli.figures.exact import SOLUTIONS
from deli.figures.model import FigureConfig
from deli.figures.quantities import extract
from deli.plotting.figures import check_picture, write_picture
from deli.recording.paths import check_name, check_output
from deli.recording.schema import TRAJECTORY, Schema, dataset_of
from deli.recording.whole import write_tree
from deli.running.plan import Plan
from deli.simulation import run_plan
from deli.version import __version__

RUN_ATTRIBUTES = (
    "title",
    "config",
    "outcome",
    "deli_version",
    "backend_versions",
    "machine",
    "start",
    "end",
    "wall_time",
)
"""The attributes of runs that a figure's dataset keeps."""


class Maker:
    """A maker of figures in a folder: FIGURE.nc, FIGURE.png, and the recorded runs in ``runs``.

    A run's file is named by its config, so that figures share runs and recorded runs are not repeated.

    Parameters
    ----------
    folder : Path
        Folder of all files; it is made if it does not exist.
    quick : bool
        Whether to apply the changes under ``quick`` in the configs.
    overwrite : bool
        Whether to replace runs that an earlier `Maker` recorded.
    progress : bool
        Whether to show a bar for each run.
    """

    def __init__(self, folder: Path, *, quick: bool = False, overwrite: bool = False, progress: bool = False) -> None:
        self._folder, self._runs = folder, folder / "runs"
        self._quick, self._overwrite, self._progress = quick, overwrite, progress
        self._recorded: set[Path] = set()

    def plans(self, figure: FigureConfig) -> dict[str, Plan]:
        """Return the plans of a figure's runs, by the names of the runs.

        Raises
        ------
        InputError
            If `deli.config.parse` or `deli.simulate` refuses a config, or a run lacks a quantity of the figure. Nothing
            has been computed or written then.
        """
        plans = {run: figure.run_config(run, quick=self._quick).plan() for run in figure.table.runs}
        for run, plan in plans.items():
            solution = figure.table.runs[run].solution
            if solution is not None:
                SOLUTIONS[solution](plan.scene, np.zeros(1))
            if "swinging_share" in _shown(figure, run):
                check_cradle(plan.scene)
            flat = "angular_momentum" in _shown(figure, run) or figure.table.view is not None
            if flat and plan.scene.dimension == 1:
                raise InputError(
                    f"figure {figure.name}, run {run!r}: {plan.scene.name} has one dimension, and neither "
                    "angular momentum nor a view; show other quantities in [[panels]]."
                )
        return plans

    def dataset(self, figure: FigureConfig) -> xr.DataTree:
        """Run the missing runs of a figure, and write the dataset of its quantities to FIGURE.nc, one group a run.

        Raises
        ------
        InputError
            If `plans` refuses the figure, or the folder cannot be made or written to.
        Interrupted
            On SIGINT or SIGTERM; the next call continues from the recorded rows.
        """
        check_name("folder", self._runs)
        try:
            self._runs.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{self._runs} cannot be made: {error.strerror or error}.") from error
        check_picture(self.path(figure, ".png"))
        groups = {f"/{run}": group for run, group in self._groups(figure)}
        root = {
            "title": f"Figure {figure.name}: {figure.table.title}",
            "claim": figure.table.claim,
            "notes": figure.table.notes,
            "figure_config": figure.text,
            "quick": int(self._quick),
        }
        tree = xr.DataTree.from_dict({"/": xr.Dataset(attrs=root), **groups})
        write_tree(self.path(figure, ".nc"), tree)
        return tree

    def picture(self, figure: FigureConfig, data: xr.DataTree) -> None:
        """Draw a figure's dataset into FIGURE.png."""
        write_picture(draw(figure, data), self.path(figure, ".png"))

    def path(self, figure: FigureConfig, suffix: str) -> Path:
        """Return the path of a figure's dataset or picture."""
        return self._folder / f"{figure.name}{suffix}"

    def _groups(self, figure: FigureConfig) -> Iterator[tuple[str, xr.Dataset]]:
        for run, plan in self.plans(figure).items():
            drawn = figure.table.runs[run]
            trajectory = self._trajectory(plan) if drawn.solution is None else _evaluated(plan, drawn.solution)
            group = extract(plan.scene, trajectory, _shown(figure, run))
            if figure.table.view is not None and figure.table.view.times is not None:
                group = group.isel(time=_rows_at(group["time"].values, figure.table.view.times))
            group.attrs = {"label": drawn.label} | trajectory.attrs
            yield run, group

    def _trajectory(self, plan: Plan) -> xr.Dataset:
        """Carry out a plan unless its run is recorded; return the trajectory with attributes of the run."""
        config = plan.config()
        digest = hashlib.sha256(tomli_w.dumps(config).encode()).hexdigest()[:8]
        output = self._runs / f"{config['scene']['name']}-{config['method']['name']}-{digest}.nc"
        overwrite = self._overwrite and output not in self._recorded
        check_output(output, resume=not overwrite, overwrite=overwrite)
        kept = dataclasses.replace(plan, output=output, resume=not overwrite, overwrite=overwrite)
        run = run_plan(kept, self._progress)
        self._recorded.add(output)
        return dataset_of(run, TRAJECTORY).assign_attrs({key: run.attrs[key] for key in RUN_ATTRIBUTES})


def _shown(figure: FigureConfig, run: str) -> list[str]:
    if figure.table.view is not None:
        return ["position"]
    panels = [panel for panel in figure.table.panels if panel.runs is None or run in panel.runs]
    return list(dict.fromkeys(quantity for panel in panels for quantity in panel.quantities))


def _rows_at(time: np.ndarray, moments: list[float]) -> list[int]:
    """Return the rows nearest to the given times, each row once, because a shortened run may end earlier."""
    return list(dict.fromkeys(int(np.abs(time - moment).argmin()) for moment in moments))


def _evaluated(plan: Plan, solution: str) -> xr.Dataset:
    """Return a closed form in the place of a recorded trajectory."""
    time = plan.step_size * np.array([plan.step_of(row) for row in range(plan.rows)])
    described = {
        variable.name: variable for variable in Schema(plan.scene.dof, plan.scene.dimension).groups[TRAJECTORY]
    }
    values = {"time": time, "position": SOLUTIONS[solution](plan.scene, time)}
    variables = {
        name: xr.Variable(described[name].dims, value, described[name].attributes) for name, value in values.items()
    }
    attributes = {
        "title": f"{plan.scene.name}: {solution} in closed form",
        "config": tomli_w.dumps(plan.config()),
        "outcome": "complete",
        "deli_version": __version__,
    }
    return xr.Dataset(variables, attrs=attributes).set_coords("time")
