"""Contacts are counted as steps are taken: discarded attempts, failed steps and reflections let go count nothing."""

import numpy as np
import pytest
from law_cases import SKIP

import deli

EVERY_BLOW = [
    deli.Collision(),
    deli.Collision(energy="discrete"),
    deli.SolveIvp(),
    *(
        deli.GVI(scheme, predictor=predictor)
        for scheme in ("midpoint", "verlet")
        for predictor in ("forward", "closed_loop")
    ),
    deli.GVI(reflection="sequential", predictor="closed_loop"),
]


@pytest.mark.parametrize("method", EVERY_BLOW, ids=str)
@pytest.mark.parametrize("beads", [3, 6, 20])
def test_a_blow_is_handed_on_along_a_row_of_beads(beads: int, method: object) -> None:
    """Gaps are small, so that a closed loop meets all of them within one step, an attempt at a time."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.0, *(1.001 * np.arange(1, beads))],
        momentum=[1.0] + [0.0] * (beads - 1),
        unilateral=deli.SpheresApart(pairs=[(i, i + 1) for i in range(beads - 1)], distance=1.0),
    )
    run = deli.simulate(scene, method, step_size=0.1, steps=20)
    assert run.attrs["outcome"] == "complete"
    assert run["trajectory"]["reflected_contacts"].sum() == beads - 1
    assert float(deli.metrics.measure(run)["reflected_contacts"]) == beads - 1
    np.testing.assert_allclose(run["trajectory"]["momentum"][-1], scene.momentum[::-1], atol=1e-12)


@pytest.mark.parametrize("method", [deli.Collision(), deli.GVI(predictor="closed_loop")], ids=str)
def test_spheres_collide_at_the_rate_of_enskog(method: object) -> None:
    """2 √π n d² √T χ collisions a sphere, with the contact value χ of Carnahan and Starling; d = m = 1."""
    spheres, filled, duration = 256, 0.3, 4.0
    gas = deli.scenes.hard_sphere_gas(spheres=spheres, filled=filled, radius=0.5, seed=3)
    temperature = (gas.momentum**2).sum() / (3 * spheres - 3)
    density, contact = filled * 6.0 / np.pi, (1.0 - filled / 2.0) / (1.0 - filled) ** 3
    rate = 2.0 * spheres * density * np.sqrt(np.pi * temperature) * contact
    run = deli.simulate(gas, method, step_size=0.01, duration=duration)
    struck = run["trajectory"]["reflected_contacts"].values
    assert struck[struck.size // 4 :].sum() / (0.75 * duration) == pytest.approx(rate, rel=0.06)


@SKIP
def test_discarded_attempts_are_work(skip: bool) -> None:
    """Two beads before a wall: the first attempt does not see that the second one is struck."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.0, 1.001, 2.002],
        momentum=[1.0, 0.0, 0.0],
        unilateral=deli.SpheresApart(pairs=[(0, 1), (1, 2)], distance=1.0),
    )
    stepper = deli.GVI(predictor="closed_loop").stepper(scene, 0.1, skip=skip)
    stepper.step(scene.position, scene.momentum)
    stats = stepper.stats
    assert stats.reflected_contacts == 2
    assert (stats.skipped if skip else stats.solves)[0] > 2
    stepper.step(scene.position, scene.momentum)
    assert stats.reflected_contacts == 4


class Broken(Exception):
    pass


@pytest.mark.parametrize(
    "method", [deli.GVI(), deli.GVI("verlet", predictor="closed_loop"), deli.Collision(), deli.SolveIvp()], ids=str
)
def test_a_step_that_fails_reflects_nothing(method: object) -> None:
    """The ball bounces, and then a function raises, at every one of its calls in the step of the bounce."""
    calls, breaking = [0], [np.inf]

    def gradient(q):
        calls[0] += 1
        if calls[0] == breaking[0]:
            raise Broken
        return np.array([9.8])

    scene = deli.Scene(
        mass=1.0,
        position=[0.01],
        momentum=[-1.0],
        potential=deli.Potential(energy=lambda q: 9.8 * q[0], gradient=gradient),
        unilateral=deli.Planes(normals=[[1.0]], bodies=[0]),
    )
    stepper = method.stepper(scene, 0.1)
    begun = calls[0]
    stepper.step(scene.position, scene.momentum)
    needed = calls[0] - begun
    for call in range(1, needed + 1):
        breaking[0] = calls[0] + call
        with pytest.raises(Broken):
            stepper.step(scene.position, scene.momentum)
        assert stepper.stats.reflected_contacts == 1
    assert needed > 1


@pytest.mark.parametrize("predictor", ["forward", "closed_loop"])
def test_the_row_before_a_failed_step_has_no_contacts_of_that_step(predictor: str) -> None:
    """The potential ends to be a number where the bounce leads; the bounce is in no row, whichever rows there are."""
    for every in (1, 3, 100):
        low = []

        def gradient(q, low=low):
            low += [q] if abs(q[0] - 0.07) < 1e-9 else []  # nowhere but in the steps of a run
            return np.array([np.nan if low and q[0] > 0.1 else 0.0])

        scene = deli.Scene(
            mass=1.0,
            position=[0.47],
            momentum=[-0.1],
            potential=deli.Potential(energy=lambda q: 0.0, gradient=gradient),
            unilateral=deli.Planes(normals=[[1.0]], bodies=[0]),
        )
        run = deli.simulate(scene, deli.GVI("verlet", predictor=predictor), step_size=1.0, steps=10, every=every)
        assert run.attrs["outcome"].startswith("failed in step 5 ")
        assert run["trajectory"]["time"][-1] == 4.0
        assert run["trajectory"]["reflected_contacts"].sum() == 0


@pytest.mark.parametrize(("speed", "struck"), [(1e-3, 0), (0.1, 1)])
def test_contacts_that_a_shadow_energy_lets_go_are_not_reflected(speed: float, struck: int) -> None:
    """A mass nears the floor slowly, under one that falls fast on a spring: the shadow flow takes it up at h²k/6."""
    scene = deli.Scene(
        mass=1.0,
        position=[0.0, 5.0],
        momentum=[-speed, -1.0],
        potential=deli.Springs(pairs=[(0, 1)], stiffness=10.0, rest_length=5.0),
        unilateral=deli.Planes(normals=[[1.0]], bodies=[0]),
    )
    stepper = deli.GVI("verlet", energy="shadow4").stepper(scene, 0.1)
    turned = stepper.reflect(scene.position, scene.momentum)
    assert (turned != scene.momentum).any() == bool(struck)
    assert stepper.stats.reflected_contacts == struck
