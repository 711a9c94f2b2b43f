"""Calls of solvers alone, on arrays made beforehand, without deli."""

from collections.abc import Callable
from typing import Any

import clarabel
import daqp
import numpy as np
import osqp
import piqp
from scipy import sparse

from solvers import tolerances

TOLERANCE = 1e-9

Numbers = dict[str, Any]
Call = Callable[[Numbers], object]


def standard_form(values: list[Numbers], pattern: np.ndarray) -> list[Numbers]:
    """Return the arrays of ``minimize ½ xᵀPx + qᵀx  subject to  A x ≤ u`` that the solvers take."""
    indices = sparse.csc_matrix(pattern.astype(float))
    cases = []
    for value in values:
        A = -value["gradients"]
        data = A.T[pattern.T]
        same_pattern = sparse.csc_matrix((data, indices.indices, indices.indptr), shape=A.shape)
        case = {"q": value["linear"], "A": np.ascontiguousarray(A), "u": -value["bounds"]}
        cases.append({**case, "A_fortran": np.asfortranarray(A), "A_sparse": same_pattern, "bounds": value["bounds"]})
    return cases


def _daqp(metric: np.ndarray, values: list[Numbers]) -> Call:
    settings = tolerances.settings("daqp", TOLERANCE)
    rows = len(values[0]["bounds"])
    sense, lower = np.zeros(rows, dtype=np.intc), np.full(rows, -np.inf)

    def run(case: Numbers) -> object:
        return daqp.solve(metric, case["q"], case["A"], case["u"], lower, sense, **settings)

    return run


def _piqp(metric: np.ndarray, values: list[Numbers]) -> Call:
    settings = tolerances.settings("piqp", TOLERANCE)
    n = len(metric)
    is_dense = bool(np.all(values[0]["A"]))
    P = metric if is_dense else sparse.csc_matrix(metric)
    nothing = np.zeros((0, n), order="F") if is_dense else sparse.csc_matrix((0, n))
    no_numbers = np.zeros(0)
    key = "A_fortran" if is_dense else "A_sparse"

    def run(case: Numbers) -> object:
        solver = piqp.DenseSolver() if is_dense else piqp.SparseSolver()
        for name, value in settings.items():
            setattr(solver.settings, name, value)
        solver.setup(P, case["q"], nothing, no_numbers, case[key], None, case["u"])
        solver.solve()
        return np.array(solver.result.x), np.array(solver.result.z_u)

    return run


def _clarabel(metric: np.ndarray, values: list[Numbers]) -> Call:
    settings = clarabel.DefaultSettings()
    chosen = {"verbose": False, "max_threads": 1, "presolve_enable": False, "equilibrate_enable": False}
    for name, value in {**chosen, **tolerances.settings("clarabel", TOLERANCE)}.items():
        setattr(settings, name, value)
    first, cones = values[0], [clarabel.NonnegativeConeT(len(values[0]["u"]))]
    P = sparse.triu(sparse.csc_matrix(metric), format="csc")
    solver = clarabel.DefaultSolver(P, first["q"], first["A_sparse"], first["u"], cones, settings)

    def run(case: Numbers) -> object:
        solver.update(q=case["q"], A=case["A_sparse"].data, b=case["u"])
        result = solver.solve()
        return np.array(result.x), np.array(result.z)

    return run


def _osqp(metric: np.ndarray, values: list[Numbers]) -> Call:
    extension = osqp.OSQP(algebra="builtin").ext
    settings = extension.OSQPSettings()
    extension.osqp_set_default_settings(settings)
    chosen = {"verbose": False, "polishing": False, "adaptive_rho": 1, "adaptive_rho_interval": 50}
    for name, value in {**chosen, **tolerances.settings("osqp", TOLERANCE)}.items():
        setattr(settings, name, value)
    P = sparse.triu(sparse.csc_matrix(metric), format="csc")
    rows, n = values[0]["A"].shape
    lower = np.full(rows, -1e30)

    def run(case: Numbers) -> object:
        P_, A = extension.CSC(P), extension.CSC(case["A_sparse"])
        solver = extension.OSQPSolver(P_, case["q"], A, lower, case["u"], rows, n, settings)
        solver.solve()
        return np.array(solver.solution.x), np.array(solver.solution.y)

    return run


RAW: dict[str, Callable[[np.ndarray, list[Numbers]], Call]] = {
    "daqp": _daqp,
    "piqp": _piqp,
    "clarabel": _clarabel,
    "osqp": _osqp,
}
