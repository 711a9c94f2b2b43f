"""Checks of a scene's initial state: finite forces, constraints met, no momentum along bilateral gradients."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from deli.errors import InputError
from deli.mechanics.arrays import Array
from deli.mechanics.constraints import ConstraintFamily, ConstraintStack
from deli.mechanics.potential_sum import PotentialSum
from deli.mechanics.tables import table_norms, table_rates, table_values


def check_potential(potential: PotentialSum, q: Array) -> None:
    """Refuse a configuration where the potential or its force is not finite."""
    with np.errstate(all="ignore"):
        energy = float(potential.energy(q))
        gradient = potential.gradient(q)
    if not (np.isfinite(energy) and np.isfinite(gradient).all()):
        raise InputError(
            f"potential: energy {energy} and largest force {float(np.abs(gradient).max())} at the initial "
            "position; start where the potential is finite"
        )


def check_kinetic(p: Array, mass: Array) -> None:
    """Refuse a momentum whose kinetic energy is not finite."""
    with np.errstate(all="ignore"):
        energy = float((p * p / mass).sum())
    if not np.isfinite(energy):
        raise InputError(f"momentum: its kinetic energy is {energy}; start slower, or choose other units")


def check_position(side: str, stack: ConstraintStack, q: Array, distance: float) -> None:
    """Refuse a configuration that misses a constraint by more than ``distance``, a length.

    Parameters
    ----------
    side
        "unilateral" (values must be >= 0) or "bilateral" (values must be 0).
    stack
        The constraints.
    q
        Configuration, shape (dof,).
    distance
        Allowed displacement of the bodies; a value may miss by this times the length of its gradient.
    """
    if not stack.families:
        return
    value, norm = _values(stack, q)
    allowed = distance * norm
    miss = (-value if side == "unilateral" else np.abs(value)) - allowed
    if not (miss <= 0.0).all():
        row = int(np.argmax(np.where(np.isnan(miss), np.inf, miss)))
        raise InputError(_missed(side, f"{row} ({stack.labels()[row]})", float(value[row]), float(allowed[row])))
    if not stack.searched:
        return
    for family in stack.searched_families:
        if side == "bilateral":
            raise InputError(f"bilateral: found {family!r}, whose rows are found by search; list them (pairs=...)")
        near = family.nearest(q)
        value, allowed = table_values(near, q), distance * table_norms(near, q)
        if not (value >= -allowed).all():
            named = f"(gap body {int(near.first[0])} - body {int(near.second[0])})"
            raise InputError(_missed(side, named, float(value[0]), float(allowed[0])))


def check_momentum(stack: ConstraintStack, q: Array, v: Array, tolerance: float) -> None:
    """Refuse a velocity at which a bilateral constraint changes, relative to its gradient and to |v|."""
    if not stack.families:
        return
    rate, norm = _rates(stack, q, v)
    allowed = tolerance * norm * np.hypot.reduce(v)  # hypot, because the squares of tiny velocities would be zero
    allowed = np.maximum(allowed, np.finfo(float).tiny)  # smaller rates are rounding
    if (np.abs(rate) > allowed).any():
        row = int(np.argmax(np.abs(rate) - allowed))
        raise InputError(
            f"momentum: bilateral constraint {row} ({stack.labels()[row]}) would change at the rate "
            f"{rate[row]:.6g}; it must be 0 (within {allowed[row]:.1e}); remove the part of the momentum along "
            "the constraint's gradient"
        )


def _missed(side: str, named: str, value: float, allowed: float) -> str:
    unilateral = side == "unilateral"
    return (
        f"position: {side} constraint {named} has value {value:.6g} at the start; "
        f"it must be {'>=' if unilateral else '='} 0 (within {allowed:.1e}); move the bodies "
        f"{'apart' if unilateral else 'onto the constraint'}"
    )


def _values(stack: ConstraintStack, q: Array) -> tuple[Array, Array]:
    """Return value and length of the gradient of each fixed row; only families of functions evaluate a jacobian."""
    rows = stack.table
    with np.errstate(all="ignore"):
        value, norm = table_values(rows, q), table_norms(rows, q)
        for family, place in _other_rows(stack):
            value[place] = family.value(q)
            norm[place] = np.linalg.norm(family.jacobian(q), axis=1)
    return value, norm


def _rates(stack: ConstraintStack, q: Array, v: Array) -> tuple[Array, Array]:
    """Return rate of change and length of the gradient of each fixed row."""
    rows = stack.table
    rate, norm = table_rates(rows, q, v), table_norms(rows, q)
    for family, place in _other_rows(stack):
        jacobian = family.jacobian(q)
        rate[place], norm[place] = jacobian @ v, np.linalg.norm(jacobian, axis=1)
    return rate, norm


def _other_rows(stack: ConstraintStack) -> Iterator[tuple[ConstraintFamily, slice]]:
    """Yield the families of functions, each with the places of its rows in the stack."""
    begin = 0
    for family in stack.families:
        if family in stack.others:
            yield family, slice(begin, begin + family.rows)
        begin += family.rows
