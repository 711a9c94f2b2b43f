"""The picture of an animation: bodies in their places, a clock, and the energy error with a cursor."""

import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes

from deli.mechanics.scene import Scene
from deli.plotting import shapes
from deli.plotting.lines import color, draw_line, unit
from deli.plotting.stages import STAGES, draw_walls
from deli.plotting.style import new_figure, run_title
from deli.recording.schema import TRAJECTORY, dataset_of

WIDTH, TALLEST, FLATTEST = 6.4, 5.6, 1.6
LETTERS, MARGIN, FLAT = 100, 0.05, 0.25
CURVES = 40
SPACE = {"projection": "3d", "proj_type": "ortho", "computed_zorder": False}


class Picture:
    """A figure that can show any of the chosen rows of a run.

    Attributes
    ----------
    figure : matplotlib.figure.Figure
        The figure, laid out. Its first axes show the bodies, its last axes the energy error; in one dimension, its
        second axes show positions over time.
    frames : int
        Number of shown rows.
    """

    def __init__(self, run: xr.DataTree, scene: Scene | None, rows: np.ndarray, dpi: float) -> None:
        recorded = dataset_of(run, TRAJECTORY)
        self._dimension = recorded.sizes["axis"]
        self._units = recorded["position"].attrs["units"]
        self._time = recorded["time"].values
        energy = recorded["hamiltonian"].values
        self._error = energy - energy[0]
        self._rows = rows
        self._scene = scene
        self.frames = len(rows)
        self._box = np.zeros(self._dimension) if scene is None or _linked(scene) else shapes.period(scene)
        position = recorded["position"].values.reshape(len(self._time), -1, self._dimension)
        self._places = _wrapped(position[rows], self._box)
        radius = np.zeros(position.shape[1]) if scene is None else shapes.radii(scene)
        self._low, self._high = _limits(self._places, radius, scene, self._box)

        span = self._high - self._low
        tall = 3.6 if self._dimension == 1 else 4.8 if self._dimension == 3 else 5.6 * span[1] / span[0]
        tall = float(np.clip(tall, FLATTEST, TALLEST))
        self.figure = new_figure((_even(WIDTH, dpi), _even(tall + 2.1, dpi)))
        self.figure.set_dpi(dpi)
        above, below = self.figure.subfigures(2, 1, height_ratios=(tall + 0.7, 1.4), squeeze=False)[:, 0]
        above.suptitle(textwrap.fill(run_title(run), LETTERS), fontsize=8)
        self._stand, curves = self._axes(above)
        if curves is not None:
            self._draw_curves(curves, position)
        self._clock = self._stand.set_title(" ")
        if scene is not None:
            for axes in (self._stand, curves) if curves is not None else (self._stand,):
                draw_walls(axes, scene, self._low, self._high, self._places)
        energy_axes = below.subplots()
        self._cursors = [
            axes.axvline(self._time[rows[0]], color="0.3", linewidth=0.8) for axes in (curves, energy_axes) if axes
        ]
        self._dot = self._draw_energy(energy_axes, recorded["hamiltonian"].attrs["units"])
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # changes from frame to frame must not move the axes
        self._stage = STAGES[self._dimension](self._stand, scene, radius)
        self.moving: list[Any] = [*self._stage.artists, self._clock, *self._cursors, self._dot]
        step = float(np.diff(self._time[rows]).min()) if len(rows) > 1 else 1.0
        self._digits = int(np.clip(np.ceil(-np.log10(max(step, 1e-9)) + 1e-9), 0, 9))
        self.show(0)

    def show(self, frame: int) -> list[Artist]:
        """Move all artists to their places in a frame, counted from 0; return the moved artists."""
        row = self._rows[frame]
        self._stage.show(self._places[frame])
        self._clock.set_text(f"time {self._time[row]:.{self._digits}f}    energy error {self._error[row]:+.1e}")
        for cursor in self._cursors:
            cursor.set_xdata([self._time[row]] * 2)
        self._dot.set_data([self._time[row]], [self._error[row]])
        return self.moving

    def drawn(self) -> Iterator[np.ndarray]:
        """Yield all frames as pixels, shape (height, width, 4), and redraw moving artists only.

        Each frame is valid until the next one.
        """
        canvas: Any = self.figure.canvas
        for artist in self.moving:
            artist.set_animated(True)
        try:
            canvas.draw()
            background = canvas.copy_from_bbox(self.figure.bbox)
            ordered = sorted(self.moving, key=lambda artist: artist.get_zorder())
            for frame in range(self.frames):
                canvas.restore_region(background)
                self.show(frame)
                for artist in ordered:
                    if hasattr(artist, "do_3d_projection"):
                        artist.do_3d_projection()
                    artist.axes.draw_artist(artist)
                yield np.asarray(canvas.buffer_rgba())
        finally:
            for artist in self.moving:
                artist.set_animated(False)

    def _axes(self, figure: Any) -> tuple[Any, Axes | None]:
        if self._dimension == 1:
            stand, curves = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 4.0))
            stand.set_ylabel(f"position{unit(self._units)}")
            stand.set_ylim(self._low[0], self._high[0])
            stand.set_xlim(0.0, 1.0)
            stand.set_xticks([])
            return stand, curves
        space: Any = (
            {"projection": "3d", "proj_type": "ortho", "computed_zorder": False} if self._dimension == 3 else {}
        )
        stand = figure.subplots(subplot_kw=space)
        for name, low, high in zip("xyz", self._low, self._high, strict=False):
            getattr(stand, f"set_{name}lim")(low, high)
            getattr(stand, f"set_{name}label")(f"{name}{unit(self._units)}")
        if self._dimension == 3:
            stand.set_box_aspect(self._high - self._low, zoom=0.9)
        else:
            stand.set_aspect("equal", adjustable="box")
        return stand, None

    def _draw_curves(self, axes: Axes, position: np.ndarray) -> None:
        """Draw positions over time between the first and the last frame, of at most `CURVES` bodies."""
        shown = slice(self._rows[0], self._rows[-1] + 1)
        bodies = np.unique(np.linspace(0, position.shape[1] - 1, min(position.shape[1], CURVES)).round().astype(int))
        for body in bodies:
            time, path = self._time[shown], position[shown, body, 0]
            if self._box[0] > 0.0:
                time, path = _torn(time, _wrapped(path, self._box), 0.5 * self._box[0])
            draw_line(axes, time, path, color(int(body)))
        axes.set_title(" ")
        self._end_axis(axes)

    def _draw_energy(self, axes: Axes, units: str) -> Any:
        shown = slice(self._rows[0], self._rows[-1] + 1)
        axes.axhline(0.0, color="0.6", linewidth=0.7)
        draw_line(axes, self._time[shown], self._error[shown], color(0))
        axes.set_title(f"H − H(0){unit(units)}", loc="right", fontsize=8)
        self._end_axis(axes)
        return axes.plot([], [], color=color(1), marker="o", markersize=4, clip_on=False)[0]

    def _end_axis(self, axes: Axes) -> None:
        axes.set_xlabel("time [T]")
        if len(self._rows) > 1:
            axes.set_xlim(self._time[self._rows[0]], self._time[self._rows[-1]])


