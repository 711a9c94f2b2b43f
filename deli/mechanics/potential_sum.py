"""The sum of several potentials."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from operator import is_
from typing import Any, Self

import numpy as np

from deli.mechanics.arrays import Array, frozen
from deli.mechanics.family import Invariance, Layout, common_invariance
from deli.mechanics.potentials import PotentialFamily
from deli.mechanics.tables import Terms, summed


class PotentialSum(PotentialFamily):
    """The sum of several potentials; the zero potential if there are none.

    Parameters
    ----------
    families
        The potentials.
    layout
        The layout they are bound to, or None.
    """

    def __init__(self, families: Sequence[PotentialFamily] = (), layout: Layout | None = None) -> None:
        parts = (part.families if isinstance(part, PotentialSum) else (part,) for part in families)
        self.families: tuple[PotentialFamily, ...] = tuple(family for part in parts for family in part)
        self.layout = layout
        self.constant_hessian = all(family.constant_hessian for family in self.families)

    def __repr__(self) -> str:
        return f"PotentialSum({list(self.families)})"

    def bind(self, layout: Layout) -> Self:
        """Return a sum with every potential bound to ``layout``, or the sum itself if all of them are already."""
        families = [family.bind(layout) for family in self.families]
        if self.layout is not None and all(map(is_, families, self.families)) and not self.layout.differs(layout):
            return self
        return type(self)(families, layout)

    def energy(self, q: Array) -> Any:
        """Return V, shape (...,), of configurations of shape (..., dof)."""
        total = np.zeros(q.shape[:-1])
        for family in self.families:
            total = total + family.energy(q)
        return total

    def gradient(self, q: Array) -> Array:
        """Return the gradient of V at one configuration, shape (dof,)."""
        if not self.families:
            return np.zeros(q.size)
        total = self.families[0].gradient(q)
        for family in self.families[1:]:
            total = total + family.gradient(q)
        return total

    def hessian(self, q: Array) -> Array | None:
        """Return V'' at one configuration, shape (dof, dof), or None if one of the potentials has no hessian."""
        if not self.families:
            return np.zeros((q.size, q.size))
        total = self.families[0].hessian(q)
        for family in self.families[1:]:
            hessian = family.hessian(q)
            if total is None or hessian is None:
                return None
            total = total + hessian
        return total

    def curvature(self, q: Array, v: Array) -> float | None:
        """Return v . V''(q) v at one configuration, or None if one of the potentials has no hessian."""
        parts = [family.curvature(q, v) for family in self.families]
        known = [part for part in parts if part is not None]
        return sum(known) if len(known) == len(parts) else None

    def terms_table(self) -> Terms:
        """Return the terms of all potentials that have a table; `others` holds the potentials without one."""
        return Terms._make(column.copy() for column in self.table)

    @cached_property
    def table(self) -> Terms:
        """The table of `terms_table`, read-only and shared."""
        if self.layout is None:
            raise AttributeError("not bound to a scene yet: pass it to deli.Scene(...), or call .bind(layout)")
        tables = [family.terms_table() for family in self.families]
        known = [table for table in tables if table is not None]
        return Terms._make(map(frozen, summed(known, self.layout.dof, self.layout.dimension)))

    @cached_property
    def others(self) -> tuple[PotentialFamily, ...]:
        """The potentials without a table."""
        return tuple(family for family in self.families if family.terms_table() is None)

    def invariance(self) -> Invariance:
        """Return the rigid motions that leave every potential unchanged."""
        return common_invariance(self.families, self.layout)
