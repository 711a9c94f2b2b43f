"""Collision integrators: events to rounding, what reflections conserve, drift, and contacts that cannot be followed."""

import numpy as np
import pytest
from law_cases import CASE_BY_NAME, SCHEMES, discs
from law_pogo import discrete_slots, exact_pogo, free_step, pogo_stick
from law_runs import Run, angular_momentum, difference, growth, run, sizes
from scipy.optimize import brentq, fsolve

import deli
from deli.kernels.advance import make_block

SCHEME = pytest.mark.parametrize("scheme", SCHEMES)
ENERGIES = ("hamiltonian", "discrete", "numerical")
ENERGY = pytest.mark.parametrize("energy", ENERGIES)
HEIGHTS = np.linspace(0.1, 2.4, 12)


def energies(method: object, scene: deli.Scene, h: float, steps: int) -> np.ndarray:
    """H after every step, of a run that may end before its time."""
    stepper = method.stepper(scene, h)
    stepper.place(scene.position, scene.momentum)
    block = make_block(steps, scene.dof, scene.dimension)
    stepper.advance(block, steps, 1, np.inf)
    done = block.fields.diagnostics[: block.fields.progress[1]]
    return done[:, 0] + done[:, 1]


@SCHEME
@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("energy", ["hamiltonian", "numerical"])
def test_a_bouncing_ball_follows_the_exact_solution(scheme: str, energy: str, order: int) -> None:
    """Free fall is exact, so that all there can be wrong are the events: a thousand of them, two or three in a step."""
    h, fall = 2.0, np.sqrt(2.0 / 9.8)
    ball = run(deli.scenes.point_mass(), deli.Collision(scheme, energy, order), h, int(2004 * fall / h))
    assert ball.reflected.sum() == int((h * ball.steps / fall + 1.0) / 2.0) >= 1000
    time = (h * np.arange(ball.steps + 1) + fall) % (2.0 * fall) - fall
    assert np.abs(ball.position[:, 0] - (1.0 - 4.9 * time**2)).max() <= 1e-11
    assert np.abs(ball.energy / 9.8 - 1.0).max() <= 1e-12
    assert ball.solves.sum() == 0
    assert (ball.smooth == 0).all()


