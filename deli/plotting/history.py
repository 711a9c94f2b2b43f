"""Energy error, momenta, gaps and solver residuals over time."""

import tomllib
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from deli.errors import InputError
from deli.metrics import energy_drift, momentum_components, undecided_momenta
from deli.metrics.trajectory import step_times
from deli.plotting.ensembles import draw_all_gaps, draw_all_momenta, draw_energies, worst_residuals
from deli.plotting.lines import ALONE, Series, color, draw_dots, draw_line, layers, legend_above, scale_log, unit
from deli.recording.members import is_ensemble
from deli.recording.schema import STATS, TRAJECTORY, dataset_of

RESIDUALS = ("primal_residual", "dual_residual", "complementarity")


def draw_history(figure: Figure | SubFigure, run: xr.DataTree) -> None:
    """Draw panels of energy, momenta, gaps and residuals with one time axis; leave out missing gaps and residuals."""
    panels = [draw_energy, draw_momenta]
    if np.isfinite(dataset_of(run, TRAJECTORY)["gap_min"].values).any():
        panels.append(draw_gaps)
    if STATS in run.children:
        panels.append(draw_residuals)
    column = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, draw in zip(column, panels, strict=True):
        draw(axes, run)
    set_time_axis(column[-1], run)
    figure.align_ylabels(column)


def set_time_axis(axes: Axes, run: xr.DataTree, *, wider: bool = False) -> None:
    """Label the time axis and limit it to the recorded time; with `wider`, extend its present limits instead."""
    time = dataset_of(run, TRAJECTORY)["time"]
    axes.set_xlabel(f"time{unit(time.attrs['units'])}")
    if len(time) > 1:
        low, high = axes.get_xlim() if wider else (np.inf, -np.inf)
        axes.set_xlim(min(low, float(time[0])), max(high, float(time[-1])))


def draw_energy(axes: Axes, run: xr.DataTree, series: Series = ALONE) -> None:
    """Draw the energy error."""
    if is_ensemble(run):
        draw_energies(axes, run)
        return
    trajectory = dataset_of(run, TRAJECTORY)
    time, energy = trajectory["time"].values, trajectory["hamiltonian"].values
    axes.axhline(0.0, color="0.6", linewidth=0.7)
    draw_line(axes, time, energy - energy[0], label=series.name(), **series.looks())
    slope, error = energy_drift(run)
    told = "" if np.isnan(slope) else f", drift {slope:+.1e} ± {error:.0e} per unit of time"
    axes.set_title("energy error" + (f" (H(0) = {energy[0]:.6g}{told})" if series.alone else ""))
    axes.set_ylabel(f"H − H(0)\n{unit(trajectory['hamiltonian'].attrs['units']).strip()}")
    legend_above(axes)


def draw_momenta(axes: Axes, run: xr.DataTree, series: Series = ALONE) -> None:
    """Draw the error of the momenta that the scene conserves, or all momenta if it conserves none."""
    if is_ensemble(run):
        draw_all_momenta(axes, run)
        return
    time = dataset_of(run, TRAJECTORY)["time"].values
    conserved = momentum_components(run, conserved=True)
    if not conserved:
        momenta = momentum_components(run, conserved=False)
        over = layers([float(np.ptp(values)) for values in momenta.values()])
        for index, (name, values) in enumerate(momenta.items()):
            looks = series.looks(index)
            draw_line(axes, time, values, label=series.name(_symbol(name)), zorder=over[index], **looks)
        unknown = ", ".join(map(_symbol, undecided_momenta(run)))
        known = f"unknown whether conserved: {unknown}" if unknown else "none is conserved"
        axes.set_title("momenta" + (f" ({known})" if series.alone else ""))
        axes.set_ylabel(
            "p [M L T⁻¹]\nL [M L² T⁻¹]" if "angular_momentum" in dataset_of(run, TRAJECTORY) else "p\n[M L T⁻¹]"
        )
        legend_above(axes)
        return
    for index, (name, values) in enumerate(conserved.items()):
        draw_dots(axes, time, np.abs(values - values[0]), label=series.name(_symbol(name)), **series.looks(index))
    scale_log(axes, "none: conserved to the last bit")
    axes.set_title("error of conserved momenta")
    errors = {"p": "|p − p(0)| [M L T⁻¹]", "L": "|L − L(0)| [M L² T⁻¹]"}
    axes.set_ylabel("\n".join(text for letter, text in errors.items() if any(name[0] == letter for name in conserved)))
    legend_above(axes)


