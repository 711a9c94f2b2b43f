"""A closed loop leaves no violation, at the energy band and drift of the forward predictor (docs/explanation)."""

import dataclasses
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from law_cases import BACKEND, ENERGIES, MANY_BODIES, REFLECTION, SCHEMES, SELECTIONS, SHADOWS, Case, crowded_chain
from law_runs import Run, angular_momentum, run
from random_scenes import random_scene

import deli

ADMISSIBLE = -1e-12
TOLERANCE = 1e-8  # the contact tolerance, in lengths of the scene
ENERGY = pytest.mark.parametrize("energy", ENERGIES)


def both(scene: deli.Scene, step_size: float, duration: float, **options: str) -> tuple[Run, Run]:
    steps = round(duration / step_size)
    methods = (deli.GVI(predictor=predictor, **options) for predictor in ("forward", "closed_loop"))
    forward, closed = (run(scene, method, step_size, steps) for method in methods)
    return forward, closed


def error(of: Run) -> float:
    return float(np.abs(of.energy - of.energy[0]).max())


def apart(scene: deli.Scene) -> deli.Scene:
    """Bodies of the impact set with some room between them, so that one step meets several impacts."""
    return dataclasses.replace(scene, position=1.02 * scene.position)


PAPER = [
    Case("point_mass", deli.scenes.point_mass, 0.01, 300),
    Case("pogo_stick", deli.scenes.pogo_stick, 0.1, 300, "verlet"),
    Case("low_pogo_stick", lambda: deli.scenes.pogo_stick(position=(5.0, 0.01)), 0.1, 300, "verlet"),
    Case("spring_sphere_smooth", lambda: deli.scenes.spring_sphere(start="smooth"), 0.5, 200),
    Case("spring_sphere_mixed", lambda: deli.scenes.spring_sphere(start="mixed"), 0.5, 400),
    Case("nonlinear_oscillator", deli.scenes.nonlinear_oscillator, 0.1, 200),
    Case("newtons_cradle", deli.scenes.newtons_cradle, 0.02, 200),
    Case("lennard_jones", deli.scenes.lennard_jones, 0.01, 300, "verlet"),
    Case("lennard_jones_crowded", crowded_chain, 0.01, 300, "verlet"),
    Case("wedge", lambda: deli.scenes.wedge(walls=3, spread=2.8, position=(0.05, 1.0)), 0.02, 200),
    Case("impacts_cradle", lambda: apart(deli.impacts.cradle(5)), 0.3, 20),
    Case("impacts_bernoulli", lambda: apart(deli.impacts.bernoulli()), 0.3, 20),
    Case("impacts_rack", lambda: apart(deli.impacts.rack(4)), 0.3, 20),
]


@pytest.mark.parametrize("case", [pytest.param(case, id=case.name) for case in PAPER + MANY_BODIES])
@pytest.mark.parametrize("energy", [*ENERGIES, *SHADOWS])
def test_every_scene_is_admissible_and_keeps_its_momenta(case: Case, energy: str) -> None:
    scene = case.build()
    of = run(scene, deli.GVI(scheme=case.scheme, energy=energy, predictor="closed_loop"), case.step_size, case.steps)
    assert of.gap >= ADMISSIBLE * scene.length_scale
    if scene.bilateral.rows:
        assert np.abs(scene.bilateral.value(of.position)).max() <= 1e-10 * scene.length_scale
    position, momentum = (
        states.reshape(of.steps + 1, scene.bodies, scene.dimension) for states in (of.position, of.momentum)
    )
    size = np.abs(momentum).max() * scene.bodies
    linear = momentum.sum(axis=1)[:, list(scene.symmetry.linear)]
    np.testing.assert_allclose(linear, np.broadcast_to(linear[0], linear.shape), atol=1e-11 * size)
    if not any(scene.symmetry.angular):
        return
    angular = angular_momentum(position, momentum)[:, list(scene.symmetry.angular)]
    atol = 1e-11 * size * np.abs(position).max()
    np.testing.assert_allclose(angular, np.broadcast_to(angular[0], angular.shape), atol=atol)


