"""deli.simulate: its arguments, how a run ends, and that the same run is the same run."""

import dataclasses
import itertools
import logging
import os
import signal
import tomllib

import numpy as np
import pytest
import xarray as xr

import deli
from deli.errors import InputError, StepError
from deli.integrators.stepper import Stepper

CLOCKS = ["solve_time", "overhead_time"]
H = 0.01


@pytest.fixture
def scene():
    return deli.scenes.newtons_cradle(balls=3)


@pytest.fixture
def at_step(monkeypatch):
    """Make the steppers do something in place of their n-th step (and of every later one)."""
    plain = Stepper.step

    def install(number, action):
        calls = []

        def step(self, q, p):
            calls.append(None)
            return plain(self, q, p) if len(calls) < number else action(lambda: plain(self, q, p))

        monkeypatch.setattr(Stepper, "step", step)

    def restore():
        monkeypatch.setattr(Stepper, "step", plain)

    install.restore = restore
    return install


def fail(_):
    raise StepError("position: the solver gave up")


def groups(run):
    """Everything of a run that does not depend on the clock."""
    stats = run["solver_stats"].to_dataset().drop_vars(CLOCKS)
    return run["trajectory"].to_dataset(), stats


def assert_same(one, other):
    for a, b in zip(groups(one), groups(other), strict=True):
        xr.testing.assert_identical(a, b)


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
        with pytest.raises(InputError, match=f"{name} is {value!r}; allowed: a whole number >= 1"):
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

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
    def test_unwritable_folder_is_refused(self, scene, tmp_path):
        tmp_path.chmod(0o500)
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
            at_step.restore()
            for flags in ({"resume": True}, {"overwrite": True}):
                with pytest.raises(InputError, match="is another run writing it") as refusal:
                    deli.simulate(scene, deli.GVI(), step_size=H, steps=3, output=path, **flags)
                refusals.append(refusal)
            return take()

        at_step(2, meddle)
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=3, output=path)
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
        for name in ("solves", "skipped", "iterations", "rows", "fallbacks"):
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
            deli.GVI(reflection="moreau"),
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
        config = tomllib.loads(deli.simulate(changed, deli.GVI(), step_size=H, steps=1).attrs["config"])
        assert config["scene"]["name"] == "custom"
        assert config["scene"]["mass"] == [2.0] * 6
        assert config["scene"]["position"] == scene.position.tolist()

    def test_progress_prints_nothing_without_a_terminal(self, scene, capsys):
        deli.simulate(scene, deli.GVI(), step_size=H, steps=5, progress=True)
        captured = capsys.readouterr()
        assert captured.out + captured.err == ""


class TestFailure:
    @pytest.mark.parametrize("every", [1, 4])
    def test_rows_until_the_failure_are_kept(self, scene, tmp_path, at_step, every, caplog):
        full = deli.simulate(scene, deli.GVI(), step_size=H, steps=9)
        at_step(10, fail)
        with caplog.at_level(logging.WARNING, logger="deli"):
            run = deli.simulate(scene, deli.GVI(), step_size=H, steps=50, every=every, output=tmp_path / "run.nc")
        assert run.attrs["outcome"] == "failed in step 10 (from time 0.09): position: the solver gave up"
        assert "the solver gave up" in caplog.text
        np.testing.assert_array_equal(run["trajectory"]["position"][-1], full["trajectory"]["position"][-1])
        picked = [0, 4, 8, 9] if every == 4 else list(range(10))
        np.testing.assert_array_equal(run["trajectory"]["time"], np.array(picked) * H)
        xr.testing.assert_identical(run, deli.open_run(tmp_path / "run.nc"))
        assert not (tmp_path / "run.nc.partial").exists()

    def test_a_state_that_is_not_finite_stops_the_run(self, scene, at_step):
        at_step(4, lambda take: (take()[0], np.full(6, np.nan)))
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=50)
        assert run.attrs["outcome"].startswith("failed in step 4 (from time 0.03): the state is not finite")
        assert run["trajectory"].sizes["time"] == 4
        assert np.isfinite(run["trajectory"]["momentum"]).all()

    def test_an_unexpected_error_is_seen_and_the_rows_are_kept(self, scene, tmp_path, at_step):
        at_step(4, lambda take: 1 // 0)
        with pytest.raises(ZeroDivisionError):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=50, output=tmp_path / "run.nc")
        run = deli.open_run(tmp_path / "run.nc")
        assert run["trajectory"].sizes["time"] == 4
        assert "ZeroDivisionError" in run.attrs["outcome"]


