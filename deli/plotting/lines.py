"""Lines of any length: drawn as they are while the eye can follow them, as an envelope beyond that."""

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
POINTS, TURNS, BINS, MEANS = 6000, 300, 700, 140
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def color(index: int) -> str:
    """Return a colour that can be told from its neighbours, by colour-blind readers too."""
    return COLORS[index % len(COLORS)]


def plain(text: str) -> str:
    """Return words that matplotlib shows as they are: without this it takes what is between dollars for a formula."""
    return text.replace("$", r"\$")


def unit(units: str) -> str:
    """Return units for a label: ``M L2 T-2`` as ``[M L² T⁻²]``, nothing for ``1``."""
    return "" if units == "1" else f" [{units.translate(SUPERSCRIPTS)}]"


def draw_line(axes: Axes, time: np.ndarray, values: np.ndarray, hue: str, label: str | None = None) -> None:
    """Draw values over time; where they turn too often for the eye, their range and their running mean.

    That is beyond `TURNS` turning points or `POINTS` points.
    """
    if _turns(values) <= TURNS and len(time) <= POINTS:
        axes.plot(time, values, color=hue, label=label, linewidth=0.9)
    else:
        draw_range(axes, time, values, hue, label)


def draw_range(axes: Axes, time: np.ndarray, values: np.ndarray, hue: str, label: str | None = None) -> None:
    """Draw the range of values and their running mean.

    A bin of the range spans some oscillations, so that the range shows their amplitude and not where in the oscillation
    a bin ends.
    """
    bins = min(int(np.clip(_turns(values) // 6, MEANS // 2, BINS)), len(values))
    middle, low = _binned(time, bins, np.mean), _binned(values, bins, np.min)
    axes.fill_between(middle, low, _binned(values, bins, np.max), color=hue, alpha=0.3, linewidth=0)
    means = min(bins, MEANS)
    axes.plot(_binned(time, means, np.mean), _binned(values, means, np.mean), color=hue, label=label, linewidth=0.9)


def _turns(values: np.ndarray) -> int:
    return int(np.count_nonzero(np.diff(np.sign(np.diff(values)))))


def _binned(values: np.ndarray, bins: int, reduce: Callable[[np.ndarray], float]) -> np.ndarray:
    return np.array([reduce(part) for part in np.array_split(values, bins)])


def draw_worst(axes: Axes, time: np.ndarray, values: np.ndarray, hue: str, label: str, **style: Any) -> None:
    """Draw values as dots for a log axis; of many points, the largest of each bin. Zeros are left out."""
    positive = np.isfinite(values) & (values > 0)
    time, values = time[positive], values[positive]
    if len(time) > POINTS:
        time, values = _binned(time, BINS, np.mean), _binned(values, BINS, np.max)
    if len(time):
        axes.plot(time, values, color=hue, label=label, linestyle="none", marker=".", markersize=2.5, **style)


def legend_above(axes: Axes) -> None:
    """Put the legend above the axes, where it covers nothing."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            handles,
            labels,
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            ncols=4,
            borderaxespad=0.1,
            handlelength=1.2,
            columnspacing=1.0,
            markerscale=3.0,
        )


def legend_below(figure: Figure | SubFigure, axes: Axes) -> None:
    """Put the legend under everything else."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, handlelength=1.2, columnspacing=1.0)


def scale_log(axes: Axes, nothing: str) -> None:
    """Give the axes a logarithmic scale, or the words `nothing` where no value is positive."""
    if axes.has_data():
        axes.set_yscale("log")
        return
    axes.set_yticks([])
    axes.text(0.5, 0.5, nothing, transform=axes.transAxes, ha="center", va="center", color="0.4", fontsize=9)
