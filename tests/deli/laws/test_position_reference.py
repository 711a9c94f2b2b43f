"""The position update (7.3, 7.4, 7.8) against a dense semismooth Newton solver, on random smooth states."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from law_cases import BACKEND, SCHEMES, SKIP
from law_reference import Reference

import deli
import solvers
from solvers import registry

State = tuple[deli.Scene, np.ndarray, np.ndarray]
SCHEME = pytest.mark.parametrize("scheme", SCHEMES)


def sliding(rng: np.random.Generator) -> State:
    """Two masses on the circle, moving along it; the spring and the repulsion press each on or pull it off."""
    first = rng.uniform(0.0, 2 * np.pi)
    angles = np.array([first, first + rng.uniform(0.5, np.pi)])
    rates = rng.normal(0.0, 0.3, 2)
    outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    scene = deli.scenes.spring_sphere(
        mass=rng.uniform(0.5, 2.0, 2),
        repulsion=rng.uniform(0.0, 60.0),
        stiffness=rng.uniform(0.1, 2.0),
        rest_length=rng.uniform(0.5, 6.0),
        position=5.0 * outward,
    )
    along = np.stack([-outward[:, 1], outward[:, 0]], axis=1)
    momentum = 5.0 * scene.mass.reshape(2, 2) * rates[:, None] * along
    return scene, scene.position, momentum.ravel()


def swinging(rng: np.random.Generator) -> State:
    """Groups of touching balls of the cradle, each swinging as one; springs press neighbours together or apart."""
    balls = 5
    group = np.cumsum(np.concatenate(([0], rng.integers(0, 2, balls - 1))))
    start, gap = rng.uniform(-0.6, 0.2), rng.uniform(0.1, 0.3)
    rates = np.sort(rng.normal(0.0, 0.5, balls))[group]
    angles = start + gap * group
    scene = deli.scenes.newtons_cradle(balls=balls, pulled=0, mass=rng.uniform(0.5, 2.0, balls))
    neighbours = [(ball, ball + 1) for ball in range(balls - 1)]
    springs = deli.Springs(neighbours, stiffness=20.0, rest_length=rng.uniform(0.3, 0.7, balls - 1))
    scene = replace(scene, potential=[*scene.potential.families, springs])
    pivots = scene.position.reshape(balls, 2) + np.array([0.0, 1.0])
    position = pivots + np.stack([np.sin(angles), -np.cos(angles)], axis=1)
    velocity = rates[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return scene, position.ravel(), scene.mass * velocity.ravel()


KINDS = {"sliding": (sliding, 0.2), "swinging": (swinging, 0.02)}
KIND = pytest.mark.parametrize("kind", KINDS)


def compare(kind: str, scheme: str, seeds: range, **options) -> np.ndarray:
    """Assert that deli's step is the reference's; return how many contacts stayed pressed and were let go."""
    draw, step_size = KINDS[kind]
    pressed = np.zeros(2, dtype=int)
    for seed in seeds:
        scene, q, p = draw(np.random.default_rng(seed))
        stepper = deli.GVI(scheme=scheme).stepper(scene, step_size, **options)
        x, y = stepper.step(q, p)
        smooth = np.flatnonzero(np.abs(scene.unilateral.value(q)) <= 1e-8)
        assert stepper.stats.reflected_contacts == 0
        assert stepper.stats.smooth_contacts == len(smooth)
        reference = Reference(scene, scheme, step_size)
        expected, forces = reference.move(q, p, smooth)
        np.testing.assert_allclose(x, expected, rtol=0, atol=1e-10 * scene.length_scale)
        # Momenta differ by positions over the step size.
        atol = 1e-10 * scene.length_scale * scene.mass.max() / step_size
        np.testing.assert_allclose(y, reference.project(q, expected, smooth), rtol=0, atol=atol)
        held = forces > 1e-9
        pressed += [held.sum(), (~held).sum()]
    return pressed


@KIND
@SCHEME
@SKIP
def test_random_smooth_states(kind: str, scheme: str, skip: bool) -> None:
    pressed, let_go = compare(kind, scheme, range(20), skip=skip)
    assert pressed >= 5
    assert let_go >= 5


@KIND
@BACKEND
def test_random_smooth_states_with_every_backend(kind: str, backend: str) -> None:
    compare(kind, "midpoint", range(100, 103), skip=False, solvers=backend)


class Tiring(solvers.Backend):
    """Answers as `daqp` does, but for an error that grows from solve to solve."""

    name, sparse = "tiring", False

    def __init__(self, program: solvers.QuadraticProgram, tolerance: float, options: Mapping[str, Any]) -> None:
        self._inner, self._error = registry.factory("daqp")(program, tolerance, options), 1e-12

    def update(self) -> None:
        self._inner.update()

    def solve(self) -> solvers.Answer:
        answer, error = self._inner.solve(), self._error
        self._error = min(100.0 * error, 1e-7)
        return answer._replace(x=answer.x + error)


@pytest.fixture
def tiring() -> Iterator[str]:
    registry.register("tiring", Tiring)
    yield "tiring"
    registry.unregister("tiring")


@SCHEME
@SKIP
def test_the_best_iterate_is_kept(tiring: str, scheme: str, skip: bool) -> None:
    """One body slides, another flies."""
    scene = deli.Scene(
        mass=[1.0, 2.0],
        position=[[0.0, 0.0], [1.0, 5.0]],
        momentum=[[1.0, 0.0], [2.0, 1.0]],
        potential=[deli.Gravity([0.0, -9.8])],
        unilateral=deli.Planes(normals=[0.0, 1.0], bodies=[0]),
        dimension=2,
    )
    choice = {"backend": tiring, "tolerance": 1e-6, "polish": False}
    stepper = deli.GVI(scheme=scheme).stepper(scene, 0.1, skip=skip, solvers={"position": choice})
    x, _ = stepper.step(scene.position, scene.momentum)
    assert stepper.stats.solves[1] >= 4
    move = 0.1 * scene.momentum / scene.mass + [0.0, 0.0, 0.0, -0.5 * 9.8 * 0.1**2]
    np.testing.assert_allclose(x, scene.position + move, rtol=0, atol=1e-11)
