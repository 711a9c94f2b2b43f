"""Dense triangular factors."""

import math

import numpy as np

from deli.kernels.compiled import kernel


@kernel
def factorize(matrix: np.ndarray, size: int, factor: np.ndarray) -> bool:
    """Write the lower Cholesky factor; return False if the matrix is not positive definite."""
    for i in range(size):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total > 0.0:
                factor[i, i] = math.sqrt(total)
            else:
                return False
    return True


@kernel
def forward(factor: np.ndarray, size: int, x: np.ndarray) -> None:
    """Overwrite x with L⁻¹x."""
    for i in range(size):
        total = x[i]
        for k in range(i):
            total -= factor[i, k] * x[k]
        x[i] = total / factor[i, i]


@kernel
def backward(factor: np.ndarray, size: int, x: np.ndarray) -> None:
    """Overwrite x with L⁻ᵀx."""
    for i in range(size - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, size):
            total -= factor[k, i] * x[k]
        x[i] = total / factor[i, i]
