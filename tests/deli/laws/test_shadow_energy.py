"""Shadow energies: the order to which smooth steps keep them, and what reflections do to them."""

import dataclasses
import itertools

import numpy as np
import pytest

import deli
from deli import metrics
from deli.mechanics.shadow import ORDERS

MEASURED = 12
SMOOTH = {
    "resting": (deli.scenes.spring_sphere, {"start": "smooth"}, 0.125, 20.0),
    "rods": (deli.scenes.newtons_cradle, {}, 0.02, 0.4),
    "chain": (deli.scenes.lennard_jones, {}, 0.005, 1.0),
}


def wander(build, settings, scheme, step_size, duration, order):
    run = deli.simulate(build(**settings), deli.DiscreteSmooth(scheme), step_size=step_size, duration=duration)
    return float(np.ptp(metrics.shadow_energy(run, order).values))


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
@pytest.mark.parametrize("case", SMOOTH)
def test_smooth_steps_keep_it_to_the_order_and_two_more(case, scheme, order):
    build, settings, step_size, duration = SMOOTH[case]
    coarse, fine = (wander(build, settings, scheme, h, duration, order) for h in (step_size, 0.5 * step_size))
    assert np.log2(coarse / fine) == pytest.approx(order + 2, abs=0.5)


@pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
def test_it_is_the_exact_invariant_of_an_oscillator(scheme):
    mass, stiffness, h = 2.0, 3.0, 0.3
    scene = deli.Scene(
        mass=mass,
        position=[0.7],
        momentum=[1.1],
        dimension=1,
        potential=deli.RadialPowers(coefficients=[0.5 * stiffness], exponents=[2]),
    )
    run = deli.simulate(scene, deli.GVI(scheme), step_size=h, steps=50)
    # Steps turn the phase plane by θ along ellipses; the flow that does so in time h has the energy θ/h times the area.
    turn = h * np.sqrt(stiffness / mass)
    if scheme == "midpoint":
        angle, ratio = 2.0 * np.arctan(0.5 * turn), np.sqrt(stiffness * mass)
    else:
        angle, ratio = 2.0 * np.arcsin(0.5 * turn), np.sqrt(stiffness * mass * (1.0 - 0.25 * turn**2))
    exact = angle / h * 0.5 * (1.1**2 / ratio + ratio * 0.7**2)
    error = [np.abs(metrics.shadow_energy(run, order, scene).values - exact).max() for order in ORDERS]
    assert error[0] < 1e-3
    assert error[-1] < 1e-10
    assert all(np.diff(error) < 0.0)


def pressed(momentum=(0.4, -0.8)):
    """Two masses on an axis, the second of which has reached the wall at 0."""
    potential = [
        deli.Springs(pairs=[(0, 1)], stiffness=2.0, rest_length=1.0),
        deli.RadialPowers(coefficients=[0.3, 0.3], exponents=[4, 4], bodies=[0, 1], centre=[[0.5], [0.5]]),
    ]
    wall = deli.Planes(normals=[1.0], bodies=[1])
    return deli.Scene(
        mass=[1.0, 2.0], position=[1.4, 0.0], momentum=momentum, dimension=1, potential=potential, unilateral=wall
    )


def linked(momentum=(0.3, -0.7, -0.1, -0.4)):
    """Two masses joined by a rod, the first of which has reached the floor y = 0."""
    return deli.Scene(
        mass=[1.0, 1.0],
        position=[0.2, 0.0, 0.8, 0.8],
        momentum=momentum,
        dimension=2,
        potential=deli.RadialPowers(coefficients=[0.5, 0.5], exponents=[4, 4], centre=[[0.0, 0.5], [0.5, 0.5]]),
        unilateral=deli.Planes(normals=[0.0, 1.0], bodies=[0]),
        bilateral=deli.Rods(pairs=[(0, 1)], length=1.0),
    )


def measured(scene, scheme, step_size, order=MEASURED):
    """Shadow energy of the state that a scene begins in."""
    run = deli.simulate(scene, deli.DiscreteSmooth(scheme), step_size=step_size, steps=1)
    return float(metrics.shadow_energy(run, order, scene)[0])


def kick(build, scheme, energy, step_size):
    """Change of the shadow energy, of the highest order, in one reflection."""
    scene = build()
    turned = deli.reflect(scene, scene.position, scene.momentum, energy=energy, scheme=scheme, step_size=step_size)
    before, after = (measured(build(momentum), scheme, step_size) for momentum in (scene.momentum, turned))
    return abs(after - before)


@pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
@pytest.mark.parametrize(
    ("build", "energy", "power"),
    [
        *((build, "hamiltonian", 2) for build in (pressed, linked)),
        *((build, f"shadow{order}", order + 2) for build in (pressed, linked) for order in (2, 4, 6)),
        (pressed, "numerical", 4),
        (linked, "numerical", 2),  # which knows nothing of the force in the rod
    ],
)
def test_a_reflection_moves_it_by_the_power_that_its_energy_leaves(build, scheme, energy, power):
    coarse, fine = kick(build, scheme, energy, 0.05), kick(build, scheme, energy, 0.025)
    assert np.log2(coarse / fine) == pytest.approx(power, abs=0.4)


