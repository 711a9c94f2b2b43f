"""What takes a run takes a member of an ensemble, and what judges or shows runs takes an ensemble as a whole."""

import dataclasses

import numpy as np
import pytest
import xarray as xr
from running import DONE, INPUT_AT_FAULT, call

import deli
from deli.errors import InputError
from deli.recording.members import FEW, rows_of

SETTINGS = {"step_size": 0.1, "steps": 101, "every": 2}
METHOD = deli.GVI(scheme="verlet")
METRICS = {
    "energy_drift": deli.metrics.energy_drift,
    "energy_range": deli.metrics.energy_range,
    "drift_per_impact": deli.metrics.drift_per_impact,
    "momentum_error": deli.metrics.momentum_error,
    "angular_momentum_error": deli.metrics.angular_momentum_error,
    "violation": deli.metrics.violation,
    "complementarity": deli.metrics.complementarity,
    "equality_residual": deli.metrics.equality_residual,
    "contacts": deli.metrics.contacts,
    "steps_taken": deli.metrics.steps_taken,
}
PANELS = {name: getattr(deli.plotting, name) for name in ("energy", "momenta", "gaps", "residuals")}


def sticks(count):
    heights = np.linspace(0.5, 1.5, count)
    return [deli.scenes.pogo_stick(position=(5.0 + height, height)) for height in heights]


def discs(count=3):
    """An ensemble whose scenes conserve momenta."""
    rng = np.random.default_rng(3)
    free = deli.Scene(
        [1.0, 2.0], [0.0, 0.0, 1.5, 0.2], np.zeros(4), None, deli.SpheresApart([[0, 1]], 1.0), dimension=2
    )
    return [dataclasses.replace(free, momentum=rng.normal(size=4)) for _ in range(count)]


def ball(end):
    """A ball whose potential ends at a place."""

    def energy(q):
        if q[0] > end:
            raise ValueError("too far")
        return 0.0

    potential = deli.Potential(energy, lambda q: np.zeros(1) * energy(q), lambda q: np.zeros((1, 1)))
    return deli.Scene(1.0, 0.0, 1.0, potential)


def ensemble(scenes, **options):
    return deli.simulate_ensemble(scenes, METHOD, **SETTINGS, **options)


@pytest.fixture(scope="module")
def many():
    return ensemble(sticks(FEW + 2), labels={"height": np.linspace(0.5, 1.5, FEW + 2)})


@pytest.fixture(scope="module")
def few():
    return ensemble(sticks(3), labels={"height": [0.5, 1.0, 1.5], "colour": ["red", "$\\rho$", "blue"]})


@pytest.fixture(scope="module")
def cut():
    """An ensemble whose second member fails on the way, and whose third fails in its first step."""
    scenes = [ball(np.inf), ball(3.05), ball(0.05), ball(np.inf)]
    return deli.simulate_ensemble(scenes, deli.GVI(), **SETTINGS)


def numbers(found):
    """All numbers of what a metric returns, as arrays."""
    return [np.asarray(one) for one in (found if isinstance(found, tuple) else (found,))]


