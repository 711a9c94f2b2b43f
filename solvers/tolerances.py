"""The settings of each solver for a tolerance, and the limits of each call.

`tolerance` bounds the scaled KKT residuals of `solvers.residuals`. Each solver tests other norms. The factors below
make the solver's own test at least as strict, so that a claimed success passes the test of the residuals.
"""

from typing import Any

# Setting of the solver: factor applied to the tolerance.
TOLERANCES: dict[str, dict[str, float]] = {
    "clarabel": {"tol_feas": 0.1, "tol_gap_abs": 0.1, "tol_gap_rel": 0.1},
    "daqp": {"primal_tol": 0.1, "dual_tol": 0.01},
    # The default regularization of 1e-7 would be the error of the answer.
    "highs": {
        "primal_feasibility_tolerance": 0.1,
        "dual_feasibility_tolerance": 0.1,
        "qp_regularization_value": 0.01,
    },
    "native": {"tolerance": 0.1},  # of contradictory rows; answers are accurate to rounding
    "osqp": {"eps_abs": 0.1, "eps_rel": 0.1},
    "piqp": {"eps_abs": 0.1, "eps_rel": 0.1, "eps_duality_gap_abs": 0.1, "eps_duality_gap_rel": 0.1},
    "proxqp": {"eps_abs": 0.1, "eps_rel": 0.1, "eps_duality_gap_abs": 0.1, "eps_duality_gap_rel": 0.1},
    "qoco": {"abstol": 0.1, "reltol": 0.1},
    "qpalm": {"eps_abs": 0.1, "eps_rel": 0.1, "eps_prim_inf": 0.1, "eps_dual_inf": 0.1},
    "scs": {"eps_abs": 0.1, "eps_rel": 0.1},
}

# Smallest value a setting may take, where the solver has a floor.
FLOORS: dict[tuple[str, str], float] = {
    ("highs", "primal_feasibility_tolerance"): 1e-10,
    ("highs", "dual_feasibility_tolerance"): 1e-10,
}

# Setting of the solver: limit. Of iterations where the solver counts them, because they do not depend on the clock.
LIMITS: dict[str, dict[str, Any]] = {
    "clarabel": {"max_iter": 200},
    "daqp": {"iter_limit": 10_000},
    "highs": {"qp_iteration_limit": 10_000, "simplex_iteration_limit": 10_000, "time_limit": 10.0},
    "native": {"max_iterations": 10_000},
    "osqp": {"max_iter": 100_000},
    "piqp": {"max_iter": 250},
    "proxqp": {"max_iter": 1000, "max_iter_in": 1500},
    "qoco": {"max_iters": 200},
    "qpalm": {"max_iter": 10_000},
    "scs": {"max_iters": 100_000},
}


def settings(backend: str, tolerance: float) -> dict[str, Any]:
    """Return a solver's settings for a tolerance, with its limits."""
    scaled = {
        name: max(factor * tolerance, FLOORS.get((backend, name), 0.0)) for name, factor in TOLERANCES[backend].items()
    }
    return {**scaled, **LIMITS[backend]}
