"""Comparison of backends on recorded subproblems: performance profiles, and errors."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from deli.numerals import numeral
from deli.plotting.lines import COLORS, DASHES, color, legend_below, plain
from deli.replaying.profiles import performance_profile

ROUNDING = 1e-16


def draw_profile(axes: Axes, data: xr.Dataset) -> None:
    """Draw the share of problems that each backend solves within a factor of the least time (Dolan and Moré 2002)."""
    profile = performance_profile(data)
    draw_shares(axes, profile)
    axes.set_xlabel("time over the time of the fastest backend on the problem")
    axes.set_ylabel("share of problems with a verified solution")
    tolerance = numeral(data.attrs["tolerance"])
    axes.set_title(f"performance profile ({data.sizes['problem']:,} problems, tolerance {tolerance})")


def draw_shares(axes: Axes, profile: xr.DataArray) -> None:
    """Draw the shares that `performance_profile` returns, a line for each backend."""
    ratio = profile["ratio"].values
    end = max(2.0, 1.5 * float(ratio[-1]))
    for index, name in enumerate(profile["backend"].values):
        share = profile.isel(backend=index).values
        label = plain(str(name))
        axes.step([*ratio, end], [*share, share[-1]], where="post", label=label, linewidth=1.3, **_style(index))
    axes.set_xscale("log")
    axes.set_xlim(1.0, end)
    axes.set_ylim(0.0, 1.02)


def draw_errors(axes: Axes, data: xr.Dataset) -> None:
    """Draw the share of problems that each backend solves to an error |z − z*|, independent of the backend's claim."""
    smallest, largest = ROUNDING, 1.0
    for index, name in enumerate(data["backend"].values):
        errors = np.maximum(data["error"].isel(backend=index).values, ROUNDING)
        found = np.sort(errors[np.isfinite(errors)])
        share = np.arange(1, len(found) + 1) / data.sizes["problem"]
        steps = np.concatenate(([smallest], found, [max(largest, found[-1] if len(found) else largest)]))
        last = share[-1] if len(share) else 0.0
        axes.step(steps, [0.0, *share, last], where="post", label=str(name), linewidth=1.3, **_style(index))
    axes.set_xscale("log")
    axes.set_ylim(0.0, 1.02)
    axes.axvline(data.attrs["tolerance"], color="0.4", linewidth=0.8, linestyle=(0, (1, 3)))
    axes.set_xlabel("error of the answer, |z − z*| (dotted: the tolerance)")
    axes.set_ylabel("share of problems")
    axes.set_title("polished answers" if data.attrs["polish"] else "answers as the backends leave them")


def draw_replay(figure: Figure | SubFigure, data: xr.Dataset) -> None:
    """Draw performance profile and errors side by side."""
    left, right = figure.subplots(1, 2)
    draw_profile(left, data)
    draw_errors(right, data)
    legend_below(figure, left)


def _style(index: int) -> dict[str, Any]:
    return {"color": color(index), "linestyle": DASHES[(index + index // len(COLORS)) % len(DASHES)]}
