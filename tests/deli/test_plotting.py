"""Figures: what is drawn, that labels carry units, that pictures are written or refused."""

import struct

import numpy as np
import pytest
from matplotlib.figure import Figure

import deli
from deli.errors import InputError, StepError
from deli.plotting import shapes
from deli.plotting.lines import COLORS, Trace, unit

FAST = [
    deli.scenes.point_mass(),
    deli.scenes.pogo_stick(),
    deli.scenes.newtons_cradle(),
    deli.scenes.spring_sphere(start="mixed"),
    deli.scenes.lennard_jones(),
    deli.Scene(mass=1.0, position=[[0.0, 1.0]], momentum=[[1.0, 2.0]], dimension=2, name="free"),
]


@pytest.fixture(scope="module", params=FAST, ids=lambda scene: scene.name)
def recorded(request):
    return request.param, deli.simulate(request.param, deli.GVI(scheme="verlet"), step_size=0.01, steps=80)


def test_history_has_a_panel_for_each_question(recorded):
    scene, run = recorded
    figure = deli.plotting.history(run)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[0].startswith("energy error")
    assert "momenta" in titles[1]
    assert ("smallest gap" in titles[2]) == bool(scene.unilateral.rows)
    assert titles[-1] == "solver residuals"
    limits = {axes.get_xlim() for axes in figure.axes}
    assert limits == {(0.0, 0.8)}


def test_energy_panel_shows_the_energy_error(recorded):
    _, run = recorded
    line = deli.plotting.history(run).axes[0].lines[1]
    energy = run["trajectory"]["hamiltonian"].values
    np.testing.assert_array_equal(line.get_ydata(), energy - energy[0])


def test_trajectory_draws_every_body(recorded):
    scene, run = recorded
    figure = deli.plotting.trajectory(run)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [f"body {body}" for body in range(scene.bodies)]


def test_panels_go_on_axes_of_ones_own(recorded):
    scene, run = recorded
    own = Figure()
    kinds = {"projection": "3d"} if scene.dimension == 3 else {}
    for index, draw in enumerate((deli.plotting.energy, deli.plotting.momenta, deli.plotting.residuals), 1):
        axes = own.add_subplot(2, 2, index)
        assert draw(run, ax=axes) is own
        assert axes.get_title(loc="center") or axes.get_title(loc="left")
        assert axes.get_xlim() == (0.0, 0.8)
    axes = own.add_subplot(2, 2, 4, **kinds)
    assert deli.plotting.trajectory(run, scene, ax=axes) is own
    assert axes.get_legend() is not None
    wrong = own.add_subplot(projection=None if scene.dimension == 3 else "3d")
    with pytest.raises(InputError, match="ax: found"):
        deli.plotting.trajectory(run, ax=wrong)
    assert len(deli.plotting.energy(run).axes) == 1


def test_gaps_are_drawn_where_there_are_any(recorded):
    scene, run = recorded
    if not scene.unilateral.rows:
        with pytest.raises(InputError, match="gaps: the run has none"):
            deli.plotting.gaps(run)
        return
    (axes,) = deli.plotting.gaps(run).axes
    np.testing.assert_array_equal(axes.lines[1].get_ydata(), run["trajectory"]["gap_min"].values)


def test_a_legend_names_no_more_bodies_than_there_are_colours():
    run = deli.simulate(deli.scenes.hard_rods(rods=len(COLORS) + 1), deli.GVI(), step_size=0.01, steps=5)
    assert not deli.plotting.trajectory(run).legends


def test_walls_are_where_the_surfaces_of_bodies_end():
    walls = {(*normal, offset) for normal, offset in shapes.planes(deli.scenes.disc_pile(columns=4, radius=0.3))}
    assert walls == {(0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (-1.0, 0.0, -2.4)}


def test_axes_carry_units(recorded):
    _, run = recorded
    for figure in (deli.plotting.history(run), deli.plotting.trajectory(run)):
        for axes in figure.axes:
            label = axes.get_ylabel()
            assert label == "scaled residual" or "[" in label
        assert "[T]" in figure.axes[-1].get_xlabel() or "[L]" in figure.axes[-1].get_xlabel()


def test_a_picture_is_written(recorded, tmp_path):
    _, run = recorded
    deli.plotting.save(run, tmp_path / "run.png")
    header = (tmp_path / "run.png").read_bytes()[:24]
    assert header[1:4] == b"PNG"
    width, height = struct.unpack(">II", header[16:24])
    assert width > height > 500


def test_a_picture_whose_words_leave_no_room_is_written(tmp_path):
    run = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.1, steps=5)
    run.attrs["title"] = "a long title\n" * 200
    deli.plotting.save(run, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 0


def test_one_row_can_be_drawn(tmp_path, at_step):
    at_step(1, lambda take: StepError("position: no [/luck]"))
    for scene in (deli.scenes.pogo_stick(), deli.scenes.newtons_cradle()):
        run = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=5)
        assert run["trajectory"].sizes["time"] == 1
        deli.plotting.save(run, tmp_path / f"{scene.name}.png")
        assert "no [/luck]" in deli.plotting.history(run).get_suptitle()


