"""Metrics against values known from theory, and on runs whose numbers were set by hand."""

import numpy as np
import pytest
import xarray as xr

import deli
from deli import metrics


@pytest.fixture(scope="module")
def ball():
    return deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=400)


def changed(run, **values):
    """A copy of the run with other trajectory values."""
    copy = run.copy(deep=True)
    for name, value in values.items():
        copy["trajectory"][name].values[...] = value
    return copy


def test_every_metric_is_a_scalar_with_units_and_a_long_name(ball):
    found = metrics.measure(ball)
    assert list(found) == list(metrics.METRICS)
    assert all(value.ndim == 0 and value.attrs.keys() == {"units", "long_name"} for value in found.values())
    assert found["steps"] == 400


@pytest.mark.parametrize("slope", [0.0, 3e-4, -2.0])
def test_drift_is_the_slope_and_its_error_holds_it(ball, slope):
    time = ball["trajectory"]["time"].values
    noise = 1e-3 * np.random.default_rng(4).standard_normal(len(time))
    exact = metrics.energy_drift(changed(ball, hamiltonian=7.0 + slope * time))
    noisy = metrics.energy_drift(changed(ball, hamiltonian=7.0 + slope * time + noise))
    assert exact.slope == pytest.approx(slope, abs=1e-13)
    assert abs(noisy.slope - slope) < 4.0 * noisy.error < 1e-3


def test_band_and_violation_are_those_of_the_rows(ball):
    rows = ball["trajectory"].sizes["time"]
    energy, gap = np.full(rows, 5.0), np.full(rows, 1.0)
    energy[[3, 7]], gap[[4, 5]] = (4.0, 8.0), (-0.25, -0.75)
    found = metrics.measure(changed(ball, hamiltonian=energy, gap_min=gap))
    assert (found["energy_low"], found["energy_high"], found["energy_band"]) == (-1.0, 3.0, 4.0)
    assert found["violation_worst"] == 0.75
    assert float(found["violation_mean"]) == pytest.approx(1.0 / rows)


def test_conserved_momenta_are_kept_and_others_not_asked_for():
    gas = deli.simulate(deli.scenes.lennard_jones(), deli.GVI("verlet"), step_size=0.01, steps=200)
    found = metrics.measure(gas)
    assert found["angular_momentum_error"] < 1e-11
    assert np.isnan(found["momentum_error"])  # the box pushes back
    assert np.isnan(found["equality_residual"]) == (not gas["trajectory"]["equality_residual"].notnull().any())


def test_a_sliding_mass_is_in_contact_and_a_ball_bounces(ball):
    sliding = deli.simulate(deli.scenes.spring_sphere(start="smooth"), deli.GVI(), step_size=0.5, steps=40)
    found, bouncing = metrics.measure(sliding), metrics.measure(ball)
    assert (found["smooth_contacts"], found["reflected_contacts"]) == (2, 0)
    assert (bouncing["smooth_contacts"], bouncing["reflected_contacts"]) == (0, 4)


def test_claimed_and_verified_solves_are_counted_apart():
    run = deli.simulate(
        deli.scenes.spring_sphere(), deli.GVI(), step_size=0.5, steps=20, solvers={"backend": "daqp", "polish": False}
    )
    found = metrics.measure(run)
    assert found["solves"] == found["claimed_solves"] == found["verified_solves"] > 0


class TestTrajectoryError:
    """A run against one of other rows."""

    def test_of_a_run_to_itself_is_zero(self, ball):
        assert metrics.trajectory_error(ball, ball) == 0.0

    def test_uses_the_times_that_both_have(self, ball):
        thin = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01, steps=400, every=7)
        away = changed(thin, position=thin["trajectory"]["position"].values + 0.125)
        assert metrics.trajectory_error(thin, ball) == metrics.trajectory_error(ball, thin) == 0.0
        assert metrics.trajectory_error(away, ball) == metrics.trajectory_error(ball, away)
        assert metrics.trajectory_error(away, ball) == pytest.approx(0.125, rel=1e-14)

    def test_falls_with_the_square_of_the_step(self):
        pogo = deli.scenes.pogo_stick(position=(60.0, 51.0))  # the spring swings, far from the floor

        def run(step_size):
            return deli.simulate(pogo, deli.GVI("verlet"), step_size=step_size, duration=1.0)

        reference = run(1e-4)
        errors = [metrics.trajectory_error(run(step_size), reference) for step_size in (0.05, 0.025, 0.0125)]
        assert np.allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.02)

    def test_refuses_what_cannot_be_compared(self, ball):
        other = deli.simulate(deli.scenes.point_mass(), deli.GVI(), step_size=0.01 * np.sqrt(2.0), steps=5)
        with pytest.raises(deli.InputError, match="no time in common"):
            metrics.trajectory_error(other, ball)
        with pytest.raises(deli.InputError, match="degrees of freedom"):
            metrics.trajectory_error(deli.simulate(deli.scenes.pogo_stick(), deli.GVI(), step_size=0.01, steps=5), ball)


def test_drift_per_impact_is_the_drift_of_the_whole_run_by_reflected_contact(ball):
    time, struck = ball["trajectory"]["time"].values, np.zeros(401, dtype=int)
    struck[[5, 9, 70]] = [1, 3, 1]
    found = metrics.drift_per_impact(changed(ball, hamiltonian=2.0 - 0.5 * time, reflected_contacts=struck))
    assert found == pytest.approx(-0.5 * time[-1] / 5)
    assert np.isnan(metrics.drift_per_impact(changed(ball, reflected_contacts=0)))


@pytest.mark.parametrize("rows", [0, 1, 2, 39, 40, 41, 97])
def test_no_metric_averages_over_nothing(ball, rows):
    """Warnings are errors here."""
    time = np.linspace(0.0, 1.0, rows)
    assert np.isnan(metrics.drift(time, 2.0 * time).slope) == (rows < 40)
    if rows:
        trajectory = ball["trajectory"].isel(time=slice(rows))
        stats = ball["solver_stats"].isel(step=slice(rows - 1))
        shown = xr.DataTree.from_dict({"/": ball.to_dataset(), "/trajectory": trajectory, "/solver_stats": stats})
        assert metrics.measure(shown)["steps"] == rows - 1


@pytest.mark.parametrize("shape", [(3, 60), (3,), (60, 3)])
def test_a_drift_is_of_one_energy_for_each_time(shape):
    with pytest.raises(deli.InputError, match=r"drift: found times of shape \(60,\) and energies of shape"):
        metrics.drift(np.arange(60.0), np.zeros(shape))