def test_reflections_that_need_no_solver_are_counted_once_an_event() -> None:
    ball = run(deli.scenes.point_mass(), deli.Collision(), 0.1, 100)
    assert ball.reflected.max() == 1
    np.testing.assert_array_equal(ball.skipped[:, 0], 1)
    assert ball.solves.sum() == 0


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_the_first_of_two_events_need_not_be_the_one_that_seems_so(order: list[int]) -> None:
    """One body ends the step below the floor, the other just there after it was far below: on straight lines, later."""
    position, momentum = np.array([[1.0, -4.01], [3.0, -6.8]])[order].T
    thrown = {"potential": deli.Gravity(6.0), "unilateral": deli.Planes([1.0])}

    def step(q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
        stepper = deli.Collision("verlet").stepper(deli.Scene(1.0, q, p, **thrown), 1.0)
        state = stepper.step(q, p)
        assert stepper.stats.reflected_contacts == len(q)
        return state

    alone = [step(position[k : k + 1], momentum[k : k + 1]) for k in range(2)]
    np.testing.assert_allclose(step(position, momentum), np.hstack(alone), rtol=1e-12)


@SCHEME
@pytest.mark.parametrize("energy", ["hamiltonian", "numerical"])
def test_a_contact_that_is_closed_at_the_start_is_met_there(scheme: str, energy: str) -> None:
    ball = deli.scenes.point_mass()
    h, speed = 0.1, 3.0
    x, p = deli.Collision(scheme, energy).stepper(ball, h).step(np.zeros(1), -speed * ball.mass)
    np.testing.assert_allclose(x, speed * h - 4.9 * h**2, rtol=1e-12)
    np.testing.assert_allclose(p / ball.mass, speed - 9.8 * h, rtol=1e-12)


@pytest.mark.parametrize("rods", [3, 10])
def test_hard_rods_are_free_points_in_their_order(rods: int) -> None:
    scene, h, steps = deli.scenes.hard_rods(rods=rods), 0.4, 50
    result = run(scene, deli.Collision(), h, steps)
    room = rods * 1.0  # half of the line is filled
    shift = np.arange(rods) + 0.5
    points = np.mod(scene.position - shift + h * steps * scene.momentum, 2.0 * room)
    exact = np.sort(np.minimum(points, 2.0 * room - points)) + shift
    assert result.reflected.sum() > 5 * rods
    assert result.reflected.max() > 1  # events in one step
    assert np.abs(result.position[-1] - exact).max() <= 1e-12
    assert result.gap >= -1e-12


@SCHEME
@ENERGY
def test_simultaneous_events_keep_a_symmetry(scheme: str, energy: str) -> None:
    scene = deli.Scene(
        mass=1.0,
        position=[-0.6, 0.6],
        momentum=[-1.0, 1.0],
        potential=deli.Springs(pairs=[(0, 1)], stiffness=2.0, rest_length=1.0),
        unilateral=deli.Planes(normals=[[1.0], [-1.0]], offsets=[-1.0, -1.0], bodies=[0, 1]),
    )
    result = run(scene, deli.Collision(scheme, energy), 0.05, 400)
    assert set(result.reflected) == {0, 2}
    assert np.abs(result.position.sum(axis=1)).max() <= 1e-12
    assert np.abs(result.momentum.sum(axis=1)).max() <= 1e-12


@SCHEME
def test_an_impact_solves_the_equations_of_variational_collisions(scheme: str) -> None:
    """Fetecau et al. (2003): stationary in x, in the place of the impact and in its time, all at once."""
    q, p, h = np.array([5.6, 0.1]), np.array([0.3, -3.0]), 0.1

    def residual(unknown: np.ndarray) -> np.ndarray:
        time, impulse, met, x = unknown[0], unknown[1], unknown[2:4], unknown[4:]
        start, arrival, before = discrete_slots(scheme, q, met, time)
        departure, _, after = discrete_slots(scheme, met, x, h - time)
        turned = departure - arrival - np.array([0.0, impulse])
        return np.concatenate([start - p, turned, [met[1], after - before]])

    guess = np.array([0.034, 6.0, 5.6, 0.0, 5.6, 0.2])
    found, _, success, message = fsolve(residual, guess, xtol=1e-14, full_output=True)
    assert np.abs(residual(found)).max() <= 1e-12, (success, message)
    x, y = deli.Collision(scheme, "discrete").stepper(pogo_stick(), h).step(q, p)
    assert np.abs(x - found[4:]).max() <= 1e-12
    assert np.abs(y - discrete_slots(scheme, found[2:4], found[4:], h - found[0])[1]).max() <= 1e-12


def fraction(scheme: str, order: int, q: np.ndarray, p: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, float]:
    """State after a part of a step, and its discrete energy: of fourth order the sum of those of three steps."""
    outer, total = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0)), 0.0
    for share in [1.0] if order == 2 else [outer, 1.0 - 2.0 * outer, outer]:
        x = free_step(scheme, q, p, share * h)
        _, p, energy = discrete_slots(scheme, q, x, share * h)
        q, total = x, total + share * energy
    return q, p, total


@SCHEME
@pytest.mark.parametrize("order", [2, 4])
def test_the_discrete_energy_is_the_same_before_and_after_events(scheme: str, order: int) -> None:
    h = 0.02
    result = run(pogo_stick(), deli.Collision(scheme, "discrete", order), h, 2000)
    events = np.flatnonzero(result.reflected == 1)
    assert len(events) > 20
    for step in events:
        (q, x), (p, y) = (each[step : step + 2] for each in (result.position, result.momentum))
        time = brentq(
            lambda t, q, p: fraction(scheme, order, q, p, t)[0][1], 1e-9, h, args=(q, p), xtol=1e-17, rtol=1e-15
        )
        if min(time, h - time) < 0.1 * h:
            continue  # rounding of positions is divided by the time
        before, after = fraction(scheme, order, q, p, time)[2], fraction(scheme, order, x, y, time - h)[2]
        assert abs(after - before) <= 1e-12 * before