def test_lines_hold_all_rows_of_a_long_run():
    run = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=7000)
    gap = deli.plotting.history(run).axes[2]
    np.testing.assert_array_equal(gap.lines[1].get_ydata(), run["trajectory"]["gap_min"].values)
    assert not gap.collections
    paths, close_up = deli.plotting.trajectory(run).axes
    assert (len(paths.lines[0].get_xdata()), len(close_up.lines[0].get_xdata())) == (7001, 300)


PANELS = [deli.plotting.energy, deli.plotting.momenta, deli.plotting.gaps, deli.plotting.residuals]


@pytest.fixture(scope="module")
def three():
    """Runs of three lengths."""
    scene, settings = deli.scenes.spring_sphere(start="mixed"), {"step_size": 0.1, "skip": False}
    return {f"run {steps}": deli.simulate(scene, deli.GVI(), steps=steps, **settings) for steps in (40, 80, 60)}


def curves(axes):
    """Lines that hold as many points as a run has rows, or dots."""
    return [line for line in axes.lines if isinstance(line, Trace)]


@pytest.mark.parametrize("draw", [*PANELS, deli.plotting.trajectory], ids=lambda draw: draw.__name__)
class TestSeveralRunsOnOneAxis:
    def test_runs_have_colours_of_their_own(self, draw, three):
        axes, hues = Figure().subplots(), []
        for run in three.values():
            before = len(curves(axes))
            draw(run, ax=axes)
            hues.append({line.get_color() for line in curves(axes)[before:]} - {"0.55"})
        if len(set().union(*hues)) < len(COLORS):
            assert sum(map(len, hues)) == len(set().union(*hues))
        else:
            assert hues[0] != hues[1] != hues[2]

    def test_runs_have_labels(self, draw, three):
        axes = Figure().subplots()
        for name, run in three.items():
            draw(run, ax=axes, label=name)
        labels = [text.get_text() for text in axes.get_legend().get_texts()]
        for name in three:
            assert any(label.startswith(name) for label in labels)
        assert len(set(labels)) == len(labels)

    def test_a_label_is_taken_as_it_is(self, draw, three):
        axes = draw(next(iter(three.values())), label="$x_1 \\\\").axes[0]
        axes.figure.draw_without_rendering()

    def test_runs_have_the_colours_that_are_asked_for(self, draw, three):
        axes = Figure().subplots()
        for hue, run in zip(("crimson", "black", (0.1, 0.2, 0.3)), three.values(), strict=True):
            before = len(curves(axes))
            draw(run, ax=axes, color=hue)
            assert {line.get_color() for line in curves(axes)[before:]} == {hue}

    def test_the_title_speaks_of_no_single_run(self, draw, three):
        axes = Figure().subplots()
        titles = []
        for run in three.values():
            draw(run, ax=axes)
            titles.append(axes.get_title(loc="left"))
        assert titles[1] == titles[2] == titles[0].partition(" (")[0] or draw is deli.plotting.trajectory
        assert not any(character.isdigit() for character in titles[1]) or draw is deli.plotting.trajectory

    def test_the_longest_run_is_on_the_axes(self, draw, three):
        axes = Figure().subplots()
        for run in three.values():
            draw(run, ax=axes)
        if draw is not deli.plotting.trajectory:
            assert axes.get_xlim() == (0.0, 8.0)

    @pytest.mark.parametrize(("argument", "value"), [("label", 3), ("color", "no such colour"), ("color", "")])
    def test_what_is_no_label_and_no_colour_is_refused(self, draw, three, argument, value):
        with pytest.raises(InputError, match=f"{argument}: found {value!r}; pass a "):
            draw(three["run 40"], **{argument: value})


def test_colours_are_taken_in_their_order(three):
    axes = Figure().subplots()
    for run in three.values():
        deli.plotting.energy(run, ax=axes)
    assert tuple(line.get_color() for line in curves(axes)) == COLORS[:3]


