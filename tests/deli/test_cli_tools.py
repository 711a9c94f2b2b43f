"""The commands beside ``deli run``: lists, plot, check."""

import os

import netCDF4
import pytest
from running import DONE, SHORT, call, refused

import deli

pytestmark = pytest.mark.usefixtures("folder")


class TestLists:
    def test_scenes(self):
        result = call("scenes")
        assert result.exit_code == DONE
        assert all(name in result.stdout for name in deli.scenes.available())

    @pytest.mark.parametrize("name", deli.scenes.available())
    def test_a_scene(self, name):
        result = call("scenes", name)
        assert result.exit_code == DONE
        assert all(f"scene.{key}" in result.stdout for key in deli.scenes.get(name)().parameters)

    def test_an_unknown_scene(self):
        refused(call("scenes", "newton"), "did you mean 'newtons_cradle'")

    def test_methods(self):
        result = call("methods")
        assert result.exit_code == DONE
        for word in ("gvi", "discrete_smooth", "scheme = midpoint | verlet", "reflection = generalized | moreau"):
            assert word in result.stdout

    def test_backends(self):
        import solvers

        result = call("backends")
        assert result.exit_code == DONE
        assert all(info.name in result.stdout for info in solvers.backends())
        assert "eps_abs" in result.stdout


class TestPlotAndCheck:
    @pytest.fixture
    def recorded(self, folder):
        assert call("run", "newtons_cradle", *SHORT, "-q").exit_code == DONE
        return folder / "newtons_cradle.nc"

    def test_plot(self, recorded, folder):
        assert call("plot", recorded).exit_code == DONE
        assert (folder / "newtons_cradle.png").exists()
        assert call("plot", recorded, "-o", "other.svg").exit_code == DONE
        assert (folder / "other.svg").exists()
        refused(call("plot", "no.nc"), "no.nc does not exist")
        refused(call("plot", recorded, "-o", "x.tiff"), "'.tiff'")

    def test_check_accepts_a_sound_file(self, recorded):
        result = call("check", recorded)
        assert result.exit_code == DONE, result.output
        assert "WRONG" not in result.stdout
        assert "hamiltonian" in result.stdout

    @pytest.mark.parametrize(
        ("group", "name", "value", "what"),
        [
            ("trajectory", "position", 0.3, "hamiltonian"),
            ("trajectory", "hamiltonian", 1.0, "hamiltonian"),
            ("trajectory", "gap_min", 0.5, "gap_min"),
            ("trajectory", "momentum", float("nan"), "finite values"),
            ("trajectory", "time", 0.053, "times"),
            ("solver_stats", "primal_residual", float("inf"), "finite values"),
        ],
    )
    def test_check_finds_what_was_changed(self, recorded, group, name, value, what):
        with netCDF4.Dataset(recorded, "a") as dataset:
            dataset[group][name][5] = value
        refused(call("check", recorded), "fails these checks", what)

    def test_check_finds_a_broken_schema(self, recorded):
        with netCDF4.Dataset(recorded, "a") as dataset:
            dataset["trajectory"]["position"].delncattr("units")
        result = call("check", recorded)
        refused(result, "schema")
        assert "trajectory/position has no units" in result.stdout

    def test_check_finds_uncommitted_rows(self, recorded):
        with netCDF4.Dataset(recorded, "a") as dataset:
            dataset["committed_rows"][...] = 10
        refused(call("check", recorded), "rows")

    def test_check_of_a_custom_scene_says_what_it_cannot_check(self, folder):
        scene = deli.Scene(mass=1.0, position=[0.0], momentum=[1.0])
        deli.simulate(scene, deli.GVI(), step_size=0.1, steps=3, output="free.nc")
        result = call("check", "free.nc")
        assert result.exit_code == DONE
        assert "not recomputed" in result.stdout

    def test_check_of_a_config(self, folder):
        (folder / "fall.toml").write_text('steps = 10\nscene = "point_mass"\n')
        result = call("check", "fall.toml")
        assert result.exit_code == DONE
        assert "point_mass" in result.stdout
        assert os.listdir(folder) == ["fall.toml"]
        (folder / "bad.toml").write_text('step = 10\nscene = "point_mass"\n')
        refused(call("check", "bad.toml"), "bad.toml: step is an unknown key", "did you mean 'steps'")

    def test_check_of_something_else(self, folder):
        (folder / "text.nc").write_text("hello")
        refused(call("check", "text.nc"), "cannot be read as netCDF")
