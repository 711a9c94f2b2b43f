"""Discrete Lagrangians (8.2, 8.3), given by the forces in their two slots."""

from __future__ import annotations

import abc
from dataclasses import dataclass
from typing import ClassVar

from deli.errors import InputError
from deli.mechanics.arrays import Array
from deli.mechanics.potentials import PotentialFamily


@dataclass(frozen=True)
class Scheme(abc.ABC):
    """A second-order, symmetric, symplectic scheme on a step (q, x) of size h.

    With M the mass, D1 L_d(q, x) = -M (x - q)/h + first_force and D2 L_d(q, x) = M (x - q)/h + second_force. The
    unconstrained step solves D1 L_d(q, x) + p = 0 for x; the new momentum is D2 L_d(q, x).
    """

    name: ClassVar[str]
    weights: ClassVar[tuple[float, float, float]]
    """Weights of the force at q, at the midpoint and at x in first_force."""
    numerical_curvature: ClassVar[float]
    """Coefficient of h^2 p.M^-1 V'' M^-1 p in the second-order numerical Hamiltonian."""
    numerical_force: ClassVar[float]
    """Coefficient of h^2 grad V.M^-1 grad V in the second-order numerical Hamiltonian."""

    @abc.abstractmethod
    def first_force(self, potential: PotentialFamily, q: Array, x: Array, h: float) -> Array:
        """Return the force slot of D1 L_d(q, x), an impulse of shape (dof,)."""

    @abc.abstractmethod
    def second_force(self, potential: PotentialFamily, q: Array, x: Array, h: float) -> Array:
        """Return the force slot of D2 L_d(q, x), an impulse of shape (dof,)."""


@dataclass(frozen=True)
class Midpoint(Scheme):
    """Implicit midpoint (8.2): both slots are -(h/2) grad V((q + x)/2)."""

    name = "midpoint"
    weights = (0.0, 0.5, 0.0)
    numerical_curvature = -1.0 / 24.0
    numerical_force = -1.0 / 24.0

    def first_force(self, potential: PotentialFamily, q: Array, x: Array, h: float) -> Array:
        """Return -(h/2) grad V((q + x)/2)."""
        return (-0.5 * h) * potential.gradient(0.5 * (q + x))

    def second_force(self, potential: PotentialFamily, q: Array, x: Array, h: float) -> Array:
        """Return -(h/2) grad V((q + x)/2)."""
        return (-0.5 * h) * potential.gradient(0.5 * (q + x))


@dataclass(frozen=True)
class Verlet(Scheme):
    """Stoermer-Verlet (8.3): -(h/2) grad V(q) in the first slot, -(h/2) grad V(x) in the second."""

    name = "verlet"
    weights = (0.5, 0.0, 0.0)
    numerical_curvature = 1.0 / 12.0
    numerical_force = -1.0 / 24.0

    def first_force(self, potential: PotentialFamily, q: Array, x: Array, h: float) -> Array:
        """Return -(h/2) grad V(q)."""
        return (-0.5 * h) * potential.gradient(q)

    def second_force(self, potential: PotentialFamily, q: Array, x: Array, h: float) -> Array:
        """Return -(h/2) grad V(x)."""
        return (-0.5 * h) * potential.gradient(x)


SCHEMES: dict[str, Scheme] = {scheme.name: scheme for scheme in (Midpoint(), Verlet())}


def get_scheme(name: str) -> Scheme:
    """Return the scheme called ``name``: "midpoint" or "verlet"."""
    if not isinstance(name, str) or name not in SCHEMES:
        allowed = ", ".join(repr(known) for known in SCHEMES)
        raise InputError(f"scheme: found {name!r}; choose one of {allowed}")
    return SCHEMES[name]
