"""Lines of any length, drawn with all of their visible rows."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.colors import is_color_like, to_hex
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from deli.errors import InputError

COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#999999")
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
"""Dashes for readers who cannot distinguish colours, and for more lines than colours."""
DOTS, NOTHING = ".x+1", "nothing"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def color(index: int) -> str:
    """Return a colour that differs from its neighbours, for colour-blind readers too.

    Examples
    --------
    >>> import deli
    >>> deli.plotting.color(0), deli.plotting.color(1)
    ('#0072B2', '#D55E00')
    """
    return COLORS[index % len(COLORS)]


def plain(text: str) -> str:
    """Return text that matplotlib shows literally, instead of a formula between dollar signs."""
    return text.replace("$", r"\$")


def unit(units: str) -> str:
    """Return units for a label: ``M L2 T-2`` as ``[M L² T⁻²]``, nothing for ``1``."""
    return "" if units == "1" else f" [{units.translate(SUPERSCRIPTS)}]"


class Series(NamedTuple):
    """Looks of the lines of one run, on axes that may hold lines of other runs.

    Attributes
    ----------
    label : str or None
        Name of the run in the legend.
    hue : object
        Colour of all lines of the run, which then differ by their dashes; or None.
    beside : bool
        Whether the axes hold other lines already.
    used : int
        Number of `COLORS` on the axes already.
    """

    label: str | None = None
    hue: Any = None
    beside: bool = False
    used: int = 0

    @property
    def alone(self) -> bool:
        """Whether the title may speak of this run."""
        return self.label is None and not self.beside

    def name(self, line: str | None = None) -> str | None:
        """Return the label of a line."""
        words = (None if self.label is None else plain(self.label), line)
        return ", ".join(word for word in words if word) or None

    def looks(self, index: int = 0, own: str | None = None) -> dict[str, Any]:
        """Return colour and dashes of a line by its index among the lines of the run; `own` is its usual colour."""
        if self.hue is not None:
            return {"hue": self.hue, "linestyle": DASHES[index % len(DASHES)]}
        return {"hue": own or color(self.used + index)}


ALONE = Series()


def series_on(axes: Axes | None, label: str | None, hue: Any) -> Series:
    """Return the looks of the next run on the given axes, or on new ones.

    Raises
    ------
    InputError
        If the label is not a string, or matplotlib does not know the colour.
    """
    if label is not None and not isinstance(label, str):
        raise InputError(f"label: found {label!r}; pass a string.")
    if hue is not None and not is_color_like(hue):
        raise InputError(f"color: found {hue!r}; pass a colour of matplotlib's, such as 'C1', 'black' or '#0072B2'.")
    if axes is None:
        return Series(label, hue)
    lines = [line for line in axes.lines if isinstance(line, Trace) or not str(line.get_label()).startswith("_")]
    used = {to_hex(line.get_color()).upper() for line in lines} & set(COLORS)
    return Series(label, hue, axes.has_data(), len(used))


class Trace(Line2D):
    """A line over time that looks like a line through all rows, at the cost of a few rows for each pixel.

    In a column of pixels with several rows, the line goes through the first, the smallest, the largest and the last
    row, in their order (M4; Jugel et al. 2014). It then fills the range of the column, like a line through all rows.
    Columns are computed when the axes are drawn, at any size, resolution and zoom; the data of the line stay complete.
    """

    def draw(self, renderer: RendererBase) -> None:
        """Draw the rows that differ on the axes."""
        data = np.asarray(self.get_xydata(), dtype=float)
        kept = self._kept(data, self.get_transform().transform(data))
        if len(kept) == len(data):
            super().draw(renderer)
            return
        thinned = Line2D(*data[kept].T)
        thinned.update_from(self)
        thinned.draw(renderer)
        self.stale = False

    def _kept(self, data: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        axes: Any = self.axes
        left, right = axes.bbox.intervalx
        return extreme_rows(np.floor(np.clip(pixels[:, 0], left - 1.0, right + 1.0)), data[:, 1])


class Dots(Trace):
    """Dots over time, one for each occupied pixel."""

    def _kept(self, data: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        cells = np.floor(pixels)
        return np.sort(np.unique(cells[:, 0] + 1j * cells[:, 1], return_index=True)[1])


class Track(Trace):
    """A path in the plane; of successive rows on the same pixel the first and the last are drawn."""

    def _kept(self, data: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        moved = (np.diff(np.floor(pixels), axis=0) != 0.0).any(axis=1)
        return np.flatnonzero(np.append(True, moved) | np.append(moved, True))


def extreme_rows(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the first, the smallest, the largest and the last row of each column, and all rows that are not finite.

    Parameters
    ----------
    columns : numpy.ndarray
        Column of each row, in ascending order, shape (rows,).
    values : numpy.ndarray
        Shape (rows,).

    Returns
    -------
    numpy.ndarray
        Indices of rows, in ascending order.
    """
    known = np.isfinite(values)
    rows = np.flatnonzero(known)
    if len(rows) == 0:
        return np.arange(len(values))
    columns, values = columns[rows], values[rows]
    starts = np.flatnonzero(np.diff(columns, prepend=-np.inf))
    sizes = np.diff(starts, append=len(rows))
    kept = [starts, starts + sizes - 1]
    for extreme in (np.minimum, np.maximum):
        there = np.flatnonzero(values == np.repeat(extreme.reduceat(values, starts), sizes))
        kept.append(there[np.searchsorted(there, starts)])
    return np.union1d(rows[np.concatenate(kept)], np.flatnonzero(~known))


