"""Runs of a stepper with what each step recorded."""

from dataclasses import dataclass

import numpy as np

import deli

SOLVED_STATUSES = {0, 1, 4}  # skipped, solved, not used
EPSILON = np.finfo(float).eps
STILL = 1e-8  # speed, as a share of that of all bodies, below which a contact does not move
PERTURBATION = 1e-9  # below the contact tolerance, so that contacts stay what they are


@dataclass(frozen=True)
class Run:
    """States (steps + 1, dof), and per step: contacts, solver counts (steps, 3), worst residual and status.

    `states` are the same as a stepper takes them: with what the method carries besides q and p.
    """

    scene: deli.Scene
    position: np.ndarray
    momentum: np.ndarray
    smooth: np.ndarray
    reflected: np.ndarray
    solves: np.ndarray
    skipped: np.ndarray
    residuals: np.ndarray
    status: np.ndarray
    backends: set[str]
    states: list[tuple[np.ndarray, ...]]

    @property
    def steps(self) -> int:
        return len(self.smooth)

    @property
    def residual(self) -> float:
        """The worst recorded residual of the run, zero if none was measured."""
        return float(np.nanmax(self.residuals, initial=0.0))

    @property
    def energy(self) -> np.ndarray:
        return energy(self.scene, self.position, self.momentum)

    @property
    def gap(self) -> float:
        """The worst gap of the run."""
        return float(self.scene.unilateral.value(self.position).min())

    @property
    def rounding(self) -> float:
        """What `steps` steps may add to a relative error: their residuals, and some rounding each."""
        return self.steps * (self.residual + 50 * EPSILON)


def angular_momentum(position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    """Sum over bodies of q x p, (..., bodies, dimension) -> (..., axes), about the origin."""
    planes = {1: [], 2: [(0, 1)], 3: [(1, 2), (2, 0), (0, 1)]}[position.shape[-1]]
    components = [position[..., i] * momentum[..., j] - position[..., j] * momentum[..., i] for i, j in planes]
    return np.array([component.sum(axis=-1) for component in components]).T


def energy(scene: deli.Scene, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
    return 0.5 * (momentum**2 / scene.mass).sum(axis=-1) + scene.potential.energy(position)


def run(scene: deli.Scene, method: object, step_size: float, steps: int, solvers: object = "daqp", **options) -> Run:
    """Step `steps` times from the scene's initial state, or from another one, ``start``."""
    states = [options.pop("start", (scene.position, scene.momentum))]
    stepper = method.stepper(scene, step_size, solvers=solvers, **options)
    stats = stepper.stats
    smooth, reflected, solves, skipped, residuals, status = [], [], [], [], [], []
    for _ in range(steps):
        stats.reset()
        states.append(stepper.step(*states[-1]))
        smooth.append(stats.smooth_contacts)
        reflected.append(stats.reflected_contacts)
        solves.append(stats.solves.copy())
        skipped.append(stats.skipped.copy())
        residuals.append([stats.primal_residual, stats.dual_residual, stats.complementarity])
        residuals[-1] = np.array(residuals[-1])
        status.append(stats.status.copy())
    return Run(
        scene,
        np.array([state[0] for state in states]),
        np.array([state[1] for state in states]),
        np.array(smooth),
        np.array(reflected),
        np.array(solves),
        np.array(skipped),
        np.array(residuals),
        np.array(status),
        stepper.backends,
        states,
    )


def sizes(of: Run) -> tuple[float, float]:
    """The largest position and momentum entries of a run, by which differences are measured."""
    return float(np.abs(of.position).max()), float(np.abs(of.momentum).max())


def difference(one: Run, other: Run) -> float:
    """The largest difference of two runs of one scene, relative to the run."""
    position, momentum = sizes(one)
    return max(
        float(np.abs(one.position - other.position).max()) / position,
        float(np.abs(one.momentum - other.momentum).max()) / momentum,
    )


def growth(of: Run, method: object, step_size: float, **options: object) -> float:
    """By how much the run enlarges a small difference: it is made in the momentum after the first step."""
    start = (of.position[1], of.momentum[1] * (1.0 + PERTURBATION))
    disturbed = run(of.scene, method, step_size, of.steps - 1, start=start, **options)
    position, momentum = sizes(of)
    moved = max(
        np.abs(disturbed.position - of.position[1:]).max() / position,
        np.abs(disturbed.momentum - of.momentum[1:]).max() / momentum,
    )
    return max(1.0, float(moved) / PERTURBATION)


def resolution(of: Run) -> float:
    """To what an impulse can be found from an energy, relative to the momenta: rounding over the slowest separation."""
    scene, slowest = of.scene, 1.0
    for step in np.flatnonzero(of.reflected):
        jacobian = scene.unilateral.jacobian(of.position[step + 1])
        velocity = of.momentum[step + 1] / scene.mass
        speeds = np.abs(jacobian @ velocity) / np.abs(velocity).max()
        slowest = min(slowest, speeds[speeds > STILL].min(initial=1.0))
    return 50 * EPSILON * of.reflected.sum() / slowest
