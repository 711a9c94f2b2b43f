"""Generalized reflection (6.6-6.9, Algorithms 2 and 3): approaching contacts turn back at no cost in energy."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from deli.errors import InputError, StepError
from deli.subproblems.choices import SolverChoice
from deli.subproblems.linear import EqualityProjection
from deli.subproblems.program import Program
from deli.subproblems.stats import StepStats

if TYPE_CHECKING:
    import cvxpy as cp

REFLECTION = 0
OPERATORS = ("generalized", "moreau", "sequential")
ENERGIES = ("hamiltonian", "numerical")
_PASSES = 1000
_MOST_PASSES = 1_000_000
_SAME = 1e-10  # relative difference of two momenta that are one


def model(mass: np.ndarray, rows: int, bilateral_rows: int) -> "cp.Problem":
    """Algorithm 2, line 9, with E = H: the nearest velocity to 2v that approaches no contact of 𝕍.

    ``minimize ½|v* − 2v|²_M  subject to  G_𝕍ᵀv* ≥ 0 (λ),  Fᵀv* = 0 (ν)``,  then p⁺ = p + G_𝕍λ + Fν.

    Complementarity λᵀG_𝕍ᵀv* = 0 is the conservation of energy, |v* − v|_M = |v|_M; λ solves (A.1).
    """
    return _projection(len(mass), rows, bilateral_rows, np.diag(mass))


def numerical_model(mass: np.ndarray, rows: int, bilateral_rows: int) -> "cp.Problem":
    """The same for an energy ½pᵀWp (theory: second-order numerical Hamiltonians), in the metric A = W⁻¹.

    ``minimize ½|u − 2Wp|²_A  subject to  Ĝ_𝕍ᵀu ≥ 0 (λ)``,  then p⁺ = p + Ĝ_𝕍λ, where Ĝ_𝕍 is projected as in (7.7).
    """
    import cvxpy as cp

    metric = cp.Parameter((len(mass), len(mass)), PSD=True, name="metric")
    return _projection(len(mass), rows, bilateral_rows, metric)


def _projection(dof: int, rows: int, bilateral_rows: int, metric: "np.ndarray | cp.Parameter") -> "cp.Problem":
    import cvxpy as cp

    velocity = cp.Variable(dof, name="velocity")
    linear = cp.Parameter(dof, name="linear")  # −2p
    gradients = cp.Parameter((rows, dof), name="gradients")
    bounds = cp.Parameter(rows, name="bounds")  # zero, but for the rows that pad
    constraints = [gradients @ velocity >= bounds]
    if bilateral_rows:
        bilateral = cp.Parameter((bilateral_rows, dof), name="bilateral")
        constraints.append(bilateral @ velocity == 0)
    return cp.Problem(cp.Minimize(0.5 * cp.quad_form(velocity, metric) + linear @ velocity), constraints)


class Reflection:
    """Applies a reflection operator R(q, p, 𝔸, E) to the contacts of an extended active set.

    Each pass selects rows of 𝔸, reflects off them together, and looks again, until no contact approaches:
    ``generalized`` selects the approaching contacts, ``moreau`` all that do not separate, ``sequential`` the next
    approaching one in index order.

    Parameters
    ----------
    mass : (dof,) array
    operator : str
        One of `OPERATORS`.
    metric : callable or None
        ``metric(q)`` returns W for an energy ½pᵀWp; None stands for W = M⁻¹, the Hamiltonian.
    """

    def __init__(
        self,
        mass: np.ndarray,
        operator: str,
        metric: Callable[[np.ndarray], np.ndarray] | None,
        choice: SolverChoice,
        stats: StepStats,
        skip: bool,
    ) -> None:
        if operator not in OPERATORS:
            raise InputError(f"reflection operator {operator!r} is unknown; allowed: {', '.join(OPERATORS)}.")
        self._mass = mass
        self._operator = operator
        self._metric = metric
        # n equal balls in a row need fewer than n² passes; a light one between heavy ones rattles as often as the root
        # of the masses' ratio.
        self._rattle = 4.0 * np.sqrt(mass.max() / mass.min())
        self._stats = stats
        self._skip = skip
        self.program = Program(REFLECTION, model, mass, choice, stats)
        self.numerical_program = Program(REFLECTION, numerical_model, mass, choice, stats)

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have solved something so far."""
        return self.program.backends | self.numerical_program.backends

    def apply(
        self,
        position: np.ndarray,
        momentum: np.ndarray,
        gradients: np.ndarray,
        bilateral: np.ndarray,
        velocity_tolerance: np.ndarray,
    ) -> tuple[np.ndarray, int]:
        """Return the reflected momentum, and how many contacts took part.

        Parameters
        ----------
        gradients : (contacts, dof) array
            G_𝔸(q)ᵀ, one row a contact.
        bilateral : (rows, dof) array
            F(q)ᵀ.
        velocity_tolerance : (contacts,) array
            Approach velocities below these count as zero.

        Raises
        ------
        StepError
            If no momentum lets all contacts separate, contacts still approach after a great many passes, or a solver
            fails.
        """
        reflected = np.zeros(len(gradients), dtype=bool)
        bilateral_projection = EqualityProjection(bilateral, bilateral / self._mass) if len(bilateral) else None
        limit = min(_MOST_PASSES, _PASSES + int(self._rattle * len(gradients) ** 2))
        last, before = -1, None
        for passes in range(limit):
            approach = gradients @ (momentum / self._mass)
            violated = approach < -velocity_tolerance
            if not violated.any():
                if passes == 0:
                    self._stats.skip(REFLECTION)
                return momentum, int(reflected.sum())
            if self._operator == "sequential":
                after = np.flatnonzero(violated)
                last = int(after[np.searchsorted(after, last + 1) % len(after)])
                selected = np.zeros_like(violated)
                selected[last] = True
            elif self._operator == "moreau":
                selected = approach <= velocity_tolerance
            else:
                selected = violated
            reflected |= selected
            turned = self._reflect(position, momentum, gradients[selected], bilateral, bilateral_projection)
            if before is not None and self._norm(turned - before) <= _SAME * self._norm(turned):
                raise StepError(
                    f"reflection: {self._operator!r} turns back and forth between {len(gradients)} contacts that leave "
                    f"the momentum no direction in which all of them separate; use a smaller step_size, so that "
                    f"fewer of them are met at once."
                )
            before, momentum = momentum, turned
        raise StepError(
            f"reflection: {self._operator!r} left {int(violated.sum())} of {len(gradients)} contacts approaching "
            f"(fastest at {approach.min():.2e}) after {limit} passes; try another operator or a smaller step_size."
        )

    def _norm(self, momentum: np.ndarray) -> float:
        return float(np.sqrt(momentum @ (momentum / self._mass)))

    def _reflect(
        self,
        position: np.ndarray,
        momentum: np.ndarray,
        rows: np.ndarray,
        bilateral: np.ndarray,
        bilateral_projection: EqualityProjection | None,
    ) -> np.ndarray:
        if self._metric is None:
            return momentum + self._impulse(momentum, rows, bilateral, bilateral_projection)
        impulse = self._numerical_impulse(position, momentum, rows, bilateral_projection)
        sizes = np.sqrt((rows * rows) @ (1.0 / self._mass))
        units = rows / np.where(sizes > 0.0, sizes, 1.0)[:, None]
        approach = (units @ (momentum / self._mass)).min()
        if (units @ ((momentum + impulse) / self._mass)).min() >= 0.5 * approach:
            return momentum + impulse
        # Contacts that graze approach in M⁻¹ while they recede in W, and no positive impulse conserves ½pᵀWp. Half the
        # impulse that conserves H is the smallest one that stops the approach.
        return momentum + 0.5 * self._impulse(momentum, rows, bilateral, bilateral_projection)

    def _impulse(
        self,
        momentum: np.ndarray,
        rows: np.ndarray,
        bilateral: np.ndarray,
        bilateral_projection: EqualityProjection | None,
    ) -> np.ndarray:
        """The impulse that conserves the Hamiltonian."""
        if self._skip and len(rows) == 1:
            self._stats.skip(REFLECTION)
            normal = self._tangent(rows, bilateral_projection)[0]
            response = normal / self._mass
            return (-2.0 * (response @ momentum) / (response @ normal)) * normal
        answer = self.program.solve(2.0 * momentum, rows, None, bilateral)
        return answer.unilateral @ rows + answer.bilateral @ bilateral

    def _numerical_impulse(
        self,
        position: np.ndarray,
        momentum: np.ndarray,
        rows: np.ndarray,
        bilateral_projection: EqualityProjection | None,
    ) -> np.ndarray:
        """The impulse that conserves ½pᵀWp; nearly none where contacts graze."""
        assert self._metric is not None
        metric = self._metric(position)
        normals = self._tangent(rows, bilateral_projection)
        if self._skip and len(normals) == 1:
            self._stats.skip(REFLECTION)
            response = metric @ normals[0]
            return max(0.0, -2.0 * (response @ momentum) / (response @ normals[0])) * normals[0]
        inverse = np.linalg.solve(metric, np.eye(len(momentum)))
        answer = self.numerical_program.solve(
            2.0 * momentum, normals, None, normals[:0], metric=0.5 * (inverse + inverse.T)
        )
        return np.maximum(answer.unilateral, 0.0) @ normals

    def _tangent(self, rows: np.ndarray, bilateral_projection: EqualityProjection | None) -> np.ndarray:
        """Gradients projected on the cotangent space of the bilateral constraints (7.7)."""
        if bilateral_projection is None:
            return rows
        return np.array([bilateral_projection.project(row / self._mass)[0] * self._mass for row in rows])
