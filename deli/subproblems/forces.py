"""The force slots of a scheme, evaluated once for each configuration a step meets."""

import numpy as np

from deli.mechanics.energies import potential_hessian
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme


class Forces:
    """First and second force slots of a discrete Lagrangian (8.2, 8.3) for one scene and step.

    A step asks for the same force more than once: the second slot of one step is the first of the next (verlet), and
    the midpoint's two slots are one. The last answers are kept and known again by the identity of their arrays.

    Parameters
    ----------
    scene : Scene
    scheme : Scheme
    step_size : float

    Attributes
    ----------
    newton : bool
        Whether the force of the first slot depends on x and has a known derivative, so that Newton's metric pays.
    """

    def __init__(self, scene: Scene, scheme: Scheme, step_size: float) -> None:
        self.step_size = step_size
        self._scene = scene
        self._potential = scene.potential
        self._scheme = scheme
        hessian = scene.potential.hessian(scene.position) if scheme.implicit else None
        self.newton = hessian is not None and not (scene.potential.constant_hessian and not hessian.any())
        self._seen: list[tuple[np.ndarray, np.ndarray]] = []

    def first(self, position: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Force slot of D₁L_d(q, x)."""
        if self._scheme.implicit:
            return self._scheme.first_force(self._potential, position, moved, self.step_size)
        return self._at(position)

    def second(self, position: np.ndarray, moved: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Force slot of D₂L_d(q, x), given that of D₁L_d(q, x)."""
        return first if self._scheme.implicit else self._at(moved)

    def stiffness(self, position: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """Minus the derivative of the first slot by the velocity (x − q)/h: (h²/4)V″ at the midpoint."""
        return (0.25 * self.step_size**2) * potential_hessian(self._scene, 0.5 * (position + moved))

    def _at(self, position: np.ndarray) -> np.ndarray:
        for seen, force in self._seen:
            if seen is position:
                return force
        force = self._scheme.first_force(self._potential, position, position, self.step_size)
        self._seen = [(position, force), *self._seen[:1]]
        return force
