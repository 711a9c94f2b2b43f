"""The result of a solve."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np


class Status(StrEnum):
    """Outcome of a solve. ``SOLVED`` is a verified answer; ``INFEASIBLE`` and ``UNBOUNDED`` are proved.

    Examples
    --------
    >>> import solvers
    >>> solvers.Status.ITERATION_LIMIT.value
    'iteration_limit'
    >>> solvers.Status("solved") is solvers.Status.SOLVED
    True
    """

    SOLVED = "solved"
    INACCURATE = "inaccurate"
    INFEASIBLE = "infeasible"
    UNBOUNDED = "unbounded"
    ITERATION_LIMIT = "iteration_limit"
    TIME_LIMIT = "time_limit"
    FAILED = "failed"


@dataclass(slots=True, eq=False)
class Solution:
    """Answer to one solve, with residuals recomputed from the answer itself.

    Attributes
    ----------
    primal : dict of str to ndarray
        Value of each cvxpy Variable by name, in the Variable's shape; nan where there is no answer.
    dual : list of ndarray
        Multipliers in the order of ``problem.constraints``, each in its constraint's shape and with cvxpy's
        sign: nonnegative for inequalities; for an equality ``F v == d`` the Lagrangian has ``+ y.(F v - d)``.
    objective : float
        Value of the problem's objective at the answer, with its constant, and with its own sign if it is maximized;
        nan where there is no answer. Parts such as ``abs`` and ``max``, for which the standard form has auxiliary
        variables, count by these variables, which are as accurate as the residuals say.
    status : Status
        The verdict on the residuals below: ``SOLVED`` if they are all within the tolerance. ``INFEASIBLE`` and
        ``UNBOUNDED`` are proved (`solvers.certificates.prove`), whichever of the two was claimed. Without a proof such
        a claim is ``FAILED``.
    claimed : Status
        The claim of the backend.
    backend : str
        Name of the backend that answered; of a chain, its member.
    iterations : int
        Iterations that the backend reports.
    fallbacks : int
        Number of members of the chain that failed before this one.
    polished : bool
        Whether the active-set polish replaced the backend's answer.
    setup_time, solve_time, overhead_time : float
        Seconds of handing over the data, of the solver, and of everything else.
    primal_residual, dual_residual, complementarity : float
        Scaled KKT residuals, defined in `solvers.residuals.Residuals`.
    message : str
        The backend's status text. A claim that was not verified stands before it.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x = cp.Variable(2, name="x")
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x[0] + x[1] >= 2])
    >>> solution = solvers.compile(problem, "daqp").solve()
    >>> solution.ok, solution.backend, solution.primal_residual < 1e-9
    (True, 'daqp', True)
    >>> solution.primal["x"].round(6)
    array([1., 1.])
    >>> round(solution.objective, 6), round(float(solution.dual[0]), 6)
    (2.0, 2.0)
    """

    primal: dict[str, np.ndarray]
    dual: list[np.ndarray]
    objective: float
    status: Status
    claimed: Status
    backend: str
    iterations: int
    fallbacks: int
    polished: bool
    setup_time: float
    solve_time: float
    overhead_time: float
    primal_residual: float
    dual_residual: float
    complementarity: float
    message: str

    @property
    def ok(self) -> bool:
        """Whether the answer was verified to the tolerance."""
        return self.status is Status.SOLVED