class TestMetrics:
    @pytest.mark.parametrize("name", METRICS)
    @pytest.mark.parametrize("make", [sticks, discs])
    def test_one_value_a_member_that_of_its_run_alone(self, name, make):
        scenes = make(3)
        run = ensemble(scenes)
        whole = numbers(METRICS[name](run))
        for member, scene in enumerate(scenes):
            alone = numbers(METRICS[name](deli.simulate(scene, METHOD, **SETTINGS)))
            for of_all, of_member, of_run in zip(
                whole, numbers(METRICS[name](run.isel(member=member))), alone, strict=True
            ):
                assert of_all.shape == (3,)
                np.testing.assert_array_equal([of_all[member], of_member], [of_run, of_run])

    def test_measure_has_labels_units_and_each_members_numbers(self, few):
        whole = deli.metrics.measure(few)
        assert set(whole.sizes) == {"member"}
        np.testing.assert_array_equal(whole["height"], [0.5, 1.0, 1.5])
        for member, scene in enumerate(sticks(3)):
            alone = deli.metrics.measure(deli.simulate(scene, METHOD, **SETTINGS))
            left_out = ["wall_time", "solver_time", "overhead_time"]
            found = whole.isel(member=member).reset_coords(drop=True)
            xr.testing.assert_identical(found.drop_vars(left_out), alone.drop_vars(left_out))
        assert whole["wall_time"].isnull().all()  # that of the whole is no member's

    def test_members_are_compared_with_theirs_or_with_one(self, few):
        np.testing.assert_array_equal(deli.metrics.trajectory_error(few, few), np.zeros(3))
        first = few.isel(member=0)
        errors = deli.metrics.trajectory_error(few, first)
        assert errors[0] == 0.0
        assert (errors[1:] > 0.1).all()
        with pytest.raises(InputError, match="the reference has 3 members and the run has 10"):
            deli.metrics.trajectory_error(ensemble(sticks(10)), few)

    def test_momenta_and_shadow_energies_are_over_members_and_time(self, few):
        for found in (*deli.metrics.momentum_components(few, conserved=False).values(),):
            assert found.dims == ("member", "time")
            np.testing.assert_array_equal(found, few["trajectory"]["linear_momentum"].isel(axis=0))
        scene = sticks(1)[0]
        shadow = deli.metrics.shadow_energy(few, scene=scene)
        one = deli.metrics.shadow_energy(few.isel(member=1), scene=scene)
        np.testing.assert_array_equal(shadow.isel(member=1), one)
        assert shadow.attrs == one.attrs

    def test_members_are_measured_as_far_as_they_got(self, cut):
        found = deli.metrics.measure(cut)
        assert [rows_of(cut, member) for member in range(4)] == [52, 16, 1, 52]
        np.testing.assert_allclose(found["simulated_time"], [10.1, 3.0, 0.0, 10.1])
        np.testing.assert_array_equal(found["energy_band"], np.zeros(4))
        assert float(deli.metrics.measure(cut.isel(member=1))["simulated_time"]) == 3.0

    def test_momenta_are_conserved_that_all_members_conserve(self):
        assert ensemble(sticks(2)).attrs["conserved_linear_momentum"] == "none"
        scenes = discs(2)
        run = ensemble(scenes)
        assert run.attrs["conserved_linear_momentum"] == "x y"
        assert run.attrs["conserved_angular_momentum"] == "z"
        falling = dataclasses.replace(scenes[0], potential=deli.Gravity([0.0, -1.0]))
        run = ensemble([*scenes, falling])
        assert run.attrs["conserved_linear_momentum"] == "x"
        assert run.attrs["conserved_angular_momentum"] == "none"


class TestPlots:
    @pytest.mark.parametrize("name", PANELS)
    def test_panels(self, name, few, many, cut):
        for run in (few, many, few.isel(member=0), few.isel(member=slice(0, 1))):
            figure = PANELS[name](run)
            figure.canvas.draw()
        if name != "gaps":
            PANELS[name](cut).canvas.draw()

    def test_few_members_are_lines_with_labels(self, few):
        axes = deli.plotting.energy(few).axes[0]
        labels = axes.get_legend_handles_labels()[1]
        assert labels == ["height 0.5, colour red", r"height 1, colour \$\rho\$", "height 1.5, colour blue"]
        energy = few["trajectory"]["hamiltonian"].values
        for line, label in ((line, line.get_label()) for line in axes.lines if str(line.get_label()) in labels):
            member = labels.index(label)
            np.testing.assert_array_equal(line.get_ydata(), energy[member] - energy[member, 0])

    def test_many_members_are_a_median_and_a_band(self, many):
        axes = deli.plotting.gaps(many).axes[0]
        assert axes.get_legend_handles_labels()[1] == ["smallest to largest", "median of members"]
        gap = many["trajectory"]["gap_min"].values
        (line,) = (line for line in axes.lines if line.get_label() == "median of members")
        np.testing.assert_array_equal(line.get_ydata(), np.median(gap, axis=0))
        (band,) = axes.collections
        heights = band.get_paths()[0].vertices[:, 1]
        assert set(heights) >= {*gap.min(axis=0), *gap.max(axis=0)}
        assert "height" in axes.get_title(loc="left")

    def test_a_member_is_drawn_like_a_run(self, few, cut):
        figure = deli.plotting.trajectory(few.isel(member=1), sticks(3)[1])
        assert figure.get_suptitle().endswith(r"height 1, colour \$\rho\$")
        assert "failed in step" in deli.plotting.history(cut.isel(member=1)).get_suptitle()
        assert "failed" not in deli.plotting.history(cut.isel(member=0)).get_suptitle()

    @pytest.mark.parametrize("draw", [deli.plotting.trajectory, deli.plotting.animate])
    def test_trajectories_and_films_ask_for_a_member(self, draw, few):
        with pytest.raises(InputError, match=r"an ensemble of 3 members.*isel\(member=0\).*--member 0"):
            draw(few)


