"""A closed loop leaves no violation (theory of admissible steps) at the energy error of the forward predictor."""

import numpy as np
import pytest
from law_cases import REFLECTION
from law_runs import Run, run

import deli

ADMISSIBLE = -1e-12


def both(scene: deli.Scene, step_size: float, duration: float, **options: str) -> tuple[Run, Run]:
    steps = round(duration / step_size)
    methods = (deli.GVI(predictor=predictor, **options) for predictor in ("forward", "closed_loop"))
    forward, closed = (run(scene, method, step_size, steps) for method in methods)
    return forward, closed


def error(of: Run) -> float:
    return float(np.abs(of.energy - of.energy[0]).max())


@pytest.mark.parametrize("step_size", [0.03, 0.02, 0.01, 0.005])
def test_cradle(step_size: float) -> None:
    forward, closed = both(deli.scenes.newtons_cradle(), step_size, 6.0)
    assert forward.gap < -step_size  # about as deep as a ball falls in a step
    assert closed.gap >= ADMISSIBLE
    assert error(closed) == pytest.approx(error(forward), rel=0.01)


@pytest.mark.long
def test_cradle_at_length() -> None:
    forward, closed = both(deli.scenes.newtons_cradle(), 0.01, 60.0)
    violations = (forward.scene.unilateral.value(forward.position).min(axis=1) < ADMISSIBLE).mean()
    assert forward.gap == pytest.approx(-1.9e-2, abs=5e-4)
    assert violations == pytest.approx(0.012, abs=1e-3)
    assert closed.gap >= ADMISSIBLE
    assert error(closed) == pytest.approx(1.0e-3, rel=0.02)


def test_low_pogo_stick_lands() -> None:
    """A bounce shorter than the step, at every second step: forward sinks in, the closed loop lands."""
    scene = deli.scenes.pogo_stick(position=(5.0, 0.01))
    forward, closed = both(scene, 0.1, 200.0, scheme="verlet")
    assert forward.gap < -3e-2
    assert closed.gap >= ADMISSIBLE
    assert error(closed) < 1.2 * error(forward)


@pytest.mark.long
def test_mixed_spring_sphere_lands() -> None:
    forward, closed = both(deli.scenes.spring_sphere(start="mixed"), 0.5, 1000.0)
    assert forward.gap == pytest.approx(-9.8e-4, abs=1e-5)
    assert closed.gap >= ADMISSIBLE
    assert error(forward) == pytest.approx(0.85, abs=0.01)
    assert error(closed) == pytest.approx(1.04, abs=0.03)


@REFLECTION
def test_every_operator_closes_the_loop(operator: str, order: str) -> None:
    _, closed = both(deli.scenes.newtons_cradle(), 0.02, 3.0, reflection=operator, order=order)
    assert closed.reflected.sum() > 0
    assert closed.gap >= ADMISSIBLE
