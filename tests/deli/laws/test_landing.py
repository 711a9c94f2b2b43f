"""A contact that lands keeps its gap for a step, and the energy along its gradient (docs/explanation)."""

import numpy as np
import pytest
from law_cases import ENERGIES, SCHEMES
from law_runs import difference, run

import deli
from deli.mechanics.energies import numerical_hamiltonian
from deli.mechanics.schemes import get_scheme

STIFFNESS, LENGTH, GRAVITY, STEP = 10.0, 5.0, 9.8, 0.1


def in_disc(speed: float, inward: float = 0.01, depth: float = 1e-3) -> deli.Scene:
    """A particle just inside a unit circle, which moves along it."""
    return deli.Scene(
        mass=1.0,
        position=[1.0 - depth, 0.0],
        momentum=[-inward, speed],
        unilateral=[deli.SpheresInside(radius=1.0)],
        dimension=2,
    )


def in_disc_by_functions(speed: float) -> deli.Scene:
    return deli.Scene(
        mass=1.0,
        position=[0.999, 0.0],
        momentum=[-0.01, speed],
        unilateral=[
            deli.Constraints(
                value=lambda q: np.array([1.0 - np.hypot(*q)]), jacobian=lambda q: -q[None, :] / np.hypot(*q)
            )
        ],
        dimension=2,
    )


def low_pogo_stick() -> deli.Scene:
    return deli.scenes.pogo_stick(position=(5.0, 0.01), momentum=(0.3, -0.1))


def between_walls(width: float, speed: float) -> deli.Scene:
    """A particle in a channel along the second axis, which bounces between its walls."""
    return deli.Scene(
        mass=1.0,
        position=[0.3 * width, 0.0],
        momentum=[speed, 1.0],
        unilateral=[deli.Planes([[1.0, 0.0], [-1.0, 0.0]], [0.0, -width], [0, 0])],
        dimension=2,
    )


def test_whispering_along_a_circle_keeps_energy_and_angular_momentum() -> None:
    """Every step lands: the chord of a step leaves the circle. Without force energy is exact."""
    scene = in_disc(1.0)
    of = run(scene, deli.GVI(predictor="closed_loop"), 0.1, 1000)
    np.testing.assert_allclose(np.hypot(*of.position.T), 0.999, rtol=1e-12)
    np.testing.assert_allclose(of.energy, of.energy[0], rtol=1e-11)
    angular = of.position[:, 0] * of.momentum[:, 1] - of.position[:, 1] * of.momentum[:, 0]
    np.testing.assert_allclose(angular, angular[0], rtol=1e-11)
    assert run(scene, deli.GVI(), 0.1, 10).gap < -1e-3


def test_particles_that_do_not_meet_land_as_each_alone() -> None:
    """Each keeps its own energy."""
    starts = [([0.999, 0.0], [-0.01, 1.0]), ([0.0, -0.999], [2.0, 0.03])]
    runs = [
        run(
            deli.Scene(1.0, position, momentum, unilateral=deli.SpheresInside(1.0), dimension=2),
            deli.GVI(predictor="closed_loop"),
            0.1,
            100,
        )
        for position, momentum in [*starts, tuple(np.array(starts).transpose(1, 0, 2))]
    ]
    for name in ("position", "momentum"):
        first, second, both = (getattr(of, name) for of in runs)
        np.testing.assert_allclose(both, np.hstack([first, second]), atol=1e-12)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_landed_motion_is_that_along_the_level(scheme: str) -> None:
    """The pogo stick's mass above a landed one is an oscillator of its own: the scheme's steps are known for it."""
    scene = low_pogo_stick()
    of = run(scene, deli.GVI(scheme, predictor="closed_loop"), STEP, 50)
    # A step of a linear oscillator about its rest position is a matrix.
    square, half = STEP**2 * STIFFNESS, 0.5 * STEP
    if scheme == "verlet":
        matrix = np.array([[1.0 - square / 2.0, STEP], [-STEP * STIFFNESS * (1.0 - square / 4.0), 1.0 - square / 2.0]])
    else:
        implicit = np.array([[1.0, -half], [half * STIFFNESS, 1.0]])
        matrix = np.linalg.solve(implicit, np.array([[1.0, half], [-half * STIFFNESS, 1.0]]))
    rest = 0.01 + LENGTH - GRAVITY / STIFFNESS
    state = np.array([5.0 - rest, 0.3])
    for position, momentum in zip(of.position, of.momentum, strict=True):
        np.testing.assert_allclose(position, [rest + state[0], 0.01], atol=1e-12)
        np.testing.assert_allclose([momentum[0], abs(momentum[1])], [state[1], 0.1], atol=1e-12)
        state = matrix @ state


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_landing_leaves_nothing_behind(scheme: str) -> None:
    """A stepper that has just landed takes any other step as a new one does, to the bit."""
    method, landed = deli.GVI(scheme, predictor="closed_loop"), low_pogo_stick()
    used = method.stepper(landed, STEP)
    states = [([4.0, 0.0], [-0.3, 0.0]), *(([height + 5.0, height], [-0.3, -0.4]) for height in (0.0, 0.005, 0.05))]
    for position, momentum in states:  # at rest under a spring that presses, and approaching
        used.step(landed.position, landed.momentum)
        fresh = method.stepper(landed, STEP)
        for mine, theirs in zip(used.step(position, momentum), fresh.step(position, momentum), strict=True):
            assert mine.tobytes() == theirs.tobytes()


