"""Steps and reflections feel each potential as its family defines it."""

import numpy as np
import pytest
from mechanics_cases import BODIES, DIMENSIONS, POTENTIALS, layout, spread

import deli
from deli.mechanics.energies import reflection_metric
from deli.mechanics.schemes import SCHEMES

STEP_SIZE = 0.005  # for which all numerical Hamiltonians are positive definite

every_potential = pytest.mark.parametrize("name", POTENTIALS)
dimensions = pytest.mark.parametrize("dimension", DIMENSIONS)


def scene(name: str, dimension: int, unilateral=()) -> deli.Scene:
    random = np.random.default_rng(dimension)
    position = spread(dimension) + random.uniform(-0.4, 0.4, BODIES * dimension)
    return deli.Scene(
        mass=layout(dimension).mass[::dimension],
        position=position,
        momentum=random.normal(size=position.size),
        potential=[POTENTIALS[name](dimension)],
        unilateral=unilateral,
        dimension=dimension,
    )


@every_potential
@dimensions
def test_a_step_is_driven_by_the_gradient(name: str, dimension: int) -> None:
    free = scene(name, dimension)
    q, p, potential, h = free.position, free.momentum, free.potential, STEP_SIZE
    x, y = deli.DiscreteSmooth("verlet").stepper(free, h).step(q, p)
    middle = p - 0.5 * h * potential.gradient(q)
    expected = q + h * middle / free.mass
    np.testing.assert_allclose(x, expected, rtol=1e-12)
    np.testing.assert_allclose(y, middle - 0.5 * h * potential.gradient(expected), rtol=0, atol=1e-11 * abs(y).max())


@every_potential
@dimensions
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("body", range(BODIES))
def test_a_numerical_reflection_is_bent_by_the_hessian(name: str, dimension: int, scheme: str, body: int) -> None:
    at = scene(name, dimension).position.reshape(BODIES, dimension)[body]
    normal = np.arange(1.0, dimension + 1.0) / np.linalg.norm(np.arange(1.0, dimension + 1.0))
    struck = scene(name, dimension, [deli.Planes(normal, offsets=normal @ at, bodies=[body])])
    gradient = struck.unilateral.jacobian(struck.position)[0]
    p = struck.momentum - (gradient @ struck.momentum + 1.0) * gradient
    W = reflection_metric(struck, SCHEMES[scheme], struck.position, STEP_SIZE)
    expected = p - 2.0 * (gradient @ W @ p) / (gradient @ W @ gradient) * gradient
    turned = deli.reflect(struck, struck.position, p, energy="numerical", scheme=scheme, step_size=STEP_SIZE)
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-11 * abs(p).max())
    assert gradient @ (turned - p) > 1.0