@ENERGY
@pytest.mark.parametrize("order", [2, 4])
def test_angular_momentum_is_conserved(energy: str, order: int) -> None:
    case = CASE_BY_NAME["nonlinear_oscillator"]
    result = run(case.build(), deli.Collision("midpoint", energy, order), case.step_size, 400)
    assert result.reflected.sum() > 10
    shape = (result.steps + 1, 2, 2)
    angular = angular_momentum(result.position.reshape(shape), result.momentum.reshape(shape))
    length, impulse = sizes(result)
    assert np.abs(angular - angular[0]).max() <= result.rounding * length * impulse
    assert result.gap >= -1e-12


@SCHEME
@pytest.mark.parametrize(("energy", "least"), [("hamiltonian", 1.9), ("numerical", 1.9), ("discrete", 0.9)])
def test_runs_with_impacts_converge(scheme: str, energy: str, least: float) -> None:
    """Of second order, where direct methods are of first; conserving E_d of parts of unequal size costs one."""
    scene, duration = pogo_stick(), 3.0
    exact = exact_pogo(scene.position, scene.momentum, duration)
    errors = []
    for steps in (1000, 16000):
        result = run(scene, deli.Collision(scheme, energy), duration / steps, steps)
        assert result.reflected.sum() >= 4
        errors.append(np.abs(np.concatenate([result.position[-1], result.momentum[-1]]) - exact).max())
    assert np.log2(errors[0] / errors[1]) / 4.0 >= least


@SCHEME
def test_steps_to_and_from_events_are_of_fourth_order(scheme: str) -> None:
    q, p = np.array([5.6, 0.03]), np.array([0.3, -3.0])

    def error(h: float, order: int) -> float:
        step = deli.Collision(scheme, order=order).stepper(pogo_stick(), h)
        ended = np.concatenate(step.step(q, p))
        assert step.stats.reflected_contacts == 1
        return float(np.abs(ended - exact_pogo(q, p, h)).max())

    assert error(0.1, 4) >= 2**5 * error(0.05, 4)
    assert error(0.05, 4) <= 0.1 * error(0.05, 2)
    assert error(0.1, 2) <= 2**5 * error(0.05, 2)


def test_energy_drifts_where_that_of_gvi_does_not() -> None:
    """Fig. 1.4: not at a certain time, which depends on the start, but over an ensemble of starts."""

    def drift(method: object) -> np.ndarray:
        runs = [energies(method, pogo_stick(height), 0.1, 30_000) for height in HEIGHTS]
        assert all(len(energy) == 30_000 for energy in runs)
        return np.array([np.ptp(energy.reshape(30, -1).mean(axis=1)) for energy in runs])

    steady, drifting = drift(deli.GVI("verlet")), drift(deli.Collision("verlet"))
    assert steady.max() <= 0.6
    assert np.median(drifting) >= 3.0
    assert (drifting > steady).mean() >= 0.9


def test_conserving_the_numerical_hamiltonian_tightens_the_band() -> None:
    def band(energy: str) -> float:
        method = deli.Collision("verlet", energy)
        runs = [energies(method, pogo_stick(height), 0.02, 5000) for height in HEIGHTS]
        return float(np.median([np.ptp(energy) for energy in runs]))

    assert band("numerical") <= 0.7 * band("hamiltonian")


@pytest.mark.parametrize(
    ("scene", "step_size", "message"),
    [
        (deli.scenes.point_mass(position=0.0, momentum=0.0), 0.1, r"constraint 0 .* after 0 events .* 0 into its 0\.1"),
        (deli.scenes.spring_sphere(start="smooth"), 0.5, "rest or slide, or impacts accumulate"),
    ],
    ids=["resting", "sliding"],
)
@ENERGY
def test_contacts_that_last_end_with_what_to_do(scene: deli.Scene, step_size: float, message: str, energy: str) -> None:
    stepper = deli.Collision("verlet", energy).stepper(scene, step_size)
    with pytest.raises(deli.StepError, match=rf"{message}.*use deli\.GVI"):
        stepper.step(scene.position, scene.momentum)


