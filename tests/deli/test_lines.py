"""Lines of many rows: what is drawn of them at any width is true of all rows."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from scipy.ndimage import binary_dilation

from deli.plotting.lines import draw_dots, draw_line, draw_track

DPI = 100


class Spy(RendererAgg):
    """Draws, and keeps the vertices of each line and the number of its markers."""

    def __init__(self, figure):
        super().__init__(*map(int, figure.bbox.size), figure.dpi)
        self.lines, self.dots = [], 0
        self.marking, self.draw_markers = self.draw_markers, self.mark

    def draw_path(self, gc, path, transform, rgbFace=None):
        self.lines.append(path.vertices)
        super().draw_path(gc, path, transform, rgbFace)

    def mark(self, gc, marker, marker_transform, path, transform, rgbFace=None):
        self.dots += len(path.vertices)
        self.marking(gc, marker, marker_transform, path, transform, rgbFace)

    def lit(self):
        return np.asarray(self.buffer_rgba())[..., 3] > 128


def drawn(width, draw, height=200):
    """Draw on axes that are all of a picture so many pixels wide; return the axes and the spy."""
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    draw(axes)
    spy = Spy(figure)
    axes.draw(spy)
    return axes, spy


def oscillation(rows, period):
    return np.sin(2.0 * np.pi * np.arange(rows) / period)


values = st.one_of(
    arrays.arrays(float, st.integers(2, 3000), elements=st.floats(-1e6, 1e6)),
    st.builds(oscillation, st.integers(2, 20_000), st.floats(2.0, 500.0)),
)


@settings(deadline=None)
@given(values, st.integers(20, 600))
@example(oscillation(201, 6.07), 1100)
@example(oscillation(3001, 6.07), 1100)
def test_a_line_shows_the_extremes_of_its_rows_and_nothing_but_rows(values, width):
    time = np.linspace(0.0, 300.0, len(values))
    axes, spy = drawn(width, lambda axes: draw_line(axes, time, values, "k"))
    (vertices,) = spy.lines
    rows = np.searchsorted(time, vertices[:, 0])
    assert np.all(np.diff(rows) > 0)
    np.testing.assert_array_equal(vertices, np.column_stack([time[rows], values[rows]]))
    column = np.floor(axes.transData.transform(np.column_stack([time, values]))[:, 0]).astype(int)
    for pixel in np.unique(column):
        here, shown = values[column == pixel], values[rows[column[rows] == pixel]]
        assert (shown[0], shown.min(), shown.max(), shown[-1]) == (here[0], here.min(), here.max(), here[-1])
        assert len(shown) == min(len(shown), 4)
    (line,) = axes.lines
    np.testing.assert_array_equal(line.get_ydata(), values)


@settings(deadline=None, max_examples=30)
@given(st.integers(500, 20_000), st.floats(2.0, 2000.0), st.integers(50, 400))
def test_a_line_covers_the_pixels_that_all_rows_would(rows, period, width):
    time, values = np.linspace(0.0, 1.0, rows), oscillation(rows, period)
    _, thinned = drawn(width, lambda axes: draw_line(axes, time, values, "k"))
    _, whole = drawn(width, lambda axes: axes.plot(time, values, color="k", linewidth=0.9))
    for one, other in ((thinned.lit(), whole.lit()), (whole.lit(), thinned.lit())):
        assert not np.any(one & ~binary_dilation(other, np.ones((3, 3))))


@pytest.mark.parametrize("missing", [slice(1000, 1500), slice(None, 40), slice(None)])
def test_what_is_not_finite_breaks_a_line(missing):
    values = oscillation(5000, 7.0)
    values[missing] = np.nan
    time = np.arange(5000.0)
    _, spy = drawn(200, lambda axes: draw_line(axes, time, values, "k"))
    lit = spy.lit().any(axis=0)
    assert lit.any() == np.isfinite(values).any()
    if missing == slice(1000, 1500):
        assert not lit[48:62].any()  # rows 1000 to 1500 are on columns 45 to 64


def test_a_window_shows_its_rows_and_where_the_line_leaves_it():
    time, values = np.arange(100_000.0), oscillation(100_000, 9.0)

    def draw(axes):
        draw_line(axes, time, values, "k")
        axes.set_xlim(5000.0, 5050.0)

    _, spy = drawn(500, draw)
    shown = spy.lines[0][:, 0]
    assert set(range(4999, 5052)) <= set(shown)
    assert len(shown) < 70


def test_dots_on_one_pixel_are_drawn_once():
    generator = np.random.default_rng(1)
    time, values = np.linspace(0.0, 1.0, 50_000), 10.0 ** generator.integers(-16, -13, 50_000)
    values[::3] = 0.0

    def draw(axes):
        draw_dots(axes, time, values, "k", "residual")
        axes.set_yscale("log")

    axes, spy = drawn(300, draw)
    pixels = np.floor(axes.transData.transform(np.column_stack([time, values])[values > 0.0]))
    assert spy.dots == len(np.unique(pixels, axis=0)) < 1000
    low, high = axes.get_ylim()
    assert 0.0 < low < 1e-16 < 1e-14 < high


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 20_000), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.integers(50, 400))
def test_a_path_in_the_plane_is_drawn_on_every_pixel_of_its_rows(rows, across, up, width):
    """However fast a body goes to and fro, it is drawn where it turned."""
    path = np.column_stack([oscillation(rows, 2.0 + 500.0 * across), oscillation(rows, 2.0 + 3000.0 * up)])
    axes, spy = drawn(width, lambda axes: draw_track(axes, path, "k"))
    (vertices,) = spy.lines
    everywhere, shown = (set(map(tuple, np.floor(axes.transData.transform(some)))) for some in (path, vertices))
    assert shown == everywhere
    assert set(map(tuple, vertices)) <= set(map(tuple, path))
