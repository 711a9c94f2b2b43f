"""Which constraints touch, approach, or stay smooth: the predicates of (6.4) and (7.1), with explicit tolerances."""

from collections.abc import Callable

import numpy as np

from deli.errors import InputError
from deli.mechanics.constraints import ConstraintFamily
from deli.mechanics.scene import Scene

ROUNDING = 1e-12  # scaled gap below which a constraint is violated by more than rounding
_ROUNDOFF = 8 * np.finfo(float).eps  # of the momenta of all bodies, which leaks into each of them


class Contacts:
    """Values and gradients of a scene's constraints, and the scaled zero of each.

    "g = 0" means ``|g_i| ≤ τ L |∇g_i(q₀)|`` with L the scene's length; "∇gᵀv = 0" means
    ``|∇g_iᵀv| ≤ τ ‖∇g_i‖ (‖p‖ + ‖impulse of the forces in one step‖)``, norms in the metric M⁻¹ over the bodies that
    the constraint touches. Both are unchanged by units and by how a constraint is scaled.

    Parameters
    ----------
    scene : Scene
    tolerance : float
        τ, the contact tolerance.
    """

    def __init__(self, scene: Scene, tolerance: float) -> None:
        if not 0 < tolerance < 1:
            raise InputError(f"contact_tolerance is {tolerance!r}; allowed: 0 < contact_tolerance < 1.")
        self.tolerance = tolerance
        self._inverse_mass = 1.0 / scene.mass
        self._dimension = scene.dimension
        self._unilateral = scene.unilateral
        self._bilateral = scene.bilateral
        self.rows = scene.unilateral.rows
        self.gap_scale = _scale(scene.unilateral, scene)
        self.bilateral_scale = _scale(scene.bilateral, scene)
        self._gap_zero = tolerance * self.gap_scale
        self.no_rows = np.zeros((0, scene.dof))
        self._seen: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def gaps(self, position: np.ndarray) -> np.ndarray:
        """g(q), shape (rows,)."""
        return self._remember("gaps", position, self._unilateral.value) if self.rows else self.gap_scale

    def gradients(self, position: np.ndarray) -> np.ndarray:
        """G(q)ᵀ, shape (rows, dof)."""
        return self._remember("gradients", position, self._unilateral.jacobian) if self.rows else self.no_rows

    def bilateral(self, position: np.ndarray) -> np.ndarray:
        """F(q)ᵀ, shape (bilateral rows, dof)."""
        if not self._bilateral.rows:
            return self.no_rows
        return self._remember("bilateral", position, self._bilateral.jacobian)

    def touching(self, position: np.ndarray) -> np.ndarray:
        """Mask of the constraints with g_i(q) = 0."""
        return np.abs(self.gaps(position)) <= self._gap_zero

    def crossed(self, position: np.ndarray) -> np.ndarray:
        """Mask of the constraints with g_i(q) ≤ 0."""
        return self.gaps(position) <= 0.0

    def violated(self, position: np.ndarray) -> np.ndarray:
        """Mask of the constraints violated by more than rounding."""
        return self.gaps(position) < -ROUNDING * self.gap_scale

    def velocity_zero(self, gradients: np.ndarray, momentum: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Normal velocities of the given rows below which they count as zero, shape (rows,)."""
        inverse_mass = self._inverse_mass
        squares = np.stack((momentum * momentum, force * force)) * inverse_mass
        by_body = squares.reshape(2, -1, self._dimension).sum(axis=2)
        touched = (gradients != 0.0).reshape(len(gradients), -1, self._dimension).any(axis=2)
        speed = np.sqrt(by_body @ touched.T).sum(axis=0) * self.tolerance
        speed += np.sqrt(by_body.sum(axis=1)).sum() * _ROUNDOFF
        return speed * np.sqrt((gradients * gradients) @ inverse_mass)

    def smooth(
        self, candidates: np.ndarray, gradients: np.ndarray, momentum: np.ndarray, force: np.ndarray
    ) -> np.ndarray:
        """Indices of 𝕊 among touching constraints: those whose normal velocity is zero (7.1)."""
        if not len(candidates):
            return candidates
        rows = gradients[candidates]
        normal = rows @ (momentum * self._inverse_mass)
        return candidates[np.abs(normal) <= self.velocity_zero(rows, momentum, force)]

    def _remember(self, kind: str, position: np.ndarray, evaluate: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        seen = self._seen.get(kind)
        if seen is not None and seen[0] is position:
            return seen[1]
        value = evaluate(position)
        self._seen[kind] = (position, value)
        return value


def _scale(constraints: ConstraintFamily, scene: Scene) -> np.ndarray:
    if not constraints.rows:
        return np.zeros(0)
    norms = np.linalg.norm(constraints.jacobian(scene.position), axis=1)
    norms[norms == 0] = 1.0
    return scene.length_scale * norms
