"""The pogo stick by itself: its forces, its discrete Lagrangians, and its exact motion."""

import numpy as np
from scipy.integrate import solve_ivp

import deli


def pogo_stick(height: float = 1.0) -> deli.Scene:
    return deli.scenes.pogo_stick(position=(5.0 + height, height))


def pogo_force(q: np.ndarray) -> np.ndarray:
    stretch = q[0] - q[1] - 5.0
    return np.array([-9.8 - 10.0 * stretch, -9.8 + 10.0 * stretch])


def pogo_energy(q: np.ndarray) -> float:
    return 9.8 * (q[0] + q[1]) + 5.0 * (q[0] - q[1] - 5.0) ** 2


def exact_pogo(q: np.ndarray, p: np.ndarray, duration: float) -> np.ndarray:
    """The state after a time, by an adaptive method that stops at events."""
    state, time = np.concatenate([q, p]), 0.0
    while time < duration:
        found = solve_ivp(
            lambda _, s: np.concatenate([s[2:], pogo_force(s[:2])]), (time, duration), state,
            method="DOP853", rtol=1e-13, atol=1e-13, events=_FLOOR,
        )  # fmt: skip
        state, time = found.y[:, -1] * (1.0, 1.0, 1.0, -1.0 if found.status == 1 else 1.0), found.t[-1]
    return state


def _floor(_: float, state: np.ndarray) -> float:
    return float(state[1])


_floor.terminal, _floor.direction = True, -1.0  # type: ignore[attr-defined]
_FLOOR = _floor


def discrete_slots(scheme: str, q: np.ndarray, x: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, float]:
    """−D₁L_d, D₂L_d and E_d of the pogo stick (8.2, 8.3)."""
    v = (x - q) / h
    middle = 0.5 * (q + x)
    if scheme == "midpoint":
        first = second = pogo_force(middle)
        potential = pogo_energy(middle)
    else:
        first, second = pogo_force(q), pogo_force(x)
        potential = 0.5 * (pogo_energy(q) + pogo_energy(x))
    return v - 0.5 * h * first, v + 0.5 * h * second, 0.5 * v @ v + potential


def free_step(scheme: str, q: np.ndarray, p: np.ndarray, h: float) -> np.ndarray:
    x = q + h * (p + 0.5 * h * pogo_force(q))
    if scheme == "midpoint":  # linear, so that Newton's method ends after a step
        stiffness = 10.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        residual = discrete_slots(scheme, q, x, h)[0] - p
        x = x - np.linalg.solve(np.eye(2) / h + 0.25 * h * stiffness, residual)
    return x
