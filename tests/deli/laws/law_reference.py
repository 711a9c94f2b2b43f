"""Dense, slow and independent: the unconstrained step, and the position and momentum update by semismooth Newton."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

import deli

_ITERATIONS = 60


@dataclass(frozen=True)
class Reference:
    """One step (7.3-7.6, 7.8, 7.9) of a scene with a scheme and a step size, without reflection."""

    scene: deli.Scene
    scheme: str
    step_size: float

    def force(self, q: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The slot of D1."""
        at = 0.5 * (q + x) if self.scheme == "midpoint" else q
        return -0.5 * self.step_size * self.scene.potential.gradient(at)

    def predict(self, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """The unconstrained step (8.1)."""
        return self.move(q, p, np.zeros(0, dtype=int), bilateral=False)[0]

    def move(
        self, q: np.ndarray, p: np.ndarray, smooth: np.ndarray, bilateral: bool = True
    ) -> tuple[np.ndarray, np.ndarray]:
        """Solve for (x, λ) the position update with the contacts `smooth`, min(λ, g(x)) = 0 in place of (7.4)."""
        scene, h = self.scene, self.step_size
        dof, contacts = scene.dof, len(smooth)
        held = scene.bilateral.rows if bilateral else 0
        normals, across = scene.unilateral.jacobian(q)[smooth], scene.bilateral.jacobian(q)[:held]
        length, impulse = np.abs(q).max(), np.abs(p).max() or scene.mass.max() * np.abs(q).max() / h
        x, forces = q + h * p / scene.mass, np.zeros(contacts + held)
        for _ in range(_ITERATIONS):
            gaps = scene.unilateral.value(x)[smooth]
            pressing = forces[:contacts] / impulse < gaps / length
            balance = scene.mass * (x - q) / h - p - self.force(q, x) - np.concatenate((normals, across)).T @ forces
            natural = np.where(pressing, forces[:contacts] / impulse, gaps / length)
            equalities = scene.bilateral.value(x)[:held]
            residual = np.concatenate((balance / impulse, natural, equalities / length))
            if np.abs(residual).max() < 1e-14:
                return x, forces[:contacts]
            stiffness = np.diag(scene.mass / h)
            if self.scheme == "midpoint":
                stiffness = stiffness + 0.25 * h * scene.potential.hessian(0.5 * (q + x))
            by_force = np.where(pressing[:, None], np.eye(contacts) / impulse, 0.0)
            by_gap = np.where(pressing[:, None], 0.0, scene.unilateral.jacobian(x)[smooth] / length)
            derivative = np.block(
                [
                    [stiffness / impulse, -normals.T / impulse, -across.T / impulse],
                    [by_gap, by_force, np.zeros((contacts, held))],
                    [scene.bilateral.jacobian(x)[:held] / length, np.zeros((held, contacts + held))],
                ]
            )
            change = np.linalg.lstsq(derivative, -residual, rcond=1e-14)[0]
            x, forces = x + change[:dof], forces + change[dof:]
            if np.abs(residual).max() < 1e-12 and np.abs(change[:dof]).max() < 1e-15 * length:
                return x, forces[:contacts]
        raise AssertionError(f"the reference did not converge: {np.abs(residual).max():.1e}")

    def project(self, q: np.ndarray, x: np.ndarray, smooth: np.ndarray) -> np.ndarray:
        """The momentum at x: D2 less what the bilateral constraints and the contacts `smooth` do not allow there."""
        scene = self.scene
        at = 0.5 * (q + x) if self.scheme == "midpoint" else x
        momentum = scene.mass * (x - q) / self.step_size - 0.5 * self.step_size * scene.potential.gradient(at)
        closed = smooth[np.abs(scene.unilateral.value(x)[smooth]) <= 1e-8 * scene.length_scale]
        rows = np.concatenate((scene.unilateral.jacobian(x)[closed], scene.bilateral.jacobian(x)))
        root = np.sqrt(scene.mass)
        multipliers = np.linalg.lstsq((rows / root).T, momentum / root, rcond=1e-12)[0]
        return momentum - rows.T @ multipliers

    def unexplained(self, q: np.ndarray, p: np.ndarray, x: np.ndarray, contacts: np.ndarray) -> float:
        """How far the impulse that led to x is from any Nλ + Fν with λ >= 0 of the given contacts, relative to p."""
        scene = self.scene
        impulse = scene.mass * (x - q) / self.step_size - p - self.force(q, x)
        across = scene.bilateral.jacobian(q)
        columns = np.concatenate((scene.unilateral.jacobian(q)[contacts], across, -across)).T
        size = max(np.abs(p).max(), np.abs(scene.mass * (x - q) / self.step_size).max())
        return float((nnls(columns, impulse)[1] if columns.size else np.linalg.norm(impulse)) / size)
