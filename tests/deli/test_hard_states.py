"""States on which a careless tolerance, rank decision or cache gives a wrong answer or none."""

import numpy as np
import pytest

import deli
from deli.mechanics.energies import hamiltonian


def walk(scene, method, step_size, steps, **keywords):
    """Positions and momenta of a run, and its stepper."""
    stepper = method.stepper(scene, step_size, **keywords)
    states = [(scene.position, scene.momentum)]
    for _ in range(steps):
        states.append(stepper.step(*states[-1]))
    positions, momenta = np.array(states).swapaxes(0, 1)
    return positions, momenta, stepper


def energy_range(scene, positions, momenta):
    energies = hamiltonian(scene, positions, momenta)
    return np.ptp(energies)


def stacked(mass):
    """Two balls on a line, the lower one on a floor, both at rest under gravity."""
    return deli.Scene(
        mass=mass,
        position=[0.0, 1.0],
        momentum=[0.0, 0.0],
        potential=[deli.Gravity([-9.8])],
        unilateral=[
            deli.Planes(normals=[[1.0]], bodies=[0]),
            deli.Constraints(value=lambda q: np.array([q[1] - q[0] - 1.0]), jacobian=lambda q: np.array([[-1.0, 1.0]])),
        ],
    )


def test_a_rod_far_from_where_it_started_is_still_solved_to_rounding():
    scene = deli.Scene(
        mass=1.0,
        position=[[0.0, 0.0], [1.0, 0.0]],
        momentum=[[100.0, 1.0], [100.0, -1.0]],
        dimension=2,
        bilateral=[deli.Rods(pairs=[(0, 1)], length=1.0)],
    )
    positions, momenta, _ = walk(scene, deli.GVI(), 0.05, 400)
    assert np.abs(scene.bilateral.value(positions)).max() < 1e-11  # 2000 lengths out, x itself is rounded to 2e-13
    assert energy_range(scene, positions, momenta) < 1e-13 * 1e4


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e8, 1e10])
def test_a_stiff_spring_rests_on_the_floor(stiffness):
    scene = deli.Scene(
        mass=1.0,
        position=[1.0, 0.0],
        momentum=[0.0, 0.0],
        potential=[deli.Springs(pairs=[(0, 1)], stiffness=stiffness, rest_length=1.0), deli.Gravity([-9.8])],
        unilateral=[deli.Planes(normals=[[1.0]], bodies=[1])],
    )
    positions, momenta, stepper = walk(scene, deli.GVI(), 0.1, 100)
    assert stepper.stats.reflected_contacts == 0
    assert positions[:, 1].min() > -1e-12
    assert energy_range(scene, positions, momenta) < 1e-9


@pytest.mark.parametrize("shift", [0.0, 1e3, 1e6])
def test_a_shifted_scene_takes_the_same_path(shift):
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.1]])
    springs = deli.Springs(pairs=[(0, 1), (1, 2), (2, 3)], stiffness=100.0, rest_length=1.0)
    momentum = [[0.0, 1.0], [0.3, 0.0], [0.0, 0.2], [0.1, 0.1]]
    here, _, _ = walk(deli.Scene(1.0, square, momentum, [springs], dimension=2), deli.GVI(), 0.05, 60)
    there, _, _ = walk(deli.Scene(1.0, square + shift, momentum, [springs], dimension=2), deli.GVI(), 0.05, 60)
    assert np.abs(there - shift - here).max() < 1e-12 + 1e4 * np.finfo(float).eps * shift


@pytest.mark.parametrize("heavy", [1.0, 1e4, 1e8])
@pytest.mark.parametrize("step_size", [0.1, 1.0])
def test_a_heavy_body_hides_no_error_of_a_light_one(heavy, step_size):
    """An oscillator without a hessian beside a free body: its midpoint energy is conserved exactly."""
    oscillator = deli.Potential(energy=lambda q: 0.5 * q[0] ** 2, gradient=lambda q: np.array([q[0], 0.0]))
    scene = deli.Scene([1.0, heavy], [1.0, 0.0], [0.0, heavy], [oscillator])
    positions, momenta, _ = walk(scene, deli.GVI(), step_size, 300)
    light = 0.5 * (positions[:, 0] ** 2 + momenta[:, 0] ** 2)
    # A residual of 1e-14 of the step's impulse, in the metric of the masses, is what the iteration is run to.
    assert np.abs(light - 0.5).max() < 300 * 1e-14 * (10.0 + np.sqrt(heavy))


@pytest.mark.parametrize("masses", [(1.0, 1e8), (1e8, 1.0), (1.0, 1e12), (1e12, 1.0)])
def test_a_stack_of_unequal_masses_rests(masses):
    scene = stacked(masses)
    positions, momenta, stepper = walk(scene, deli.GVI(), 0.01, 50)
    assert stepper.stats.smooth_contacts == 2
    assert stepper.stats.reflected_contacts == 0
    assert np.abs(positions - scene.position).max() < 1e-14
    # In the metric of the masses the two gradients enclose an angle of the root of their ratio.
    angle = np.sqrt(min(masses) / max(masses))
    assert np.abs(momenta / scene.mass).max() < 20 * np.finfo(float).eps / angle * 0.01 * 9.8


