"""Refusals of problems that are no quadratic programs; each names the part that is in the way."""

from collections.abc import Iterator
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.constraints import PSD as Semidefinite
from cvxpy.constraints import SOC, ExpCone, FiniteSet, NonNeg, NonPos, PowCone3D, PowConeND, Zero
from cvxpy.problems.problem_form import ProblemForm
from scipy import sparse

from solvers.errors import SolverError

TAKEN_BY_PARAMETERS = ("nonneg", "nonpos", "pos", "neg", "symmetric", "diag", "PSD", "NSD", "sparsity")
TAKEN_BY_VARIABLES = ("nonneg", "nonpos", "pos", "neg", "symmetric", "diag", "sparsity", "bounds")
REMEDIES = {
    "complex": "give its real and its imaginary part a Variable each",
    "imag": "state its imaginary part as a real Variable",
    "hermitian": "give its real and its imaginary part a Variable each",
    "boolean": "only continuous Variables are allowed",
    "integer": "only continuous Variables are allowed",
    "PSD": "semidefinite cones are not linear; allowed: linear constraints",
    "NSD": "semidefinite cones are not linear; allowed: linear constraints",
}
CONES: dict[type, str] = {
    SOC: "a second-order cone",
    ExpCone: "an exponential cone",
    Semidefinite: "a semidefinite cone",
    PowCone3D: "a power cone",
    PowConeND: "a power cone",
}
LINEAR = (Zero, NonNeg, NonPos)
SHOWN = 60  # characters of an expression in a message


def refuse_parts(problem: cp.Problem) -> None:
    """Refuse names that are given twice, constraints that are listed twice, integers, complex numbers and nan.

    Raises
    ------
    SolverError
        If there is one; the message names the Parameter, the Variable or the constraint.
    """
    _refuse_duplicates("Parameter", problem.parameters())
    _refuse_duplicates("Variable", problem.variables())
    for parameter in problem.parameters():
        for attribute in _beyond(parameter, TAKEN_BY_PARAMETERS):
            raise SolverError(f"Parameter {parameter.name()!r} has the attribute {attribute}: not supported")
    for variable in problem.variables():
        for attribute in _beyond(variable, TAKEN_BY_VARIABLES):
            remedy = REMEDIES.get(attribute, "state it as a constraint")
            raise SolverError(f"Variable {variable.name()!r} has the attribute {attribute}: {remedy}")
    first: dict[int, int] = {}
    for number, constraint in enumerate(problem.constraints):
        if first.setdefault(constraint.id, number) != number:
            raise SolverError(
                f"constraint {number} ({_shown(constraint)}) is the same object as constraint {first[constraint.id]}, "
                "which has one multiplier: list it once, or state it twice"
            )
        shown = f"constraint {number} ({_shown(constraint)})"
        if isinstance(constraint, FiniteSet):
            raise SolverError(f"{shown} is a finite set, which needs integer Variables; allowed: continuous ones")
        if constraint.is_complex():
            raise SolverError(f"{shown} is complex: state its real and its imaginary part")
    for where, part in _parts(problem):
        for constant in part.constants():
            value = constant.value.data if sparse.issparse(constant.value) else constant.value
            if np.isnan(value).any():
                raise SolverError(f"{where} holds nan in a constant; allowed: numbers")
            if part is problem.objective and np.isinf(value).any():
                raise SolverError(f"{where} holds inf in a constant; allowed: finite numbers")


def refuse_cones(problem: cp.Problem) -> None:
    """Refuse the first part of a problem that linear rows and a quadratic objective cannot state.

    Raises
    ------
    SolverError
        If there is one; the message names the cone, and the constraint that needs it.
    """
    for where, part in _parts(problem):
        alone = cp.Problem(part) if part is problem.objective else cp.Problem(cp.Minimize(0), [part])
        cones = ProblemForm(alone).cones(quad_obj=True).difference(LINEAR)
        if cones:
            names = sorted({CONES.get(cone, f"the cone {cone.__name__}") for cone in cones})
            raise SolverError(
                f"{where} ({_shown(part)}) needs {' and '.join(names)}; "
                "allowed: linear constraints and a convex quadratic objective"
            )


def refuse_not_finite(problem: cp.Problem, constraints: list[int]) -> None:
    """Refuse a problem that holds inf anywhere but in the bound of an open row.

    Parameters
    ----------
    constraints : list of int
        Numbers of the constraints whose own rows are at fault; empty where auxiliary rows or the objective are.

    Raises
    ------
    SolverError
        Always; the message names the constraints.
    """
    names = [f"constraint {number}" for number in constraints]
    if not names:
        names = [where for where, part in _parts(problem) if not all(map(_finite, part.constants()))]
    raise SolverError(
        f"{' or '.join(names) or 'a product of constants'} holds inf where it is no open bound; allowed in constants: "
        "finite numbers, and inf as the bound of an inequality that bounds nothing"
    )


def _parts(problem: cp.Problem) -> Iterator[tuple[str, Any]]:
    yield "the objective", problem.objective
    for number, constraint in enumerate(problem.constraints):
        yield f"constraint {number}", constraint


def _finite(constant: cp.Constant) -> bool:
    value = constant.value
    return bool(np.isfinite(value.data if sparse.issparse(value) else value).all())


def _beyond(leaf: cp.expressions.leaf.Leaf, taken: tuple[str, ...]) -> Iterator[str]:
    """Yield the attributes of a leaf that are not supported, also those of a newer cvxpy."""
    return (name for name, value in leaf.attributes.items() if name not in taken and value is not None and value)


def _refuse_duplicates(kind: str, leaves: list[Any]) -> None:
    names = [leaf.name() for leaf in leaves]
    for name in names:
        if names.count(name) > 1:
            raise SolverError(f"{names.count(name)} {kind}s are named {name!r}: give each its own name")


def _shown(part: Any) -> str:
    text = " ".join(str(part).split())
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."
