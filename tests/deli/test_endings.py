"""How a run ends: by failing, by being interrupted, and by being resumed."""

import logging
import os
import signal

import numpy as np
import pytest
import xarray as xr
from running import H, assert_same

import deli
from deli.errors import InputError, StepError


@pytest.fixture
def scene():
    return deli.scenes.newtons_cradle(balls=3)


def fail(_):
    return StepError("position: the solver gave up")


def drift(force):
    """A body that has moved a step size after each step, as far as `force(position)` allows."""
    pushed = deli.Potential(energy=lambda q: 0.0, gradient=lambda q: np.array([force(q[0])]))
    return deli.Scene(mass=1.0, position=[0.0], momentum=[1.0], potential=pushed)


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

    @pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
    def test_a_state_that_is_not_finite_stops_the_run(self, scheme):
        scene = drift(lambda x: 0.0 if x < 3.3 * H else np.nan)
        run = deli.simulate(scene, deli.GVI(scheme=scheme), step_size=H, steps=50)
        assert run.attrs["outcome"].startswith("failed in step 4 (from time 0.03): the state is no longer finite")
        np.testing.assert_allclose(run["trajectory"]["position"][:, 0], np.arange(4) * H, rtol=1e-14)
        assert np.isfinite(run["trajectory"]["momentum"]).all()

    @pytest.mark.parametrize("every", [1, 3, 5])
    def test_an_unexpected_error_is_seen_and_the_rows_are_kept(self, tmp_path, every):
        scene = drift(lambda x: 0.0 if x < 4.3 * H else 1 // 0)
        with pytest.raises(ZeroDivisionError):
            deli.simulate(scene, deli.GVI(), step_size=H, steps=50, every=every, output=tmp_path / "run.nc")
        run = deli.open_run(tmp_path / "run.nc")
        np.testing.assert_allclose(run["trajectory"]["time"], np.array(sorted({*range(0, 5, every), 4})) * H)
        assert run.attrs["outcome"].startswith("failed in step 5 (from time 0.04): ZeroDivisionError")


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
        named = r"energy of Potential \(potential 0\) at 4 states is \[9\.8, .* there and \[1\.6, "
        with pytest.raises(InputError, match=named):
            deli.simulate(fall(1.6), deli.GVI(), step_size=H, steps=100, output=path, resume=True)
        run = deli.simulate(fall(9.8), deli.GVI(), step_size=H, steps=100, output=path, resume=True)
        assert run.attrs["outcome"] == "complete"
