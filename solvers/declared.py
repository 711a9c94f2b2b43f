"""Checks of the attributes that Parameters declare, made at every solve.

Only Parameters with attributes cost time. The rules of disciplined programming rest on the attributes: a problem whose
``Parameter(PSD=True)`` holds an indefinite matrix is not convex, and its stationary points are no solutions.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from solvers.errors import ParameterError

if TYPE_CHECKING:
    import cvxpy

REAL = "fiub"  # kinds of numpy's types whose values are real numbers
KINDS = {"c": "complex numbers", "U": "text", "S": "text", "O": "Python objects", "M": "dates", "m": "times"}
ROUNDOFF = 1e-9  # relative asymmetry and negative curvature taken for rounding error

Check = Callable[[], None]


def real_numbers(name: str, value: Any) -> np.ndarray:
    """Return a Parameter's value as an array of real numbers.

    Raises
    ------
    ParameterError
        If the value holds complex numbers, text, other objects or masked entries, or is no array of any shape.
    """
    if np.ma.is_masked(value):
        raise ParameterError(f"parameter {name!r} has masked entries; allowed: real numbers everywhere")
    try:
        array = value.toarray() if sparse.issparse(value) else np.asarray(value)
    except ValueError as error:
        raise ParameterError(f"parameter {name!r} is no array of numbers: {error}") from error
    if array.dtype.kind not in REAL:
        found = KINDS.get(array.dtype.kind, f"values of type {array.dtype}")
        raise ParameterError(f"parameter {name!r} holds {found}; allowed: real numbers")
    with np.errstate(over="ignore"):  # a number too large for a double becomes inf, which is refused
        return array.astype(float, copy=False)


def checks(parameters: "list[cvxpy.Parameter]", views: dict[str, np.ndarray]) -> tuple[Check, ...]:
    """Return one function for each attribute to check; it raises ParameterError if the value lacks the attribute."""
    found: list[Check] = []
    for parameter in parameters:
        name, attributes = parameter.name(), parameter.attributes
        view = views[name]
        if attributes["nonneg"] or attributes["pos"]:
            found.append(_sign(name, view, 1.0))
        if attributes["nonpos"] or attributes["neg"]:
            found.append(_sign(name, view, -1.0))
        if attributes["symmetric"] or attributes["PSD"] or attributes["NSD"]:
            found.append(_symmetric(name, view))
        if attributes["PSD"]:
            found.append(_semidefinite(name, view, 1.0))
        if attributes["NSD"]:
            found.append(_semidefinite(name, view, -1.0))
        if attributes["diag"]:
            found.append(_diagonal(name, view))
    return tuple(found)


def _sign(name: str, view: np.ndarray, sign: float) -> Check:
    def check() -> None:
        if (sign * view).min(initial=0.0) < 0.0:
            word = "nonnegative" if sign > 0.0 else "nonpositive"
            raise ParameterError(f"parameter {name!r} is declared {word} and holds {sign * (sign * view).min():g}")

    return check


def _symmetric(name: str, view: np.ndarray) -> Check:
    def check() -> None:
        asymmetry, size = np.abs(view - view.T).max(), np.abs(view).max()
        if asymmetry > ROUNDOFF * size:
            raise ParameterError(
                f"parameter {name!r} is declared symmetric and differs from its transpose by {asymmetry:g}"
            )

    return check


def _semidefinite(name: str, view: np.ndarray, sign: float) -> Check:
    identity = np.eye(len(view))

    def check() -> None:
        try:
            np.linalg.cholesky(sign * view + (ROUNDOFF * np.abs(view).max() + np.finfo(float).tiny) * identity)
        except np.linalg.LinAlgError:
            word = "positive" if sign > 0.0 else "negative"
            worst = sign * np.linalg.eigvalsh(sign * view)[0]
            message = f"parameter {name!r} is declared {word} semidefinite and has the eigenvalue {worst:g}"
            raise ParameterError(message) from None

    return check


def _diagonal(name: str, view: np.ndarray) -> Check:
    outside = ~np.eye(len(view), dtype=bool)

    def check() -> None:
        if np.any(view[outside]):
            raise ParameterError(f"parameter {name!r} has entries outside the pattern it declares")

    return check
