"""A step preserves dq∧dp on smooth intervals (Theorem 5.1), without constraints and on the constrained phase space.

Tangent vectors of the constrained phase space are followed by retracted curves; central differences with Richardson's
extrapolation leave about 1e-12: the rounding of a step, 1e-15, over the reach of the differences, 1e-3.
"""

from dataclasses import replace

import numpy as np
import pytest
from law_cases import SCHEMES, double_pendulum
from law_geometry import HeldConstraints, Step, symplectic_defect
from law_runs import run

import deli

TOLERANCE = 1e-11
SCHEME = pytest.mark.parametrize("scheme", SCHEMES)
SCENES = {
    "spring_sphere": (lambda: deli.scenes.spring_sphere(start="mixed"), 0.3),
    "nonlinear_oscillator": (deli.scenes.nonlinear_oscillator, 0.05),
    "pogo_stick": (lambda: deli.scenes.pogo_stick(momentum=(0.5, -1.0)), 0.1),
}


def free(scene: deli.Scene) -> deli.Scene:
    return replace(scene, unilateral=None, bilateral=None)


def defect(method: object, held: HeldConstraints, h: float, q: np.ndarray, p: np.ndarray) -> float:
    stepper = method.stepper(held.scene, h, solvers="daqp")
    return symplectic_defect(held, stepper.step, q, p)


@SCHEME
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", [deli.GVI, deli.DiscreteSmooth])
def test_unconstrained_steps(name: str, scheme: str, method: type) -> None:
    build, h = SCENES[name]
    scene = free(build())
    assert defect(method(scheme=scheme), HeldConstraints(scene), h, scene.position, scene.momentum) < TOLERANCE


@SCHEME
def test_free_chain_in_space(scheme: str) -> None:
    scene = free(deli.scenes.lennard_jones(spheres=3))
    assert defect(deli.GVI(scheme=scheme), HeldConstraints(scene), 0.01, scene.position, scene.momentum) < TOLERANCE


def swinging_cradle() -> tuple[deli.Scene, np.ndarray, np.ndarray]:
    """Balls that have swung apart, no two of them in reach of each other within a step."""
    scene = deli.scenes.newtons_cradle(balls=3, pulled=0)
    angles, rates = np.array([-0.6, 0.0, 0.5]), np.array([0.4, 0.3, 0.7])
    pivots = scene.position + np.tile([0.0, 1.0], 3)
    q = pivots + np.stack([np.sin(angles), -np.cos(angles)], axis=1).ravel()
    p = (rates[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)).ravel()
    return scene, q, p


@SCHEME
@pytest.mark.parametrize("method", [deli.GVI, deli.DiscreteSmooth])
def test_bilateral_constraints(scheme: str, method: type) -> None:
    pendulum = double_pendulum()
    held = HeldConstraints(pendulum)
    assert defect(method(scheme=scheme), held, 0.03, pendulum.position, pendulum.momentum) < TOLERANCE

    cradle, q, p = swinging_cradle()
    assert defect(method(scheme=scheme), HeldConstraints(cradle), 0.02, q, p) < TOLERANCE


@SCHEME
def test_chain_on_rods_in_space(scheme: str) -> None:
    scene = deli.scenes.lennard_jones(spheres=4)
    assert defect(deli.GVI(scheme=scheme), HeldConstraints(scene), 0.01, scene.position, scene.momentum) < TOLERANCE


@SCHEME
@pytest.mark.parametrize("method", [deli.GVI, deli.DiscreteSmooth])
@pytest.mark.parametrize(("start", "pressed"), [("smooth", (0, 1)), ("mixed", (1,))])
def test_pressed_contacts(scheme: str, method: type, start: str, pressed: tuple[int, ...]) -> None:
    scene = deli.scenes.spring_sphere(start=start)
    stepper = method(scheme=scheme).stepper(scene, 0.3, solvers="daqp")

    def step(q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        stepper.stats.reset()
        moved = stepper.step(q, p)
        assert stepper.stats.smooth_contacts == len(pressed)
        assert stepper.stats.reflected_contacts == 0
        assert np.abs(scene.unilateral.value(moved[0])[list(pressed)]).max() < 1e-13
        return moved

    held = HeldConstraints(scene, pressed)
    assert symplectic_defect(held, step, scene.position, scene.momentum) < TOLERANCE


@pytest.mark.parametrize("shrink", [1e-8, 1e-4])
def test_a_step_that_loses_momentum_is_found_out(shrink: float) -> None:
    pendulum, sphere = double_pendulum(), deli.scenes.spring_sphere()
    for held, h in (
        (HeldConstraints(free(sphere)), 0.3),
        (HeldConstraints(pendulum), 0.03),
        (HeldConstraints(sphere, (0, 1)), 0.3),
    ):
        step = deli.DiscreteSmooth().stepper(held.scene, h, solvers="daqp").step

        def damped(q: np.ndarray, p: np.ndarray, step: Step = step) -> tuple[np.ndarray, np.ndarray]:
            moved, carried = step(q, p)
            return moved, (1.0 - shrink) * carried

        found = symplectic_defect(held, damped, held.scene.position, held.scene.momentum)
        assert found == pytest.approx(shrink, rel=1e-3)
        assert found > TOLERANCE


def test_explicit_euler_is_found_out() -> None:
    scene = free(deli.scenes.nonlinear_oscillator())

    def euler(q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return q + 0.05 * p / scene.mass, p - 0.05 * scene.potential.gradient(q)

    assert symplectic_defect(HeldConstraints(scene), euler, scene.position, scene.momentum) > 1e-3


def test_the_retraction_reaches_the_constrained_phase_space() -> None:
    scene = double_pendulum()
    held = HeldConstraints(scene)
    rng = np.random.default_rng(1)
    q, p = held.retract(scene.position + 0.05 * rng.standard_normal(4), scene.momentum + 0.05 * rng.standard_normal(4))
    assert np.abs(held.value(q)).max() < 1e-15
    assert np.abs(held.jacobian(q) @ (p / scene.mass)).max() < 1e-14
    moving = run(scene, deli.GVI(), 0.03, 20)
    assert np.abs(moving.position - scene.position).max() > 0.1
    assert len(held.tangents(q, p)) == 4
