"""KKT residuals, computed from an answer and never taken from a vendor."""

import math

import numpy as np

from solvers.program import QuadraticProgram


class Residuals:
    r"""Scaled KKT residuals of an answer (x, y) to a quadratic program.

    With the terms of each equation compared, and the maximum norm throughout,

    .. math::

        \text{primal} &= \frac{\max(|A_e x - u_e|, (A_i x - u_i)_+)}{1 + \max(|Ax|, |u|)} \\
        \text{dual} &= \max\Bigl(\frac{|Px + q + A^T y|}{1 + \max(|Px|, |q|, |A^T y|)},
                       \frac{(-y_i)_+}{1 + |y|}\Bigr) \\
        \text{complementarity} &= \frac{\max_i |y_i (u_i - A_i x)|}{1 + \max(|x^T P x|, |q^T x|)}

    where e runs over equality and i over inequality rows. A nan in the answer makes at least one of them nan.

    Parameters
    ----------
    program : QuadraticProgram
        Read anew at every call.
    """

    __slots__ = (
        "_aty", "_ax", "_dual", "_inequalities", "_negative", "_offsets", "_products", "_px", "_q", "_terms", "_u",
        "_violated", "_violation", "_y", "_y_inequality", "complementarity", "dual", "primal", "program",
    )  # fmt: skip

    def __init__(self, program: QuadraticProgram) -> None:
        n, m, e = program.variables, program.rows, program.equalities
        self.program = program
        # All terms live side by side: one call takes all absolute values and one all maxima.
        self._terms = np.zeros(4 * n + 6 * m)
        self._px, self._q, self._aty, self._dual = self._terms[: 4 * n].reshape(4, n)
        self._ax, self._u, self._y, self._violation, negative, products = self._terms[4 * n :].reshape(6, m)
        self._y_inequality, self._violated = self._y[e:], self._violation[e:]
        self._negative, self._products = negative[e:], products[e:]
        self._inequalities = m > e
        self._offsets = np.array([k * n for k in range(4)] + [4 * n + k * m for k in range(6) if m])
        self.primal = self.dual = self.complementarity = math.nan

    def compute(self, x: np.ndarray, y: np.ndarray) -> float:
        """Set `primal`, `dual` and `complementarity`; return the largest, nan if anything is nan or infinite."""
        program, terms, violation = self.program, self._terms, self._violation
        program.quadratic.multiply(x, self._px)
        self._q[:] = program.linear
        np.add(self._px, self._q, self._dual)
        if program.rows:
            program.matrix.multiply(x, self._ax)
            program.matrix.multiply_transposed(y, self._aty)
            self._dual += self._aty
            self._u[:] = program.upper
            self._y[:] = y
            np.subtract(self._ax, self._u, violation)
            if self._inequalities:
                np.multiply(self._y_inequality, self._violated, self._products)
                np.maximum(self._violated, 0.0, out=self._violated)
                np.minimum(self._y_inequality, 0.0, out=self._negative)
        objective = max(abs(float(x.dot(self._px))), abs(float(x.dot(self._q))))
        np.abs(terms, terms)
        maxima = np.maximum.reduceat(terms, self._offsets).tolist()
        if not math.isfinite(sum(maxima)):
            self.primal = self.dual = self.complementarity = math.nan
            return math.nan
        px, q, aty, dual = maxima[:4]
        self.dual = dual / (1.0 + max(px, q, aty))
        self.primal = self.complementarity = 0.0
        if program.rows:
            ax, u, largest, violated, negative, product = maxima[4:]
            self.primal = violated / (1.0 + max(ax, u))
            self.dual = max(self.dual, negative / (1.0 + largest))
            self.complementarity = product / (1.0 + objective)
        return max(self.primal, self.dual, self.complementarity)