def _even(inches: float, dpi: float) -> float:
    """Return a length rounded to an even number of pixels, as films need it."""
    return 2.0 * round(0.5 * inches * dpi) / dpi


def _linked(scene: Scene) -> bool:
    bodies = scene.position.reshape(-1, scene.dimension)
    return bool(len(shapes.rods(scene, bodies)) or len(shapes.springs(scene, bodies)))


def _wrapped(places: np.ndarray, box: np.ndarray) -> np.ndarray:
    """Return places within a periodic box; coordinates along axes that are not periodic stay unchanged."""
    length = np.where(box > 0.0, box, 1.0)
    return np.where(box > 0.0, np.mod(places, length), places)


def _torn(time: np.ndarray, path: np.ndarray, jump: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a path with a gap at every jump of at least `jump`, so that no line crosses a periodic box."""
    gaps = 1 + np.flatnonzero(np.abs(np.diff(path)) > jump)
    return np.insert(time, gaps, time[gaps]), np.insert(path, gaps, np.nan)


def _limits(
    places: np.ndarray, radius: np.ndarray, scene: Scene | None, box: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits of bodies and the walls near them, with a margin; along periodic axes the limits of the box."""
    low = (places - radius[:, None]).min(axis=(0, 1))
    high = (places + radius[:, None]).max(axis=(0, 1))
    if scene is not None:
        for point in shapes.pivots(scene):
            low, high = np.minimum(low, point), np.maximum(high, point)
        for centre, size in shapes.containers_near(scene, places):
            low, high = np.minimum(low, centre - size), np.maximum(high, centre + size)
        reach = float((high - low).max())
        for normal, offset in shapes.planes(scene):
            across = np.abs(normal) == 1.0
            if across.any():
                wall = float(offset * normal[across][0])
                near = (low[across] - reach <= wall) & (wall <= high[across] + reach)
                low[across] = np.where(near, np.minimum(low[across], wall), low[across])
                high[across] = np.where(near, np.maximum(high[across], wall), high[across])
    wide = float((high - low).max()) or 1.0
    lacking = np.maximum(FLAT * wide - (high - low), 0.0)
    low, high = low - 0.5 * lacking - MARGIN * wide, high + 0.5 * lacking + MARGIN * wide
    return np.where(box > 0.0, 0.0, low), np.where(box > 0.0, box, high)
