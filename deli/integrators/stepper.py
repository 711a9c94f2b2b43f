"""What every integrator's step needs: the scene's subproblems, bound to one step size and one choice of solvers."""

from abc import ABC, abstractmethod

import numpy as np

from deli.errors import InputError, StepError
from deli.integrators.contacts import Contacts
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme
from deli.subproblems.choices import parse_choices
from deli.subproblems.forces import Forces
from deli.subproblems.position import POSITION, Position, Update
from deli.subproblems.projection import Projection
from deli.subproblems.stats import StepStats


class Stepper(ABC):
    """Advances one scene by one step at a time.

    A step is a function of (q, p) alone: nothing is warm-started, so a run can be continued from any recorded state.

    Parameters
    ----------
    scene : Scene
    scheme : Scheme
    step_size : float
        h > 0.
    solvers : str or mapping
        As for `deli.simulate`.
    skip : bool
        Answer without a solver what needs none; the trajectory is the same to solver tolerance.
    contact_tolerance : float
        τ of `deli.integrators.contacts.Contacts`.

    Attributes
    ----------
    stats : StepStats
        What the steps since the last ``stats.reset()`` cost.
    """

    def __init__(
        self,
        scene: Scene,
        scheme: Scheme,
        step_size: float,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
    ) -> None:
        if isinstance(step_size, bool) or not isinstance(step_size, (int, float)) or not 0 < step_size < np.inf:
            raise InputError(f"step_size is {step_size!r}; allowed: a finite number > 0.")
        self.scene = scene
        self.step_size = float(step_size)
        self.choices = parse_choices(solvers)
        self.skip = skip
        self.stats = StepStats()
        self._mass = scene.mass
        self._contacts = Contacts(scene, contact_tolerance)
        self._forces = Forces(scene, scheme, self.step_size)
        self._position = Position(
            scene,
            self._forces,
            self._contacts.gap_scale,
            self._contacts.bilateral_scale,
            self.choices["position"],
            self.stats,
            skip,
        )
        self._projection = Projection(scene.mass, self.choices["projection"], self.stats, skip)

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have solved something so far."""
        return self._position.program.backends | self._projection.program.backends

    def step(self, position: np.ndarray, momentum: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (q, p) one step later, both (dof,) arrays that are not to be written to.

        Raises
        ------
        StepError
            If a subproblem could not be solved, or the state is no longer finite.
        """
        # Values are remembered by the identity of arrays, so an array that somebody may write to is copied.
        position, momentum = _own(position), _own(momentum)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            moved, carried = self._step(position, momentum)
        if not (np.isfinite(moved).all() and np.isfinite(carried).all()):
            raise StepError("the state is no longer finite; use a smaller step_size.")
        moved.flags.writeable = False
        carried.flags.writeable = False
        return moved, carried

    @abstractmethod
    def _step(self, position: np.ndarray, momentum: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (q, p) one step later."""

    def _move(self, position: np.ndarray, momentum: np.ndarray, rows: np.ndarray, guess: Update, free: bool) -> Update:
        """Position update (7.3, 7.4, 7.8) with the constraints `rows` pressing.

        `guess` is a prediction, and `free` says that it was made with this very momentum: without constraints it is
        the answer.
        """
        contacts = self._contacts
        bilateral = contacts.bilateral(position)
        if self.skip and free and not len(rows) and not len(bilateral):
            self.stats.skip(POSITION)
            return guess
        gradients = contacts.gradients(position)[rows] if len(rows) else contacts.no_rows
        return self._position.solve(position, momentum, rows, gradients, bilateral, guess)

    def _project(self, position: np.ndarray, update: Update, smooth: np.ndarray) -> np.ndarray:
        """Momentum update (7.5, 7.6, 7.9): D₂L_d(q, x), projected off what stays active at x."""
        contacts, moved = self._contacts, update.position
        momentum = self._mass * update.velocity + self._forces.second(position, moved, update.force)
        active = smooth
        if len(smooth):
            opened = smooth[update.pressed[: len(smooth)] < update.gaps[: len(smooth)]]
            active = np.setdiff1d(smooth[contacts.touching(moved)[smooth]], opened)
        gradients = contacts.gradients(moved)[active] if len(active) else contacts.no_rows
        return self._projection.solve(momentum, gradients, contacts.bilateral(moved))


def _own(array: np.ndarray) -> np.ndarray:
    if array.flags.writeable or array.base is not None:
        array = np.array(array, dtype=float)
        array.flags.writeable = False
    return array
