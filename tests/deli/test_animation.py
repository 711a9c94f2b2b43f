"""Animations: which rows are shown, where bodies are drawn, what files hold, what is refused."""

import os
import signal
import subprocess
import sys
import time

import matplotlib.animation
import numpy as np
import pytest
from mpl_toolkits.mplot3d.proj3d import proj_transform
from PIL import Image
from running import DONE, RUN_FAILED, call, deli_process, refused

import deli
from deli.errors import DeliError, InputError
from deli.plotting import animate, save_animation, shapes

FRAMES = 4
SMALL = {"disc_pile": {"rows": 3, "columns": 3}, "hard_sphere_gas": {"spheres": 10}, "chain_on_cylinder": {"masses": 5}}
NAMES = deli.scenes.available()


@pytest.fixture(scope="module", params=NAMES)
def recorded(request):
    scene = deli.scenes.get(request.param)(**SMALL.get(request.param, {}))
    return scene, deli.simulate(scene, deli.GVI(scheme="verlet"), step_size=0.01, steps=40)


@pytest.fixture(scope="module")
def cradle():
    return deli.simulate(deli.scenes.newtons_cradle(balls=3), deli.GVI(), step_size=0.01, steps=40)


def last_frame(run, scene=None, **settings):
    """The axes after an animation was played to its end, the bodies' first."""
    player = animate(run, scene, every=20, **settings)
    player.to_jshtml()
    return player._fig.axes


def places(run, row):
    trajectory = run["trajectory"]
    return trajectory["position"].values[row].reshape(-1, trajectory.sizes["axis"])


def artist(axes, name):
    (found,) = [each for each in axes.collections if each.get_gid() == name]
    return found


def drawn(axes, dimension):
    """Where bodies are drawn, shape (bodies, dimension), sized ones before points; of bars their middle."""
    if dimension == 3:
        return np.stack(artist(axes, "balls")._offsets3d, axis=1)
    points = artist(axes, "points").get_offsets()[:, -dimension:]
    if dimension == 2:
        return np.concatenate([artist(axes, "discs").get_offsets(), points])
    bars = [[path.vertices[:4, 1].mean()] for path in artist(axes, "bars").get_paths()]
    return np.concatenate([np.reshape(bars, (-1, 1)), points])


