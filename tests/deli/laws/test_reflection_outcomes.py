"""Clusters of touching bodies whose reflection is known, and the momentum maps of any cluster."""

import numpy as np
import pytest
from law_cases import BACKEND, ENERGIES, REFLECTION, SHADOWS, SKIP
from law_runs import angular_momentum

import deli

ENERGY = pytest.mark.parametrize("energy", [*ENERGIES, *SHADOWS])


@REFLECTION
def test_planes_in_each_dimension(operator: str, order: str) -> None:
    """A body in a corner of its space, on ready-made planes; pushed in head on it comes straight back."""
    for dimension in (1, 2, 3):
        normals = 3.0 * np.eye(dimension)
        scene = deli.Scene(
            mass=2.0,
            position=np.zeros(dimension),
            momentum=-np.arange(1.0, dimension + 1.0),
            unilateral=deli.Planes(normals=normals, bodies=[0] * dimension),
            dimension=dimension,
        )
        after = deli.reflect(scene, scene.position, scene.momentum, operator, order=order)
        np.testing.assert_allclose(after, -scene.momentum, rtol=1e-14)


def row_of_balls(momentum: list[float]) -> deli.Scene:
    balls = len(momentum)
    pairs = [(ball, ball + 1) for ball in range(balls - 1)]
    return deli.Scene(
        mass=1.0,
        position=np.arange(balls, dtype=float),
        momentum=momentum,
        unilateral=deli.SpheresApart(pairs=pairs, distance=1.0),
    )


@SKIP
@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_two_spheres_turn_back_along_their_line(dimension: int, skip: bool) -> None:
    line = np.arange(1.0, dimension + 1.0) / np.linalg.norm(np.arange(1.0, dimension + 1.0))
    mass, along, across = np.array([1.0, 3.0]), np.array([2.0, -1.0]), np.cos(np.arange(2.0 * dimension))
    across = across.reshape(2, dimension) - np.outer(across.reshape(2, dimension) @ line, line)
    scene = deli.Scene(
        mass=mass,
        position=np.array([-0.5 * line, 0.5 * line]),
        momentum=mass[:, np.newaxis] * (np.outer(along, line) + across),
        unilateral=deli.SpheresApart(pairs=[(0, 1)], distance=1.0),
        dimension=dimension,
    )
    turned = 2.0 * (mass @ along) / mass.sum() - along
    after = deli.reflect(scene, scene.position, scene.momentum, skip=skip)
    expected = mass[:, np.newaxis] * (np.outer(turned, line) + across)
    np.testing.assert_allclose(after.reshape(2, dimension), expected, atol=1e-12)


def test_passes_that_need_no_solver_are_counted_one_by_one() -> None:
    """A blow is handed on through a row of balls from pair to pair."""
    scene = row_of_balls([1.0, 0.0, 0.0, 0.0, 0.0])
    stepper = deli.GVI(reflection="sequential").stepper(scene, 0.01)
    stepper.step(scene.position, scene.momentum)
    assert stepper.stats.skipped[0] == 4
    assert stepper.stats.solves[0] == 0


def test_a_contact_between_bodies_that_both_turned_is_met_once() -> None:
    """The outer balls strike the inner ones, these strike each other, and then the outer ones."""
    scene = row_of_balls([1.0, 0.0, 0.0, -1.0])
    stepper = deli.GVI().stepper(scene, 0.01)
    _, after = stepper.step(scene.position, scene.momentum)
    np.testing.assert_array_equal(after, -scene.momentum)
    assert stepper.stats.skipped[0] == 3
    assert stepper.stats.solves[0] == 0


