"""Methods that substitute constraint forces, against closed forms and the systems that define them."""

import cvxpy as cp
import numpy as np
import pytest
from scipy.optimize import nnls

import deli
from deli.errors import InputError

GRAVITY = 9.8


def direct(place, h):
    def step(q, p):
        x = max(q + h * p - 0.5 * h**2 * GRAVITY, q - q / place)
        return x, 2.0 * (x - q) / h - p

    return step


def newmark(beta, gamma, imex, h):
    def step(q, p):
        free = q + h * p - 0.5 * h**2 * GRAVITY
        here = beta == 0.0 and not imex
        x = free if here and q > 1e-8 else max(free, 0.0)
        gain = 2.0 if imex else 2.0 * (1.0 - gamma) if here else gamma / beta
        return x, p - h * GRAVITY + gain * (x - free) / h

    return step


def moreau_jean(theta, restitution, h):
    def step(q, p):
        carried = p - h * GRAVITY
        if q + 0.5 * h * p <= 0.0:
            carried = max(carried, -restitution * p)
        return q + h * (theta * carried + (1.0 - theta) * p), carried

    return step


def nonsmooth_alpha(restitution, h):
    def step(q, p):
        carried, x = p - h * GRAVITY, q + h * p - 0.5 * h**2 * GRAVITY
        if x <= 1e-8:
            carried = max(carried, -restitution * p)
        return max(x, 0.0), carried

    return step


CLOSED = [
    (deli.Direct("midpoint"), lambda h: direct(0.5, h)),
    (deli.Direct("endpoint"), lambda h: direct(1.0, h)),
    (deli.Newmark(), lambda h: newmark(0.25, 0.5, False, h)),
    (deli.Newmark(0.5, 1.0), lambda h: newmark(0.5, 1.0, False, h)),
    (deli.Newmark(0.0, 0.5), lambda h: newmark(0.0, 0.5, False, h)),
    (deli.Newmark(0.0, 0.3), lambda h: newmark(0.0, 0.3, False, h)),
    (deli.Newmark(0.1, 0.7, imex=True), lambda h: newmark(0.1, 0.7, True, h)),
    (deli.Newmark(0.0, 0.5, imex=True), lambda h: newmark(0.0, 0.5, True, h)),
    (deli.MoreauJean(), lambda h: moreau_jean(0.5, 1.0, h)),
    (deli.MoreauJean(0.7, 0.4), lambda h: moreau_jean(0.7, 0.4, h)),
    (deli.NonsmoothAlpha(), lambda h: nonsmooth_alpha(1.0, h)),
    (deli.NonsmoothAlpha(0.2, 0.4), lambda h: nonsmooth_alpha(0.4, h)),
]


@pytest.mark.parametrize(("method", "closed"), CLOSED, ids=[str(method) for method, _ in CLOSED])
@pytest.mark.parametrize("h", [0.01, 0.1])
def test_a_falling_mass_follows_the_closed_form(method, closed, h):
    scene = deli.scenes.point_mass()
    stepper, step = method.stepper(scene, h), closed(h)
    state = (scene.position, scene.momentum)
    for _ in range(120):
        expected = step(float(state[0][0]), float(state[1][0]))
        state = stepper.step(*state)
        np.testing.assert_allclose([state[0][0], state[1][0]], expected, rtol=1e-11, atol=1e-11)


def test_the_midpoint_step_minimizes_b14():
    scene, h = deli.scenes.pogo_stick(), 0.1
    stepper = deli.Direct("midpoint").stepper(scene, h)
    values = scene.parameters
    x = cp.Variable(2)
    middle, moved = cp.Parameter(2), cp.Parameter(2)
    stretch = (middle + x / 2)[0] - (middle + x / 2)[1] - values["rest_length"]
    potential = values["stiffness"] / 2 * cp.square(stretch) + values["gravity"] * cp.sum(middle + x / 2)
    objective = cp.sum_squares(x) / 2 - moved @ x + h**2 * potential
    problem = cp.Problem(cp.Minimize(objective), [(middle + x / 2)[1] >= 0])
    q, p = scene.position, scene.momentum
    pressed = 0
    for _ in range(60):
        middle.value, moved.value = q / 2, q + h * p
        problem.solve(solver="DAQP")
        pressed += problem.constraints[0].dual_value > 1e-6
        q, p = stepper.step(q, p)
        if q[0] < q[1]:
            break  # where the masses pass each other V is not what is minimized here
        np.testing.assert_allclose(x.value, q, atol=1e-9)
    assert pressed > 1


