"""``deli figures``: the configs of the paper's figures, what is made of them, and what is refused."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from running import DONE, RUN_FAILED, call, refused

import deli
from deli.config import parse
from deli.errors import InputError, StepError
from deli.figures import CONFIGS, draw, load
from deli.figures.exact import bouncing_ball

PAPER = Path(__file__).parents[2] / "studies/paper"
FIGURES = ["1.3a", "1.3b", "1.4a", "1.4b", "5.1b", "5.1c", "6.1a", "8.2a", "8.2b", "8.2c", "8.2d"]
FIGURES += ["8.3b", "8.3c", "8.4a", "8.4b", "8.5a", "8.5b", "8.5c"]

SMALL = """
title = "A ball"
claim = "It bounces."
[[panels]]
quantities = ["position"]
[config]
scene = "point_mass"
duration = 2.0
[runs.gvi]
label = "GVI"
[runs.exact]
label = "exact"
color = "green"
solution = "bouncing_ball"
[quick]
steps = 20
"""


@pytest.fixture
def small(folder):
    """A folder with one figure, and how to change it."""
    (folder / "configs").mkdir()

    def write(*changes):
        text = SMALL
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (folder / "configs/ball.toml").write_text(text)
        return "figures", "ball", "--configs", "configs", "-o", "made"

    return write


class TestConfigs:
    def test_all_figures_are_there_once(self):
        assert sorted(path.stem for path in PAPER.glob("*.toml")) == FIGURES
        assert CONFIGS.resolve() == PAPER.resolve()

    @pytest.mark.parametrize("name", FIGURES)
    @pytest.mark.parametrize("quick", [False, True])
    def test_runs_are_possible(self, name, quick):
        figure = load(PAPER / f"{name}.toml")
        for run in figure.table.runs:
            plan = figure.run_config(run, quick=quick).plan()
            assert plan.steps > 0
            assert figure.table.view is None or plan.scene.dimension > 1

    @pytest.mark.parametrize("name", FIGURES)
    def test_a_wrong_key_is_refused(self, name, tmp_path):
        text = (PAPER / f"{name}.toml").read_text()
        wrong = tmp_path / "wrong.toml"
        wrong.write_text(f"titel = 'x'\n{text}")
        with pytest.raises(InputError, match="titel is an unknown key; did you mean 'title'"):
            load(wrong)
        run = next(iter(tomllib.loads(text)["runs"]))
        wrong.write_text(text.replace(f"[runs.{run}]", f"[runs.{run}]\ncolour = 'red'"))
        with pytest.raises(InputError, match=rf"runs.{run}.colour is an unknown key; did you mean 'color'"):
            load(wrong)
        load(PAPER / f"{name}.toml").run_config(run)
        wrong.write_text(text.replace("[config]", "[config]\nstepsize = 0.1"))
        with pytest.raises(InputError, match=f"run {run!r}: stepsize is an unknown key; did you mean 'step_size'"):
            load(wrong).run_config(run)

    def test_one_run_of_the_chain_is_shared(self):
        configs = [load(PAPER / f"8.5{letter}.toml").run_config("gvi").table for letter in "abc"]
        assert configs[0] == configs[1] == configs[2]


class TestFigures:
    def test_made_as_asked(self, folder):
        result = call("figures", "5.1c", "8.2c", "-o", "made", "--quick")
        assert result.exit_code == DONE, result.output
        for name, run, steps in (("5.1c", "discrete_smooth", 200), ("8.2c", "gvi", 200)):
            assert f"{steps} steps" in result.stdout
            assert (folder / f"made/{name}.png").read_bytes()[1:4] == b"PNG"
            with xr.open_datatree(folder / f"made/{name}.nc") as data:
                assert list(data.children) == [run]
                assert set(data[run].data_vars) == {"energy", "angular_momentum"}
                assert data[run].sizes == {"time": steps + 1}
                assert data.attrs["figure_config"] == (PAPER / f"{name}.toml").read_text()
                again = parse(tomllib.loads(data[run].attrs["config"])).plan()
                recorded = deli.simulate(again.scene, again.method, step_size=again.step_size, steps=again.steps)
                for shown, name_of_it in (("energy", "hamiltonian"), ("angular_momentum",) * 2):
                    np.testing.assert_array_equal(data[run][shown], recorded["trajectory"][name_of_it])

    def test_shared_runs_run_once_and_are_kept(self, folder, at_step):
        assert call("figures", "8.5a", "8.5b", "8.5c", "-o", "made", "--quick", "-q").stdout == ""
        assert len(list((folder / "made/runs").iterdir())) == 1
        with xr.open_datatree("made/8.5a.nc") as snapshot, xr.open_datatree("made/8.5b.nc") as paths:
            np.testing.assert_array_equal(snapshot["gvi"]["position"], paths["gvi"]["position"][-1:])
        at_step(1, lambda take: pytest.fail("a step was taken"))
        assert call("figures", "8.5c", "-o", "made", "--quick").exit_code == DONE

    def test_a_closed_form_beside_a_run(self, small, folder):
        assert call(*small()).exit_code == DONE
        with xr.open_datatree("made/ball.nc") as data:
            integrated, exact = data["gvi"]["position"], data["exact"]["position"]
            assert set(data["exact"].data_vars) == {"position"}
            assert exact.attrs == integrated.attrs
            in_flight = data["gvi"]["time"] < 0.44
            np.testing.assert_allclose(exact[in_flight], integrated[in_flight], rtol=0, atol=1e-14)
        assert call(*small(), "--quick").exit_code == DONE
        with xr.open_datatree("made/ball.nc") as data:
            assert data["gvi"].sizes["time"] == data["exact"].sizes["time"] == 21

    @pytest.mark.parametrize("step", [1, 3])
    def test_failed_runs_are_drawn(self, small, folder, at_step, step):
        arguments = small(('["position"]', '["energy"]'), ('solution = "bouncing_ball"', ""))
        assert call(*arguments).exit_code == DONE
        at_step(step, lambda take: StepError("no more"))
        assert call(*arguments).exit_code == DONE
        (folder / "made/ball.png").unlink()
        result = call(*arguments, "--overwrite")
        assert result.exit_code == RUN_FAILED
        assert f"ball gvi: failed in step {step}" in result.stderr
        assert (folder / "made/ball.png").exists()
        with xr.open_datatree("made/ball.nc") as data:
            assert data["gvi"].sizes["time"] == step

    def test_an_interrupted_figure_continues(self, small, folder, at_step):
        def interrupt(take):
            raise KeyboardInterrupt

        at_step(3, interrupt)
        result = call(*small())
        assert result.exit_code == RUN_FAILED
        assert "interrupted after step 2, in the middle of the next; 3 rows are in" in result.stderr
        at_step.restore()
        assert call(*small()).exit_code == DONE
        with xr.open_datatree("made/ball.nc") as data:
            assert data["gvi"].sizes["time"] == 201

    def test_distances_and_changes_of_energy(self, small):
        arguments = small(
            ('["position"]', '["radius", "energy_change"]'),
            ('"point_mass"', '"spring_sphere"'),
            ('solution = "bouncing_ball"', ""),
        )
        assert call(*arguments).exit_code == DONE
        with xr.open_datatree("made/ball.nc") as data:
            np.testing.assert_allclose(data["exact"]["radius"], 5.0, rtol=1e-13)
            assert data["exact"]["radius"].dims == ("time", "body")
            assert data["exact"]["energy_change"][0] == 0.0

    def test_swings_of_the_cradle(self, small):
        arguments = small(
            ('["position"]', '["swinging_share"]'),
            ('"point_mass"', '"newtons_cradle"'),
            ('solution = "bouncing_ball"', ""),
        )
        assert call(*arguments).exit_code == DONE
        with xr.open_datatree("made/ball.nc") as data:
            share = data["gvi"]["swinging_share"]
            assert share[0] == 1.0
            assert share.attrs["clean_swings"] == 2  # at the start, and half a period later; the third is not reached
            assert 0.99 < share.median() <= share.max() <= 1.0
            assert 0.4 < share.min() < 0.6  # while a blow is handed on

    def test_swings_are_the_cradle_s(self, small, folder):
        arguments = small(('["position"]', '["swinging_share"]'), ('solution = "bouncing_ball"', ""))
        refused(call(*arguments), "swings need scene newtons_cradle", "found point_mass")

    def test_the_list(self):
        result = call("figures", "--list")
        assert result.exit_code == DONE
        assert all(name in result.stdout for name in FIGURES)


class TestRefusals:
    def test_an_unknown_figure(self, folder):
        refused(call("figures", "5.1d", "-o", "made"), "figure is '5.1d'", "allowed: ", ", ".join(FIGURES))
        assert not list(folder.iterdir())

    @pytest.mark.parametrize(
        ("old", "new", "words"),
        [
            ('["position"]', '["positon"]', "panels.0.quantities.0 is 'positon'; did you mean 'position'"),
            ('["position"]', '["position"]\nruns = ["gvy"]', "panels.0.runs is 'gvy'; did you mean 'gvi'"),
            ('["position"]', '["energy"]', "runs.exact.solution gives positions only"),
            ("[[panels]]", "[view]\n[[panels]]", "expected either panels over time"),
            ('[[panels]]\nquantities = ["position"]', "[view]", "[view] shows one run; found gvi, exact"),
            ("bouncing_ball", "flying_ball", "did you mean 'bouncing_ball'"),
            ("point_mass", "pogo_stick", "belongs to scene point_mass; found pogo_stick"),
            ("steps = 20", "steps = nan", "quick.steps is nan"),
            ("[runs.gvi]", "[runs.'a/b']", "runs.a/b"),
            ("title", "'title", "is not valid TOML"),
            ("[[panels]]", "[[panels]]\nlimits = [1]", "panels.0.limits"),
        ],
    )
    def test_configs(self, small, folder, old, new, words):
        refused(call(*small((old, new))), words)
        assert not (folder / "made").exists()

    def test_one_dimension_has_no_angular_momentum(self, small, folder):
        arguments = small(('["position"]', '["angular_momentum"]'), ('solution = "bouncing_ball"', ""))
        refused(call(*arguments), "point_mass has one dimension")

    def test_folders(self, small, folder):
        refused(call("figures", "--list", "--configs", "nowhere"), "nowhere holds no figure configs")
        (folder / "file").write_text("")
        refused(call(*small(), "-o", "file"), "file/runs cannot be made")


class TestPictures:
    def draw(self, small, *arguments):
        assert call(*small(("[config]", "[config]\nrecord.every = 4")), *arguments).exit_code in (DONE, RUN_FAILED)
        with xr.open_datatree("made/ball.nc") as data:
            return draw(load(Path("configs/ball.toml")), data.load())

    def test_what_is_not_recorded_is_said(self, small):
        (axes,) = self.draw(small).axes
        labels = [text.get_text() for text in axes.get_legend().get_texts()]
        assert labels == ["GVI (one step in 4)", "exact (one step in 4)"]

    def test_a_run_that_stopped_says_when(self, small, at_step):
        at_step(9, lambda take: StepError("no more"))
        (axes,) = self.draw(small).axes
        assert axes.get_legend().get_texts()[0].get_text() == "GVI (one step in 4, stopped at time 0.08)"

    @pytest.mark.parametrize(("name", "shortened"), [("8.4b", False), ("1.3b", True)])
    def test_only_what_is_shortened_is_called_so(self, folder, name, shortened):
        assert call("figures", name, "--quick", "-o", "made").exit_code == DONE
        with xr.open_datatree(f"made/{name}.nc") as data:
            figure = draw(load(PAPER / f"{name}.toml"), data.load())
        assert figure.get_suptitle().endswith("(quick: shorter runs)") == shortened

    def test_every_row_of_the_oscillating_energy_is_drawn(self, folder):
        assert call("figures", "8.2c", "--quick", "-o", "made").exit_code == DONE
        with xr.open_datatree("made/8.2c.nc") as data:
            line = draw(load(PAPER / "8.2c.toml"), data.load()).axes[0].lines[0]
            np.testing.assert_array_equal(line.get_ydata(), data["gvi"]["energy"])


def test_the_bouncing_ball_keeps_its_energy():
    """Height and speed of the closed form, by central differences away from impacts, give one energy."""
    scene = deli.scenes.point_mass(position=2.0, momentum=3.0, mass=1.5)
    step = 1e-3
    time = np.arange(0.0, 5.0, step)
    height = bouncing_ball(scene, time)[:, 0]
    assert height[0] == pytest.approx(2.0, rel=1e-14)
    assert height.min() >= 0.0
    speed = (height[2:] - height[:-2]) / (2.0 * step)
    flying = (height[2:] + height[:-2] - 2.0 * height[1:-1]) < 0.0
    energy = 0.5 * speed**2 + 9.8 * height[1:-1]
    np.testing.assert_allclose(energy[flying], 0.5 * 2.0**2 + 9.8 * 2.0, rtol=1e-9)
