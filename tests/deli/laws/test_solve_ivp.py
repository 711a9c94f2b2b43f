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


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(
    ("half", "speed", "step_size"),
    [
        (1.0, 3.0, 0.125), (0.5, 3.0, 0.1), (0.5, 3.0, 0.125), (0.3, 3.0, 0.1), (0.3, 3.0, 0.05), (0.7, 1.0, 0.01),
        (0.7, 0.7, 0.05), (1.1, 1.0, 0.01), (1.0, 1.0, 0.25), (0.5, 2.0, 0.125), (1.0, 2.0, 0.5), (0.7, 0.7, 0.1),
    ],
)  # fmt: skip
def test_impacts_fall_on_the_ends_of_steps(half, speed, step_size, unit):
    """A ball between two walls: in round numbers it meets them where steps end, to rounding before or after."""
    walls = deli.Planes(normals=[[1.0], [-1.0]], offsets=[0.0, -2.0 * half * unit], bodies=[0, 0])
    scene = deli.Scene(mass=1.0, position=[half * unit], momentum=[-speed * unit], unilateral=walls)
    steps = int(4.0 * half / speed / step_size) + 1
    result = run(scene, step_size, steps)
    assert result.attrs["outcome"] == "complete"
    trajectory = result["trajectory"]
    phase = (half - speed * trajectory["time"].values) % (4.0 * half)
    exact = unit * np.minimum(phase, 4.0 * half - phase)
    np.testing.assert_allclose(trajectory["position"].values[:, 0], exact, rtol=0, atol=1e-12 * unit)
    assert trajectory["gap_min"].min() > -1e-13 * unit


@pytest.mark.parametrize("side", [-1, 0, 1])
@pytest.mark.parametrize("velocity", [-0.7, 0.7])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_motion_begins_on_a_wall(side, velocity, unit):
    """Whatever rounding says of the gap: what approaches is turned back at once, what recedes is not."""
    wall = 0.3 * unit
    position = wall if side == 0 else np.nextafter(wall, side * np.inf)
    planes = deli.Planes(normals=[[1.0]], offsets=[wall], bodies=[0])
    scene = deli.Scene(mass=2.0, position=[position], momentum=[2.0 * velocity * unit], unilateral=planes)
    trajectory = run(scene, 0.1, 3)["trajectory"]
    expected = wall + 0.7 * unit * trajectory["time"].values
    np.testing.assert_allclose(trajectory["position"].values[:, 0], expected, rtol=1e-14)
    assert trajectory["reflected_contacts"].sum() == (velocity < 0.0)


@pytest.mark.parametrize("apart", [0.0, 1e-16, 1e-15, 1e-14, 1e-13, 1e-11, 1e-9])
@pytest.mark.parametrize("step_size", [0.5, 1.0, 2.0, 1.0 / 3.0])
@pytest.mark.parametrize("contact_tolerance", [1e-15, 1e-8])
def test_a_corner_is_left_the_way_it_was_entered(apart, step_size, contact_tolerance):
    """Its walls are met together, or one after the other in quick succession, within a step or at its end."""
    walls = deli.Planes(np.eye(2), bodies=[0, 0])
    scene = deli.Scene(1.0, [1.0, 1.0 + apart], [-1.0, -1.0], unilateral=walls, dimension=2)
    steps = round(2.0 / step_size)
    result = deli.simulate(
        scene, deli.SolveIvp(), step_size=step_size, steps=steps, contact_tolerance=contact_tolerance
    )
    assert result.attrs["outcome"] == "complete"
    np.testing.assert_allclose(result["trajectory"]["momentum"][-1], [1.0, 1.0], rtol=1e-14)
    np.testing.assert_allclose(result["trajectory"]["position"][-1], [1.0, 1.0], atol=3e-9)
    assert result["trajectory"]["reflected_contacts"].sum() == 2


@pytest.mark.parametrize("step_size", [0.1, 0.25, 0.5, 1.0])
def test_several_impacts_are_met_at_one_time(step_size):
    """Two pairs of balls, and three in a row, all at t = 1/2."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.0, 2.0, 10.0, 12.0, 20.0, 21.5, 23.0],
        momentum=[1.0, -1.0, 1.0, -1.0, 1.0, 0.0, -1.0],
        unilateral=deli.SpheresApart(pairs=[(0, 1), (2, 3), (4, 5), (5, 6)], distance=1.0),
    )
    result = run(scene, step_size, round(1.0 / step_size))
    assert result.attrs["outcome"] == "complete"
    np.testing.assert_allclose(result["trajectory"]["momentum"][-1], -scene.momentum, atol=1e-12)
    np.testing.assert_allclose(result["trajectory"]["position"][-1], scene.position, atol=1e-12)
    assert result["trajectory"]["reflected_contacts"].sum() == 4


@pytest.mark.parametrize("offset", [-1e-13, -1e-15, 0.0, 1e-15, 1e-13])
@pytest.mark.parametrize("step_size", [0.1, 0.5, 1.0, 0.3])
def test_a_particle_grazes_a_disc(offset, step_size):
    """A touch within rounding changes nothing; a deeper one turns the ball by the angle at which it meets the disc."""
    disc = deli.Constraints(
        value=lambda q: np.array([np.hypot(*q) - 1.0]), jacobian=lambda q: (q / np.hypot(*q))[np.newaxis]
    )
    scene = deli.Scene(1.0, [-1.0, 1.0 + offset], [1.0, 0.0], unilateral=disc, dimension=2)
    result = run(scene, step_size, round(2.0 / step_size))
    assert result.attrs["outcome"] == "complete"
    np.testing.assert_allclose(result["trajectory"]["momentum"][-1], [1.0, 0.0], atol=4.0 * np.sqrt(2e-13))
    assert result["trajectory"]["gap_min"].min() > -2e-13


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("height", [0.0, 1e-17, 1e-15])
def test_a_particle_slides_where_nothing_presses(unit, height):
    floor = deli.Planes(normals=[[0.6, 0.8]], offsets=[0.3 * unit], bodies=[0])
    start = np.array([0.18, 0.24]) + height * np.array([0.6, 0.8]) + 0.5 * np.array([-0.8, 0.6])
    scene = deli.Scene(1.0, start * unit, np.array([0.8, -0.6]) * unit, unilateral=floor, dimension=2)
    result = run(scene, 0.1, 30)
    assert result.attrs["outcome"] == "complete"
    np.testing.assert_allclose(result["trajectory"]["momentum"].values, np.tile(scene.momentum, (31, 1)), rtol=1e-14)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_what_presses_is_an_outcome_and_not_a_fall(unit):
    """A ball that comes down on two others, and rests; in any unit the run ends where it cannot follow."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.5 * unit, 1.5 * unit],
        momentum=[0.0, 0.0],
        potential=deli.Gravity(-9.8 * unit),
        unilateral=[
            deli.Planes(normals=[[1.0]], offsets=[0.5 * unit], bodies=[0]),
            deli.SpheresApart(pairs=[(0, 1)], distance=unit),
        ],
    )
    result = run(scene, 0.01, 10)
    assert result.attrs["outcome"].startswith("failed in step 1 (from time 0): solve_ivp: unilateral constraint ")
    assert result.attrs["outcome"].endswith("deli.GVI.")


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
