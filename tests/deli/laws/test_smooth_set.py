"""𝕊 (7.1) is judged by the momentum after the reflection: what comes to rest presses, what was at rest may leave."""

import numpy as np
import pytest
from law_cases import BACKEND, SKIP
from law_reference import Reference

import deli

STEP_SIZE = 0.01


def row(attraction: float) -> deli.Scene:
    """A ball runs into two that touch: it comes to rest, the last one leaves. A spring draws the first two together."""
    return deli.Scene(
        mass=1.0,
        position=[-1.0, 0.0, 1.0],
        momentum=[1.0, 0.0, 0.0],
        potential=deli.Springs(pairs=[(0, 1)], stiffness=attraction, rest_length=0.5),
        unilateral=deli.SpheresApart(pairs=[(0, 1), (1, 2)], distance=1.0),
    )


@BACKEND
@SKIP
@pytest.mark.parametrize("attraction", [5.0, -5.0])
def test_smooth_after_a_reflection(attraction: float, backend: str, skip: bool) -> None:
    scene = row(attraction)
    stepper = deli.GVI().stepper(scene, STEP_SIZE, solvers=backend, skip=skip)
    x, p = stepper.step(scene.position, scene.momentum)
    assert stepper.stats.reflected_contacts == 2
    assert stepper.stats.smooth_contacts == 1

    reference, reflected, smooth = Reference(scene, "midpoint", STEP_SIZE), scene.momentum[::-1], np.array([0])
    expected, forces = reference.move(scene.position, reflected, smooth)
    assert (forces[0] > 1e-6) == (attraction > 0.0)
    np.testing.assert_allclose(x, expected, atol=1e-13)
    np.testing.assert_allclose(p, reference.project(scene.position, expected, smooth), atol=1e-11)
    assert scene.unilateral.value(x).min() >= -1e-14
    assert scene.unilateral.value(x)[1] == pytest.approx(STEP_SIZE, rel=2e-2)


def test_a_contact_that_touches_and_approaches_is_not_smooth() -> None:
    scene = deli.scenes.point_mass(position=0.0, momentum=-1.0)
    stepper = deli.GVI().stepper(scene, STEP_SIZE)
    _, p = stepper.step(scene.position, scene.momentum)
    assert stepper.stats.reflected_contacts == 1
    assert stepper.stats.smooth_contacts == 0
    assert p[0] == pytest.approx(1.0 - 9.8 * STEP_SIZE)


def test_a_contact_that_neither_presses_nor_opens_is_held() -> None:
    """It slides from where no force presses it to where one does, which the momentum there does not follow."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.0, 0.0],
        momentum=[1.0, 0.0],
        potential=deli.Potential(energy=lambda q: q[0] * q[1], gradient=lambda q: q[::-1].copy()),
        unilateral=deli.Planes(normals=[0.0, 1.0], bodies=[0]),
        dimension=2,
    )
    stepper = deli.GVI(scheme="verlet").stepper(scene, STEP_SIZE)
    x, p = stepper.step(scene.position, scene.momentum)
    np.testing.assert_array_equal(x, [STEP_SIZE, 0.0])
    np.testing.assert_array_equal(p, [1.0, 0.0])


def test_a_ball_at_rest_on_the_floor_stays() -> None:
    scene = deli.scenes.point_mass(position=0.0)
    stepper = deli.GVI().stepper(scene, STEP_SIZE)
    q, p = scene.position, scene.momentum
    for _ in range(50):
        q, p = stepper.step(q, p)
        assert stepper.stats.smooth_contacts == 1
    assert stepper.stats.reflected_contacts == 0
    assert abs(q[0]) <= 1e-13
    assert p[0] == 0.0


def test_a_ball_at_rest_above_the_floor_does_not_approach_it() -> None:
    """What it falls in a step is more than its height, and there is no momentum yet to reflect."""
    scene = deli.scenes.point_mass(position=0.01, momentum=0.0)
    stepper = deli.GVI("verlet").stepper(scene, 0.1)
    q, p = stepper.step(scene.position, scene.momentum)
    np.testing.assert_allclose([q[0], p[0] / scene.mass[0]], [0.01 - 4.9 * 0.1**2, -9.8 * 0.1], rtol=1e-13)
    _, p = stepper.step(q, p)
    assert stepper.stats.reflected_contacts == 1
    assert abs(p[0]) <= 1e-13  # turned back, and slowed down by the next step's fall