@SKIP
def test_contacts_may_be_listed_in_any_order(skip: bool) -> None:
    """A blow in the middle of a row of balls is handed on to both of its ends."""
    momentum = np.array([0.0, 0.0, 1.0, -1.0, 0.0, 0.0])
    pairs = np.array([(ball, ball + 1) for ball in range(5)])
    for listed in (pairs, pairs[::-1], pairs[:, ::-1], pairs[[1, 4, 0, 3, 2]]):
        scene = deli.Scene(
            mass=1.0,
            position=np.arange(6.0),
            momentum=momentum,
            unilateral=deli.SpheresApart(pairs=listed, distance=1.0),
        )
        after = deli.reflect(scene, scene.position, momentum, skip=skip)
        np.testing.assert_allclose(after, [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0], atol=1e-14)


def test_what_comes_back_in_a_later_step_is_no_cycle() -> None:
    """A ball between two walls has, after each bounce, the momentum that it had before the one before."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.5],
        momentum=[1.0],
        unilateral=deli.Planes(normals=[[1.0], [-1.0]], offsets=[0.0, -1.0], bodies=[0, 0]),
        dimension=1,
    )
    for operator in ("generalized", "moreau", "sequential"):
        run = deli.simulate(scene, deli.GVI(reflection=operator), step_size=0.1, steps=100)
        momentum = run["trajectory/momentum"].values.ravel()
        assert set(momentum) == {-1.0, 1.0}
        assert np.count_nonzero(np.diff(momentum)) >= 8


@SKIP
@BACKEND
@pytest.mark.parametrize("balls", [3, 5])
def test_generalized_reflection_moves_the_last_ball_alone(balls: int, backend: str, skip: bool) -> None:
    for moving in range(1, balls):
        scene = row_of_balls([1.0] * moving + [0.0] * (balls - moving))
        after = deli.reflect(scene, scene.position, scene.momentum, solvers=backend, skip=skip)
        np.testing.assert_allclose(after, scene.momentum[::-1], atol=1e-14)
        back = deli.reflect(scene, scene.position, -scene.momentum[::-1], solvers=backend, skip=skip)
        np.testing.assert_allclose(back, -scene.momentum, atol=1e-14)


@pytest.mark.parametrize("balls", [3, 5])
def test_generalized_reflection_in_the_cradle(balls: int) -> None:
    scene = deli.scenes.newtons_cradle(balls=balls, pulled=0)
    momentum = np.zeros((balls, 2))
    momentum[0, 0] = 1.0
    after = deli.reflect(scene, scene.position, momentum)
    np.testing.assert_allclose(after.reshape(balls, 2), momentum[::-1], atol=1e-14)


@pytest.mark.parametrize(("speeds", "first"), [((2.0, 1.0), 0), ((1.0, 2.0), 1), ((1.0, 1.0), 0)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("masses", [(1.0, 1.0), (100.0, 1.0)])
def test_fastest_is_measured_in_the_metric_of_the_mass(
    speeds: tuple[float, float], first: int, scale: float, masses: tuple[float, float]
) -> None:
    """Two constraints share a body: −∇gᵀv / ‖∇g‖ in M⁻¹ decides which is first, not how one of them is scaled."""
    root = np.sqrt(np.array([*masses, 1.0]))
    rows = np.array([[-1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    momentum = np.zeros(3)
    lengths = np.sqrt((rows**2 / root**2).sum(axis=1))
    momentum[0], momentum[1] = (masses[0] * speeds[0] * lengths[0], -masses[1] * speeds[1] * lengths[1])
    rows[1] *= scale
    scene = deli.Scene(
        mass=root**2,
        position=np.zeros(3),
        momentum=momentum,
        unilateral=deli.Constraints(value=lambda q: rows @ q, jacobian=lambda q: rows),
    )
    expected = momentum.copy()
    for row in (rows[first], rows[1 - first], rows[first], rows[1 - first]):
        speed = row @ (expected / root**2)
        if speed < 0.0:
            expected -= 2.0 * speed / (row @ (row / root**2)) * row
    after = deli.reflect(scene, scene.position, momentum, "sequential", order="fastest")
    np.testing.assert_allclose(after, expected, rtol=1e-13, atol=1e-13)


def test_moreau_spreads_the_impulse() -> None:
    for balls in (3, 5):
        scene = row_of_balls([1.0] + [0.0] * (balls - 1))
        after = deli.reflect(scene, scene.position, scene.momentum, "moreau")
        np.testing.assert_allclose(after, [2.0 / balls - 1.0] + [2.0 / balls] * (balls - 1), atol=1e-14)


def pile(dimension: int, energy: str = "hamiltonian") -> deli.Scene:
    """A sphere among touching ones, in springs; nothing holds the pile, so it conserves all momenta."""
    if dimension == 2:
        angles = np.arange(6) * np.pi / 3
        around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    else:
        around = np.vstack([np.eye(3), -np.eye(3)])
    rng = np.random.default_rng(dimension)
    positions = np.vstack([np.zeros(dimension), around]) + 0.7
    bodies = len(positions)
    pairs = [(i, j) for i in range(bodies) for j in range(i)]
    touching = [pair for pair in pairs if np.linalg.norm(positions[pair[0]] - positions[pair[1]]) < 1 + 1e-9]
    return deli.Scene(
        mass=rng.uniform(0.5, 2.0, bodies),
        position=positions,
        momentum=rng.standard_normal((bodies, dimension)),
        potential=deli.Springs(pairs=pairs, stiffness=1.0, rest_length=0.8),
        unilateral=deli.SpheresApart(pairs=touching, distance=1.0),
        dimension=dimension,
    )


@REFLECTION
@ENERGY
@SKIP
@pytest.mark.parametrize("dimension", [2, 3])
def test_reflection_conserves_linear_and_angular_momentum(
    dimension: int, operator: str, order: str, energy: str, skip: bool
) -> None:
    scene = pile(dimension)
    assert all(scene.symmetry.linear + scene.symmetry.angular)
    q, before = scene.position, scene.momentum
    after = deli.reflect(scene, q, before, operator, energy, order=order, step_size=0.2, skip=skip)
    shape = (scene.bodies, dimension)
    change = (after - before).reshape(shape)
    assert np.abs(change).max() > 0.1
    np.testing.assert_allclose(change.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(angular_momentum(q.reshape(shape), change), 0.0, atol=1e-13)


def broken(operator: str, order: str, listed: list[int]) -> np.ndarray:
    """A cue ball of mass 2 meets two touching ones at once; in which order the contacts are listed is `listed`."""
    side = np.sqrt(3.0) / 2
    scene = deli.Scene(
        mass=[2.0, 1.0, 1.0],
        position=[[-side, 0.0], [0.0, 0.5], [0.0, -0.5]],
        momentum=[[2.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
        unilateral=deli.SpheresApart(pairs=[[(0, 1), (0, 2), (1, 2)][k] for k in listed], distance=1.0),
        dimension=2,
    )
    return deli.reflect(scene, scene.position, scene.momentum, operator, order=order).reshape(3, 2)


@REFLECTION
def test_only_the_sequential_operator_depends_on_the_order_of_contacts(operator: str, order: str) -> None:
    first, second = broken(operator, order, [0, 1, 2]), broken(operator, order, [2, 1, 0])
    mirrored = first[[0, 2, 1]] * [1.0, -1.0]
    depends = not np.allclose(first, second, atol=1e-12)
    lopsided = not np.allclose(first, mirrored, atol=1e-12)
    assert depends == lopsided == (operator == "sequential")


@REFLECTION
@SKIP
@pytest.mark.parametrize("bodies", [1, 1001])
def test_a_ball_between_two_walls_is_refused(operator: str, order: str, skip: bool, bodies: int) -> None:
    """However many others there are."""
    scene = deli.Scene(
        mass=1.0,
        position=np.zeros(bodies),
        momentum=np.ones(bodies),
        unilateral=deli.Planes(normals=[[1.0], [-1.0]], bodies=[0, 0]),
        dimension=1,
    )
    with pytest.raises(deli.StepError, match="turns back and forth between 2 contacts"):
        deli.reflect(scene, scene.position, scene.momentum, operator, order=order, skip=skip)
