"""The nonsmooth generalized-alpha method, against its equations solved by other means, and what it is known for."""

import numpy as np
import pytest
from law_cases import CASE_BY_NAME, MANY_BODIES, SKIP, Case
from law_runs import difference, growth, run
from running import assert_same
from scipy.linalg import null_space
from scipy.optimize import nnls
from test_convergence_orders import SMOOTH, orders

import deli
from deli.recording.verify import verify

REACHED = 1e-9  # of the sizes at hand
CASES = {**CASE_BY_NAME, **{case.name: case for case in MANY_BODIES}}
SETTINGS = [(0.0, 1.0), (0.5, 0.3), (0.8, 1.0), (1.0, 0.0)]


def nearest(wish: np.ndarray, rows: np.ndarray, bounds: np.ndarray, held: np.ndarray) -> np.ndarray:
    """The point nearest to `wish` with rows @ z >= bounds and held @ z = 0, by nonnegative least squares.

    As Lawson and Hanson solve least distance programs, in coordinates in which the equalities hold.
    """
    free = null_space(held) if len(held) else np.eye(len(wish))
    inner, rows = free.T @ wish, rows @ free
    apart = bounds - rows @ inner
    if not (apart > 0.0).any():
        return free @ inner
    scale, target = np.abs(apart).max(), np.zeros(len(inner) + 1)
    target[-1] = 1.0
    system = np.vstack([rows.T, apart / scale])
    residual = system @ nnls(system, target, maxiter=1000 * len(rows))[0] - target
    return free @ (inner - scale * residual[:-1] / residual[-1])


class Equations:
    """The method's step, dense: from the new position everything else follows."""

    def __init__(self, scene: deli.Scene, rho: float, restitution: float, h: float) -> None:
        self.scene, self.restitution, self.h = scene, restitution, h
        self.root = np.sqrt(scene.mass)
        self.alpha_m, self.alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self.gamma = 0.5 + self.alpha_f - self.alpha_m
        self.beta = (self.gamma + 0.5) ** 2 / 4.0

    def held(self, x):
        return self.scene.bilateral.jacobian(x) if self.scene.bilateral.rows else np.zeros((0, len(x)))

    def average(self, smooth, known):
        a, before = known
        return ((1.0 - self.alpha_f) * smooth + self.alpha_f * before - self.alpha_m * a) / (1.0 - self.alpha_m)

    def smooth(self, state, x):
        """The acceleration ã⁺ whose velocity is tangent to the bilateral constraints at x, and that velocity."""
        _, p, known = state

        def velocity(acceleration):
            change = (1.0 - self.gamma) * known[0] + self.gamma * self.average(acceleration, known)
            return p / self.scene.mass + self.h * change

        free = -self.scene.potential.gradient(x) / self.scene.mass
        held = self.held(x)
        pushes = (held / self.scene.mass).T
        share = self.h * self.gamma * (1.0 - self.alpha_f) / (1.0 - self.alpha_m)
        multipliers = np.linalg.lstsq(share * held @ pushes, -held @ velocity(free), rcond=None)[0]
        acceleration = free + pushes @ multipliers
        return acceleration, velocity(acceleration)

    def unexplained(self, state, x):
        """Part of the position's correction that no multiplier explains, and the least gap."""
        q, p, known = state
        acceleration = self.average(self.smooth(state, x)[0], known)
        predicted = q + self.h * p / self.scene.mass
        predicted += self.h**2 * ((0.5 - self.beta) * known[0] + self.beta * acceleration)
        gaps, normals = self.scene.unilateral.value(x), self.scene.unilateral.jacobian(x)
        if self.scene.bilateral.rows:
            assert np.abs(self.scene.bilateral.value(x)).max() <= REACHED
        held = self.held(x)
        pushes = (np.vstack([normals[gaps <= REACHED], held, -held]) / self.root).T
        correction = self.root * (x - predicted)
        return nnls(pushes, correction)[1] if pushes.size else np.linalg.norm(correction), gaps.min(initial=np.inf)

    def following(self, state, x):
        """Momentum and memory at the new position."""
        q, p, known = state
        acceleration, velocity = self.smooth(state, x)
        closed = self.scene.unilateral.value(x) <= 1e-8 * self.scene.length_scale
        rows = self.scene.unilateral.jacobian(x)[closed]
        bounds = -self.restitution * self.scene.unilateral.jacobian(q)[closed] @ (p / self.scene.mass)
        after = nearest(self.root * velocity, rows / self.root, bounds, self.held(x) / self.root)
        return self.root * after, np.array([self.average(acceleration, known), acceleration]), closed.sum()


@pytest.mark.parametrize(("rho", "restitution"), SETTINGS)
@pytest.mark.parametrize("name", CASES)
def test_steps_solve_the_equations(name: str, rho: float, restitution: float) -> None:
    case: Case = CASES[name]
    scene, h = case.build(), case.step_size
    method = deli.NonsmoothAlpha(rho, restitution)
    stepper, equations = method.stepper(scene, h), Equations(scene, rho, restitution, h)
    state = (scene.position, scene.momentum, np.tile(-scene.potential.gradient(scene.position) / scene.mass, (2, 1)))
    impacts = 0
    for step in range(case.steps):
        x, y, memory = stepper.step(*state) if step else stepper.step(*state[:2])
        # What a step could give: at rest momenta are rounding.
        length, impulse = np.abs(x).max(), np.abs([y, state[1], h * scene.mass * memory[1]]).max()
        residual, gap = equations.unexplained(state, x)
        assert residual <= REACHED * length
        assert gap >= -REACHED
        expected, remembered, closed = equations.following(state, x)
        np.testing.assert_allclose(y, expected, rtol=0, atol=REACHED * impulse)
        np.testing.assert_allclose(memory, remembered, rtol=0, atol=REACHED * impulse / h / scene.mass.min())
        impacts += closed
        state = x, y, memory
    assert impacts


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("name", ["oscillator", "pendulum"])
def test_second_order_where_the_motion_is_smooth(name: str, rho: float) -> None:
    build, coarse = SMOOTH[name]
    scene, duration, exact = build()
    errors = []
    for steps in (coarse * 2**k for k in range(2, 6)):
        ended = run(scene, deli.NonsmoothAlpha(rho), duration / steps, steps)
        errors.append(np.linalg.norm(np.concatenate(ended.states[-1][:2]) - exact))
    np.testing.assert_allclose(orders(errors)[1:], 2.0, atol=0.1)