class TestPlaces:
    def test_bodies_are_where_the_last_frame_has_them(self, recorded):
        scene, run = recorded
        expected = places(run, -1)
        box = shapes.period(scene)
        expected = np.where(box > 0.0, np.mod(expected, np.where(box > 0.0, box, 1.0)), expected)
        axes = last_frame(run)[0]
        found = drawn(axes, scene.dimension)
        np.testing.assert_allclose(found, expected, atol=1e-12)
        for name, low, high in zip("xyz"[: scene.dimension], found.min(axis=0), found.max(axis=0), strict=True):
            least, most = getattr(axes, f"get_{'y' if scene.dimension == 1 else name}lim")()
            assert least <= low <= high <= most

    def test_discs_are_as_large_as_the_bodies_on_equal_axes(self, cradle):
        axes = last_frame(cradle)[0]
        discs = artist(axes, "discs")
        np.testing.assert_allclose(discs.get_widths(), 0.5)
        np.testing.assert_allclose(discs.get_heights(), 0.5)
        assert axes.get_aspect() == 1.0

    def test_balls_are_as_large_as_their_diameters(self):
        radius, away = 0.7, 5.0
        scene = deli.Scene(
            mass=1.0,
            position=[[0.0, 0.0, 0.0], [away, 0.0, 0.0]],
            momentum=np.zeros((2, 3)),
            unilateral=[deli.SpheresApart(pairs=[(0, 1)], distance=2.0 * radius)],
            dimension=3,
        )
        run = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=2)
        axes = last_frame(run, scene)[0]
        balls = artist(axes, "balls")
        pixels = axes.transData.transform(np.transpose(proj_transform(*places(run, 0).T, axes.get_proj())[:2]))
        points = np.linalg.norm(pixels[1] - pixels[0]) * 72.0 / axes.get_figure(root=True).dpi
        direction = np.array([1.0, 0.0, 0.0])
        across = np.linalg.norm(np.cross(direction, _view(axes)))  # parallel projection shortens by the sine
        assert np.sqrt(balls.get_sizes()[0]) == pytest.approx(2.0 * radius * points / (away * across), rel=1e-6)

    def test_rods_end_at_the_bodies(self, cradle):
        rods = artist(last_frame(cradle)[0], "rods").get_segments()
        expected = shapes.rods(deli.scenes.newtons_cradle(balls=3), places(cradle, -1))
        np.testing.assert_allclose(rods, expected)

    def test_the_clock_tells_time_and_energy_error(self, cradle):
        axes = last_frame(cradle)
        energy = cradle["trajectory"]["hamiltonian"].values
        assert axes[0].get_title(loc="left") == f"time 0.4    energy error {energy[-1] - energy[0]:+.1e}"
        assert axes[-1].lines[-1].get_data() == ([0.4], [energy[-1] - energy[0]])

    def test_periodic_boxes_hold_their_bodies(self):
        run = deli.simulate(
            deli.scenes.hard_rods(boundary="ring", momentum=np.full(10, 3.0)), deli.GVI(), step_size=0.1, steps=100
        )
        assert places(run, -1).max() > 20.0
        middles = drawn(last_frame(run)[0], 1)
        assert middles.min() >= 0.0
        assert middles.max() <= 20.0

    @pytest.mark.parametrize("dimension", [1, 2, 3])
    def test_bodies_of_an_unknown_scene_are_points(self, dimension):
        scene = deli.Scene(
            mass=1.0, position=np.eye(3)[:, :dimension], momentum=np.ones((3, dimension)), dimension=dimension
        )
        run = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=20)
        np.testing.assert_allclose(drawn(last_frame(run)[0], dimension), places(run, -1))

    def test_a_scene_of_ones_own_is_drawn_when_given_and_another_refused(self):
        scene = deli.Scene(
            mass=1.0,
            position=[[0.0, 1.0], [0.0, 3.0]],
            momentum=np.zeros((2, 2)),
            potential=deli.Springs(pairs=[(0, 1)], stiffness=1.0),
            unilateral=[deli.Planes(normals=[0.0, 1.0])],
            dimension=2,
        )
        run = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=20)
        axes = last_frame(run, scene)[0]
        np.testing.assert_allclose(artist(axes, "springs").get_segments(), [places(run, -1)])
        for draw in (animate, deli.plotting.trajectory):
            with pytest.raises(InputError, match=r"found 'newtons_cradle' \(3 bodies in 2 dimensions\); the run is of"):
                draw(run, deli.scenes.newtons_cradle(balls=3))


def _view(axes):
    elevation, azimuth = np.radians([axes.elev, axes.azim])
    return np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])


