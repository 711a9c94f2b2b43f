"""KKT residuals and objective, computed from an answer and never taken from a backend's report."""

import math
from collections.abc import Callable

import numpy as np

from solvers.program import QuadraticProgram

EXACT = 2e-15  # natural residual that rounding alone explains: polish cannot improve it


class Residuals:
    r"""Scaled KKT residuals of an answer (x, y) to a quadratic program.

    With the terms of each equation compared, and the maximum norm throughout,

    .. math::

        \text{primal} &= \frac{\max(|A_e x - u_e|, (A_i x - u_i)_+)}{1 + \max(|Ax|, |u|)} \\
        \text{dual} &= \max\Bigl(\frac{|Px + q + A^T y|}{1 + \max(|Px|, |q|, |A^T y|)},
                       \frac{(-y_i)_+ |A_i|}{1 + \max(|Px|, |q|, |A^T y|)}\Bigr) \\
        \text{complementarity} &= \frac{\max_i |y_i (u_i - A_i x)|}{1 + \max(|x^T P x|, |q^T x|)} \\
        \text{natural} &= \max\Bigl(\frac{|Px + q + A^T y|}{1 + \max(|Px|, |q|, |A^T y|)},
                          \frac{\max(|A_e x - u_e|, |\min(y_i, u_i - A_i x)|)}{1 + \max(|Ax|, |u|)}\Bigr)

    where e runs over equality and i over inequality rows. A negative multiplier of an inequality counts by its force,
    also where it is small beside other multipliers. If any number is nan or infinite, all residuals are nan. The first
    three decide about an answer; the natural residual decides about an improvement by `solvers.polish`. `objective` is
    :math:`\tfrac12 x^T P x + q^T x`.

    Parameters
    ----------
    program : QuadraticProgram
        The program, read anew at every call.
    """

    __slots__ = ("_kernel", "_numbers", "complementarity", "dual", "natural", "objective", "primal")

    def __init__(self, program: QuadraticProgram) -> None:
        from solvers import kernels  # numba takes half a second to import, and is not needed to list backends

        self._kernel: Callable[..., tuple[float, float, float, float, float]]
        matrices: tuple[np.ndarray, ...]
        quadratic, matrix = program.quadratic, program.matrix
        if quadratic.dense is not None and matrix.dense is not None:
            self._kernel = kernels.dense_residuals
            matrices = (quadratic.dense, matrix.dense)
        else:
            self._kernel = kernels.sparse_residuals
            matrices = (*quadratic.columns(), *matrix.columns())
        self._numbers = (*matrices, program.linear, program.upper, program.equalities)
        self.compute(np.zeros(program.variables), np.zeros(program.rows))  # compiles the kernel before the first solve
        self.forget()

    def forget(self) -> None:
        """Set all residuals and the objective to nan: there is no point to measure."""
        self.primal = self.dual = self.complementarity = self.natural = self.objective = math.nan

    def compute(self, x: np.ndarray, y: np.ndarray) -> float:
        """Set all residuals; return the largest of the first three, nan if any number is nan or infinite."""
        primal, dual, complementarity, self.natural, self.objective = self._kernel(*self._numbers, x, y)
        self.primal, self.dual, self.complementarity = primal, dual, complementarity
        return max(primal, dual, complementarity)