def draw_gaps(axes: Axes, run: xr.DataTree, series: Series = ALONE) -> None:
    """Draw the smallest gap.

    Raises
    ------
    InputError
        If the scene has no unilateral constraints.
    """
    if is_ensemble(run):
        draw_all_gaps(axes, run)
        return
    trajectory = dataset_of(run, TRAJECTORY)
    time, gap = trajectory["time"].values, trajectory["gap_min"].values
    if not np.isfinite(gap).any():
        raise InputError("gaps: the run has none to draw; its scene has no unilateral constraints.")
    axes.axhline(0.0, color="0.6", linewidth=0.7)
    looks = series.looks()
    draw_line(axes, time, gap, label=series.name(), **looks)
    worst = int(gap.argmin())
    axes.set_title("smallest gap" + (f" ({_deepest(gap[worst], time[worst])})" if series.alone else ""))
    axes.set_ylabel(f"min g\n{unit(trajectory['gap_min'].attrs['units']).strip()}")
    if gap[worst] < 0.0:
        spot: dict[str, Any] = {"marker": "o", "markersize": 4, "linestyle": "none", "clip_on": False}
        axes.plot(time[worst], gap[worst], color=color(1) if series.alone else looks["hue"], **spot)
    legend_above(axes)


def draw_residuals(axes: Axes, run: xr.DataTree, series: Series = ALONE) -> None:
    """Draw the scaled residuals of each subproblem (of an ensemble, the largest of all members) and the tolerances."""
    trajectory, stats = dataset_of(run, TRAJECTORY), dataset_of(run, STATS)
    time = trajectory["time"].values
    if is_ensemble(run):
        measured, equality, ends = *worst_residuals(run, RESIDUALS), time[1:]
    else:
        measured = np.fmax.reduce([stats[name].values for name in RESIDUALS])
        equality, ends = trajectory["equality_residual"].values, step_times(run)
    over = layers(np.count_nonzero(measured > 0.0, axis=0).tolist())
    for index, name in enumerate(stats["subproblem"].values):
        looks = series.looks(index)
        draw_dots(axes, ends, measured[:, index], label=series.name(str(name)), zorder=over[index], **looks)
    draw_dots(axes, time, equality, label=series.name("|f(q)| [L]"), zorder=1.5, **series.looks(3, "0.55"))
    scale_log(axes, "none: nothing was solved")
    if axes.has_data():
        _draw_tolerances(axes, run)
    axes.set_title("solver residuals")
    axes.set_ylabel("scaled residual")
    legend_above(axes)


def _draw_tolerances(axes: Axes, run: xr.DataTree) -> None:
    choices = tomllib.loads(run.attrs["config"])["solvers"]
    for tolerance in sorted({choice["tolerance"] for choice in choices.values()}):
        axes.axhline(tolerance, color="0.3", linewidth=0.8, linestyle=(0, (4, 3)))
        place = (1.0, tolerance)
        axes.annotate("tolerance", place, xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
    low, high = axes.get_ylim()
    axes.set_ylim(low / 3.0, high * 10.0)


def _deepest(gap: float, time: float) -> str:
    return f"worst {gap:.1e} at time {time:.6g}" if gap < 0.0 else f"no violation, least {gap:.1e}"


def _symbol(name: str) -> str:
    letter, axis = name.split("_")
    return f"${letter}_{axis}$"