@pytest.mark.parametrize("scheme", SCHEMES)
def test_numerical_energy_is_the_same_after_a_landing(scheme: str) -> None:
    scene, found = low_pogo_stick(), get_scheme(scheme)
    of = run(scene, deli.GVI(scheme, energy="numerical", predictor="closed_loop"), STEP, 50)
    states = zip(of.position, of.momentum, strict=True)
    energies = [numerical_hamiltonian(scene, found, q, p, STEP) for q, p in states]
    np.testing.assert_allclose(of.position[:, 1], 0.01, rtol=1e-13)
    assert np.ptp(of.momentum[1:, 1]) > 1e-3  # pays for the rest
    np.testing.assert_allclose(energies, energies[0], rtol=1e-13)


@pytest.mark.parametrize("order", [2, 4, 8])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_shadow_energies_are_the_same_after_a_landing(scheme: str, order: int) -> None:
    """Of steps that land, of reflections, and of free steps between them."""
    for speed in (0.1, 0.5, 1.0):
        scene = deli.scenes.pogo_stick(position=(5.0, 0.01), momentum=(0.3, -speed))
        method = deli.GVI(scheme, energy=f"shadow{order}", predictor="closed_loop")
        run = deli.simulate(scene, method, step_size=STEP, steps=50)
        energies = deli.metrics.shadow_energy(run, order, scene).values
        np.testing.assert_allclose(energies, energies[0], rtol=1e-11)
        landed = np.abs(np.diff(run["trajectory"]["position"].values[:, 1])) < 1e-13
        assert landed.any()
        assert np.ptp(run["trajectory"]["momentum"].values[1:, 1]) > 1e-3  # pays for the rest


@pytest.mark.parametrize("scheme", SCHEMES)
def test_shadow_energies_are_the_same_where_another_contact_rests(scheme: str) -> None:
    scene = deli.Scene(
        mass=1.0,
        position=[LENGTH, 0.01, 0.0],
        momentum=[0.3, -0.5, 0.0],
        potential=[deli.Gravity(-GRAVITY), deli.Springs([(0, 1)], STIFFNESS, LENGTH)],
        unilateral=deli.Planes([1.0], bodies=[1, 2]),
    )
    run = deli.simulate(scene, deli.GVI(scheme, energy="shadow4", predictor="closed_loop"), step_size=STEP, steps=50)
    energies = deli.metrics.shadow_energy(run, 4, scene).values
    np.testing.assert_allclose(energies, energies[0], rtol=1e-11)
    assert (run["trajectory"]["smooth_contacts"].values[1:] == 1).all()
    assert (np.abs(np.diff(run["trajectory"]["position"].values[:, 1])) < 1e-13).any()


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("build", [low_pogo_stick, lambda: in_disc(1.0)], ids=["pogo_stick", "disc"])
def test_landings_turn_back_but_for_a_reflection(build: object, scheme: str) -> None:
    """Back again, momentum along the level is reversed; across it, it separates whichever way it came."""
    scene = build()
    stepper = deli.GVI(scheme, predictor="closed_loop").stepper(scene, STEP)
    position, momentum = scene.position, scene.momentum
    for _ in range(2):
        there = stepper.step(position, momentum)
        q, p = stepper.step(there[0], -there[1])
        np.testing.assert_allclose(q, position, atol=1e-12)
        gradient = scene.unilateral.jacobian(position)[0]
        across, returned = gradient @ momentum, gradient @ p
        np.testing.assert_allclose(p - returned * gradient, across * gradient - momentum, atol=1e-12)
        assert returned == pytest.approx(abs(across), abs=1e-12)
        position, momentum = there


