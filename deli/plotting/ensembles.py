"""Energy error, momenta, gaps and solver residuals of an ensemble: a line for each of few members, a range of many."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from deli.errors import InputError
from deli.metrics import momentum_components
from deli.plotting.lines import color, draw_dots, draw_line, layers, legend_above, plain, scale_log, unit
from deli.recording.members import FEW, count_members, name_of
from deli.recording.schema import STATS, TRAJECTORY, dataset_of


def draw_energies(axes: Axes, run: xr.DataTree) -> None:
    """Draw the energy error of members."""
    trajectory = dataset_of(run, TRAJECTORY)
    energy = trajectory["hamiltonian"].values
    error = energy - energy[:, :1]
    axes.axhline(0.0, color="0.6", linewidth=0.7)
    _draw_members(axes, run, error)
    low, high = np.fmin.reduce(error, axis=None), np.fmax.reduce(error, axis=None)
    axes.set_title(f"energy error of {count_members(run)} members ({low:+.1e} to {high:+.1e})")
    axes.set_ylabel(f"H − H(0)\n{unit(trajectory['hamiltonian'].attrs['units']).strip()}")
    legend_above(axes)


def draw_all_momenta(axes: Axes, run: xr.DataTree) -> None:
    """Draw the largest error of the momenta that members conserve, or the range of all momenta if none is conserved."""
    time = dataset_of(run, TRAJECTORY)["time"].values
    conserved = momentum_components(run, conserved=True)
    if not conserved:
        momenta = {name: part.values for name, part in momentum_components(run, conserved=False).items()}
        for index, (name, values) in enumerate(momenta.items()):
            letter, axis = name.split("_")
            _draw_range(axes, time, values, color(index), f"${letter}_{axis}$: ")
        axes.set_title("momenta (none is conserved)")
        axes.set_ylabel("p [M L T⁻¹]\nL [M L² T⁻¹]" if any(name[0] == "L" for name in momenta) else "p\n[M L T⁻¹]")
        legend_above(axes)
        return
    errors = {
        letter: [abs(part - part[:, :1]).values for name, part in conserved.items() if name[0] == letter]
        for letter in "pL"
    }
    for index, (letter, parts) in enumerate(errors.items()):
        if parts:
            worst = np.fmax.reduce([np.fmax.reduce(part) for part in parts])
            draw_dots(axes, time, worst, color(index), f"${letter}$, worst member and component")
    scale_log(axes, "none: conserved to the last bit")
    axes.set_title("error of conserved momenta")
    labels = {"p": "|p − p(0)| [M L T⁻¹]", "L": "|L − L(0)| [M L² T⁻¹]"}
    axes.set_ylabel("\n".join(label for letter, label in labels.items() if errors[letter]))
    legend_above(axes)


def draw_all_gaps(axes: Axes, run: xr.DataTree) -> None:
    """Draw the smallest gap of members.

    Raises
    ------
    InputError
        If no scene has unilateral constraints.
    """
    trajectory = dataset_of(run, TRAJECTORY)
    gap, time = trajectory["gap_min"].values, trajectory["time"].values
    if not np.isfinite(gap).any():
        raise InputError("gaps: the run has none to draw; its scenes have no unilateral constraints.")
    axes.axhline(0.0, color="0.6", linewidth=0.7)
    _draw_members(axes, run, gap)
    member, row = np.unravel_index(np.nanargmin(gap), gap.shape)
    where = f"at time {time[row]:.6g}, {plain(name_of(run, int(member)))}"
    axes.set_title(f"smallest gap (worst {gap[member, row]:+.1e} {where})")
    axes.set_ylabel(f"min g\n{unit(trajectory['gap_min'].attrs['units']).strip()}")
    legend_above(axes)


def worst_residuals(run: xr.DataTree, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest residual of members by step and subproblem, and their largest |f(q)| by row."""
    stats = dataset_of(run, STATS)
    equality = dataset_of(run, TRAJECTORY)["equality_residual"].values
    return np.fmax.reduce([np.fmax.reduce(stats[name].values) for name in names]), np.fmax.reduce(equality)


def _draw_members(axes: Axes, run: xr.DataTree, values: np.ndarray) -> None:
    """Draw values of shape (members, rows): a line for each of few members, else median and range."""
    time = dataset_of(run, TRAJECTORY)["time"].values
    if len(values) > FEW:
        _draw_range(axes, time, values, color(0))
        return
    over = layers([float(np.fmax.reduce(one) - np.fmin.reduce(one)) for one in values])
    for member, one in enumerate(values):
        draw_line(axes, time, one, color(member), plain(name_of(run, member)), zorder=over[member])


def _draw_range(axes: Axes, time: np.ndarray, values: np.ndarray, hue: str, name: str = "") -> None:
    """Draw the median of members over time, and the band between their smallest and their largest value."""
    known = np.isfinite(values).any(axis=0)
    time, values = time[known], values[:, known]
    low, high = np.fmin.reduce(values), np.fmax.reduce(values)
    axes.fill_between(time, low, high, color=hue, alpha=0.25, linewidth=0, label=f"{name}smallest to largest")
    draw_line(axes, time, np.nanmedian(values, axis=0), hue, f"{name}median of members")
