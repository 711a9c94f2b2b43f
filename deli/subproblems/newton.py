"""The metric in which a position update is linearized: the masses, or Newton's for an implicit force."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from deli.subproblems.forces import Forces
from deli.subproblems.linear import EqualityProjection
from deli.subproblems.program import Multipliers

_SOFTEST = -0.5  # least eigenvalue, relative to the masses, that the metric takes from an indefinite hessian
_NONE = np.zeros(0)


@dataclass(frozen=True)
class Linearization:
    """Right-hand side ŵ and metric A of one linearization; `matrix` None stands for A = M."""

    linear: np.ndarray
    matrix: np.ndarray | None
    factor: np.ndarray | None


class Newton:
    """Linearizes ``M v = p + φ(q, q + h v) + …`` about a trial velocity, and solves what has no inequality rows.

    By Newton, A = M + (h²/4)V″ and ŵ = p + φ + (h²/4)V″v. Where A is not positive definite, the hessian's most negative
    eigenvalues are raised in both: the fixed point is the same. Explicit forces, and potentials without a
    hessian, have A = M and ŵ = p + φ.

    Parameters
    ----------
    mass : (dof,) array
    forces : Forces
    """

    def __init__(self, mass: np.ndarray, forces: Forces) -> None:
        self._mass = mass
        self._root = np.sqrt(mass)
        self._forces = forces
        self._equalities: EqualityProjection | None = None

    def at(
        self, position: np.ndarray, momentum: np.ndarray, velocity: np.ndarray, moved: np.ndarray, force: np.ndarray
    ) -> Linearization:
        """Linearize about x = `moved` = q + h `velocity`, where the force of the first slot is `force`."""
        if not self._forces.newton:
            return Linearization(momentum + force, None, None)
        stiffness = self._forces.stiffness(position, moved)
        matrix = np.diag(self._mass) + stiffness
        factor, info = dpotrf(matrix, lower=1)
        if info != 0:
            stiffness = self._raise(stiffness)
            matrix = np.diag(self._mass) + stiffness
            factor, _ = dpotrf(matrix, lower=1)
        return Linearization(momentum + force + stiffness @ velocity, matrix, factor)

    def solve(self, linearization: Linearization, rows: np.ndarray, targets: np.ndarray) -> Multipliers:
        """Solve ``A v = ŵ + Rᵀν, R v = r`` for equality rows R (rows, dof) and targets r (rows,)."""
        factor, linear = linearization.factor, linearization.linear
        velocity = linear / self._mass if factor is None else dpotrs(factor, linear, lower=1)[0]
        if not len(rows):
            return Multipliers(velocity, _NONE, _NONE)
        if factor is not None:
            equalities = EqualityProjection(rows, dpotrs(factor, rows.T, lower=1)[0].T)
        else:
            if self._equalities is None or self._equalities.rows is not rows:
                self._equalities = EqualityProjection(rows, rows / self._mass)
            equalities = self._equalities
        multipliers = equalities.multipliers(targets - rows @ velocity)
        return Multipliers(velocity + multipliers @ equalities.response, _NONE, multipliers)

    def _raise(self, stiffness: np.ndarray) -> np.ndarray:
        outer = np.outer(self._root, self._root)
        values, vectors = np.linalg.eigh(stiffness / outer)
        return (vectors * np.maximum(values, _SOFTEST)) @ vectors.T * outer
