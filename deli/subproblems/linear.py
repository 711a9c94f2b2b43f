"""The metric projection where all rows are equalities: one linear solve and no solver."""

import numpy as np
from scipy.linalg import qr
from scipy.linalg.lapack import dpotrf, dpotrs

_PIVOT = 1e-7  # of a Cholesky factor with unit diagonal, below which its row is taken for dependent on the others


class EqualityProjection:
    """Project velocities onto ``{v : R v = r}`` in the metric A.

    ``v = v̂ + A⁻¹Rᵀν`` with ``R A⁻¹Rᵀ ν = r − R v̂``, where ``R A⁻¹Rᵀ`` (the Delassus matrix) is factored once, scaled to
    a unit diagonal so that neither masses nor the size of a gradient decide on its rank. Dependent rows are solved for
    the multipliers of least norm; the projection is unique either way.

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
        delassus = response @ rows.T
        self._scale = 1.0 / np.sqrt(_positive(delassus.diagonal()))
        self._delassus = delassus * self._scale * self._scale[:, None]
        factor, info = dpotrf(self._delassus, lower=1)
        self.independent = info == 0 and factor.diagonal().min() > _PIVOT
        self._factor = factor

    def multipliers(self, mismatch: np.ndarray) -> np.ndarray:
        """Return ν for a mismatch ``r − R v̂`` of shape (rows,)."""
        scaled = self._scale * mismatch
        if self.independent:
            return self._scale * dpotrs(self._factor, scaled, lower=1)[0]
        return self._scale * np.linalg.lstsq(self._delassus, scaled, rcond=_PIVOT**2)[0]

    def project(self, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the projection of `velocity` (dof,) onto ``R v = 0`` and its multipliers (rows,)."""
        multipliers = self.multipliers(-(self.rows @ velocity))
        projected = velocity + multipliers @ self.response
        # The Delassus matrix squares the condition number of the rows; one refinement takes the error back out.
        correction = self.multipliers(-(self.rows @ projected))
        return projected + correction @ self.response, multipliers + correction


def independent_rows(rows: np.ndarray) -> np.ndarray | None:
    """Return the indices, in order, of a largest independent subset of rows; None if that is all of them."""
    if len(rows) < 2:
        return None
    norms = np.sqrt(_positive(np.einsum("ij,ij->i", rows, rows)))
    unit = rows / norms[:, None]
    if EqualityProjection(unit, unit).independent:
        return None
    _, triangle, order = qr(unit.T, mode="economic", pivoting=True)
    rank = int((np.abs(triangle.diagonal()) > _PIVOT).sum())
    return np.sort(order[:rank])


def _positive(diagonal: np.ndarray) -> np.ndarray:
    return np.where(diagonal > 0, diagonal, 1.0)