class TestSolverStats:
    @pytest.mark.parametrize("method", [METHOD, deli.SolveIvp(), deli.NonsmoothAlpha()])
    def test_without_them_the_trajectory_is_the_same(self, method):
        run, without = (
            deli.simulate_ensemble(sticks(3), method, **SETTINGS, solver_stats=kept, workers=2)
            for kept in (True, False)
        )
        xr.testing.assert_identical(run["trajectory"].to_dataset(), without["trajectory"].to_dataset())
        assert list(without.children) == ["trajectory"]
        assert "solver_stats = false" in without.attrs["config"]

    def test_tools_do_without(self, folder):
        run = ensemble(sticks(3), solver_stats=False, output="short.nc")
        ensemble(sticks(3), output="long.nc")
        assert (folder / "short.nc").stat().st_size < 0.6 * (folder / "long.nc").stat().st_size
        found, full = deli.metrics.measure(run), deli.metrics.measure(deli.open_run("long.nc"))
        assert found["skipped"].isnull().all()
        xr.testing.assert_identical(found["energy_band"], full["energy_band"])
        assert len(deli.plotting.history(run).axes) == 3
        assert len(deli.plotting.history(run.isel(member=0)).axes) == 3
        for tool in (deli.plotting.residuals, lambda run: deli.plotting.residuals(run.isel(member=0))):
            with pytest.raises(InputError, match="the run has no group solver_stats"):
                tool(run)
        for command in ("check", "plot"):
            assert call(command, "short.nc").exit_code == DONE

    def test_it_is_yes_or_no(self):
        with pytest.raises(InputError, match="solver_stats is 'no'; allowed: True, False"):
            ensemble(sticks(1), solver_stats="no")


