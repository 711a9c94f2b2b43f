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
        "_aty", "_ax", "_dense", "_dual", "_inequalities", "_negative", "_objective", "_offsets", "_points_first",
        "_products", "_px", "_residual", "_sign", "_stacked", "_stacked_product", "_terms", "_vectors", "_violated",
        "_y", "_y_inequality", "_zeros", "complementarity", "dual", "primal", "program",
    )  # fmt: skip

    def __init__(self, program: QuadraticProgram) -> None:
        n, m, e = program.variables, program.rows, program.equalities
        self.program = program
        # All terms live side by side, in the order of the program's numbers: few calls do all the arithmetic.
        self._terms = np.zeros(4 * n + 6 * m)
        stacked = self._terms[: 3 * (n + m)].reshape(3, n + m)
        self._stacked_product, self._vectors, self._residual = stacked
        points_first = np.shares_memory(program.numbers[:1], program.linear[:1])
        self._points_first = points_first
        of_point, of_row = (slice(0, n), slice(n, None)) if points_first else (slice(m, None), slice(0, m))
        self._objective = stacked[:2, of_point]
        self._px, self._ax = self._stacked_product[of_point], self._stacked_product[of_row]
        self._dual = self._residual[of_point]
        self._violated = self._residual[of_row][e:]
        self._sign = np.ones(n + m)
        self._sign[of_row] = -1.0
        self._aty = self._terms[3 * (n + m) : 4 * n + 3 * m]
        self._y, negative, products = self._terms[4 * n + 3 * m :].reshape(3, m)
        self._y_inequality, self._negative, self._products = self._y[e:], negative[e:], products[e:]
        self._zeros = np.zeros(m - e)
        self._inequalities = m > e
        self._dense = program.quadratic.dense is not None
        if self._dense:
            self._stacked = program.numbers[n + m :].reshape(n + m, n)
        sizes = ([n, m] if points_first else [m, n]) * 3 + [n, m, m, m]
        self._offsets = np.concatenate(([0], np.cumsum(sizes)))[:-1][np.array(sizes) > 0]
        self.forget()

    def forget(self) -> None:
        """Set all residuals to nan: there is no point to measure."""
        self.primal = self.dual = self.complementarity = math.nan

    def compute(self, x: np.ndarray, y: np.ndarray) -> float:
        """Set `primal`, `dual` and `complementarity`; return the largest, nan if anything is nan or infinite."""
        program, terms = self.program, self._terms
        with np.errstate(all="ignore"):  # a diverged answer may overflow
            if self._dense:
                self._stacked.dot(x, self._stacked_product)
            else:
                program.quadratic.multiply(x, self._px)
                program.matrix.multiply(x, self._ax)
            np.multiply(program.numbers[: self._sign.size], self._sign, self._vectors)
            np.add(self._stacked_product, self._vectors, self._residual)
            if program.rows:
                program.matrix.multiply_transposed(y, self._aty)
                np.add(self._dual, self._aty, self._dual)
                self._y[:] = y
                if self._inequalities:
                    np.multiply(self._y_inequality, self._violated, self._products)
                    np.maximum(self._violated, self._zeros, out=self._violated)
                    np.minimum(self._y_inequality, self._zeros, out=self._negative)
            curvature, slope = self._objective.dot(x).tolist()
            np.abs(terms, terms)
            maxima = np.maximum.reduceat(terms, self._offsets).tolist()
        if not math.isfinite(sum(maxima)):
            self.forget()
            return math.nan
        self.primal = self.complementarity = 0.0
        if not program.rows:
            px, q, dual, _ = maxima
            self.dual = dual / (1.0 + max(px, q))
            return self.dual
        if self._points_first:
            px, ax, q, u, dual, violated, aty, largest, negative, product = maxima
        else:
            ax, px, u, q, violated, dual, aty, largest, negative, product = maxima
        self.primal = violated / (1.0 + max(ax, u))
        self.dual = max(dual / (1.0 + max(px, q, aty)), negative / (1.0 + largest))
        self.complementarity = product / (1.0 + max(abs(curvature), abs(slope)))
        return max(self.primal, self.dual, self.complementarity)
