"""Potentials and constraints made from plain Python functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Self

import numpy as np

from deli.errors import InputError
from deli.mechanics.arrays import Array
from deli.mechanics.constraints import ConstraintFamily
from deli.mechanics.derivatives import JaxDerivative, check_derivative
from deli.mechanics.family import Invariance, Layout
from deli.mechanics.measured import measure_invariance
from deli.mechanics.potentials import PotentialFamily

Function = Callable[[Array], Any]


class Potential(PotentialFamily):
    """A potential made of plain Python functions of the flat configuration q, shape (dof,).

    Its invariances are measured (`deli.mechanics.measured`). If ``gradient`` is left out, JAX derives it and the
    hessian, and ``energy`` must be written with ``jax.numpy``. Supplied derivatives are checked against finite
    differences at the initial state of the scene. Functions receive a copy of q, one configuration at a time.

    Parameters
    ----------
    energy
        V(q), a number.
    gradient
        The gradient of V, shape (dof,).
    hessian
        V'', shape (dof, dof); used only by numerical Hamiltonians and the Newton metric.

    Raises
    ------
    InputError
        If the gradient is missing and JAX is not installed.

    Examples
    --------
    >>> import deli
    >>> quartic = deli.Potential(energy=lambda q: (q**4).sum() / 4, gradient=lambda q: q**3)
    >>> scene = deli.Scene(mass=1.0, position=[2.0], momentum=[0.0], potential=quartic)
    >>> float(scene.potential.energy(scene.position))
    4.0

    A wrong derivative is refused:

    >>> wrong = deli.Potential(energy=lambda q: (q**4).sum() / 4, gradient=lambda q: q**2)
    >>> deli.Scene(mass=1.0, position=[2.0], momentum=[0.0], potential=wrong)
    Traceback (most recent call last):
        ...
    deli.errors.InputError: gradient of Potential: entry 0 is 4, finite differences at the initial state give 8; ...
    """

    def __init__(self, energy: Function, gradient: Function | None = None, hessian: Function | None = None) -> None:
        _check_callable("Potential", energy=energy, gradient=gradient, hessian=hessian)
        self.layout: Layout | None = None
        self._given = {"energy": energy, "gradient": gradient, "hessian": hessian}
        self._hessian = hessian
        if gradient is not None:
            self._energy, self._gradient = energy, gradient
            return
        derivative = JaxDerivative("energy of Potential", energy, "gradient")
        self._energy, self._gradient = derivative.value, derivative
        if hessian is None:
            self._hessian = JaxDerivative("energy of Potential", energy, "hessian")

    def bind(self, layout: Layout) -> Self:
        """Return a copy for ``layout``, its functions checked at the initial state."""
        bound = type(self)(**self._given)  # type: ignore[arg-type]
        bound.layout = layout
        q, dof = layout.position, layout.dof
        _read("energy of Potential", self._energy, q, ())
        gradient = _read("gradient of Potential", self._gradient, q, (dof,))
        if self._given["gradient"] is not None:
            check_derivative("gradient of Potential", gradient, self.energy, q)
        if self._hessian is not None:
            hessian = _read("hessian of Potential", self._hessian, q, (dof, dof))
            if self._given["hessian"] is not None:
                check_derivative("hessian of Potential", hessian, self.gradient, q)
        return bound

    def energy(self, q: Array) -> Any:
        """Return V, shape (...,), of configurations of shape (..., dof)."""
        if q.ndim == 1:
            return float(self._energy(q.copy()))
        flat = [float(self._energy(row.copy())) for row in q.reshape(-1, q.shape[-1])]
        return np.array(flat).reshape(q.shape[:-1])

    def gradient(self, q: Array) -> Array:
        """Return the gradient of V at one configuration, shape (dof,)."""
        return np.array(self._gradient(q.copy()), dtype=np.float64)

    def hessian(self, q: Array) -> Array | None:
        """Return V'' at one configuration, shape (dof, dof), or None if there is no hessian."""
        return None if self._hessian is None else np.array(self._hessian(q.copy()), dtype=np.float64)

    def invariance(self) -> Invariance:
        """Return the rigid motions that leave V unchanged, as measured at some states."""
        return measure_invariance(
            _bound(self.layout), lambda q: np.array([self.energy(q)]), lambda q: self.gradient(q)[np.newaxis]
        )


class Constraints(ConstraintFamily):
    """Constraints made of plain Python functions of the flat configuration q, shape (dof,).

    Their invariances are measured (`deli.mechanics.measured`). If ``jacobian`` is left out, JAX derives it, and
    ``value`` must be written with ``jax.numpy``. A supplied jacobian is checked against finite differences at the
    initial state of the scene.

    Parameters
    ----------
    value
        c(q), shape (rows,).
    jacobian
        Derivative of c, shape (rows, dof), one row a constraint.

    Raises
    ------
    InputError
        If the jacobian is missing and JAX is not installed.

    Examples
    --------
    >>> import deli
    >>> parabola = deli.Constraints(value=lambda q: [q[1] - q[0] ** 2], jacobian=lambda q: [[-2.0 * q[0], 1.0]])
    >>> scene = deli.Scene(mass=1.0, position=[0.5, 1.0], momentum=[0.0, 0.0], unilateral=parabola, dimension=2)
    >>> scene.unilateral.value(scene.position)
    array([0.75])
    >>> scene.unilateral.jacobian(scene.position)
    array([[-1.,  1.]])
    """

    def __init__(self, value: Function, jacobian: Function | None = None) -> None:
        _check_callable("Constraints", value=value, jacobian=jacobian)
        self.layout: Layout | None = None
        self._given = {"value": value, "jacobian": jacobian}
        if jacobian is not None:
            self._value, self._jacobian = value, jacobian
            return
        derivative = JaxDerivative("value of Constraints", value, "jacobian")
        self._value, self._jacobian = derivative.value, derivative

    def bind(self, layout: Layout) -> Self:
        """Return a copy for ``layout``, its functions checked at the initial state."""
        bound = type(self)(**self._given)  # type: ignore[arg-type]
        bound.layout = layout
        q = layout.position
        value = _read("value of Constraints", self._value, q, None)
        if value.ndim != 1:
            raise InputError(
                f"value of Constraints: found shape {value.shape}; return a vector of shape (rows,), also for one row"
            )
        bound.rows = value.size
        jacobian = _read("jacobian of Constraints", self._jacobian, q, (value.size, layout.dof))
        if self._given["jacobian"] is not None:
            check_derivative("jacobian of Constraints", jacobian, self.value, q)
        return bound

    def value(self, q: Array) -> Array:
        """Return c, shape (..., rows), of configurations of shape (..., dof)."""
        if q.ndim == 1:
            return np.array(self._value(q.copy()), dtype=np.float64)
        flat = [np.asarray(self._value(row.copy()), dtype=np.float64) for row in q.reshape(-1, q.shape[-1])]
        return np.array(flat).reshape(*q.shape[:-1], self.rows)

    def jacobian(self, q: Array) -> Array:
        """Return the jacobian at one configuration, shape (rows, dof)."""
        return np.array(self._jacobian(q.copy()), dtype=np.float64)

    def labels(self) -> list[str]:
        """Name each row for messages."""
        return [f"constraint row {row}" for row in range(self.rows)]

    def invariance(self) -> Invariance:
        """Return the rigid motions that leave c unchanged, as measured at some states."""
        return measure_invariance(_bound(self.layout), self.value, self.jacobian)


def _check_callable(family: str, **functions: Any) -> None:
    required = next(iter(functions))
    for name, function in functions.items():
        if not callable(function) and (function is not None or name == required):
            raise InputError(f"{name} of {family}: found {function!r}; pass a function of the flat configuration q")


def _read(name: str, function: Function, q: Array, shape: tuple[int, ...] | None) -> Array:
    try:
        found = np.asarray(function(q.copy()))
    except InputError:
        raise
    except Exception as error:  # a user's function may raise any exception
        raise InputError(f"{name}: fails at the initial state: {type(error).__name__}: {error}") from error
    if found.dtype.kind not in "fiu":
        raise InputError(f"{name}: found values of type {found.dtype} at the initial state; return real numbers")
    value = found.astype(np.float64)
    if shape is not None and value.shape != shape:
        raise InputError(f"{name}: found shape {value.shape} at the initial state; it must return shape {shape}")
    if not np.isfinite(value).all():
        raise InputError(
            f"{name}: not finite at the initial state ({_first_not_finite(value)}); start where it is defined"
        )
    return value


def _first_not_finite(value: Array) -> str:
    where = tuple(int(k) for k in np.argwhere(~np.isfinite(value))[0])
    return f"entry {where} is {value[where]}" if where else str(value)


def _bound(layout: Layout | None) -> Layout:
    if layout is None:
        raise AttributeError("not bound to a scene yet: pass it to deli.Scene(...), or call .bind(layout)")
    return layout