class TestFrames:
    @pytest.mark.parametrize(
        ("settings", "times"),
        [
            ({"every": 10}, [0.0, 0.1, 0.2, 0.3, 0.4]),
            ({"every": 100}, [0.0]),
            ({"duration": 0.5, "fps": 10.0}, [0.0, 0.1, 0.2, 0.3, 0.4]),
            ({"duration": 0.3, "fps": 10.0, "start": 0.2}, [0.2, 0.3, 0.4]),
            ({"duration": 0.3, "fps": 10.0, "end": 0.2}, [0.0, 0.1, 0.2]),
            ({"start": 0.29, "end": 0.31}, [0.29, 0.3, 0.31]),
        ],
    )
    def test_frames_are_equidistant_in_time(self, cradle, tmp_path, settings, times):
        film = save_animation(cradle, tmp_path / "a.gif", dpi=30, **settings)
        np.testing.assert_allclose(film.times, times, atol=1e-12)
        with Image.open(tmp_path / "a.gif") as image:
            assert image.n_frames == len(times)

    def test_rows_at_uneven_times_play_evenly(self):
        time = np.concatenate([np.linspace(0.0, 1.0, 1000, endpoint=False), np.linspace(1.0, 2.0, 11)])
        from deli.plotting.playback import choose_rows

        np.testing.assert_allclose(time[choose_rows(time, fps=10.0, duration=2.1)], np.arange(21) / 10.0, atol=1e-3)

    def test_without_a_duration_no_row_is_repeated(self, cradle, tmp_path):
        assert len(set(save_animation(cradle, tmp_path / "a.gif", dpi=30).times)) == 41

    def test_frames_too_few_to_follow_are_told(self, tmp_path):
        run = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=2000)
        assert save_animation(run, tmp_path / "a.gif", dpi=30, every=1000).misses_motion
        assert not save_animation(run, tmp_path / "b.gif", dpi=30, every=20).misses_motion

    @pytest.mark.parametrize(
        ("settings", "words"),
        [
            ({"fps": 0.0}, "fps: found 0.0"),
            ({"fps": float("nan")}, "fps: found nan"),
            ({"duration": -1.0}, "duration: found -1.0"),
            ({"every": 0}, "every: found 0"),
            ({"every": 2, "duration": 1.0}, "every and duration are both set"),
            ({"start": 1.0}, "no row between 1 and 0.4; the run has 41 rows from time 0 to 0.4"),
            ({"start": 0.3, "end": 0.2}, "no row between 0.3 and 0.2"),
        ],
    )
    def test_numbers_out_of_range_are_refused(self, cradle, settings, words):
        with pytest.raises(InputError, match=words):
            animate(cradle, **settings)


class TestFiles:
    def test_every_scene_makes_a_gif(self, recorded, tmp_path):
        _, run = recorded
        film = save_animation(run, tmp_path / "a.gif", dpi=50, duration=0.16)
        assert film.fps == 25.0
        with Image.open(tmp_path / "a.gif") as image:
            assert image.format == "GIF"
            assert image.n_frames == FRAMES
            assert image.size[0] == 320
            assert image.info["duration"] == 40
            first = np.asarray(image.convert("RGB"))
            image.seek(FRAMES - 1)
            assert (np.asarray(image.convert("RGB")) != first).any()
        assert os.listdir(tmp_path) == ["a.gif"]

    def test_frames_of_a_file_are_what_a_full_draw_shows(self, cradle, tmp_path):
        save_animation(cradle, tmp_path / "a.gif", dpi=100, every=20)
        player = animate(cradle, every=20)
        player.to_jshtml()
        player._fig.canvas.draw()
        whole = np.asarray(player._fig.canvas.buffer_rgba())[..., :3].astype(int)
        with Image.open(tmp_path / "a.gif") as image:
            image.seek(2)
            found = np.asarray(image.convert("RGB")).astype(int)
        assert np.abs(found - whole).mean() < 2.0
        assert (np.abs(found - whole).max(axis=2) > 60).mean() < 2e-3

    def test_an_mp4(self, cradle, tmp_path):
        imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
        film = save_animation(cradle, tmp_path / "a.mp4", dpi=51, every=10, fps=12.5)
        count, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "a.mp4"))
        assert count == len(film.times) == 5
        assert seconds == pytest.approx(5 / 12.5, abs=0.02)
        assert os.listdir(tmp_path) == ["a.mp4"]

    def test_rates_that_a_gif_cannot_hold(self, cradle, tmp_path):
        assert save_animation(cradle, tmp_path / "a.gif", dpi=30, every=20, fps=30.0).fps == pytest.approx(100 / 3)
        with pytest.raises(InputError, match="to 50 a second"):
            save_animation(cradle, tmp_path / "b.gif", fps=60.0)

    @pytest.mark.parametrize(
        ("name", "words"),
        [("a.avi", "'.avi'; allowed: .gif, .mp4"), ("no/a.gif", "does not exist"), ("d.gif", "is a folder")],
    )
    def test_files_that_cannot_be_written_are_refused(self, cradle, tmp_path, name, words):
        (tmp_path / "d.gif").mkdir()
        with pytest.raises(InputError, match=words):
            save_animation(cradle, tmp_path / name)

    def test_nothing_is_overwritten_unless_asked(self, cradle, tmp_path):
        target = tmp_path / "a.gif"
        target.write_text("mine")
        with pytest.raises(InputError, match=r"exists.*--overwrite"):
            save_animation(cradle, target)
        assert target.read_text() == "mine"
        save_animation(cradle, target, dpi=30, every=20, overwrite=True)
        with Image.open(target) as image:
            assert image.n_frames == 3

    def test_mp4_without_ffmpeg_says_what_to_install(self, cradle, tmp_path, monkeypatch):
        monkeypatch.setattr(matplotlib.animation.FFMpegWriter, "isAvailable", classmethod(lambda cls: False))
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
        with pytest.raises(InputError, match=r"pip install '\.\[movies\]'"):
            save_animation(cradle, tmp_path / "a.mp4")
        assert not os.listdir(tmp_path)

    def test_a_failing_write_leaves_the_old_film(self, cradle, tmp_path, monkeypatch):
        target = tmp_path / "a.gif"
        target.write_text("mine")

        def full(*arguments, **keywords):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(Image.Image, "save", full)
        with pytest.raises(DeliError, match="No space left"):
            save_animation(cradle, target, overwrite=True)
        assert target.read_text() == "mine"
        assert os.listdir(tmp_path) == ["a.gif"]