@pytest.mark.parametrize("energy", ENERGIES)
def test_between_walls_too_near_for_a_step_what_bounces_stays(energy: str) -> None:
    """No reflection separates both walls; along them the motion is exact."""
    scene = between_walls(0.5, 25.0)
    of = run(scene, deli.GVI(energy=energy, predictor="closed_loop"), 0.1, 20)
    np.testing.assert_allclose(of.position[:, 0], 0.15, rtol=1e-13)
    np.testing.assert_allclose(of.position[:, 1], 0.1 * np.arange(21), atol=1e-12)
    np.testing.assert_allclose(of.energy, of.energy[0], rtol=1e-13)


def test_a_wall_that_touches_on_either_side_is_no_obstacle() -> None:
    scene = between_walls(0.5, 25.0)
    start = (np.array([0.0, 0.0]), scene.momentum)
    tight = deli.Scene(
        mass=1.0,
        position=[0.0, 0.0],
        momentum=[2.0, 1.0],
        unilateral=[deli.Planes([[1.0, 0.0], [-1.0, 0.0]], [0.0, 0.0], [0, 0])],
        dimension=2,
    )
    of = run(tight, deli.GVI(predictor="closed_loop"), 0.1, 5)
    np.testing.assert_allclose(of.position[-1], [0.0, 0.5], atol=1e-13)
    np.testing.assert_allclose(of.energy, of.energy[0], rtol=1e-13)
    assert run(scene, deli.GVI(predictor="closed_loop"), 0.1, 5, start=start).gap >= 0.0


def test_no_step_along_the_gradient_reaches_a_disc_that_it_overshoots() -> None:
    """The counter-example: |q + h (v + λ n(q))| >= h |v_t| for every λ, so no step is admissible where h |v_t| > r."""
    stepper = deli.GVI(predictor="closed_loop").stepper(in_disc(9.5, 0.0, 0.0), 0.1)
    q, _ = stepper.step(np.array([1.0, 0.0]), np.array([0.0, 9.5]))
    assert np.hypot(*q) == pytest.approx(1.0, abs=1e-9)
    with pytest.raises(deli.StepError, match=r"position: .* did not converge"):
        stepper.step(np.array([1.0, 0.0]), np.array([0.0, 10.5]))


def test_a_solver_that_leaves_a_violation_is_told() -> None:
    scene = deli.scenes.spring_sphere(start="mixed")
    loose = {"backend": "osqp", "tolerance": 1e-3, "polish": False}
    stepper = deli.GVI(predictor="closed_loop").stepper(scene, 0.5, solvers=loose)
    with pytest.raises(deli.StepError, match="closed loop: unilateral constraint 1 is violated by"):
        stepper.step(scene.position, scene.momentum)


@pytest.mark.parametrize("energy", ENERGIES)
@pytest.mark.parametrize("name", ["pogo_stick", "disc"])
def test_landings_need_no_skipping(name: str, energy: str) -> None:
    scene = low_pogo_stick() if name == "pogo_stick" else in_disc(1.0)
    method = deli.GVI("verlet", energy=energy, predictor="closed_loop")
    on, off = (run(scene, method, 0.1, 30, skip=skip) for skip in (True, False))
    assert difference(on, off) <= 1e-10


def test_landings_on_functions_are_those_on_tables() -> None:
    method = deli.GVI(predictor="closed_loop")
    table, functions = (run(build(1.0), method, 0.1, 50) for build in (in_disc, in_disc_by_functions))
    assert difference(table, functions) <= 1e-11
