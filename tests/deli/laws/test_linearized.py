"""Linearized constraints: nothing changes where they are affine, and elsewhere the step obeys their tangents."""

from dataclasses import replace

import numpy as np
import pytest
from law_cases import PREDICTORS, SCHEMES, double_pendulum
from law_reference import Reference
from law_runs import difference, run

import deli

STEP_SIZE = 0.02
DOWN, UP = np.array([1.0, -0.5]) / np.hypot(1.0, 0.5), np.array([0.5, 1.0]) / np.hypot(1.0, 0.5)
ROPE = np.concatenate([-DOWN, DOWN, [0.0, 0.0]])[np.newaxis]

SCHEME = pytest.mark.parametrize("scheme", SCHEMES)
AS_FUNCTIONS = pytest.mark.parametrize("as_functions", [False, True], ids=["families", "functions"])


def functions(stack: object) -> list[deli.Constraints]:
    """The same constraints, of which only values and gradients are known."""
    return [deli.Constraints(value=stack.value, jacobian=stack.jacobian)]


def sledges() -> deli.Scene:
    """On a slope two masses slide, on a rope that is always taut along it; a third falls onto it."""
    return deli.Scene(
        mass=[1.0, 2.0, 0.5],
        position=[0.0 * DOWN, DOWN, 2.0 * DOWN + 0.2 * UP],
        momentum=[0.3 * DOWN, 0.6 * DOWN, [0.1, -1.0]],
        potential=[deli.Gravity([0.0, -9.8]), deli.Springs(pairs=[(1, 2)], stiffness=3.0, rest_length=0.5)],
        unilateral=[deli.Planes(normals=[UP] * 3, bodies=[0, 1, 2])],
        bilateral=[deli.Constraints(value=lambda q: ROPE @ q - 1.0, jacobian=lambda q: ROPE)],
        dimension=2,
    )


@SCHEME
@AS_FUNCTIONS
@pytest.mark.parametrize("predictor", PREDICTORS)
def test_affine_constraints_are_their_own_tangents(scheme: str, predictor: str, as_functions: bool) -> None:
    scene = sledges()
    if as_functions:
        scene = replace(scene, unilateral=functions(scene.unilateral))
    plain, linearized = (
        run(scene, deli.GVI(scheme=scheme, predictor=predictor, linearized=each), STEP_SIZE, 60)
        for each in (False, True)
    )
    assert plain.smooth.max() >= 2
    assert plain.reflected.sum() >= 1
    np.testing.assert_array_equal(linearized.smooth, plain.smooth)
    np.testing.assert_array_equal(linearized.reflected, plain.reflected)
    assert difference(plain, linearized) < 1e-10


@SCHEME
@AS_FUNCTIONS
def test_a_contact_that_lands_keeps_its_gap(scheme: str, as_functions: bool) -> None:
    scene = deli.Scene(
        mass=[2.0],
        position=1e-3 * UP,
        momentum=0.3 * DOWN,
        potential=[deli.Gravity([0.0, -9.8])],
        unilateral=[deli.Planes(normals=[UP], bodies=[0])],
        dimension=2,
    )
    if as_functions:
        scene = replace(scene, unilateral=functions(scene.unilateral))
    method = deli.GVI(scheme=scheme, predictor="closed_loop", linearized=True)
    found = run(scene, method, STEP_SIZE, 5)
    np.testing.assert_allclose(scene.unilateral.value(found.position), 1e-3, rtol=1e-10)


@SCHEME
@AS_FUNCTIONS
def test_a_step_obeys_the_tangents_at_the_prediction(scheme: str, as_functions: bool) -> None:
    scene = double_pendulum()
    if as_functions:
        scene = replace(scene, bilateral=functions(scene.bilateral))
    reference = Reference(scene, scheme, STEP_SIZE)
    stepper = deli.GVI(scheme=scheme, linearized=True).stepper(scene, STEP_SIZE)
    q, p = scene.position, scene.momentum
    for _ in range(20):
        x, y = stepper.step(q, p)
        at = reference.predict(q, p)
        across = scene.bilateral.jacobian(at)
        np.testing.assert_allclose(scene.bilateral.value(at) + across @ (x - at), 0.0, atol=1e-11)
        impulse = scene.mass * (x - q) / STEP_SIZE - p - reference.force(q, x)
        later = scene.mass * (x - q) / STEP_SIZE - y + reference.force(x, q)
        for pull in (impulse, later):
            unexplained = pull - across.T @ np.linalg.lstsq(across.T, pull, rcond=None)[0]
            np.testing.assert_allclose(unexplained, 0.0, atol=1e-10 * np.abs(p).max())
        np.testing.assert_allclose(across @ (y / scene.mass), 0.0, atol=1e-11)
        assert np.abs(impulse).max() > 1e-3
        q, p = x, y
