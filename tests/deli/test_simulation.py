"""deli.simulate: its arguments, its output, and that the same run is the same run."""

import dataclasses
import itertools
import os
import tomllib

import numpy as np
import pytest
import xarray as xr
from running import H, assert_same

import deli
from deli.errors import InputError


@pytest.fixture
def scene():
    return deli.scenes.newtons_cradle(balls=3)


class TestArguments:
    @pytest.mark.parametrize("step_size", [0.0, -0.1, float("nan"), float("inf"), "0.1", None, True])
    def test_step_size_must_be_positive_and_finite(self, scene, step_size):
        with pytest.raises(InputError, match="step_size is"):
            deli.simulate(scene, deli.GVI(), step_size=step_size, steps=1)

    def test_exactly_one_of_steps_and_duration(self, scene):
        with pytest.raises(InputError, match="neither of steps and duration"):
            deli.simulate(scene, deli.GVI(), step_size=H)
        with pytest.raises(InputError, match=r"both \(steps=1, duration=0.01\)"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, duration=0.01)

    @pytest.mark.parametrize(("name", "value"), [("steps", 0), ("steps", 1.5), ("every", 0), ("every", "2")])
    def test_counts_are_whole_and_positive(self, scene, name, value):
        arguments = {"steps": 1, name: value}
        with pytest.raises(InputError, match=f"{name} is {value!r}; allowed: a whole number from 1 to "):
            deli.simulate(scene, deli.GVI(), step_size=H, **arguments)

    def test_duration_must_be_a_multiple_of_the_step_size(self, scene):
        with pytest.raises(InputError, match=r"nearest allowed values are 0.99 \(33 steps\) and 1.02 \(34 steps\)"):
            deli.simulate(scene, deli.GVI(), step_size=0.03, duration=1.0)

    def test_duration_counts_as_a_multiple_up_to_rounding(self, scene):
        run = deli.simulate(scene, deli.GVI(), step_size=0.1, duration=0.1 + 0.2)
        assert run["trajectory"].sizes["time"] == 4

    @pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
    def test_contact_tolerance_must_be_positive(self, scene, value):
        with pytest.raises(InputError, match="contact_tolerance is"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, contact_tolerance=value)

    def test_scene_and_method_must_be_instances(self, scene):
        with pytest.raises(InputError, match=r"expected a deli\.Scene"):
            deli.simulate(deli.scenes.point_mass, deli.GVI(), step_size=H, steps=1)
        with pytest.raises(InputError, match="expected a method's instance"):
            deli.simulate(scene, deli.GVI, step_size=H, steps=1)

    def test_unknown_backend(self, scene):
        with pytest.raises(InputError, match="clarabell"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, solvers="clarabell")

    def test_flags_are_flags(self, scene):
        with pytest.raises(InputError, match="skip is 1; allowed: True or False"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, skip=1)


class TestOutput:
    def test_existing_output_is_refused_and_kept(self, scene, tmp_path):
        path = tmp_path / "run.nc"
        path.write_text("precious")
        with pytest.raises(InputError, match="exists"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, output=path)
        assert path.read_text() == "precious"

    def test_overwrite_replaces_only_when_the_run_ends(self, scene, tmp_path, at_step):
        path = tmp_path / "run.nc"
        path.write_text("precious")

        def look(take):
            assert path.read_text() == "precious"
            return take()

        at_step(1, look)
        deli.simulate(scene, deli.GVI(), step_size=H, steps=3, output=path, overwrite=True)
        assert deli.open_run(path)["trajectory"].sizes["time"] == 4

    def test_partial_file_is_refused(self, scene, tmp_path):
        (tmp_path / "run.nc.partial").touch()
        with pytest.raises(InputError, match="unfinished run"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, output=tmp_path / "run.nc")

    def test_missing_folder_is_refused_before_computing(self, scene, tmp_path, at_step):
        at_step(1, lambda take: pytest.fail("a step was taken"))
        with pytest.raises(InputError, match="does not exist"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, output=tmp_path / "no" / "run.nc")

    def test_unwritable_folder_is_refused(self, scene, tmp_path, monkeypatch):
        monkeypatch.setattr(os, "access", lambda path, mode: False)  # permissions do not bind root
        with pytest.raises(InputError, match="no permission"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, output=tmp_path / "run.nc")

    def test_folder_as_output_is_refused(self, scene, tmp_path):
        with pytest.raises(InputError, match="is a folder"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, output=tmp_path)

    def test_resume_needs_an_output_and_excludes_overwrite(self, scene, tmp_path):
        with pytest.raises(InputError, match="no output"):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=1, resume=True)
        with pytest.raises(InputError, match="both set"):
            deli.simulate(
                scene, deli.GVI(), step_size=H, steps=1, resume=True, overwrite=True, output=tmp_path / "run.nc"
            )

    def test_second_writer_is_refused(self, scene, tmp_path, at_step):
        path = tmp_path / "run.nc"
        refusals = []

        def meddle(take):
            for flags in ({"resume": True}, {"overwrite": True}):
                with pytest.raises(InputError, match="is another run writing it") as refusal:
                    deli.simulate(scene, deli.GVI(), step_size=H, steps=3, output=path, **flags)
                refusals.append(refusal)
            return take()

        at_step(2, meddle)
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=3, output=path)
        at_step.restore()
        assert len(refusals) == 2 * 2  # both flags, in place of steps 2 and 3
        assert_same(run, deli.simulate(scene, deli.GVI(), step_size=H, steps=3))


