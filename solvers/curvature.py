"""Curvature of programs, for backends that need or prefer a positive definite quadratic term."""

from typing import TYPE_CHECKING

import numpy as np

from solvers import registry
from solvers.errors import SolverError

if TYPE_CHECKING:
    from solvers.canonical import Canonical

SEMIDEFINITE = 1e-14  # pivot, relative to the diagonal, that counts as zero
SHOWN = 6  # entries that a message lists


def fitting(members: tuple[str, ...], canonical: "Canonical") -> tuple[str, ...]:
    """Return a chain without the first members that miss curvature in a problem at all values of its Parameters.

    A single backend stays if it only prefers curvature.

    Raises
    ------
    SolverError
        If no member is left. The message names the entries of Variables without curvature, and backends that need none.
    """
    lacking = None
    while True:  # later members are imported only when they are reached
        needed = registry.can(members[0], "strictly_convex")
        if not needed and (len(members) == 1 or not registry.can(members[0], "prefers_curvature")):
            return members
        lacking = _lacking(canonical) if lacking is None else lacking
        if not lacking:
            return members
        if len(members) == 1:
            raise SolverError(_refusal(members[0], lacking))
        members = members[1:]


def _refusal(name: str, lacking: str) -> str:
    others = [name for name in registry.available() if not registry.can(name, "strictly_convex")]
    return (
        f"{name} needs a positive definite quadratic term, and {lacking}: give every variable curvature of its own, "
        f"by quad_form(x, P) in place of sum_squares of an expression, or use another backend: {', '.join(others)}"
    )


def _lacking(canonical: "Canonical") -> str:
    """Return where curvature is missing at all values of the Parameters; empty text if it may be complete."""
    quadratic = canonical.map.program.quadratic
    matrix = quadratic.to_sparse()
    if not quadratic.constant:
        matrix.data[:] = 1.0  # what the pattern allows
    flat = np.flatnonzero(~(matrix.diagonal() > 0.0))
    if flat.size:
        named = [
            f"{name}[{', '.join(map(str, np.unravel_index(entry, place.shape, order='F')))}]" if place.shape else name
            for name, place in canonical.primal
            for entry in place.entries(flat)
        ]
        more = f" and {len(named) - SHOWN} more" if len(named) > SHOWN else ""
        return f"there is none in {', '.join(named[:SHOWN]) or 'auxiliary variables of the model'}{more}"
    diagonal = matrix.nnz == len(matrix.diagonal())
    if quadratic.constant and not diagonal and not _positive_definite(matrix.toarray()):
        return "that of this problem is singular"
    return ""


def _positive_definite(matrix: np.ndarray) -> bool:
    try:
        factor = np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return bool(np.all(factor.diagonal() ** 2 > SEMIDEFINITE * matrix.diagonal()))
