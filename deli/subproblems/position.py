"""Position update with complementarity (7.3, 7.4, 7.8), solved as a sequence of metric projections."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from deli.errors import StepError
from deli.mechanics.scene import Scene
from deli.subproblems.choices import SolverChoice
from deli.subproblems.forces import Forces
from deli.subproblems.newton import Newton
from deli.subproblems.program import Multipliers, Program
from deli.subproblems.stats import StepStats

if TYPE_CHECKING:
    import cvxpy as cp

POSITION = 1
_TARGET = 1e-14  # scaled residual at which the iteration is done
_ACCEPTED = 1e-10  # scaled residual accepted of an iteration that has reached its floor
_SLACK = 10.0  # what is accepted instead of an unpolished solver, in its tolerances
_ITERATIONS = 200
_PROGRESS = 0.9  # factor by which a residual has to fall to count as progress
_PATIENCE = 3  # iterations without progress after which the floor is reached
_ROUNDING = 8 * np.finfo(float).eps


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
    """A trial or final x = q + h v.

    Attributes
    ----------
    position, velocity, force : (dof,) arrays
        x, v = (x − q)/h, and the force of the first slot at (q, x).
    gaps, pressed : (m,) arrays
        g_i(x) in units of the scene's length, and λ_i|∇g_i| in units of the step's impulses, for its rows.
    residuals : (float, float, float)
        Scaled residuals, primal, dual and complementarity, of the nonlinear system (7.3, 7.4, 7.8).
    """

    position: np.ndarray
    velocity: np.ndarray
    force: np.ndarray
    gaps: np.ndarray
    pressed: np.ndarray
    residuals: tuple[float, float, float]


@dataclass(frozen=True)
class _Rows:
    """The constraints of one position update, with their gradients at q."""

    chosen: np.ndarray
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
        self._root = np.sqrt(scene.mass)
        self._gap_scale = gap_scale
        self._bilateral_scale = bilateral_scale
        self._choice = choice
        self._stats = stats
        self._skip = skip
        self._newton = Newton(scene.mass, forces)
        self._free = _Rows(np.zeros(0, dtype=int), np.zeros((0, scene.dof)), np.zeros((0, scene.dof)))
        linearize = newton_model if forces.newton else model
        self.program = Program(POSITION, linearize, scene.mass, choice, stats, measured=False)

    def predict(self, position: np.ndarray, momentum: np.ndarray) -> Update:
        """Return the unconstrained step: x with D₁L_d(q, x) + p = 0 (8.1)."""
        return self._iterate(position, momentum, self._free, momentum / self._scene.mass, through_model=False)

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
            If the nonlinear system is not solved to a scaled residual of 1e-10 (or, by a solver that is not polished,
            to ten of its tolerances).
        """
        through_model = len(rows) > 0 or not self._skip
        if not through_model:
            self._stats.skip(POSITION)
        update = self._iterate(position, momentum, _Rows(rows, gradients, bilateral), guess.velocity, through_model)
        self._stats.measure(POSITION, *update.residuals)
        return update

    def _iterate(
        self, position: np.ndarray, momentum: np.ndarray, rows: _Rows, velocity: np.ndarray, through_model: bool
    ) -> Update:
        step_size = self._forces.step_size
        exact = self._choice.polish or not through_model
        accepted = _ACCEPTED if exact else max(_ACCEPTED, _SLACK * self._choice.tolerance)
        moved = position + step_size * velocity
        force, gaps, mismatch = self._evaluate(position, moved, rows)
        best, least, stalled = None, np.inf, 0
        for _ in range(_ITERATIONS):
            linearization = self._newton.at(position, momentum, velocity, moved, force)
            targets = rows.bilateral @ velocity - mismatch / step_size
            if through_model:
                bounds = rows.gradients @ velocity - gaps / step_size
                answer = self.program.solve(
                    linearization.linear, rows.gradients, bounds, rows.bilateral, targets, linearization.matrix
                )
            else:
                answer = self._newton.solve(linearization, rows.bilateral, targets)
            velocity = answer.velocity
            moved = position + step_size * velocity
            force, gaps, mismatch = self._evaluate(position, moved, rows)
            update = self._judge(momentum, rows, moved, answer, force, gaps, mismatch)
            worst = max(update.residuals) if exact else self._certified(update)
            stalled = 0 if worst < _PROGRESS * least else stalled + 1
            if best is None or worst < least:
                best, least = update, worst
            if least <= _TARGET or (stalled >= _PATIENCE and least <= accepted) or not np.isfinite(worst):
                break
        if best is not None and least <= max(accepted, self._floor(position, momentum, best)):
            return best
        residuals = (np.nan,) * 3 if best is None else best.residuals
        raise StepError(
            f"position: the update with {len(rows.chosen)} unilateral and {len(rows.bilateral)} bilateral constraints "
            f"did not converge: scaled residuals are primal {residuals[0]:.1e}, dual {residuals[1]:.1e}, "
            f"complementarity {residuals[2]:.1e} where {accepted:.0e} is allowed; use a smaller step_size, "
            f"polish = true or a tighter tolerance, or a potential with a hessian."
        )

    def _evaluate(
        self, position: np.ndarray, moved: np.ndarray, rows: _Rows
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Force of the first slot at (q, x), g_𝕊(x) and f(x)."""
        gaps = self._scene.unilateral.value(moved)[rows.chosen] if len(rows.chosen) else _NONE
        mismatch = self._scene.bilateral.value(moved) if len(rows.bilateral) else _NONE
        return self._forces.first(position, moved), gaps, mismatch

    def _judge(
        self,
        momentum: np.ndarray,
        rows: _Rows,
        moved: np.ndarray,
        answer: Multipliers,
        force: np.ndarray,
        gaps: np.ndarray,
        mismatch: np.ndarray,
    ) -> Update:
        """Measure the residuals of (7.3, 7.4, 7.8) at x; impulses are compared in the metric of the masses."""
        carried = self._scene.mass * answer.velocity
        error = carried - momentum - force
        impulse = self._largest(carried, momentum, force) or 1.0
        primal = complementarity = 0.0
        pressed = scaled = _NONE
        if len(gaps):
            error -= answer.unilateral @ rows.gradients
            normals = rows.gradients / self._root
            pressed = answer.unilateral * np.sqrt(np.einsum("ij,ij->i", normals, normals)) / impulse
            scaled = gaps / self._gap_scale[rows.chosen]
            primal = max(0.0, -float(scaled.min()))
            complementarity = float(np.abs(np.minimum(pressed, scaled)).max())
        if len(mismatch):
            error -= answer.bilateral @ rows.bilateral
            primal = max(primal, float(np.abs(mismatch / self._bilateral_scale).max()))
        dual = float(np.abs(error / self._root).max()) / impulse
        return Update(moved, answer.velocity, force, scaled, pressed, (primal, dual, complementarity))

    def _largest(self, *impulses: np.ndarray) -> float:
        """Largest entry of some impulses in the metric of the masses."""
        return max(float(np.abs(impulse / self._root).max()) for impulse in impulses)

    def _certified(self, update: Update) -> float:
        """The residual that an interior-point solver can vouch for: products λg in place of min(λ, g)."""
        primal, dual, _ = update.residuals
        product = float(np.abs(update.pressed * update.gaps).max(initial=0.0))
        negative = -float(update.pressed.min(initial=0.0))
        return max(primal, dual, product, negative)

    def _floor(self, position: np.ndarray, momentum: np.ndarray, update: Update) -> float:
        """What rounding of x alone leaves of the residuals: far from the origin, or of a stiff force."""
        reach = np.abs(update.position)
        floor = float(reach.max()) / self._scene.length_scale
        if self._forces.newton:
            stiffness = np.abs(self._forces.stiffness(position, update.position))
            impulse = self._largest(momentum, update.force) or 1.0
            floor = max(floor, float((stiffness @ reach / self._root).max()) / (self._forces.step_size * impulse))
        return _ROUNDING * floor


_NONE = np.zeros(0)
