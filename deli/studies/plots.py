"""The plots of a study's report: those that its file asks for under ``[[plots]]``, or a first look."""

from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from pydantic import Field

from deli.config.models import Table
from deli.errors import InputError
from deli.plotting import comparison
from deli.plotting.style import STYLE, new_figure
from deli.studies.findings import SCENE

PANEL, MOST_COLUMNS = (4.2, 3.6), 3
MOST_TRACES = 6
OpenCase = Callable[[Mapping[str, Any]], xr.DataTree]


class _Plot(Table):
    """What every plot has: a title, labels by axis to which it is restricted, and an axis with a panel a label."""

    title: str
    where: dict[str, Any] = Field(default_factory=dict)
    panels: str | None = None


class Pareto(_Plot):
    """Cases as points in two metrics, with the front of the best."""

    kind: Literal["pareto"]
    x: str
    y: str
    by: str | None = None

    def draw(self, axes: Any, metrics: xr.Dataset, _: OpenCase) -> None:
        """Draw on the axes."""
        comparison.pareto(metrics, self.x, self.y, self.by, axes)


class WorkPrecision(_Plot):
    """Error against cost along an axis."""

    kind: Literal["work_precision"]
    cost: str
    error: str
    along: str
    by: str | None = None

    def draw(self, axes: Any, metrics: xr.Dataset, _: OpenCase) -> None:
        """Draw on the axes."""
        comparison.work_precision(metrics, self.cost, self.error, self.along, self.by, axes)


class HeatMap(_Plot):
    """A metric over two axes, failures crossed out."""

    kind: Literal["heat_map"]
    x: str
    y: str
    value: str

    def draw(self, axes: Any, metrics: xr.Dataset, _: OpenCase) -> None:
        """Draw on the axes."""
        comparison.heat_map(metrics, self.x, self.y, self.value, axes)


class Traces(_Plot):
    """Energy over time of the cases along an axis, the first case of all other axes."""

    kind: Literal["energy_traces"]
    by: str

    def draw(self, axes: Any, metrics: xr.Dataset, open_case: OpenCase) -> None:
        """Draw on the axes."""
        others = {str(name): metrics[name].values[0] for name in metrics["outcome"].dims if name != self.by}
        runs = {}
        for label in metrics[self.by].values[:MOST_TRACES]:
            place = {**others, self.by: label}
            if str(metrics["file"].sel(place).item()):
                runs[str(label)] = open_case(place)
        comparison.energy_traces(runs, axes)


Plot = Annotated[Pareto | WorkPrecision | HeatMap | Traces, Field(discriminator="kind")]


def first_look(metrics: xr.Dataset) -> list[Plot]:
    """Plots for a study whose file asks for none: what its axes allow, a panel for each scene."""
    axes = [str(name) for name in metrics["outcome"].dims if metrics.sizes[name] > 1]
    panels = SCENE if SCENE in axes else None
    axes = [name for name in axes if name != panels]
    numeric = [name for name in axes if np.issubdtype(metrics[name].dtype, np.number)]
    by = next((name for name in axes if name not in numeric), None)
    error = "trajectory_error" if metrics["trajectory_error"].notnull().any() else "energy_band"
    title, cost = "Which case is worth its time", "wall_time"
    plots: list[Plot] = [Pareto(kind="pareto", title=title, x=cost, y=error, by=by or _first(axes), panels=panels)]
    for along in numeric:
        title = f"Error against time along {along}"
        plots.append(
            WorkPrecision(kind="work_precision", title=title, cost=cost, error=error, along=along, by=by, panels=panels)
        )
    if len(axes) > 1:
        x, y = sorted(axes, key=lambda name: -metrics.sizes[name])[:2]
        plots.append(HeatMap(kind="heat_map", title="Where it works", x=x, y=y, value=error, panels=panels))
    if axes:
        title = "Energy over time"
        plots.append(Traces(kind="energy_traces", title=title, by=by or axes[0], panels=panels))
    return plots


def check_plots(plots: list[Plot], metrics: xr.Dataset) -> None:
    """Refuse plots of what a study does not have.

    Raises
    ------
    InputError
        Naming the plot, the name and what there is.
    """
    for number, plot in enumerate(plots):
        fields = plot.model_dump(exclude={"kind", "title", "where"}, exclude_none=True)
        for key, name in (fields | {f"where.{name}": name for name in plot.where}).items():
            if name not in metrics.variables:
                known = ", ".join(str(known) for known in (*metrics.coords, *metrics.data_vars))
                raise InputError(f"plots.{number}.{key} is {name!r}; allowed: {known}.")


def draw(plot: Plot, metrics: xr.Dataset, open_case: OpenCase) -> Figure:
    """Draw one plot of a study, in a panel or one for each label of an axis."""
    chosen = metrics.sel({name: [label] for name, label in plot.where.items()})
    labels = [None] if plot.panels is None else list(chosen[plot.panels].values)
    columns = min(len(labels), MOST_COLUMNS)
    rows = -(-len(labels) // columns)
    with matplotlib.rc_context(STYLE):
        figure = new_figure((2.4 + PANEL[0] * columns, PANEL[1] * rows))
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes, label in zip(grid, labels, strict=False):
            part = chosen if label is None else chosen.sel({plot.panels: [label]})
            plot.draw(axes, part, open_case)
            if label is not None:
                axes.set_title(str(label))
        for axes in grid[: len(labels) - 1]:
            legend = axes.get_legend()
            if legend is not None and columns > 1:  # the last panel's stands for all
                legend.remove()
        for axes in grid[len(labels) :]:
            axes.remove()
    return figure


def _first(names: list[str]) -> str | None:
    return names[0] if names else None
