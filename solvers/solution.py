"""What a solve returns."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np


class Status(StrEnum):
    """Outcome of a solve; ``SOLVED`` is a verified answer, ``INFEASIBLE`` and ``UNBOUNDED`` a verified lack of one."""

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
        The vendor's own word.
    backend : str
        Who solved it; a member of the chain where the backend asked for is a chain.
    iterations : int
        Iterations the vendor reports.
    fallbacks : int
        How many members of a chain failed before this one.
    polished : bool
        Whether the active-set polish replaced the vendor's answer.
    setup_time, solve_time, overhead_time : float
        Seconds spent handing over the data, in the solver, and in everything else.
    primal_residual, dual_residual, complementarity : float
        Scaled KKT residuals, defined in `solvers.residuals.Residuals`.
    message : str
        The vendor's status text, after a claim that was not verified.
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
