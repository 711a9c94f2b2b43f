"""Steps without impacts are symmetric: turn the momentum round, step as often again, and be where the run began."""

from dataclasses import replace

import numpy as np
import pytest
from law_cases import SCHEMES, double_pendulum
from law_runs import EPSILON, growth, run, sizes

import deli

STEPS = 20


def free(scene: deli.Scene) -> deli.Scene:
    return replace(scene, unilateral=None, bilateral=None)


def hanging_group() -> deli.Scene:
    """Balls of the cradle that swing as one and press on each other, since the last is light."""
    scene = deli.scenes.newtons_cradle(balls=3, pulled=3, angle=0.5)
    rates = np.tile([np.cos(0.5), np.sin(0.5)], 3)
    return replace(scene, momentum=-0.4 * rates)


SMOOTH = {
    "free_spring_sphere": (lambda: free(deli.scenes.spring_sphere(start="mixed")), 0.2),
    "free_oscillator": (lambda: free(deli.scenes.nonlinear_oscillator()), 0.05),
    "free_chain": (lambda: free(deli.scenes.lennard_jones(spheres=3)), 0.01),
    "double_pendulum": (double_pendulum, 0.02),
    "chain_on_rods": (lambda: deli.scenes.lennard_jones(spheres=4), 0.01),
    "cradle_as_one": (hanging_group, 0.02),
    "pressed": (lambda: deli.scenes.spring_sphere(start="smooth"), 0.2),
}


def return_error(method: object, scene: deli.Scene, step_size: float, disturbance: float = 0.0) -> tuple[float, float]:
    """How far a run there and back misses its start, relative to the run, and what its residuals let expect."""
    there = run(scene, method, step_size, STEPS)
    turned = (there.position[-1], -(1.0 + disturbance) * there.momentum[-1])
    back = run(scene, method, step_size, STEPS, start=turned)
    assert there.reflected.sum() == back.reflected.sum() == 0
    assert np.abs(there.position[-1] - there.position[0]).max() > 1e-2 * np.abs(there.position[0]).max()
    length, impulse = sizes(there)
    missed = max(
        np.abs(back.position[::-1] - there.position).max() / length,
        np.abs(back.momentum[::-1] + there.momentum).max() / impulse,
    )
    residual = max(there.residual, back.residual) + 50 * EPSILON
    # A position's residual is divided by the step size on its way into a momentum.
    stiff = max(1.0, length * scene.mass.max() / (step_size * impulse))
    return missed, 2 * STEPS * residual * stiff * growth(back, method, step_size)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("method", [deli.GVI, deli.DiscreteSmooth])
@pytest.mark.parametrize("name", SMOOTH)
def test_steps_turn_back(name: str, method: type, scheme: str) -> None:
    build, step_size = SMOOTH[name]
    missed, expected = return_error(method(scheme=scheme), build(), step_size)
    assert missed <= expected
    missed, _ = return_error(method(scheme=scheme), build(), step_size, disturbance=1e-8)
    assert missed > expected