@pytest.mark.parametrize("energy", ["hamiltonian", "numerical"])
def test_impacts_that_accumulate_end(energy: str) -> None:
    """A bounce takes 2e-6 of the step of 0.1."""
    stepper = deli.Collision("verlet", energy).stepper(deli.scenes.point_mass(), 0.1)
    with pytest.raises(deli.StepError, match=r"constraint 0 .* after 10\d\d events of the step, 0\.002.*use deli\.GVI"):
        stepper.step(np.zeros(1), np.array([1e-5]))


def test_an_impact_without_a_solution_is_said_to_be_one() -> None:
    stepper = deli.Collision("verlet", "discrete").stepper(pogo_stick(), 0.1)
    with pytest.raises(deli.StepError, match=r"no impulse at unilateral constraint 0 conserves the discrete energy"):
        stepper.step(np.array([4.984, 0.007]), np.array([-0.792, 0.384]))


def test_a_failed_step_leaves_the_state_and_the_step_size() -> None:
    scene, method = deli.scenes.point_mass(), deli.Collision()
    stepper = method.stepper(scene, 0.1)
    with pytest.raises(deli.StepError):
        stepper.step(np.zeros(1), np.zeros(1))
    assert np.array_equal(np.array(stepper.state), np.zeros((2, 1)))
    again = [np.concatenate(one.step(np.ones(1), np.ones(1))) for one in (stepper, method.stepper(scene, 0.1))]
    assert np.array_equal(*again)


@pytest.mark.parametrize(
    ("name", "energy"),
    [
        *((name, energy) for name in ("lennard_jones", "discs", "pogo_stick") for energy in ENERGIES),
        ("newtons_cradle", "hamiltonian"),
        ("newtons_cradle", "numerical"),
    ],
)
def test_rods_hold_and_solvers_change_nothing(name: str, energy: str) -> None:
    case = CASE_BY_NAME[name]
    method = deli.Collision(case.scheme, energy)
    scene = case.build()
    skipped: Run = run(scene, method, case.step_size, case.steps)
    solved = run(scene, method, case.step_size, case.steps, skip=False)
    assert skipped.reflected.sum() > 0
    assert np.array_equal(skipped.reflected, solved.reflected)
    allowed = skipped.rounding + solved.rounding
    assert difference(skipped, solved) <= 10 * allowed * growth(skipped, method, case.step_size)
    assert skipped.gap >= -1e-12 * scene.length_scale
    if scene.bilateral.rows:
        assert np.abs(scene.bilateral.value(skipped.position)).max() <= 1e-13 * scene.length_scale


def test_many_steps_at_once_are_the_same_as_one_by_one() -> None:
    scene = discs()
    result = run(scene, deli.Collision(), 0.02, 100)
    stepper = deli.Collision().stepper(scene, 0.02)
    stepper.place(scene.position, scene.momentum)
    block = make_block(100, scene.dof, scene.dimension)
    assert stepper.advance(block, 100, 1, np.inf) is None
    assert np.array_equal(block.fields.position, result.position[1:])
    assert np.array_equal(block.fields.contacts[:, 1], result.reflected)


@pytest.mark.parametrize(
    ("setting", "value", "allowed"),
    [
        ("scheme", "euler", "midpoint, verlet"),
        ("energy", "total", "hamiltonian, discrete, numerical"),
        ("order", 3, "2, 4"),
    ],
)
def test_settings_are_checked(setting: str, value: object, allowed: str) -> None:
    with pytest.raises(deli.InputError, match=f"Collision: {setting} {value!r} is unknown; allowed: {allowed}"):
        deli.Collision(**{setting: value})