def test_a_panel_that_had_nothing_to_draw_shows_the_next_run():
    still = deli.Scene(mass=1.0, position=[0.0], momentum=[0.0], dimension=1, name="still")
    moving = deli.simulate(deli.scenes.lennard_jones(), deli.GVI(), step_size=0.01, steps=30)
    axes = Figure().subplots()
    deli.plotting.momenta(deli.simulate(still, deli.GVI(), step_size=0.01, steps=30), ax=axes, label="still")
    assert [text.get_text() for text in axes.texts] == ["none: conserved to the last bit"]
    deli.plotting.momenta(moving, ax=axes, label="moving")
    assert not axes.texts
    assert axes.get_yscale() == "log"
    assert len(axes.get_yticks())


def test_wide_lines_lie_under_narrow_ones():
    run = deli.simulate(deli.scenes.newtons_cradle(), deli.GVI(), step_size=0.01, steps=300)
    lines = deli.plotting.momenta(run).axes[0].lines
    widths = [np.ptp(line.get_ydata()) for line in sorted(lines, key=lambda line: line.get_zorder())]
    assert widths == sorted(widths, reverse=True)


def test_a_custom_scene_is_drawn_with_its_walls_when_given():
    scene = deli.Scene(
        mass=1.0,
        position=[[0.0, 1.0]],
        momentum=[[1.0, -2.0]],
        unilateral=[deli.Planes(normals=[0.0, 1.0]), deli.SpheresInside(radius=5.0)],
        dimension=2,
    )
    run = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=10)
    assert len(deli.plotting.trajectory(run).axes[0].patches) == 0
    assert len(deli.plotting.trajectory(run, scene).axes[0].patches) == 1


def test_shapes_of_the_cradle():
    scene = deli.scenes.newtons_cradle(balls=3, radius=0.25, length=1.0)
    np.testing.assert_array_equal(shapes.radii(scene), 0.25)
    assert len(shapes.pivots(scene)) == 3
    bodies = scene.position.reshape(3, 2)
    ends = list(shapes.rods(scene, bodies))
    assert len(ends) == 3
    for one, other in ends:
        assert np.linalg.norm(one - other) == pytest.approx(1.0)


def test_shapes_of_the_chain_in_its_container():
    scene = deli.scenes.lennard_jones()
    np.testing.assert_array_equal(shapes.radii(scene), 0.3)
    ((centre, radius),) = shapes.containers(scene)
    np.testing.assert_array_equal(centre, 0.0)
    assert radius == pytest.approx(5.0)
    assert len(list(shapes.rods(scene, scene.position.reshape(-1, 3)))) == 5


def test_springs_and_planes():
    pogo = deli.scenes.pogo_stick()
    assert len(list(shapes.springs(pogo, pogo.position.reshape(2, 1)))) == 1
    ((normal, offset),) = shapes.planes(pogo)
    assert (float(normal[0]), offset) == (1.0, 0.0)


@pytest.mark.parametrize(("units", "label"), [("M L2 T-2", " [M L² T⁻²]"), ("L", " [L]"), ("1", "")])
def test_units_in_labels(units, label):
    assert unit(units) == label


@pytest.mark.parametrize("name", ["run.bmp", "run", "no/run.png"])
def test_pictures_that_cannot_be_written_are_refused(recorded, tmp_path, name):
    with pytest.raises(InputError, match="picture"):
        deli.plotting.save(recorded[1], tmp_path / name)


def test_the_largest_numbers_are_drawn(tmp_path):
    """As a file that something else has changed may hold them."""
    run = deli.simulate(deli.scenes.newtons_cradle(balls=2), deli.GVI(), step_size=0.02, steps=20, skip=False)
    run["solver_stats"]["primal_residual"].values[3] = 1e307
    deli.plotting.save(run, tmp_path / "run.png")
    assert (tmp_path / "run.png").stat().st_size > 10_000


@pytest.mark.parametrize("scene", [deli.scenes.point_mass(), deli.scenes.spring_sphere()], ids=lambda scene: scene.name)
def test_worst_is_said_of_what_penetrated(scene):
    run = deli.simulate(scene, deli.GVI(), step_size=0.01, steps=60)
    for shift in (0.0, 1.0 - float(run["trajectory"]["gap_min"].min())):
        run["trajectory"]["gap_min"].values[:] += shift
        least = float(run["trajectory"]["gap_min"].min())
        title = deli.plotting.gaps(run).axes[0].get_title(loc="left")
        assert ("worst -" in title) == (least < 0.0)
        assert ("no violation" in title) == (least >= 0.0)