def test_a_resting_ball_rests() -> None:
    ball = deli.scenes.point_mass(position=0.0)
    ended = run(ball, deli.NonsmoothAlpha(), 0.01, 50)
    assert (ended.smooth == 1).all()
    assert np.abs([ended.position, ended.momentum]).max() <= 1e-16


def test_a_bouncing_ball_loses_energy_and_never_penetrates() -> None:
    """Each impact is put where the step ends, and keeps the speed with which the step began."""
    losses = []
    for h in (2e-3, 1e-3):
        record = deli.simulate(deli.scenes.point_mass(), deli.NonsmoothAlpha(), step_size=h, duration=10.0)
        energy = record["trajectory/hamiltonian"].values
        changes = np.diff(energy)[np.abs(np.diff(energy)) > 1e-9]
        assert len(changes) > 9
        # Between the end of a step and the impact within it lie at most h, and a drop of speed of g h.
        assert (changes <= 1e-12).all()
        assert (changes >= -h * 9.8 * np.sqrt(2 * 9.8)).all()
        assert record["trajectory/gap_min"].values.min() >= -2e-14  # to which positions are iterated
        losses.append(1.0 - energy[-1] / energy[0])
    assert 0.03 < losses[1] < 0.06
    assert 1.5 < losses[0] / losses[1] < 2.5


def test_impulses_are_those_of_newtons_law_at_each_contact() -> None:
    """A ball hits two that touch: with e = 1 all three contacts' velocities are at least turned, and a blow is lost."""
    balls = deli.Scene(
        mass=1.0,
        position=[0.0, 1.05, 2.05],
        momentum=[1.0, 0.0, 0.0],
        unilateral=deli.Constraints(
            value=lambda q: np.diff(q) - 1.0, jacobian=lambda q: np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
        ),
    )
    ended = run(balls, deli.NonsmoothAlpha(), 0.1, 5)
    np.testing.assert_allclose(ended.momentum[-1], [-1 / 3, 2 / 3, 2 / 3], atol=1e-12)


@SKIP
@pytest.mark.parametrize("backend", ["native", "daqp", "clarabel"])
@pytest.mark.parametrize("name", ["discs", "newtons_cradle", "spring_sphere_mixed"])
def test_a_run_is_the_same_with_every_backend(name: str, backend: str, skip: bool) -> None:
    case = CASES[name]
    scene, method, steps = case.build(), deli.NonsmoothAlpha(), case.steps // 2
    known = run(scene, method, case.step_size, steps)
    other = run(scene, method, case.step_size, steps, solvers=backend, skip=skip)
    assert (known.solves + known.skipped)[:, 2].min() > 0
    np.testing.assert_array_equal(other.smooth, known.smooth)
    assert difference(known, other) <= growth(known, method, case.step_size) * (known.rounding + other.rounding)


class TestRecords:
    """What the method remembers is part of what is recorded, so that runs go on where they stopped."""

    H = 0.02

    def test_a_run_that_is_resumed_is_the_uninterrupted_one(self, tmp_path, at_step) -> None:
        path, scene = tmp_path / "run.nc", CASES["discs"].build()
        arguments = {"step_size": self.H, "steps": 120, "every": 7}

        def interrupt(take):
            raise KeyboardInterrupt

        at_step(60, interrupt)
        with pytest.raises(deli.Interrupted):
            deli.simulate(scene, deli.NonsmoothAlpha(), output=path, **arguments)
        at_step.restore()
        resumed = deli.simulate(scene, deli.NonsmoothAlpha(), output=path, resume=True, **arguments)
        whole = deli.simulate(scene, deli.NonsmoothAlpha(), **arguments)
        assert whole["trajectory/smooth_contacts"].values.any()
        assert_same(resumed, whole)
        assert all(finding.holds is not False for finding in verify(path))

    def test_rows_hold_what_a_step_needs(self) -> None:
        scene, method = CASES["discs"].build(), deli.NonsmoothAlpha()
        rows = deli.simulate(scene, method, step_size=self.H, steps=60)["trajectory"].to_dataset()
        stepper = method.stepper(scene, self.H)
        names = ("auxiliary_acceleration", "smooth_acceleration")
        for row in range(60):
            memory = np.array([rows[name].values[row] for name in names])
            q, p, memory = stepper.step(rows["position"].values[row], rows["momentum"].values[row], memory)
            np.testing.assert_array_equal(q, rows["position"].values[row + 1])
            np.testing.assert_array_equal(p, rows["momentum"].values[row + 1])
            np.testing.assert_array_equal(memory, [rows[name].values[row + 1] for name in names])
        assert {rows[name].attrs["units"] for name in names} == {"L T-2"}

    def test_other_methods_remember_nothing(self) -> None:
        run = deli.simulate(deli.scenes.point_mass(), deli.MoreauJean(), step_size=self.H, steps=2)
        assert not [name for name in run["trajectory"].data_vars if "acceleration" in name]
