"""The metric projection where all rows are equalities: one linear solve and no solver."""

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

_RANK = 1e-10  # ratio of pivots below which rows are taken for dependent


class EqualityProjection:
    """Project velocities onto ``{v : R v = r}`` in the metric A.

    ``v = v̂ + A⁻¹Rᵀν`` with ``R A⁻¹Rᵀ ν = r − R v̂``, where ``R A⁻¹Rᵀ`` (the Delassus matrix) is factored once. Dependent
    rows are solved for the multipliers of least norm; the projection is unique either way.

    Parameters
    ----------
    rows : (rows, dof) array
        R, one gradient a row.
    response : (rows, dof) array
        The velocities A⁻¹Rᵀ that unit impulses cause, one a row.
    """

    def __init__(self, rows: np.ndarray, response: np.ndarray) -> None:
        self.rows = rows
        self.response = response
        self._delassus = response @ rows.T
        factor, info = dpotrf(self._delassus, lower=1)
        pivots = factor.diagonal()
        self._factor = factor if info == 0 and pivots.min() > _RANK**0.5 * pivots.max() else None

    def multipliers(self, mismatch: np.ndarray) -> np.ndarray:
        """Return ν for a mismatch ``r − R v̂`` of shape (rows,)."""
        if self._factor is None:
            return np.linalg.lstsq(self._delassus, mismatch, rcond=_RANK)[0]
        return dpotrs(self._factor, mismatch, lower=1)[0]

    def project(self, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the projection of `velocity` (dof,) onto ``R v = 0`` and its multipliers (rows,)."""
        multipliers = self.multipliers(-(self.rows @ velocity))
        projected = velocity + multipliers @ self.response
        # The Delassus matrix squares the condition number of the rows; one refinement takes the error back out.
        correction = self.multipliers(-(self.rows @ projected))
        return projected + correction @ self.response, multipliers + correction
