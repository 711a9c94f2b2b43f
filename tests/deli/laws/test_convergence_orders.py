"""Second order on smooth scenes, first order with impacts, against exact solutions or a fine adaptive integration."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from law_cases import SCHEMES
from law_runs import run
from scipy.integrate import solve_ivp

import deli

SCHEME = pytest.mark.parametrize("scheme", SCHEMES)
FINE = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


def final_error(scene: deli.Scene, method: object, duration: float, steps: int, exact: np.ndarray) -> float:
    """Distance of the final state from the exact one, (q, p) joined."""
    ended = run(scene, method, duration / steps, steps)
    return float(np.linalg.norm(np.concatenate([ended.position[-1], ended.momentum[-1]]) - exact))


def orders(errors: list[float]) -> np.ndarray:
    """Observed order between step sizes that halve."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def oscillator() -> tuple[deli.Scene, float, np.ndarray]:
    """V = 2 q² with m = 0.5: the frequency is sqrt(8)."""
    scene = deli.Scene(mass=0.5, position=[1.0], momentum=[0.3], potential=deli.RadialPowers([2.0], [2.0]))
    duration, frequency = 3.0, np.sqrt(8.0)
    cosine, sine = np.cos(frequency * duration), np.sin(frequency * duration)
    position = cosine + 0.6 / frequency * sine
    return scene, duration, np.array([position, 0.5 * (0.6 * cosine - frequency * sine)])


def pendulum() -> tuple[deli.Scene, float, np.ndarray]:
    scene = deli.scenes.newtons_cradle(balls=1, pulled=1, angle=1.2)
    duration = 2.0
    angle, rate = solve_ivp(lambda _, s: [s[1], -9.8 * np.sin(s[0])], (0, duration), [1.2, 0.0], **FINE).y[:, -1]
    along = np.array([np.cos(angle), np.sin(angle)])
    return scene, duration, np.concatenate([[np.sin(angle), -np.cos(angle)], rate * along])


def sliding() -> tuple[deli.Scene, float, np.ndarray]:
    """Both masses of the spring on the circle, in their angles."""
    scene, duration = deli.scenes.spring_sphere(start="smooth"), 4.0

    def state(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        outward = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return outward, np.stack([-outward[:, 1], outward[:, 0]], axis=1)

    def derivative(_: float, s: np.ndarray) -> np.ndarray:
        outward, along = state(s[:2])
        gradient = scene.potential.gradient((5.0 * outward).ravel()).reshape(2, 2)
        return np.concatenate([s[2:], -(gradient * along).sum(axis=1) / 5.0])

    q = scene.position.reshape(2, 2)
    start = np.concatenate([np.arctan2(q[:, 1], q[:, 0]), [0.2, 0.2]])
    ended = solve_ivp(derivative, (0, duration), start, **FINE).y[:, -1]
    outward, along = state(ended[:2])
    return scene, duration, np.concatenate([5.0 * outward.ravel(), (5.0 * ended[2:, None] * along).ravel()])


SMOOTH = {"oscillator": (oscillator, 32), "pendulum": (pendulum, 64), "sliding": (sliding, 16)}


@SCHEME
@pytest.mark.parametrize("method", [deli.GVI, deli.DiscreteSmooth])
@pytest.mark.parametrize("name", SMOOTH)
def test_second_order_where_the_motion_is_smooth(name: str, method: type, scheme: str) -> None:
    build, coarse = SMOOTH[name]
    scene, duration, exact = build()
    errors = [final_error(scene, method(scheme=scheme), duration, coarse * 2**k, exact) for k in range(4)]
    np.testing.assert_allclose(orders(errors)[1:], 2.0, atol=0.06)


def bouncing(scene: deli.Scene, duration: float) -> np.ndarray:
    """Where the motion of a scene with one contact ends: impacts are located, and turn the normal velocity."""
    mass, dof = scene.mass, scene.dof

    def derivative(_: float, s: np.ndarray) -> np.ndarray:
        return np.concatenate([s[dof:] / mass, -scene.potential.gradient(s[:dof])])

    def gap(_: float, s: np.ndarray) -> float:
        return scene.unilateral.value(s[:dof])[0]

    gap.terminal, gap.direction = True, -1.0
    time, state, impacts = 0.0, np.concatenate([scene.position, scene.momentum]), 0
    while True:
        ended = solve_ivp(derivative, (time, duration), state, events=gap, **FINE)
        time, state = ended.t[-1], ended.y[:, -1].copy()
        if not len(ended.t_events[0]):
            assert impacts > 0
            return state
        impacts += 1
        normal = scene.unilateral.jacobian(state[:dof])[0]
        response = normal / mass
        state[dof:] -= 2.0 * (response @ state[dof:]) / (response @ normal) * normal


HEIGHTS = np.linspace(0.8, 1.2, 16)  # the impacts fall on all phases of a step


def balls() -> list[deli.Scene]:
    return [deli.scenes.point_mass(position=height) for height in HEIGHTS]


def pogo_sticks() -> list[deli.Scene]:
    return [deli.scenes.pogo_stick(position=(height + 5.3, height)) for height in HEIGHTS]


def oscillators() -> list[deli.Scene]:
    return [deli.scenes.nonlinear_oscillator(clearance=height - 0.6) for height in HEIGHTS]


@pytest.mark.parametrize(
    ("scenes", "duration"),  # no impact is within a coarse step of the end
    [(balls, 0.9), (pogo_sticks, 1.04), (oscillators, 0.65)],
    ids=["point_mass", "pogo_stick", "nonlinear_oscillator"],
)
@SCHEME
def test_first_order_with_impacts(scenes: Callable[[], list[deli.Scene]], duration: float, scheme: str) -> None:
    """The error depends on the phase of the impact in its step, from none to a full step's: it is averaged."""
    method = deli.GVI(scheme=scheme)
    ensemble = [(scene, bouncing(scene, duration)) for scene in scenes()]
    means = [
        np.mean([final_error(scene, method, duration, steps, exact) for scene, exact in ensemble])
        for steps in (32, 64, 128, 256, 512)
    ]
    slope = np.polyfit(np.arange(5.0), np.log2(means), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)


def test_the_reference_of_a_bouncing_ball_is_the_exact_one() -> None:
    scene = deli.scenes.point_mass()
    impact = np.sqrt(2 / 9.8)
    time = 1.2 - impact
    speed = 9.8 * impact
    exact = [speed * time - 4.9 * time**2, speed - 9.8 * time]
    np.testing.assert_allclose(bouncing(scene, 1.2), exact, atol=1e-10)


def test_a_first_order_scheme_is_not_of_second_order() -> None:
    """The same measure tells symplectic Euler, which is of first order, from the schemes."""
    scene, duration, exact = oscillator()
    errors = []
    for steps in (32, 64, 128, 256):
        (q, p), h = (scene.position, scene.momentum), duration / steps
        for _ in range(steps):
            p = p - h * scene.potential.gradient(q)
            q = q + h * p / scene.mass
        errors.append(float(np.linalg.norm(np.concatenate([q, p]) - exact)))
    np.testing.assert_allclose(orders(errors)[1:], 1.0, atol=0.2)


def test_dropping_the_contact_keeps_second_order() -> None:
    """The first order is the impacts' doing: without the floor the same fall is exact."""
    scene = replace(deli.scenes.point_mass(), unilateral=None)
    exact = np.array([1.0 - 4.9 * 1.2**2, -9.8 * 1.2])
    assert final_error(scene, deli.GVI(), 1.2, 64, exact) < 1e-12