@pytest.mark.parametrize("name", ["low_pogo_stick", "spring_sphere_mixed", "newtons_cradle", "impacts_rack"])
@BACKEND
def test_every_backend_is_admissible_to_the_contact_tolerance(name: str, backend: str) -> None:
    case = next(case for case in PAPER if case.name == name)
    scene, method = case.build(), deli.GVI(scheme=case.scheme, predictor="closed_loop")
    of = run(scene, method, case.step_size, 20, solvers=backend)
    assert of.gap >= -TOLERANCE * scene.length_scale


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.randoms(), st.sampled_from(SCHEMES), st.sampled_from(SELECTIONS), st.sampled_from([*ENERGIES, *SHADOWS]))
def test_random_scenes_are_admissible_or_say_why_not(
    random: Random, scheme: str, selection: tuple[str, str], energy: str
) -> None:
    scene, step_size = random_scene(random)
    method = deli.GVI(scheme, *selection[:1], energy=energy, predictor="closed_loop", order=selection[1])
    check(scene, method, step_size, 30)


@pytest.mark.parametrize("begin", range(0, 300, 100))
def test_most_random_scenes_do_not_give_up(begin: int) -> None:
    outcomes = []
    for seed in range(begin, begin + 100):
        scene, step_size = random_scene(Random(seed))
        method = deli.GVI(SCHEMES[seed % 2], predictor="closed_loop")
        outcomes.append(check(scene, method, step_size, 100))
    assert sum(outcomes) >= 97


def check(scene: deli.Scene, method: deli.GVI, step_size: float, steps: int) -> bool:
    """Step on, and say whether all steps were taken; the position update is all that may give up."""
    stepper = method.stepper(scene, step_size)
    q, p = scene.position, scene.momentum
    gave_up = ""
    for _ in range(steps):
        try:
            q, p = stepper.step(q, p)
        except deli.StepError as outcome:
            gave_up = str(outcome)
            break
        assert scene.unilateral.value(q).min(initial=0.0) >= -1e-10 * scene.length_scale
        assert np.abs(scene.bilateral.value(q)).max(initial=0.0) <= 1e-9 * scene.length_scale
    assert gave_up.startswith("position: ") or not gave_up
    return not gave_up


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


@ENERGY
def test_low_pogo_stick_lands(energy: str) -> None:
    """A bounce shorter than the step, at every step: forward sinks in, the closed loop lands."""
    scene = deli.scenes.pogo_stick(position=(5.0, 0.01))
    forward, closed = both(scene, 0.1, 200.0, scheme="verlet", energy=energy)
    assert forward.gap < -3e-2
    assert closed.gap >= ADMISSIBLE
    assert np.ptp(closed.energy) < 0.5 * np.ptp(forward.energy)


@pytest.mark.long
@pytest.mark.parametrize(
    ("energy", "forward_error", "closed_error"), [("hamiltonian", 0.85, 0.93), ("numerical", 0.17, 0.165)]
)
def test_mixed_spring_sphere_lands(energy: str, forward_error: float, closed_error: float) -> None:
    forward, closed = both(deli.scenes.spring_sphere(start="mixed"), 0.5, 1000.0, energy=energy)
    assert forward.gap < -5e-4
    assert closed.gap >= ADMISSIBLE
    assert error(forward) == pytest.approx(forward_error, abs=0.01)
    assert error(closed) == pytest.approx(closed_error, abs=0.01)


@pytest.mark.long
@ENERGY
def test_mean_energies_of_an_ensemble_are_as_near_as_the_forward_predictors(energy: str) -> None:
    """Single runs are chaotic; over many starts the band is no wider and the drift no larger than their scatter."""
    variants = [deli.scenes.pogo_stick(position=(5.0 + low, low)) for low in np.linspace(0.005, 0.1, 32)]
    bands, gains = [], []
    for predictor in ("forward", "closed_loop"):
        method = deli.GVI("verlet", energy=energy, predictor=predictor)
        record = deli.simulate_ensemble(variants, method, step_size=0.1, duration=1000.0)["trajectory"]
        hamiltonian = record["hamiltonian"].values
        bands.append(np.ptp(hamiltonian, axis=1).mean())
        slopes = [deli.metrics.drift(record["time"].values, member).slope for member in hamiltonian]
        gains.append(1000.0 * np.sqrt(np.mean(np.square(slopes))))
    assert bands[1] <= bands[0]
    assert gains[1] <= 0.05  # of an energy of 50


@REFLECTION
def test_every_operator_closes_the_loop(operator: str, order: str) -> None:
    _, closed = both(deli.scenes.newtons_cradle(), 0.02, 3.0, reflection=operator, order=order)
    assert closed.reflected.sum() > 0
    assert closed.gap >= ADMISSIBLE
