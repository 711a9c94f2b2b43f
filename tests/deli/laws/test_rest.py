"""A pile at rest stays at rest, by every method that holds contacts, in any units, at any solver's accuracy."""

import numpy as np
import pytest

import deli

STEP_SIZE, STEPS, GRAVITY = 0.01, 100, 9.8
METHODS = [
    *(
        deli.GVI(scheme, predictor=predictor)
        for scheme in ("midpoint", "verlet")
        for predictor in ("forward", "closed_loop")
    ),
    deli.GVI(linearized=True),
    deli.GVI(reflection="moreau"),
    deli.DiscreteSmooth(),
    deli.Direct("midpoint"),
    deli.Direct("endpoint"),
    deli.Newmark(),
    deli.Newmark(beta=0.0),
    deli.Newmark(imex=True),
    *(deli.MoreauJean(theta, restitution) for theta in (0.5, 1.0) for restitution in (0.0, 0.5, 1.0)),
    *(deli.NonsmoothAlpha(restitution=restitution) for restitution in (0.0, 1.0)),
]
EXPLICIT = deli.Newmark(beta=0.0)  # whose momentum at rest is that of half a step of free fall, by its closed form
UNITS = [(1.0, 1.0), (1e-9, 1.0), (1e9, 1.0), (1.0, 1e-9), (1.0, 1e9)]  # of length and of time


def column(length: float, time: float) -> deli.Scene:
    """Eight balls on a floor, on top of each other."""
    return deli.Scene(
        mass=1.0,
        position=(np.arange(8) + 0.5) * length,
        momentum=np.zeros(8),
        potential=deli.Gravity(-GRAVITY * length / time**2),
        unilateral=[
            deli.Planes(normals=[[1.0]], offsets=[0.5 * length], bodies=[0]),
            deli.SpheresApart(pairs=[(i, i + 1) for i in range(7)], distance=length),
        ],
    )


def stirred(scene: deli.Scene, method: object, length: float, time: float, **settings: object) -> tuple[float, float]:
    """Largest kinetic energy, in that of one step of free fall, and deepest gap, in lengths."""
    run = deli.simulate(scene, method, step_size=STEP_SIZE * time, steps=STEPS, **settings)
    assert run.attrs["outcome"] == "complete"
    fallen = scene.bodies * 0.5 * (GRAVITY * length / time * STEP_SIZE) ** 2
    return float(run["trajectory"]["kinetic_energy"].max()) / fallen, float(run["trajectory"]["gap_min"].min()) / length


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize(("length", "time"), UNITS)
def test_a_column_stays(method: object, length: float, time: float) -> None:
    kinetic, gap = stirred(column(length, time), method, length, time)
    assert kinetic == pytest.approx(0.25 if method == EXPLICIT else 0.0, rel=1e-11, abs=1e-16)
    assert gap >= -1e-13


@pytest.mark.parametrize("method", METHODS, ids=str)
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_column_stays_with_a_solver_of_low_accuracy(method: object, unit: float) -> None:
    """Interior points leave velocities and gaps that are zero to the solver's tolerance alone."""
    loose = {"backend": "clarabel", "polish": False}
    kinetic, gap = stirred(column(unit, 1.0), method, unit, 1.0, solvers={"default": loose}, skip=False)
    assert kinetic == pytest.approx(0.25 if method == EXPLICIT else 0.0, rel=1e-11, abs=1e-12)
    assert gap >= -1e-9


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_a_pile_of_discs_stays(restitution: float) -> None:
    scene = deli.scenes.disc_pile(rows=4, columns=4)
    for settings in ({}, {"skip": False}):
        kinetic, gap = stirred(scene, deli.MoreauJean(restitution=restitution), 1.0, 1.0, **settings)
        assert kinetic <= 1e-20
        assert gap >= -1e-13


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("opening", [-1e-10, 0.0, 1e-10, 1e-6])
def test_what_opens_is_let_go(opening: float, unit: float) -> None:
    """A ball that a string pulls up leaves the floor; one that rounding alone opens is not pushed."""
    scene = deli.Scene(
        mass=1.0,
        position=[unit, 0.0],
        momentum=[0.0, opening * unit],
        potential=deli.Gravity([0.0, 9.8 * unit]),
        unilateral=deli.Planes(normals=[[0.0, 1.0]], bodies=[0]),
        dimension=2,
    )
    stepper = deli.MoreauJean(restitution=0.0).stepper(scene, STEP_SIZE)
    q, p = stepper.step(scene.position, scene.momentum)
    np.testing.assert_allclose(p, [0.0, (opening + 9.8 * STEP_SIZE) * unit], rtol=1e-13)
    np.testing.assert_allclose(q[1], (opening + 4.9 * STEP_SIZE) * STEP_SIZE * unit, rtol=1e-13)
