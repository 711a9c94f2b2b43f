"""Position update with complementarity (7.3, 7.4, 7.8), solved as a sequence of metric projections."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from deli.errors import StepError
from deli.mechanics.scene import Scene
from deli.subproblems.choices import SolverChoice
from deli.subproblems.forces import Forces
from deli.subproblems.linear import EqualityProjection
from deli.subproblems.program import Multipliers, Program
from deli.subproblems.stats import StepStats

if TYPE_CHECKING:
    import cvxpy as cp

POSITION = 1
_TARGET = 1e-14  # scaled residual at which the iteration is done
_ACCEPTED = 1e-10  # scaled residual with which one that no longer improves is accepted, or ten solver tolerances
_ITERATIONS = 100
_PATIENCE = 3  # iterations without halving the residual before the iteration is taken to have reached its floor


def model(mass: np.ndarray, rows: int, bilateral_rows: int) -> "cp.Problem":
    """One linearization of the position update about x_j, with the gradients frozen at q where the forces act.

    ``minimize ½vᵀA v − ŵᵀv  subject to  N_𝕊(q)ᵀv ≥ b (λ),  F(q)ᵀv = c (ν)``,  then x_{j+1} = q + h v, with::

        b = (−g(x_j) + N(q)ᵀ(x_j − q)) / h        c = (−f(x_j) + F(q)ᵀ(x_j − q)) / h
        A = M,  ŵ = p + φ(q, x_j)       or, by Newton,      A = M + (h²/4)V″,  ŵ = p + φ(q, x_j) + (h²/4)V″v_j

    Where x_{j+1} = x_j the linearization is exact: (x, λ, ν) solves the asymmetric system (7.3, 7.4, 7.8) itself.
    """
    return _linearization(mass, rows, bilateral_rows, newton=False)


def newton_model(mass: np.ndarray, rows: int, bilateral_rows: int) -> "cp.Problem":
    """`model` with the Newton metric A as a parameter."""
    return _linearization(mass, rows, bilateral_rows, newton=True)


def _linearization(mass: np.ndarray, rows: int, bilateral_rows: int, newton: bool) -> "cp.Problem":
    import cvxpy as cp

    dof = len(mass)
    velocity = cp.Variable(dof, name="velocity")
    linear = cp.Parameter(dof, name="linear")  # −ŵ
    metric = cp.Parameter((dof, dof), PSD=True, name="metric") if newton else np.diag(mass)
    constraints = []
    if rows:
        gradients = cp.Parameter((rows, dof), name="gradients")
        bounds = cp.Parameter(rows, name="bounds")
        constraints.append(gradients @ velocity >= bounds)
    if bilateral_rows:
        bilateral = cp.Parameter((bilateral_rows, dof), name="bilateral")
        targets = cp.Parameter(bilateral_rows, name="targets")
        constraints.append(bilateral @ velocity == targets)
    return cp.Problem(cp.Minimize(0.5 * cp.quad_form(velocity, metric) + linear @ velocity), constraints)


@dataclass(frozen=True)
class Update:
    """A trial or final x = q + h v, with the force of the first slot there."""

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray


@dataclass(frozen=True)
class _Constraints:
    """The rows of one position update: gradients at q, values wherever they are asked for."""

    rows: np.ndarray
    gradients: np.ndarray
    bilateral: np.ndarray


class Position:
    """Solves the predictions and position updates of a run.

    Without constraints the update is the unconstrained step D₁L_d(q, x) + p = 0, with bilateral ones alone each
    linearization is one linear solve; the model is solved for the rest, or for all where ``skip`` is false.

    Parameters
    ----------
    scene : Scene
    forces : Forces
        The force slots of the scheme.
    gap_scale, bilateral_scale : (rows,) arrays
        The size of a gap or equality that counts as one: the scene's length times the norm of the row's gradient.
    """

    def __init__(
        self,
        scene: Scene,
        forces: Forces,
        gap_scale: np.ndarray,
        bilateral_scale: np.ndarray,
        choice: SolverChoice,
        stats: StepStats,
        skip: bool,
    ) -> None:
        self._scene = scene
        self._forces = forces
        self._gap_scale = gap_scale
        self._bilateral_scale = bilateral_scale
        self._stats = stats
        self._skip = skip
        self._tolerance = max(_ACCEPTED, 10 * choice.tolerance)
        self._mass_matrix = np.diag(scene.mass)
        self._free = _Constraints(np.zeros(0, dtype=int), np.zeros((0, scene.dof)), np.zeros((0, scene.dof)))
        linearize = newton_model if forces.newton else model
        self.program = Program(POSITION, linearize, scene.mass, choice, stats, measured=False)

    def predict(self, position: np.ndarray, momentum: np.ndarray) -> Update:
        """Return the unconstrained step: x with D₁L_d(q, x) + p = 0 (8.1)."""
        start = self._at(position, momentum / self._scene.mass)
        return self._iterate(position, momentum, self._free, start, through_model=False)[0]

    def solve(
        self,
        position: np.ndarray,
        momentum: np.ndarray,
        rows: np.ndarray,
        gradients: np.ndarray,
        bilateral: np.ndarray,
        guess: Update,
    ) -> Update:
        """Return the x of (7.8).

        Parameters
        ----------
        momentum : (dof,) array
            p⁺, after the reflection.
        rows : (m,) array of int
            The smooth set 𝕊, as indices of unilateral constraints.
        gradients, bilateral : (m, dof) and (k, dof) arrays
            N_𝕊(q)ᵀ and F(q)ᵀ.
        guess : Update
            Where to start, such as the prediction.

        Raises
        ------
        StepError
            If the nonlinear system is not solved to a scaled residual of 1e-10 (or ten solver tolerances).
        """
        through_model = len(rows) > 0 or not self._skip
        if not through_model:
            self._stats.skip(POSITION)
        constraints = _Constraints(rows, gradients, bilateral)
        update, residuals = self._iterate(position, momentum, constraints, guess, through_model)
        self._stats.measure(POSITION, *residuals)
        return update

    def _iterate(
        self,
        position: np.ndarray,
        momentum: np.ndarray,
        constraints: _Constraints,
        guess: Update,
        through_model: bool,
    ) -> tuple[Update, tuple[float, float, float]]:
        mass = self._scene.mass
        equalities = None
        if not through_model and len(constraints.bilateral) and not self._forces.newton:
            equalities = EqualityProjection(constraints.bilateral, constraints.bilateral / mass)
        update = guess
        gaps, mismatch = self._values(update.position, constraints)
        best, stalled = np.inf, 0
        for _ in range(_ITERATIONS):
            metric, linear = self._metric(position, momentum, update)
            bounds = constraints.gradients @ update.velocity - gaps / self._forces.step_size
            targets = constraints.bilateral @ update.velocity - mismatch / self._forces.step_size
            if through_model:
                answer = self.program.solve(
                    linear,
                    constraints.gradients,
                    bounds,
                    constraints.bilateral,
                    targets,
                    (self._mass_matrix if metric is None else metric[0]) if self._forces.newton else None,
                )
            else:
                answer = self._solve_linear(metric, linear, constraints.bilateral, targets, equalities)
            update = self._at(position, answer.velocity)
            gaps, mismatch = self._values(update.position, constraints)
            residuals = self._residuals(momentum, constraints, update, answer, gaps, mismatch)
            worst = max(residuals)
            stalled = 0 if worst < 0.5 * best else stalled + 1
            best = min(best, worst)
            if worst <= _TARGET or (stalled >= _PATIENCE and worst <= min(self._tolerance, 2.0 * best)):
                return update, residuals
            if not np.isfinite(worst):
                break
        raise StepError(
            f"position: the update did not converge: scaled residuals are primal {residuals[0]:.1e}, "
            f"dual {residuals[1]:.1e}, complementarity {residuals[2]:.1e} where {self._tolerance:.0e} is allowed; "
            f"use a smaller step_size, a tighter solver tolerance, or supply the potential's hessian."
        )

    def _at(self, position: np.ndarray, velocity: np.ndarray) -> Update:
        moved = position + self._forces.step_size * velocity
        return Update(moved, velocity, self._forces.first(position, moved))

    def _values(self, position: np.ndarray, constraints: _Constraints) -> tuple[np.ndarray, np.ndarray]:
        gaps = self._scene.unilateral.value(position)[constraints.rows] if len(constraints.rows) else _NONE
        mismatch = self._scene.bilateral.value(position) if len(constraints.bilateral) else _NONE
        return gaps, mismatch

    def _metric(
        self, position: np.ndarray, momentum: np.ndarray, update: Update
    ) -> tuple[tuple[np.ndarray, np.ndarray] | None, np.ndarray]:
        """Return (A, its Cholesky factor), or None for A = M, and ŵ."""
        if self._forces.newton:
            stiffness = self._forces.stiffness(position, update.position)
            metric = self._mass_matrix + stiffness
            factor, info = dpotrf(metric, lower=1)
            if info == 0:
                return (metric, factor), momentum + update.force + stiffness @ update.velocity
        return None, momentum + update.force

    def _solve_linear(
        self,
        metric: tuple[np.ndarray, np.ndarray] | None,
        linear: np.ndarray,
        bilateral: np.ndarray,
        targets: np.ndarray,
        equalities: EqualityProjection | None,
    ) -> Multipliers:
        mass = self._scene.mass
        velocity = linear / mass if metric is None else dpotrs(metric[1], linear, lower=1)[0]
        if not len(bilateral):
            return Multipliers(velocity, _NONE, _NONE)
        if equalities is None:
            response = bilateral / mass if metric is None else dpotrs(metric[1], bilateral.T, lower=1)[0].T
            equalities = EqualityProjection(bilateral, response)
        multipliers = equalities.multipliers(targets - bilateral @ velocity)
        return Multipliers(velocity + multipliers @ equalities.response, _NONE, multipliers)

    def _residuals(
        self,
        momentum: np.ndarray,
        constraints: _Constraints,
        update: Update,
        answer: Multipliers,
        gaps: np.ndarray,
        mismatch: np.ndarray,
    ) -> tuple[float, float, float]:
        """Scaled residuals (primal, dual, complementarity) of the nonlinear system (7.3, 7.4, 7.8)."""
        carried = self._scene.mass * update.velocity
        force_error = carried - momentum - update.force
        impulse = max(np.abs(carried).max(), np.abs(momentum).max(), np.abs(update.force).max()) or 1.0
        primal = complementarity = 0.0
        if len(gaps):
            force_error -= answer.unilateral @ constraints.gradients
            scale = self._gap_scale[constraints.rows]
            scaled = gaps / scale
            primal = max(0.0, -scaled.min())
            # λ times the norm of its gradient is an impulse.
            pressed = answer.unilateral * (scale / self._scene.length_scale) / impulse
            complementarity = np.abs(np.minimum(pressed, scaled)).max()
        if len(mismatch):
            force_error -= answer.bilateral @ constraints.bilateral
            primal = max(primal, np.abs(mismatch / self._bilateral_scale).max())
        return float(primal), float(np.abs(force_error).max() / impulse), float(complementarity)


_NONE = np.zeros(0)
