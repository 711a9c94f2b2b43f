"""Clusters of touching bodies whose reflection is known, and the momentum maps of any cluster."""

import numpy as np
import pytest
from law_cases import BACKEND, ENERGIES, OPERATORS, SKIP
from law_runs import angular_momentum

import deli

OPERATOR = pytest.mark.parametrize("operator", OPERATORS)
ENERGY = pytest.mark.parametrize("energy", ENERGIES)


@OPERATOR
def test_planes_in_each_dimension(operator: str) -> None:
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
        after = deli.reflect(scene, scene.position, scene.momentum, operator)
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


@OPERATOR
@ENERGY
@SKIP
@pytest.mark.parametrize("dimension", [2, 3])
def test_reflection_conserves_linear_and_angular_momentum(
    dimension: int, operator: str, energy: str, skip: bool
) -> None:
    scene = pile(dimension)
    assert all(scene.symmetry.linear + scene.symmetry.angular)
    q, before = scene.position, scene.momentum
    after = deli.reflect(scene, q, before, operator, energy, step_size=0.2, skip=skip)
    shape = (scene.bodies, dimension)
    change = (after - before).reshape(shape)
    assert np.abs(change).max() > 0.1
    np.testing.assert_allclose(change.sum(axis=0), 0.0, atol=1e-13)
    np.testing.assert_allclose(angular_momentum(q.reshape(shape), change), 0.0, atol=1e-13)


def broken(operator: str, order: list[int]) -> np.ndarray:
    """A cue ball of mass 2 meets two touching ones at once; which contact is listed first is `order`."""
    side = np.sqrt(3.0) / 2
    scene = deli.Scene(
        mass=[2.0, 1.0, 1.0],
        position=[[-side, 0.0], [0.0, 0.5], [0.0, -0.5]],
        momentum=[[2.0, 0.0], [0.0, 0.0], [0.0, 0.0]],
        unilateral=deli.SpheresApart(pairs=[[(0, 1), (0, 2), (1, 2)][k] for k in order], distance=1.0),
        dimension=2,
    )
    return deli.reflect(scene, scene.position, scene.momentum, operator).reshape(3, 2)


@OPERATOR
def test_only_the_sequential_operator_depends_on_the_order_of_contacts(operator: str) -> None:
    first, second = broken(operator, [0, 1, 2]), broken(operator, [2, 1, 0])
    mirrored = first[[0, 2, 1]] * [1.0, -1.0]
    depends = not np.allclose(first, second, atol=1e-12)
    lopsided = not np.allclose(first, mirrored, atol=1e-12)
    assert depends == lopsided == (operator == "sequential")


@OPERATOR
@SKIP
def test_a_ball_between_two_walls_is_refused(operator: str, skip: bool) -> None:
    scene = deli.Scene(
        mass=1.0, position=[0.0], momentum=[1.0], unilateral=deli.Planes(normals=[[1.0], [-1.0]], bodies=[0, 0])
    )
    with pytest.raises(deli.StepError, match="reflection"):
        deli.reflect(scene, scene.position, scene.momentum, operator, skip=skip)
