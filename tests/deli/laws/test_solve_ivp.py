"""SciPy between events, against exact motions and against what it cannot do."""

import numpy as np
import pytest

import deli
from deli.figures.exact import SOLUTIONS


def run(scene, step_size, steps, **settings):
    return deli.simulate(scene, deli.SolveIvp(**settings), step_size=step_size, steps=steps)


@pytest.mark.parametrize("algorithm", ["DOP853", "RK45", "Radau", "LSODA"])
def test_a_bouncing_ball_follows_its_parabolas(algorithm):
    scene = deli.scenes.point_mass()
    trajectory = run(scene, 0.25, 40, algorithm=algorithm)["trajectory"]
    exact = SOLUTIONS["bouncing_ball"](scene, trajectory["time"].values)
    np.testing.assert_allclose(trajectory["position"].values, exact, atol=1e-7 if algorithm == "LSODA" else 1e-12)
    assert trajectory["reflected_contacts"].sum() == 11


def test_rods_pass_their_momenta_on():
    scene = deli.scenes.hard_rods(rods=6)
    trajectory = run(scene, 0.5, 60)["trajectory"]
    exact = SOLUTIONS["passing_points"](scene, trajectory["time"].values)
    np.testing.assert_allclose(trajectory["position"].values, exact, atol=1e-9)


@pytest.mark.parametrize("unit", [1e-8, 1e8])
def test_impacts_are_found_in_any_unit_of_time(unit):
    """SciPy ends its search for an event at an absolute width, which was wider than a contact is thick."""
    scene = deli.scenes.nonlinear_oscillator(strength=unit**-2, speed=1.0 / unit)
    found = run(scene, 0.05 * unit, 200)["trajectory"]
    usual = run(deli.scenes.nonlinear_oscillator(), 0.05, 200)["trajectory"]
    assert found["gap_min"].values.min() > 0.0
    assert found["reflected_contacts"].sum() == usual["reflected_contacts"].sum()


def test_energy_is_as_good_as_the_tolerance():
    scene = deli.scenes.pogo_stick()
    error = {}
    for rtol in (1e-4, 1e-7, 1e-10):
        energy = run(scene, 1.0, 40, rtol=rtol, atol=rtol)["trajectory"]["hamiltonian"].values
        error[rtol] = np.abs(energy / energy[0] - 1.0).max()
    assert error[1e-4] > 30 * error[1e-7] > 900 * error[1e-10] > 0.0


def test_a_run_that_goes_on_is_the_run_that_never_stopped(tmp_path, monkeypatch):
    scene, method = deli.scenes.wedge(), deli.SolveIvp()
    whole = deli.simulate(scene, method, step_size=0.25, steps=60)
    stepper = method.stepper(scene, 0.25)
    q, p = scene.position, scene.momentum
    for row in range(1, 61):
        q, p = stepper.step(q, p)
        np.testing.assert_array_equal(whole["trajectory"]["position"][row], q)
        np.testing.assert_array_equal(whole["trajectory"]["momentum"][row], p)


def test_members_of_an_ensemble_run_as_they_would_alone():
    sticks = [deli.scenes.pogo_stick(position=[height, 1.0]) for height in (5.5, 6.5)]
    many = deli.simulate_ensemble(sticks, deli.SolveIvp(), step_size=0.1, steps=20)
    for member, stick in enumerate(sticks):
        alone = run(stick, 0.1, 20)
        np.testing.assert_array_equal(
            many["trajectory"]["position"][member].values, alone["trajectory"]["position"].values
        )


def test_work_is_counted():
    result = run(deli.scenes.point_mass(), 0.1, 10)
    stats = result["solver_stats"].sel(subproblem="position")
    assert stats["iterations"].min() > 5
    assert result["solver_stats"]["solves"].sum() == 0


@pytest.mark.parametrize("height", [0.0, 1e-12])
def test_resting_contacts_are_an_outcome(height):
    result = run(deli.scenes.point_mass(position=height), 0.1, 10)
    assert result.attrs["outcome"].startswith("failed in step 1 (from time 0): solve_ivp: ")
    assert result.attrs["outcome"].endswith("deli.GVI.")


def test_impacts_that_follow_at_once_are_an_outcome():
    """A corner whose walls are met together is left the way it was entered; else each wall has an impact of its own."""
    outcomes = []
    for apart in (0.0, 1e-13):
        walls = deli.Planes(np.eye(2), bodies=[0, 0])
        scene = deli.Scene(1.0, [1.0, 1.0 + apart], [-1.0, -1.0], unilateral=walls, dimension=2)
        result = deli.simulate(scene, deli.SolveIvp(), step_size=2.0, steps=1, contact_tolerance=1e-15)
        outcomes.append(result.attrs["outcome"])
    assert outcomes[0] == "complete"
    assert "a contact is met again at once, after 1 events of the step, 1 into its 2:" in outcomes[1]


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        (deli.scenes.newtons_cradle, "no bilateral constraints"),
        (lambda: deli.scenes.hard_sphere_gas(spheres=1000), "found by search"),
    ],
    ids=["cradle", "gas"],
)
def test_scenes_beyond_it_are_refused(scene, words):
    with pytest.raises(deli.InputError, match=words):
        run(scene(), 0.01, 1)


@pytest.mark.parametrize("settings", [{"rtol": 0.0}, {"rtol": 2.0}, {"atol": -1.0}, {"algorithm": "euler"}])
def test_settings_out_of_range_are_refused(settings):
    with pytest.raises(deli.InputError, match=f"SolveIvp: {next(iter(settings))}"):
        deli.SolveIvp(**settings)