class TestRun:
    def test_time_and_rows(self, scene):
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=5)
        np.testing.assert_array_equal(run["trajectory"]["time"], np.arange(6) * H)
        np.testing.assert_array_equal(run["trajectory"]["position"][0], scene.position)
        np.testing.assert_array_equal(run["trajectory"]["momentum"][0], scene.momentum)
        assert run["solver_stats"].sizes == {"step": 5, "subproblem": 3}

    def test_two_runs_are_equal_to_the_bit(self, scene):
        one, other = (deli.simulate(scene, deli.GVI(), step_size=H, steps=200) for _ in range(2))
        assert_same(one, other)

    def test_scene_is_not_changed(self, scene):
        before = {name: getattr(scene, name).copy() for name in ("mass", "position", "momentum")}
        deli.simulate(scene, deli.GVI(), step_size=H, steps=20)
        for name, value in before.items():
            np.testing.assert_array_equal(getattr(scene, name), value)

    @pytest.mark.parametrize("every", [1, 7, 10, 1000])
    def test_thinning_picks_rows_and_sums_stats(self, scene, every):
        full = deli.simulate(scene, deli.GVI(), step_size=H, steps=200)
        thin = deli.simulate(scene, deli.GVI(), step_size=H, steps=200, every=every)
        picked = sorted({*range(0, 201, every), 200})
        for name in ("time", "position", "momentum", "hamiltonian", "gap_min", "smooth_contacts"):
            np.testing.assert_array_equal(thin["trajectory"][name], full["trajectory"][name][picked])
        intervals = list(itertools.pairwise(picked))
        assert full["solver_stats"]["solves"].sum() > 0
        assert full["trajectory"]["reflected_contacts"].sum() > 0
        for name in ("solves", "skipped", "iterations", "rows", "fallbacks", "claimed", "verified"):
            values = full["solver_stats"][name].values
            np.testing.assert_array_equal(thin["solver_stats"][name], [values[a:b].sum(axis=0) for a, b in intervals])
        residual = full["solver_stats"]["primal_residual"].values
        expected = [np.fmax.reduce(residual[a:b], axis=0) for a, b in intervals]
        np.testing.assert_array_equal(thin["solver_stats"]["primal_residual"], expected)
        reflected = full["trajectory"]["reflected_contacts"].values
        expected = [reflected[a + 1 : b + 1].sum() for a, b in intervals]
        np.testing.assert_array_equal(thin["trajectory"]["reflected_contacts"][1:], expected)

    def test_config_reproduces_the_run(self, scene):
        run = deli.simulate(
            scene,
            deli.GVI(reflection="sequential", order="fastest"),
            step_size=H,
            steps=50,
            every=2,
            solvers={"default": "daqp", "position": {"backend": "clarabel", "tolerance": 1e-10}},
            contact_tolerance=1e-7,
        )
        from deli.config import parse
        from deli.simulation import run_plan

        config = tomllib.loads(run.attrs["config"])
        assert config["scene"] == {"name": "newtons_cradle", **scene.parameters}
        assert_same(run, run_plan(parse(config).plan()))

    def test_a_changed_scene_is_recorded_as_custom(self, scene):
        changed = dataclasses.replace(scene, mass=2.0)
        attributes = deli.simulate(changed, deli.GVI(), step_size=H, steps=1).attrs
        assert tomllib.loads(attributes["config"])["scene"] == {"name": "custom", "label": "newtons_cradle"}
        content = tomllib.loads(attributes["scene"])
        assert content["mass"] == [2.0] * 6
        assert content["position"] == scene.position.tolist()

    def test_progress_prints_nothing_without_a_terminal(self, scene, capsys):
        deli.simulate(scene, deli.GVI(), step_size=H, steps=5, progress=True)
        captured = capsys.readouterr()
        assert captured.out + captured.err == ""


class TestOpenRun:
    def test_missing(self, tmp_path):
        with pytest.raises(InputError, match="does not exist"):
            deli.open_run(tmp_path / "no.nc")

    def test_not_netcdf(self, tmp_path):
        (tmp_path / "text.nc").write_text("hello")
        with pytest.raises(InputError, match="cannot be read as netCDF"):
            deli.open_run(tmp_path / "text.nc")

    def test_a_folder(self, tmp_path):
        with pytest.raises(InputError, match="cannot be read as netCDF"):
            deli.open_run(tmp_path)

    def test_foreign_netcdf(self, tmp_path):
        xr.Dataset({"x": ("t", [1.0])}).to_netcdf(tmp_path / "other.nc")
        with pytest.raises(InputError, match="not a run recorded by deli"):
            deli.open_run(tmp_path / "other.nc")
