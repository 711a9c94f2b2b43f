"""A backend that raises, at whichever solve: the step ends there and says so, and no later one is blamed for it."""

from collections.abc import Iterator

import lies
import numpy as np
import pytest

import deli
import solvers

STEP_SIZE, STEPS = 0.05, 3
METHODS = [
    *(deli.GVI(predictor=predictor) for predictor in ("forward", "closed_loop")),
    *(deli.GVI(energy=energy, predictor="closed_loop") for energy in ("numerical", "shadow4")),
    deli.GVI(reflection="moreau", energy="numerical"),
    deli.GVI(linearized=True),
    deli.DiscreteSmooth("verlet"),
    deli.Newmark(),
    deli.Direct("endpoint"),
    deli.MoreauJean(),
    deli.NonsmoothAlpha(),
    *(deli.Collision(energy=energy) for energy in ("hamiltonian", "discrete")),
    deli.Collision(order=4),
]


class Blown(Exception):
    pass


class Fuse:
    """Counts the solves of a backend, one of which raises."""

    def __init__(self) -> None:
        self.solves, self.blown = 0, 0

    def __call__(self) -> None:
        self.solves += 1
        if self.solves == self.blown:
            raise Blown("out of luck")


@pytest.fixture
def fuse() -> Iterator[Fuse]:
    found = Fuse()
    solvers.register("fused", lies.acting("fused", found))
    yield found
    solvers.unregister("fused")


def swing(above: float) -> deli.Scene:
    """Two masses on a rod, in a quartic well: one touches a floor, or is above it, the other flies against it."""
    return deli.Scene(
        mass=[1.0, 2.0],
        position=[0.0, above, 1.0, above],
        momentum=[0.2, 0.0, 0.4, -1.0],
        dimension=2,
        potential=[deli.Gravity([0.0, -9.8]), deli.RadialPowers([1.0], [4.0], centre=[0.3, 1.0])],
        unilateral=[deli.Planes(normals=[[0.0, 1.0], [0.0, 1.0]], offsets=[0.0, -0.05], bodies=[0, 1])],
        bilateral=[deli.Rods(pairs=[(0, 1)], length=1.0)],
    )


@pytest.mark.parametrize("method", METHODS, ids=str)
def test_a_step_ends_where_its_backend_raises(method: object, fuse: Fuse) -> None:
    scene = swing(0.01 if isinstance(method, deli.Collision) else 0.0)  # where contacts may not rest
    stepper = method.stepper(scene, STEP_SIZE, "fused", False)
    state, solved = (scene.position, scene.momentum), 0
    for _ in range(STEPS):
        begun = fuse.solves
        after = stepper.step(*state)
        counted = fuse.solves - begun
        for solve in range(1, counted + 1):
            fuse.blown = fuse.solves + solve
            with pytest.raises(deli.StepError, match="backend 'fused' raised Blown: out of luck"):
                stepper.step(*state)
            assert fuse.solves == fuse.blown
        for one, other in zip(stepper.step(*state), after, strict=True):
            np.testing.assert_array_equal(one, other)
        state, solved = after, solved + counted
    assert solved > 0


@pytest.mark.long
def test_gradients_are_projected_by_a_backend_that_may_raise(fuse: Fuse) -> None:
    """More rods than compiled code takes: the backend gets their part of (7.7) too."""
    bodies = 152
    scene = deli.Scene(
        mass=1.0,
        position=np.arange(bodies, dtype=float),
        momentum=np.full(bodies, -1.0),
        potential=deli.RadialPowers([1e-3], [4.0]),
        unilateral=deli.Planes(normals=[[1.0]], bodies=[0]),
        bilateral=deli.Rods(pairs=[(k, k + 1) for k in range(bodies - 1)], length=1.0),
    )
    stepper = deli.GVI(energy="numerical").stepper(scene, 1e-4, "fused", False)
    stepper.reflect(scene.position, scene.momentum)
    counted = fuse.solves
    assert counted > 1
    for solve in range(1, counted + 1):
        fuse.blown = fuse.solves + solve
        with pytest.raises(deli.StepError, match="backend 'fused' raised Blown"):
            stepper.reflect(scene.position, scene.momentum)
        assert fuse.solves == fuse.blown