class TestInterruption:
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_a_signal_stops_after_the_step_and_the_run_resumes(self, scene, tmp_path, at_step, number):
        path = tmp_path / "run.nc"
        full = deli.simulate(scene, deli.GVI(), step_size=H, steps=300, every=3)
        before = signal.getsignal(number)

        def interrupt(take):
            at_step.restore()
            os.kill(os.getpid(), number)
            return take()

        at_step(161, interrupt)
        with pytest.raises(deli.Interrupted, match=f"{number.name} after step 161.*resume to continue") as stop:
            deli.simulate(scene, deli.GVI(), step_size=H, steps=300, every=3, output=path)
        assert signal.getsignal(number) is before
        assert not path.exists()
        partial = deli.open_run(f"{path}.partial")
        xr.testing.assert_identical(stop.value.run, partial)
        assert partial["trajectory"].sizes["time"] == 1 + 161 // 3
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=300, every=3, output=path, resume=True)
        assert_same(run, full)
        assert run.attrs["outcome"] == "complete"
        assert run.attrs["wall_time"] > partial.attrs["wall_time"]
        assert not (tmp_path / "run.nc.partial").exists()

    def test_keyboard_interrupt_without_output_carries_the_rows(self, scene, at_step):
        def interrupt(take):
            raise KeyboardInterrupt

        at_step(5, interrupt)
        with pytest.raises(KeyboardInterrupt, match="no output") as stop:
            deli.simulate(scene, deli.GVI(), step_size=H, steps=20)
        assert stop.value.run["trajectory"].sizes["time"] == 5


class TestResume:
    def interrupted(self, scene, path, at_step, **arguments):
        def interrupt(take):
            at_step.restore()
            raise KeyboardInterrupt

        at_step(51, interrupt)
        with pytest.raises(deli.Interrupted):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=100, output=path, **arguments)

    def test_starts_anew_where_there_is_nothing(self, scene, tmp_path):
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=5, output=tmp_path / "run.nc", resume=True)
        assert_same(run, deli.simulate(scene, deli.GVI(), step_size=H, steps=5))

    def test_a_finished_run_is_returned_untouched(self, scene, tmp_path, at_step):
        path = tmp_path / "run.nc"
        run = deli.simulate(scene, deli.GVI(), step_size=H, steps=5, output=path)
        content = path.read_bytes()
        at_step(1, lambda take: pytest.fail("a step was taken"))
        again = deli.simulate(scene, deli.GVI(), step_size=H, steps=5, output=path, resume=True)
        xr.testing.assert_identical(run, again)
        assert path.read_bytes() == content

    @pytest.mark.parametrize(
        ("key", "change"),
        [
            ("step_size", {"step_size": 0.02}),
            ("steps", {"steps": 101}),
            ("record.every", {"every": 2}),
            ("skip", {"skip": False}),
            ("contact_tolerance", {"contact_tolerance": 1e-7}),
            ("solvers.position.tolerance", {"solvers": {"position": {"tolerance": 1e-8}}}),
            ("method.reflection", {"method": deli.GVI(reflection="moreau")}),
            ("scene.balls", {"scene": deli.scenes.newtons_cradle(balls=4)}),
        ],
    )
    def test_another_configuration_is_refused_by_key(self, scene, tmp_path, at_step, key, change):
        path = tmp_path / "run.nc"
        self.interrupted(scene, path, at_step)
        arguments = {"scene": scene, "method": deli.GVI(), "step_size": H, "steps": 100, **change}
        with pytest.raises(InputError, match=rf"cannot be resumed, its configuration differs: .*{key} is"):
            deli.simulate(output=path, resume=True, **arguments)

    def test_other_functions_of_a_custom_scene_are_refused(self, tmp_path, at_step):
        def fall(gravity):
            return deli.Scene(
                mass=1.0,
                position=[1.0],
                momentum=[0.0],
                potential=deli.Potential(energy=lambda q: gravity * q[0], gradient=lambda q: np.array([gravity])),
            )

        path = tmp_path / "run.nc"
        self.interrupted(fall(9.8), path, at_step)
        with pytest.raises(InputError, match=r"hamiltonian of the initial state is 9\.8 there and 1\.6"):
            deli.simulate(fall(1.6), deli.GVI(), step_size=H, steps=100, output=path, resume=True)
        run = deli.simulate(fall(9.8), deli.GVI(), step_size=H, steps=100, output=path, resume=True)
        assert run.attrs["outcome"] == "complete"


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