@pytest.mark.usefixtures("folder")
class TestCommand:
    @pytest.fixture
    def file(self, folder):
        assert call("run", "newtons_cradle", "--set", "steps=20", "-o", "c.nc", "-q").exit_code == DONE
        return folder / "c.nc"

    def test_animate(self, file, folder):
        result = call("animate", file, "--dpi", 30, "--every", 5)
        assert result.exit_code == DONE, result.output
        assert "time 0 to 0.2 in 5 frames, 0.2 s" in result.stdout
        with Image.open(folder / "c.gif") as image:
            assert image.n_frames == 5
        refused(call("animate", file), "c.gif exists")
        assert call("animate", file, "--dpi", 30, "--every", 5, "--overwrite", "-q").stdout == ""

    def test_what_is_refused(self, file):
        refused(call("animate", "no.nc"), "no.nc does not exist")
        refused(call("animate", file, "-o", "c.avi"), "'.avi'")
        refused(call("animate", file, "--start", 7), "no row")
        refused(call("animate", file, "--dpi", 0), "dpi: found 0.0")

    def test_an_unfinished_run(self, file, folder):
        file.rename(folder / "u.nc.partial")
        assert call("animate", "u.nc.partial", "--dpi", 30, "--every", 10).exit_code == DONE
        assert (folder / "u.gif").exists()

    def test_a_scene_of_ones_own_is_told(self):
        scene = deli.Scene(mass=1.0, position=[0.0], momentum=[1.0])
        deli.simulate(scene, deli.GVI(), step_size=0.1, steps=3, output="free.nc")
        result = call("animate", "free.nc", "--dpi", 30)
        assert result.exit_code == DONE
        assert "bodies are drawn as points" in result.stdout

    @pytest.mark.parametrize("name", ["c.gif", "c.mp4"])
    def test_an_interrupt_leaves_nothing(self, file, folder, name):
        if name.endswith("mp4"):
            pytest.importorskip("imageio_ffmpeg")
        process = deli_process("animate", "c.nc", "-o", name, "--duration", "1000", start_new_session=True)
        try:
            while not (folder / f"{name}.partial").exists() and process.poll() is None:
                time.sleep(0.05)
            os.killpg(process.pid, signal.SIGINT)  # as from a terminal: to ffmpeg too
            _, said = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        assert process.returncode == RUN_FAILED, said
        assert said == f"deli: stopped by SIGINT; {name} was not written.\n"
        assert os.listdir(folder) == ["c.nc"]