def draw_line(
    axes: Axes, time: np.ndarray, values: np.ndarray, hue: Any, label: str | None = None, **style: Any
) -> None:
    """Draw values over time as a `Trace`."""
    _add(axes, Trace(time, values, color=hue, label=label, **{"linewidth": 0.9, **style}))


def draw_dots(
    axes: Axes, time: np.ndarray, values: np.ndarray, hue: Any, label: str | None, linestyle: Any = "-", **style: Any
) -> None:
    """Draw positive values as dots for a logarithmic axis; other markers stand for other dashes."""
    positive = np.isfinite(values) & (values > 0)
    if positive.any():
        looks: dict[str, Any] = {"linestyle": "none", "marker": DOTS[DASHES.index(linestyle)], "markersize": 2.5}
        _add(axes, Dots(time[positive], values[positive], color=hue, label=label, **looks, **style))


def draw_track(axes: Axes, path: np.ndarray, hue: str, **style: Any) -> None:
    """Draw a path in the plane, shape (rows, 2), as a `Track`."""
    _add(axes, Track(*path.T, color=hue, **style))


def layers(extents: Sequence[float]) -> list[float]:
    """Return the zorder of each line, such that lines of larger extent lie under lines of smaller extent."""
    order = np.argsort(np.argsort(extents))
    return [2.0 - 0.1 * float(rank) / len(extents) for rank in order]


def _add(axes: Axes, line: Line2D) -> None:
    axes.add_line(line)
    axes.autoscale_view()


def legend_above(axes: Axes) -> None:
    """Put the legend above the axes, where it covers no line."""
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
    """Put the legend under the figure."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=6, handlelength=1.2, columnspacing=1.0)


def scale_log(axes: Axes, nothing: str) -> None:
    """Give the axes a logarithmic scale, or write the text `nothing` if no value is positive."""
    for words in [text for text in axes.texts if text.get_gid() == NOTHING]:  # of a run drawn before
        words.remove()
    if axes.has_data():
        axes.set_yscale("log")
        return
    axes.set_yticks([])
    style: dict[str, Any] = {"ha": "center", "va": "center", "color": "0.4", "fontsize": 9, "gid": NOTHING}
    axes.text(0.5, 0.5, nothing, transform=axes.transAxes, **style)