@pytest.mark.parametrize(("scheme", "step_size"), [("midpoint", 0.5), ("verlet", 0.7)])
@pytest.mark.parametrize("order", [2, 4, 6, 8])
@pytest.mark.parametrize("build", [pressed, linked])
def test_a_reflection_conserves_its_own_to_rounding(build, order, scheme, step_size):
    scene, options = build(), {"scheme": scheme, "step_size": step_size}
    turned = deli.reflect(scene, scene.position, scene.momentum, energy=f"shadow{order}", **options)
    assert np.abs(turned - scene.momentum).max() > 0.1
    before, after = (measured(build(momentum), order=order, **options) for momentum in (scene.momentum, turned))
    assert after == pytest.approx(before, rel=1e-12)


@pytest.mark.parametrize(("scheme", "other", "speed"), [("midpoint", 3.0, 0.03), ("verlet", -3.0, 0.05)])
def test_contacts_that_graze_are_let_go(scheme, other, speed):
    """The smooth steps lead the second mass away from the wall: at once, or after an impulse that does not turn it."""
    for slower, pushed in ((0.2 * speed, False), (speed, True)):
        scene = pressed((other, -slower))
        turned = deli.reflect(scene, scene.position, scene.momentum, energy="shadow4", scheme=scheme, step_size=0.2)
        assert turned[0] == other
        assert (-slower < turned[1] < 0.0) if pushed else turned[1] == -slower
        before, after = (measured(pressed(momentum), scheme, 0.2, 4) for momentum in (scene.momentum, turned))
        assert after == pytest.approx(before, rel=1e-12)


def test_impacts_of_the_pogo_stick_do_not_add_up():
    def worst(energy):
        method = deli.GVI("verlet", energy=energy)
        run = deli.simulate(deli.scenes.pogo_stick(momentum=[0.5, -0.5]), method, step_size=0.1, steps=5000)
        assert run["trajectory"]["reflected_contacts"].sum() > 1000
        found = metrics.shadow_energy(run, MEASURED).values
        return float(np.abs(found - found[0]).max())

    found = [worst(energy) for energy in ("hamiltonian", "shadow2", "shadow4", "shadow6", "shadow8")]
    assert found[0] > 0.1
    assert found[-1] < 1e-4
    assert all(after < 0.2 * before for before, after in itertools.pairwise(found))


def test_momentum_maps_are_kept_and_contacts_that_rest_stay():
    run = deli.simulate(
        deli.scenes.spring_sphere(start="mixed"), deli.GVI(energy="shadow6"), step_size=0.25, duration=200.0
    )
    assert run.attrs["outcome"] == "complete"
    assert metrics.angular_momentum_error(run) < 1e-10
    assert metrics.violation(run)[0] < 1e-10
    held, struck = metrics.contacts(run)
    assert held > 0.99
    assert struck > 50


def test_what_it_cannot_be_measured_of_is_refused():
    run = deli.simulate(deli.scenes.pogo_stick(), deli.GVI("verlet"), step_size=0.1, steps=2)
    with pytest.raises(deli.InputError, match="order is 3; allowed: 2, 4"):
        metrics.shadow_energy(run, 3)
    with pytest.raises(
        deli.InputError, match=r"6 bodies in 3 dimensions\); the run is of 'pogo_stick' \(2 bodies in 1 dimension\)"
    ):
        metrics.shadow_energy(run, scene=deli.scenes.lennard_jones())
    other = deli.simulate(deli.scenes.pogo_stick(), deli.Newmark(), step_size=0.1, steps=2)
    with pytest.raises(deli.InputError, match="newmark has no scheme"):
        metrics.shadow_energy(other)
    scene = pressed()
    own = deli.simulate(scene, deli.GVI(), step_size=0.1, steps=2)
    with pytest.raises(deli.InputError, match=r"pass it as scene=\.\.\."):
        metrics.shadow_energy(own)
    assert metrics.shadow_energy(own, scene=scene).sizes == {"time": 3}


def test_a_reflection_that_needs_a_step_size_says_so():
    scene = pressed()
    with pytest.raises(deli.InputError, match="energy='shadow4' needs a step_size"):
        deli.reflect(scene, scene.position, scene.momentum, energy="shadow4")


def as_functions(scene):
    """The same scene, of whose constraints only values and gradients are known."""
    unilateral, bilateral = (
        [deli.Constraints(value=stack.value, jacobian=stack.jacobian)] if stack.rows else []
        for stack in (scene.unilateral, scene.bilateral)
    )
    return dataclasses.replace(scene, unilateral=unilateral, bilateral=bilateral)


@pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("build", [pressed, linked])
def test_constraints_that_are_functions_are_reflected_off_alike(build, order, scheme):
    options = {"energy": f"shadow{order}", "scheme": scheme, "step_size": 0.05}
    scene = build()
    known, found = (
        deli.reflect(each, each.position, each.momentum, **options) for each in (scene, as_functions(scene))
    )
    assert np.abs(known - scene.momentum).max() > 0.1
    np.testing.assert_allclose(found, known, rtol=0, atol=1e-11)


@pytest.mark.parametrize("scheme", ["midpoint", "verlet"])
@pytest.mark.parametrize("case", ["resting", "rods"])
def test_constraints_that_are_functions_are_measured_alike(case, scheme):
    build, settings, step_size, _ = SMOOTH[case]
    scene = build(**settings)
    levels = []
    for each in (scene, as_functions(scene)):
        run = deli.simulate(each, deli.DiscreteSmooth(scheme), step_size=step_size, steps=5)
        levels.append(metrics.shadow_energy(run, 4, each).values)
    np.testing.assert_allclose(levels[1], levels[0], rtol=1e-10)