class TestFiles:
    def labels(self):
        when = np.array(["2026-01-01", "2026-01-02", "2026-01-03"], dtype="datetime64[ns]")
        return {"height": [0.5, 1.0, 1.5], "colour": ["a", "bé", ""], "good": [True, False, True], "when": when}

    @pytest.mark.parametrize("method", [METHOD, deli.NonsmoothAlpha()])
    def test_what_was_written_is_opened(self, folder, method):
        run = deli.simulate_ensemble(sticks(3), method, **SETTINGS, labels=self.labels(), output="e.nc")
        xr.testing.assert_identical(deli.open_run("e.nc"), run)
        with xr.open_datatree("e.nc", engine="netcdf4") as other:
            xr.testing.assert_equal(other.load(), run)

    def test_a_run_saved_again_by_xarray_opens_and_is_said_to_be_unsealed(self, folder):
        ensemble(sticks(3), labels=self.labels(), output="e.nc")
        run = deli.open_run("e.nc")
        run.to_netcdf("again.nc", engine="netcdf4")
        xr.testing.assert_equal(deli.open_run("again.nc"), run)
        assert "the digest is that of the closed file" in call("check", "e.nc").stdout
        checked = call("check", "again.nc")
        assert checked.exit_code == DONE
        assert "not sealed" in checked.stdout

    def test_commands(self, folder, few):
        ensemble(sticks(3), output="e.nc")
        assert call("check", "e.nc").exit_code == DONE
        assert call("plot", "e.nc").exit_code == DONE
        assert call("plot", "e.nc", "--member", "2", "-o", "two.png").exit_code == DONE
        assert call("animate", "e.nc", "--member", "2", "--every", "20", "--quiet").exit_code == DONE
        assert (folder / "e.png").stat().st_size > 10_000 < (folder / "two.png").stat().st_size
        for arguments, words in (
            (("plot", "e.nc", "--member", "3", "-o", "three.png"), "member is 3; the ensemble has members 0 to 2"),
            (("animate", "e.nc", "--overwrite"), "draw one of them"),
        ):
            refused = call(*arguments)
            assert refused.exit_code == INPUT_AT_FAULT
            assert words in refused.stderr
        deli.simulate(sticks(1)[0], METHOD, **SETTINGS, output="run.nc")
        assert "the run is not an ensemble" in call("plot", "run.nc", "--member", "0").stderr

    def test_a_failed_member_and_one_that_was_not_begun_hold_up(self, folder):
        scenes = [ball(np.inf), ball(3.05), ball(0.05)]
        deli.simulate_ensemble(scenes, deli.GVI(), **SETTINGS, output="e.nc")
        checked = call("check", "e.nc")
        assert checked.exit_code == DONE, checked.stdout
        assert "1 to 52 a member" in checked.stdout

    @pytest.mark.parametrize(
        ("what", "words"),
        [
            ("momentum", "linear_momentum"),
            ("kinetic_energy", "hamiltonian"),
            ("rows", "rows"),
            ("nan", "finite values"),
        ],
    )
    def test_what_does_not_follow_is_found(self, folder, what, words):
        run = ensemble(discs(3)).copy(deep=True)
        trajectory = run["trajectory"]
        if what == "rows":
            run["steps_taken"][1] = 7
        elif what == "nan":
            trajectory["hamiltonian"][1, 7] = np.nan
        else:
            trajectory[what][1, 7] += 1e-3
        run.to_netcdf("e.nc", engine="netcdf4")
        checked = call("check", "e.nc")
        assert checked.exit_code == INPUT_AT_FAULT
        assert f"fails these checks: {words}" in checked.stderr

    @pytest.mark.parametrize(
        ("spoil", "words"),
        [
            (lambda run: run["trajectory"].__delitem__("position"), "trajectory/position is missing"),
            (lambda run: run.__delitem__("outcome"), "outcome is missing"),
            (lambda run: run.attrs.pop("config"), "its attribute config is None"),
            (lambda run: run["trajectory"].__setitem__("gap_min", run["trajectory"]["time"]), "gap_min has the dim"),
            (
                lambda run: run["solver_stats"].__setitem__("rows", 0.5 * run["solver_stats"]["rows"]),
                "rows is of the t",
            ),
        ],
    )
    def test_what_is_no_ensemble_is_refused(self, folder, spoil, words):
        run = ensemble(sticks(3)).copy(deep=True)
        spoil(run)
        run.to_netcdf("e.nc", engine="netcdf4")
        with pytest.raises(InputError, match=words):
            deli.open_run("e.nc")

    def test_a_damaged_file_is_refused(self, folder):
        ensemble(sticks(3), output="e.nc")
        content = bytearray((folder / "e.nc").read_bytes())
        content[len(content) // 2] ^= 1
        (folder / "e.nc").write_bytes(content)
        with pytest.raises(InputError, match="its content has changed since it was closed"):
            deli.open_run("e.nc")


def test_members_without_a_row_are_nan_and_an_ensemble_of_them_is_refused(few):
    run = few.copy(deep=True)
    run["trajectory"]["position"][1] = np.nan
    found = deli.metrics.measure(run)
    assert bool(found["energy_band"].isnull()[1])
    assert not found["energy_band"].isnull()[[0, 2]].any()
    run["trajectory"]["position"][:] = np.nan
    with pytest.raises(InputError, match="no member of the ensemble has a row"):
        deli.metrics.measure(run)