@pytest.mark.parametrize("keywords", [{}, {"skip": False}, {"solvers": "clarabel"}, {"solvers": "osqp", "skip": False}])
def test_a_bilateral_constraint_stated_twice_changes_nothing(keywords):
    """A pendulum's rod as a length and as a squared length, beside a ball that keeps the solver busy."""

    def scene(extra):
        rod = deli.AnchoredRods(pivots=[[0.0, 0.0]], length=1.0, bodies=[0])
        return deli.Scene(
            mass=1.0,
            position=[[0.0, -1.0], [3.0, 0.0]],
            momentum=[[0.5, 0.0], [0.0, 0.0]],
            potential=[deli.Gravity([0.0, -9.8])],
            unilateral=[deli.Planes(normals=[[0.0, 1.0]], bodies=[1])],
            bilateral=[rod, *extra],
            dimension=2,
        )

    squared = deli.Constraints(
        value=lambda q: np.array([q[0] ** 2 + q[1] ** 2 - 1.0]),
        jacobian=lambda q: np.array([[2.0 * q[0], 2.0 * q[1], 0.0, 0.0]]),
    )
    once, _, _ = walk(scene([]), deli.GVI(), 0.02, 100)
    twice, _, _ = walk(scene([squared]), deli.GVI(), 0.02, 100, **keywords)
    assert np.abs(twice - once).max() < 1e-11


@pytest.mark.parametrize("ratio", [1e4, 1e6, 1e8])
def test_a_light_ball_rattles_between_a_wall_and_a_heavy_one_until_all_separate(ratio):
    touching = deli.Constraints(
        value=lambda q: np.array([q[0], q[1] - q[0] - 1.0]), jacobian=lambda q: np.array([[1.0, 0.0], [-1.0, 1.0]])
    )
    scene = deli.Scene([1.0, ratio], [0.0, 1.0], [0.0, -ratio], unilateral=[touching])
    momentum = deli.reflect(scene, scene.position, scene.momentum)
    velocity = momentum / scene.mass
    assert velocity[0] >= -1e-8
    assert velocity[1] - velocity[0] >= -1e-8
    energy = 0.5 * (momentum**2 / scene.mass).sum()
    reflections = np.pi * np.sqrt(ratio)
    assert energy == pytest.approx(0.5 * ratio, rel=2 * np.finfo(float).eps * reflections)


def test_contacts_that_leave_no_direction_free_are_named():
    normals = np.array([[1.0, -0.1], [-1.0, -0.1], [0.0, 1.0]])
    scene = deli.Scene(
        1.0, [[0.0, 0.0]], [[0.0, -1.0]], unilateral=[deli.Planes(normals=normals, bodies=[0, 0, 0])], dimension=2
    )
    with pytest.raises(deli.StepError, match="no momentum at which all of them separate"):
        deli.reflect(scene, scene.position, scene.momentum)


def test_a_light_ball_beside_a_fast_heavy_one_still_bounces():
    floor = deli.Planes(normals=[[1.0]], bodies=[0])
    scene = deli.Scene([1.0, 1e8], [1e-3, 0.0], [-1e-4, 1e8], unilateral=[floor])
    positions, _, stepper = walk(scene, deli.GVI(), 0.1, 200)
    assert stepper.stats.reflected_contacts == 1
    assert positions[:, 0].min() > -1e-12


@pytest.mark.parametrize("step_size", [1e-3, 1e-5, 1e-6])
def test_a_contact_that_opens_is_released_at_once_however_small_the_step(step_size):
    scene = deli.Scene(1.0, [0.0], [0.0], [deli.Gravity([1.0])], [deli.Planes(normals=[[1.0]], bodies=[0])])
    positions, momenta, _ = walk(scene, deli.GVI(), step_size, 50)
    time = step_size * np.arange(51)
    assert momenta[:, 0] == pytest.approx(time, rel=1e-12)
    assert positions[:, 0] == pytest.approx(0.5 * time**2, rel=1e-11)


def test_states_updated_in_place_are_read_anew():
    scene = deli.scenes.pogo_stick()
    expected, _, _ = walk(scene, deli.GVI(scheme="verlet"), 0.1, 50)
    stepper = deli.GVI(scheme="verlet").stepper(scene, 0.1)
    position, momentum = scene.position.copy(), scene.momentum.copy()
    for _ in range(50):
        position[:], momentum[:] = stepper.step(position, momentum)
    assert (position == expected[-1]).all()


@pytest.mark.parametrize("skip", [True, False])
@pytest.mark.parametrize("backend", ["daqp", "clarabel", "osqp"])
def test_a_grazing_contact_ends_its_approach_at_little_cost_in_energy(backend, skip):
    """Where V″ couples directions, a contact can approach in M⁻¹ and recede in the numerical energy's metric."""
    coupled = deli.Potential(
        energy=lambda q: 0.5 * (q[0] ** 2 + q[1] ** 2) + 0.9 * q[0] * q[1],
        gradient=lambda q: np.array([q[0] + 0.9 * q[1], q[1] + 0.9 * q[0]]),
        hessian=lambda q: np.array([[1.0, 0.9], [0.9, 1.0]]),
    )
    scene = deli.Scene(1.0, [[0.0, 0.0]], [[-1e-3, 1.0]], coupled, deli.Planes(normals=[[1.0, 0.0]]), dimension=2)
    keywords = {"scheme": "verlet", "step_size": 0.3, "solvers": {"backend": backend, "polish": False}, "skip": skip}
    momentum = deli.reflect(scene, scene.position, scene.momentum, energy="numerical", **keywords)
    assert abs(momentum[0]) < 1e-8
    assert momentum[1] == pytest.approx(1.0, abs=1e-8)


def test_energies_that_overflow_are_recorded_as_what_they_are() -> None:
    """States are finite to the last; their energies are infinities of either sign, and no number together."""
    scene = deli.scenes.point_mass(gravity=1e308, position=1e-300)
    run = deli.simulate(scene, deli.GVI(), step_size=1e-2, steps=3)
    assert np.isfinite(run["trajectory"]["position"]).all()
