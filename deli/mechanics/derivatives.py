"""Derivatives of plain Python functions: checks by finite differences, and derivatives by JAX."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Literal

import numpy as np

from deli.errors import InputError
from deli.mechanics.arrays import Array
from solvers.distribution import install_line

ALLOWED_MISMATCH = 1e-6
"""Largest relative difference accepted between a supplied derivative and finite differences."""


def central_differences(function: Callable[[Array], Any], q: Array, step: float) -> Array:
    """Return the derivative of ``function`` by central differences, the coordinate as last axis."""
    columns = []
    for k in range(q.size):
        ahead, behind = q.copy(), q.copy()
        ahead[k] += step
        behind[k] -= step
        rise = np.asarray(function(ahead), dtype=np.float64) - np.asarray(function(behind), dtype=np.float64)
        columns.append(rise / (ahead[k] - behind[k]))
    return np.stack(columns, axis=-1)


def check_derivative(name: str, supplied: Array, function: Callable[[Array], Any], q: Array) -> None:
    """Compare a supplied derivative with finite differences of ``function`` at ``q``.

    Two step sizes give the difference and an estimate of its error, so that a strong curvature of the function is
    not mistaken for a wrong derivative.

    Raises
    ------
    InputError
        If an entry differs by more than ALLOWED_MISMATCH and that estimate; the message names the worst entry.
    """
    step = np.cbrt(np.finfo(np.float64).eps) * max(1.0, float(np.abs(q).max(initial=0.0)))
    fine, coarse = (central_differences(function, q, width) for width in (step, 2.0 * step))
    if not np.isfinite(fine).all():
        raise InputError(f"{name}: the function it derives from is not finite within {step:.1e} of the initial state")
    expected = (4.0 * fine - coarse) / 3.0
    noise = np.finfo(np.float64).eps * np.abs(np.asarray(function(q.copy()))).max(initial=0.0) / step
    scale = max(float(np.abs(expected).max(initial=0.0)), float(np.abs(supplied).max(initial=0.0)))
    allowed = ALLOWED_MISMATCH * scale + 10.0 * noise + 4.0 * np.abs(fine - coarse)
    excess = np.abs(supplied - expected) - allowed
    if excess.size and excess.max() > 0.0:
        worst = tuple(int(k) for k in np.unravel_index(np.argmax(excess), excess.shape))
        raise InputError(
            f"{name}: entry {worst[0] if len(worst) == 1 else worst} is {supplied[worst]:.8g}, finite differences at "
            f"the initial state give {expected[worst]:.8g}; correct the function, or leave the derivative out and "
            f"let JAX make it ({install_line('jax')})"
        )


class JaxDerivative:
    """A function written with ``jax.numpy`` and its derivative, from float64 arrays to float64 arrays.

    Double precision is switched on around each call only; JAX's global configuration does not change.

    Parameters
    ----------
    name
        Name of the function in error messages.
    function
        The function to differentiate.
    kind
        "gradient" of a scalar function, its "hessian", or "jacobian" of a vector function.
    """

    def __init__(
        self, name: str, function: Callable[[Any], Any], kind: Literal["gradient", "hessian", "jacobian"]
    ) -> None:
        if importlib.util.find_spec("jax") is None:
            raise InputError(
                f"{name}: no {kind} was given and JAX, which would make it, is not installed; pass {kind}=..., or "
                f"install it: {install_line('jax')}"
            )
        import jax

        self.name, self.function, self.kind = name, function, kind
        self._jax = jax
        derive = {"gradient": jax.grad, "hessian": jax.hessian, "jacobian": jax.jacfwd}[kind]
        self._value, self._derivative = jax.jit(function), jax.jit(derive(function))

    def __reduce__(self) -> tuple[Any, ...]:
        return (JaxDerivative, (self.name, self.function, self.kind))

    def __call__(self, q: Array) -> Array:
        """Return the derivative at ``q``."""
        return self._call(self._derivative, q)

    def value(self, q: Array) -> Array:
        """Return the function at ``q``, computed in double precision."""
        return self._call(self._value, q)

    def _call(self, compiled: Callable[[Array], Any], q: Array) -> Array:
        try:
            with self._double_precision():
                return np.asarray(compiled(q), dtype=np.float64)
        except self._jax.errors.JAXTypeError as error:
            raise InputError(
                f"{self.name}: JAX cannot derive this function ({str(error).splitlines()[0]}); write it with "
                f"jax.numpy instead of numpy, or pass {self.kind}=..."
            ) from error

    def _double_precision(self) -> AbstractContextManager[Any]:
        if hasattr(self._jax, "enable_x64"):
            context: AbstractContextManager[Any] = self._jax.enable_x64(True)
            return context
        from jax.experimental import enable_x64

        older: AbstractContextManager[Any] = enable_x64()
        return older
