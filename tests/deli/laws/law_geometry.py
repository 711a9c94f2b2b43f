"""Phase space with constraints held: tangent vectors, a retraction onto it, and the derivative of a step along it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import deli

Step = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
REACH = 1e-3  # of the scene's length and momentum: Richardson's fourth-order error and the rounding balance here


@dataclass(frozen=True)
class HeldConstraints:
    """The constrained phase space {c(q) = 0, ∇cᵀM⁻¹p = 0} of a scene's bilateral and chosen unilateral rows."""

    scene: deli.Scene
    pressed: tuple[int, ...] = ()

    def value(self, q: np.ndarray) -> np.ndarray:
        return np.concatenate([self.scene.bilateral.value(q), self.scene.unilateral.value(q)[list(self.pressed)]])

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        return np.vstack([self.scene.bilateral.jacobian(q), self.scene.unilateral.jacobian(q)[list(self.pressed)]])

    def retract(self, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Move a nearby state onto the constrained phase space, to rounding."""
        mass = self.scene.mass
        for _ in range(6):
            rows = self.jacobian(q)
            q = q - (rows / mass).T @ np.linalg.lstsq(rows / mass @ rows.T, self.value(q), rcond=None)[0]
        rows = self.jacobian(q)
        for _ in range(2):
            p = p - rows.T @ np.linalg.lstsq(rows / mass @ rows.T, rows @ (p / mass), rcond=None)[0]
        return q, p

    def tangents(self, q: np.ndarray, p: np.ndarray) -> np.ndarray:
        """A basis of the tangent space at (q, p), (2 dof - 2 rows, 2 dof): the kernel of all derivatives."""
        rows, dof, step = self.jacobian(q), self.scene.dof, 1e-5 * self.scene.length_scale
        if not len(rows):
            return np.eye(2 * dof)
        velocity = p / self.scene.mass
        curvature = np.column_stack(
            [
                (self.jacobian(q + step * axis) - self.jacobian(q - step * axis)) @ velocity / (2 * step)
                for axis in np.eye(dof)
            ]
        )
        derivative = np.block([[rows, np.zeros_like(rows)], [curvature, rows / self.scene.mass]])
        return np.linalg.svd(derivative)[2][len(derivative) :]

    def pushed(self, step: Step, q: np.ndarray, p: np.ndarray, tangent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives along a curve with that tangent: of the curve itself, and of its image under the step.

        Central differences at two reaches with Richardson's extrapolation. The derivative of the retracted curve is
        taken in the same way, so that errors of `tangents` do not count.
        """
        dof = self.scene.dof
        length, impulse = np.abs(q).max(), np.abs(p).max()
        reach = REACH / max(np.abs(tangent[:dof]).max() / length, np.abs(tangent[dof:]).max() / impulse)

        def central(distance: float) -> np.ndarray:
            ends = []
            for sign in (1.0, -1.0):
                start = self.retract(q + sign * distance * tangent[:dof], p + sign * distance * tangent[dof:])
                ends.append(np.concatenate([*start, *step(*start)]))
            return (ends[0] - ends[1]) / (2 * distance)

        both = (4.0 * central(0.5 * reach) - central(reach)) / 3.0
        return both[: 2 * dof], both[2 * dof :]


def symplectic_defect(held: HeldConstraints, step: Step, q: np.ndarray, p: np.ndarray) -> float:
    """Largest change of dq∧dp over all pairs of tangent vectors, which are scaled to units of the state."""
    dof = held.scene.dof
    pairs = [held.pushed(step, q, p, tangent) for tangent in held.tangents(q, p)]
    before, after = (np.array(vectors) for vectors in zip(*pairs, strict=True))

    def form(vectors: np.ndarray) -> np.ndarray:
        product = vectors[:, :dof] @ vectors[:, dof:].T
        return product - product.T

    return float(np.abs(form(after) - form(before)).max() / np.abs(form(before)).max())
