"""The Generalized Variational Integrator: Algorithm 1 with bilateral constraints (7.8, 7.9)."""

from dataclasses import dataclass

import numpy as np

from deli.errors import InputError
from deli.integrators.stepper import Stepper
from deli.mechanics.energies import reflection_metric
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import SCHEMES, get_scheme
from deli.subproblems.position import Update
from deli.subproblems.reflection import ENERGIES, OPERATORS, REFLECTION, Reflection

PREDICTORS = ("forward", "closed_loop")


@dataclass(frozen=True)
class GVI:
    """Generalized Variational Integrator (Kaufman and Pai 2012, Algorithm 1).

    Each step reflects the momentum off the extended active set 𝔸 (6.4), moves to x with complementarity on the smooth
    set 𝕊 (7.1, 7.8), and projects the momentum (7.9). On smooth intervals the map is symplectic, conserves momentum
    maps and is of second order (Theorem 5.1); with impacts it is of first order.

    Parameters
    ----------
    scheme : {"midpoint", "verlet"}
        Quadrature of the discrete Lagrangian (8.2, 8.3).
    reflection : {"generalized", "moreau", "sequential"}
        Reflection operator: Algorithm 2, Algorithm 3, or one contact at a time in index order.
    energy : {"hamiltonian", "numerical"}
        What a reflection conserves: H, or the scheme's second-order numerical Hamiltonian.
    predictor : {"forward", "closed_loop"}
        Where 𝔸 comes from: the unconstrained step (8.1), or the step's own result, repeated until it violates nothing
        that a reflection or a complementarity of this step can prevent.

    Raises
    ------
    InputError
        For a name that is not in these lists.
    """

    scheme: str = "midpoint"
    reflection: str = "generalized"
    energy: str = "hamiltonian"
    predictor: str = "forward"

    def __post_init__(self) -> None:
        for key, allowed in (
            ("scheme", SCHEMES),
            ("reflection", OPERATORS),
            ("energy", ENERGIES),
            ("predictor", PREDICTORS),
        ):
            if getattr(self, key) not in allowed:
                raise InputError(f"GVI: {key} {getattr(self, key)!r} is unknown; allowed: {', '.join(allowed)}.")

    def stepper(
        self,
        scene: Scene,
        step_size: float,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
    ) -> "GVIStepper":
        """Bind the method to a scene; see `deli.integrators.stepper.Stepper`."""
        return GVIStepper(self, scene, step_size, solvers, skip, contact_tolerance)


class GVIStepper(Stepper):
    """Steps of a `GVI`."""

    def __init__(
        self,
        method: GVI,
        scene: Scene,
        step_size: float,
        solvers: object,
        skip: bool,
        contact_tolerance: float,
    ) -> None:
        scheme = get_scheme(method.scheme)
        super().__init__(scene, scheme, step_size, solvers, skip, contact_tolerance)
        self.method = method
        metric = None
        if method.energy == "numerical":

            def metric(position: np.ndarray) -> np.ndarray:
                return reflection_metric(scene, scheme, position, self.step_size)

        self._reflection = Reflection(
            scene.mass, method.reflection, metric, self.choices["reflection"], self.stats, skip
        )

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have solved something so far."""
        return super().backends | self._reflection.backends

    def _step(self, position: np.ndarray, momentum: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        contacts = self._contacts
        touching = contacts.touching(position)
        prediction = self._position.predict(position, momentum)
        if self.method.predictor == "forward":
            active = touching | contacts.crossed(prediction.position)
            update, smooth = self._attempt(position, momentum, prediction, touching, active, _NO_LANDING)
        else:
            update, smooth = self._close_loop(position, momentum, prediction, touching)
        self.stats.smooth_contacts = len(smooth)
        return update.position, self._project(position, update, smooth)

    def _close_loop(
        self, position: np.ndarray, momentum: np.ndarray, prediction: Update, touching: np.ndarray
    ) -> tuple[Update, np.ndarray]:
        """Repeat the step with all that its result violates, until it violates nothing more that can be helped.

        What is violated joins 𝔸; what is in 𝔸 and violated still (a bounce shorter than the step) lands: it joins
        the complementarity of this step's position update, but not 𝕊. Both sets only grow, so this ends.
        """
        active = touching.copy()
        landing = np.zeros_like(touching)
        while True:
            update, smooth = self._attempt(position, momentum, prediction, touching, active, landing)
            violated = self._contacts.violated(update.position)
            lands = violated & active & ~landing
            lands[smooth] = False
            if not (lands.any() or (violated & ~active).any()):
                return update, smooth
            active |= violated
            landing |= lands

    def _attempt(
        self,
        position: np.ndarray,
        momentum: np.ndarray,
        prediction: Update,
        touching: np.ndarray,
        active: np.ndarray,
        landing: np.ndarray,
    ) -> tuple[Update, np.ndarray]:
        """Reflect off 𝔸, find 𝕊, update the position; return the update and 𝕊."""
        contacts = self._contacts
        bilateral = contacts.bilateral(position)
        smooth = _NONE
        reflected = momentum
        rows = np.flatnonzero(active)
        if len(rows):
            gradients = contacts.gradients(position)
            force = self._forces.first(position, position)
            reflected, count = self._reflection.apply(
                position,
                momentum,
                gradients[rows],
                bilateral,
                contacts.velocity_zero(gradients[rows], momentum, force),
            )
            self.stats.reflected_contacts += count
            smooth = contacts.smooth(np.flatnonzero(touching), gradients, reflected, force)
        else:
            self.stats.skip(REFLECTION)
        pressing = smooth
        if landing.any():
            pressing = np.concatenate((smooth, np.setdiff1d(np.flatnonzero(landing), smooth)))
        return self._move(position, reflected, pressing, prediction, free=reflected is momentum), smooth


_NONE = np.zeros(0, dtype=int)
_NO_LANDING = np.zeros(0, dtype=bool)