@pytest.mark.parametrize("name", ["spring_sphere", "nonlinear_oscillator"])
@pytest.mark.parametrize(("constraint", "place"), [("midpoint", 0.5), ("endpoint", 1.0)])
def test_steps_solve_the_inclusion(name, constraint, place):
    scene = deli.scenes.get(name)()
    h, pressed = 0.1, 0
    stepper = deli.Direct(constraint).stepper(scene, h)
    q, p = scene.position, scene.momentum
    for _ in range(25):
        x, carried = stepper.step(q, p)
        y = q + place * (x - q)
        gaps, normals = scene.unilateral.value(y), scene.unilateral.jacobian(y)
        impulse = scene.mass * (x - q) / h - p + 0.5 * h * scene.potential.gradient(0.5 * (q + x))
        multipliers, residual = nnls(normals.T, impulse)
        assert residual <= 1e-9
        assert gaps.min() >= -1e-9
        assert np.abs(multipliers * gaps).max() <= 1e-9
        np.testing.assert_allclose(carried, 2.0 * scene.mass * (x - q) / h - p, rtol=1e-12, atol=1e-12)
        pressed += multipliers.max() > 1e-6
        q, p = x, carried
    assert pressed


FREE = deli.Scene(
    mass=[1.0, 2.0],
    position=[[0.0, 0.0], [1.3, 0.2]],
    momentum=[[0.1, 0.4], [-0.2, 0.3]],
    potential=[deli.Springs(pairs=[(0, 1)], stiffness=3.0, rest_length=1.0)],
    dimension=2,
)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (deli.Direct("midpoint"), deli.GVI("midpoint")),
        (deli.Direct("endpoint"), deli.GVI("midpoint")),
        (deli.Newmark(0.0, 0.5), deli.GVI("verlet")),
        (deli.Newmark(0.0, 0.5, imex=True), deli.GVI("verlet")),
        (deli.Newmark(0.25, 0.5), deli.MoreauJean(0.5)),
        (deli.Newmark(0.25, 0.5), deli.NonsmoothAlpha(1.0)),
    ],
    ids=str,
)
def test_methods_that_are_one_in_free_flight(one, other):
    runs = [deli.simulate(FREE, method, step_size=0.05, steps=100) for method in (one, other)]
    for name in ("position", "momentum"):
        first, second = (run[f"trajectory/{name}"].values for run in runs)
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-11)


def test_moreau_jean_keeps_momentum_and_energy_of_an_elastic_blow():
    scene = deli.Scene(
        mass=[1.0, 3.0],
        position=[[0.0, 0.0], [2.0, 0.0]],
        momentum=[[1.0, 0.0], [0.0, 0.0]],
        unilateral=[deli.SpheresApart(pairs=[(0, 1)], distance=1.0)],
        dimension=2,
    )
    run = deli.simulate(scene, deli.MoreauJean(), step_size=0.01, steps=200)
    final = run["trajectory/momentum"].values[-1]
    np.testing.assert_allclose(final, [-0.5, 0.0, 1.5, 0.0], atol=1e-13)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: deli.Direct("start"), r"constraint.*allowed: midpoint, endpoint"),
        (lambda: deli.Newmark(beta=0.6), r"beta is 0\.6; allowed: a number from 0 to 0\.5"),
        (lambda: deli.Newmark(gamma=-0.1), r"gamma is -0\.1"),
        (lambda: deli.Newmark(imex=1), r"imex is 1; allowed: true or false"),
        (lambda: deli.MoreauJean(theta=0.2), r"theta is 0\.2; allowed: a number from 0\.5 to 1"),
        (lambda: deli.MoreauJean(restitution=float("nan")), r"restitution is nan"),
        (lambda: deli.NonsmoothAlpha(spectral_radius=1.1), r"spectral_radius is 1\.1; allowed: a number from 0 to 1"),
        (lambda: deli.NonsmoothAlpha(restitution=True), r"restitution is True"),
        (lambda: deli.GVI(linearized="yes"), r"linearized is 'yes'"),
    ],
)
def test_settings_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
