"""Copies of compiled problems. They are compiled anew, because solvers and shared storage cannot be copied."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from solvers.threads import CVXPY

if TYPE_CHECKING:
    import cvxpy

Parts = tuple["cvxpy.Problem", int, dict[str, Any], dict[str, np.ndarray]]


def parts(problem: "cvxpy.Problem", keywords: dict[str, Any], views: Mapping[str, np.ndarray]) -> Parts:
    """Return the arguments of `rebuild` after the first: model, count of names, keywords of `compile`, values."""
    from solvers.leaves import highest_identifier, without_cache

    values = {name: view.copy() for name, view in views.items()}
    return without_cache(problem), highest_identifier(), keywords, values


def rebuild(
    compile: Callable[..., Any],
    problem: "cvxpy.Problem",
    identifier: int,
    keywords: dict[str, Any],
    values: dict[str, np.ndarray],
) -> Any:
    """Compile a copy of a compiled problem with `solvers.compile`, which imports this module."""
    from solvers.leaves import reserve_identifiers

    with CVXPY:
        reserve_identifiers(identifier)
    compiled = compile(problem, **keywords)
    for name, value in values.items():
        compiled.parameters[name][...] = value
    return compiled
