"""The plots of a study's report: the entries ``[[plots]]`` of its file, or a first look."""

from collections.abc import Callable
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from deli.config.models import unknown
from deli.errors import InputError
from deli.plotting import comparison
from deli.plotting.lines import plain
from deli.plotting.profiles import draw_shares
from deli.plotting.style import STYLE, new_figure
from deli.replaying.profiles import performance_profile
from deli.studies.matching import SCENE, in_words
from deli.studies.plot_tables import EnergyTraces, HeatMap, Pareto, Plot, Profile, WorkPrecision
from deli.studies.states import DONE, EXCLUDED

PANEL, MOST_COLUMNS = (4.2, 3.6), 3
MOST_TRACES = 6
LEAST_COST = 1e-9
"""The cost below which costs count as equal."""


def first_look(study: xr.Dataset) -> list[Plot]:
    """Return plots for a study whose file has none: all that its axes allow, with a panel for each scene."""
    axes = [str(name) for name in study["state"].dims if study.sizes[name] > 1]
    panels = SCENE if SCENE in axes else None
    axes = [name for name in axes if name != panels]
    numeric = [name for name in axes if np.issubdtype(study[name].dtype, np.number)]
    by = next((name for name in axes if name not in numeric), None)
    error = "trajectory_error" if study["trajectory_error"].notnull().any() else "energy_band"
    cost = "cpu_time" if "cpu_time" in study else "wall_time"
    plots: list[Plot] = [
        Pareto(
            title="Error against time, case by case", x=cost, y=error, by=by or next(iter(axes), None), panels=panels
        )
    ]
    for along in numeric:
        title = f"Error against time, along {along}"
        plots.append(WorkPrecision(title=title, cost=cost, error=error, along=along, by=by, panels=panels))
    if len(axes) > 1:
        x, y = sorted(axes, key=lambda name: -study.sizes[name])[:2]
        plots.append(HeatMap(title=f"Error by {x} and {y}", x=x, y=y, value=error, panels=panels))
    if axes:
        plots.append(EnergyTraces(title="Energy error over time", by=by or axes[0], panels=panels))
    return plots


def check_plots(plots: list[Plot], study: xr.Dataset) -> None:
    """Refuse plots of axes, metrics or labels that a study does not have.

    Raises
    ------
    InputError
        With the plot, the unknown name and the known ones.
    """
    axes = [str(name) for name in study["state"].dims]
    metrics = [str(name) for name, values in study.data_vars.items() if np.issubdtype(values.dtype, np.number)]
    for number, plot in enumerate(plots):
        names = plot.model_dump(exclude={"kind", "title", "where"}, exclude_none=True)
        for key, name in (names | {f"where.{axis}": axis for axis in plot.where}).items():
            allowed = metrics if key in plot.METRICS else axes
            if name not in allowed:
                raise InputError(unknown(f"plots.{number}.{key}", name, allowed))
        for axis, label in plot.where.items():
            labels = study[axis].values.tolist()
            if label not in labels:
                raise InputError(unknown(f"plots.{number}.where.{axis}", label, map(str, labels)))
        drawn = [name for key, name in names.items() if key not in plot.METRICS]
        if len(set(drawn)) < len(drawn):
            raise InputError(f"plots.{number} uses an axis twice ({', '.join(drawn)}); name each once.")


def panels_of(plot: Plot, study: xr.Dataset) -> dict[str, xr.Dataset]:
    """Return the cases of each panel of a plot by the panel's title; a plot without panels has one, titled ''."""
    chosen = study
    for name, label in plot.where.items():
        chosen = _at(chosen, name, label)
    if plot.panels is None:
        return {"": chosen}
    return {str(label): _at(chosen, plot.panels, label) for label in chosen[plot.panels].values}


def draw(plot: Plot, study: xr.Dataset) -> Figure:
    """Draw one plot of a study, in one panel or in one panel for each label of an axis."""
    parts = panels_of(plot, study)
    labels = list(parts)
    columns = min(len(labels), MOST_COLUMNS)
    rows = -(-len(labels) // columns)
    with matplotlib.rc_context(STYLE):
        figure = new_figure((2.4 + PANEL[0] * columns, PANEL[1] * rows))
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, (label, part) in zip(grid, parts.items(), strict=False):
            _DRAW[plot.kind](plot, axes, part)
            axes.set_title(plain(label))
        for axes in grid[: len(labels) - 1]:
            legend = axes.get_legend()
            if legend is not None and columns > 1 and not isinstance(plot, HeatMap):  # the last panel's stands for all
                legend.remove()
        for axes in grid[len(labels) :]:
            axes.remove()
    return figure


def _at(study: xr.Dataset, name: str, label: Any) -> xr.Dataset:
    """Return the part with one label of an axis, and keep the axis (xarray would take ``[False]`` for a mask)."""
    return study.isel({name: np.flatnonzero(study[name].values == label)})


def _draw_profile(plot: Profile, axes: Axes, study: xr.Dataset) -> None:
    """Draw a performance profile, in which cases that differ along `by` alone are attempts at one problem.

    A problem with an excluded case is left out, so that all lines are shares of the same problems. A case that fails
    counts as never done.
    """
    others = [str(name) for name in study["state"].dims if name != plot.by]
    problems = study[["state", plot.cost]].stack(problem=others).transpose("problem", plot.by)
    problems = problems.isel(problem=np.flatnonzero((problems["state"] != EXCLUDED).all(plot.by)))
    attempts = {
        "time": (("problem", "backend"), np.maximum(np.abs(problems[plot.cost].values), LEAST_COST)),
        "verified": (("problem", "backend"), problems["state"].values == DONE),
    }
    draw_shares(axes, performance_profile(xr.Dataset(attempts, {"backend": study[plot.by].values})))
    axes.set_xlabel(f"{study[plot.cost].attrs['long_name']}, over the least")
    axes.set_ylabel(f"share of {problems.sizes['problem']:,} cases done")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def _draw_traces(plot: EnergyTraces, axes: Axes, study: xr.Dataset) -> None:
    others = {str(name): study[name].values[0] for name in study["state"].dims if name != plot.by}
    runs = {}
    for label in study[plot.by].values[:MOST_TRACES]:
        place = {**others, plot.by: label}
        try:
            runs[str(label)] = study.deli.run(**place)
        except InputError:  # an excluded or waiting case has no recorded rows
            continue
    comparison.energy_traces(runs, axes)
    first = in_words({name: label for name, label in others.items() if study.sizes[name] > 1})
    if first and (legend := axes.get_legend()) is not None:
        legend.set_title(plain(first))


_DRAW: dict[str, Callable[[Any, Axes, xr.Dataset], Any]] = {
    "pareto": lambda plot, axes, study: comparison.pareto(study, plot.x, plot.y, plot.by, axes),
    "work_precision": lambda plot, axes, study: comparison.work_precision(
        study, plot.cost, plot.error, plot.along, plot.by, axes
    ),
    "heat_map": lambda plot, axes, study: comparison.heat_map(study, plot.x, plot.y, plot.value, axes),
    "profile": _draw_profile,
    "energy_traces": _draw_traces,
}
