"""A problem compiled once and solved many times."""

import math
from collections.abc import Mapping
from copy import copy
from threading import Lock
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from solvers import choosing, registry
from solvers.asking import FLOAT, ask, attach
from solvers.backends.base import Answer, Backend
from solvers.copies import parts, rebuild
from solvers.curvature import fitting
from solvers.declared import checks, real_numbers
from solvers.errors import BackendError, ParameterError, SolverError
from solvers.residuals import EXACT, Residuals
from solvers.solution import Solution, Status
from solvers.threads import CVXPY
from solvers.views import Views

# A lookup of an enum's member on its class takes far longer than one of a name, and a solve needs several.
SOLVED, INACCURATE = Status.SOLVED, Status.INACCURATE
NO_POINT = (Status.INFEASIBLE, Status.UNBOUNDED)
FIXED = ("backend", "parameters", "program", "tolerance")

if TYPE_CHECKING:
    import cvxpy

    from solvers.canonical import Canonical


def compile(
    problem: "cvxpy.Problem",
    backend: str = "auto",
    tolerance: float = 1e-9,
    polish: bool = False,
    check_parameters: bool = True,
    warm_start: bool = False,
    **options: Any,
) -> "CompiledProblem":
    """Canonicalize a cvxpy problem once, for many solves with changing Parameters.

    Parameters
    ----------
    problem : cvxpy.Problem
        A convex quadratic program that follows disciplined parametrized programming (DPP), in real and continuous
        Variables of any other attributes but ``PSD`` and ``NSD``. An inequality whose bound holds inf as a constant
        is open there: it has no row, and the multiplier 0.
    backend : str
        One of `solvers.backends`, ``"auto"`` (backends that suit the problem's size, sparsity and curvature, one
        after another until an answer is verified: `solvers.choosing`), or ``"cvxpy:SOLVER"`` for any solver of cvxpy.
    tolerance : float
        Bound on the scaled KKT residuals (`solvers.residuals`), with the same meaning for every backend.
    polish : bool
        Refine each answer by solving the linear system of its active set (`solvers.polish`).
    check_parameters : bool
        Check at every solve that values have the attributes that their Parameters declare (positive semidefinite,
        nonnegative, ...). Otherwise the caller answers for them.
    warm_start : bool
        Begin each solve at the answer of the previous one, if that was solved. Answers then depend on the previous one,
        within the tolerance. Otherwise they are functions of the parameter values alone, bit for bit.
    **options
        The backend's own settings, by its own names. For ``"auto"``, one mapping for each of native, daqp, piqp and
        clarabel, by name; mappings for backends that are not members of the problem's chain have no effect.

    Returns
    -------
    CompiledProblem

    Raises
    ------
    SolverError
        If the problem, the backend or an option cannot be used. The message names the cone, the Variable, the Parameter
        or the constraint in the way, or the entries without curvature if the backend needs it everywhere.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x, b = cp.Variable(2, name="x"), cp.Parameter(2, name="b")
    >>> problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(x) - b @ x), [x >= 0.5])
    >>> compiled = solvers.compile(problem, "clarabel", tolerance=1e-8)
    >>> compiled.solve(b=[1.0, -1.0]).primal["x"].round(6)
    array([1. , 0.5])
    >>> compiled.solve(b=[3.0, 2.0]).primal["x"].round(6)
    array([3., 2.])
    """
    if not 0.0 < tolerance < 1.0:
        raise SolverError(f"tolerance is {tolerance!r}; allowed: a number between 0 and 1, such as 1e-9")
    members = registry.members(backend)
    if warm_start and not registry.can(backend, "warm_starts"):
        raise SolverError(f"{backend} has no warm start; allowed with it: {', '.join(registry.able('warm_starts'))}")
    if backend in registry.CHAINS:
        allowed = dict.fromkeys((*members, *choosing.FILLED, *choosing.SPARSE))
        for name in options:
            if name not in allowed:
                raise SolverError(f"{backend} has no option {name!r}; allowed: one mapping for {', '.join(allowed)}")
    from solvers.canonical import canonicalize  # cvxpy takes a second to import

    with CVXPY:
        canonical = canonicalize(problem)
        if backend in registry.CHAINS:
            table = {name: dict(options.get(name, {})) for name in choosing.choose(canonical.map.program)}
        else:
            table = {backend: options}
        compiled = CompiledProblem(canonical, backend, tolerance, polish, check_parameters, warm_start, table)
    compiled._keywords = {
        "backend": backend, "tolerance": tolerance, "polish": polish, "check_parameters": check_parameters,
        "warm_start": warm_start, **options,
    }  # fmt: skip
    return compiled


class CompiledProblem:
    """A problem that `solvers.compile` has canonicalized.

    Several threads may call `solve` of one compiled problem: calls take turns, each with its own values and its own
    answer. With a warm start each begins at the answer of the previous call of any thread. Values that are
    written into `parameters` belong to all threads. Compile once for each thread to solve at the same time.

    The attributes below are fixed when the problem is compiled.

    Attributes
    ----------
    parameters : mapping of str to ndarray
        Writable views of the parameter values, in each Parameter's shape. Of a symmetric Parameter the upper
        triangle is used, of a diagonal one the diagonal. The view of a sparse one is a vector of the entries that it
        declares, row by row. ``parameters["b"][...] = value`` writes into a view. A view cannot be replaced.
    backend : str
        The name given to `solvers.compile`.
    program : QuadraticProgram
        The standard form, with the numbers of the last solve; for reading only.
    tolerance : float
        Bound on the residuals of an answer called solved.

    Notes
    -----
    A copy (`copy`, `pickle`, and with it processes, joblib and Dask) is compiled anew from the problem, the keywords
    given to `solvers.compile` and the current parameter values. It gives the same answers bit for bit, begins without a
    warm start, and shares nothing with its original but, within a process, the cvxpy problem. A process that unpickles
    it has to register the user's own backends first.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> x, b = cp.Variable(2, name="x"), cp.Parameter(2, name="b")
    >>> problem = cp.Problem(cp.Minimize(0.5 * cp.sum_squares(x) - b @ x), [x >= 0.5])
    >>> compiled = solvers.compile(problem, "daqp")
    >>> compiled.parameters["b"][...] = 1.0
    >>> compiled.parameters["b"][1] = -1.0
    >>> solution = compiled.solve()
    >>> solution.primal["x"].round(6), solution.dual[0].round(6)
    (array([1. , 0.5]), array([0. , 1.5]))
    """

    __slots__ = (
        "_canonical", "_checks", "_dual", "_keywords", "_last", "_lock", "_map", "_members", "_options", "_polish",
        "_primal", "_residuals", "_sense", "_solvers", "_warm_start", "backend", "parameters", "program", "tolerance",
    )  # fmt: skip

    def __init__(
        self,
        canonical: "Canonical",
        backend: str,
        tolerance: float,
        polish: bool,
        check_parameters: bool,
        warm_start: bool,
        options: Mapping[str, Mapping[str, Any]],
    ) -> None:
        self.parameters = Views(canonical.views)
        self.program = canonical.map.program
        self.backend = backend
        self.tolerance = tolerance
        self._map = canonical.map
        self._primal, self._dual = canonical.primal, canonical.dual
        self._sense = -1.0 if canonical.problem.objective.NAME == "maximize" else 1.0  # the program minimizes
        self._checks = checks(canonical.problem.parameters(), canonical.views) if check_parameters else ()
        self._residuals = Residuals(self.program)
        self._canonical = canonical
        self._members = fitting(tuple(options), canonical)
        self._options = options
        if polish:
            from solvers.polish import Polish  # scipy.optimize takes long to import, and listing needs no polish
        self._polish = Polish(self.program) if polish else None
        self._warm_start = warm_start
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self._solvers: list[Backend] = []
        self._lock = Lock()
        self._keywords: dict[str, Any] = {}
        self._attach(0)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in FIXED and hasattr(self, name):
            raise AttributeError(f"{name} of a compiled problem is fixed: compile another one with solvers.compile")
        object.__setattr__(self, name, value)

    def solve(self, **parameters: Any) -> Solution:
        """Solve for new parameter values.

        Parameters
        ----------
        **parameters
            Values by Parameter name, in the shape of the Parameter or of its view. A Parameter that is not given keeps
            its last value; at first that is its ``.value``, if it had one when the problem was compiled.

        Returns
        -------
        Solution
            A function of the parameter values alone, bit for bit, unless compiled with ``warm_start=True``. A call from
            another thread waits until this call has its answer.

        Raises
        ------
        ParameterError
            If a name is unknown, or a value has another shape or is not made of finite real numbers. Only inf in a
            constant of the model opens an inequality; inf as the value of a Parameter is refused.
        BackendError
            If the backend, or the last member of a chain, raises an exception.
        """
        with self._lock:  # numbers, solvers and residuals are shared by all calls
            return self._solve(parameters)

    def _solve(self, parameters: Mapping[str, Any]) -> Solution:
        start = perf_counter()
        views = self._canonical.views
        for name, value in parameters.items():
            view = views.get(name)
            if view is None:
                raise ParameterError(f"unknown parameter {name!r}; allowed: {', '.join(views) or 'none'}")
            if type(value) is not np.ndarray or value.dtype is not FLOAT:
                value = real_numbers(name, value)
            view[...] = value if value.shape == view.shape else self._canonical.to_view(name, value)
        if not self._map.apply():
            self._refuse_not_finite()
        for check in self._checks:
            check()
        setup_time = solve_time = 0.0
        last = len(self._members) - 1
        for member in range(last + 1):
            before = perf_counter()
            solver = self._solvers[member] if member < len(self._solvers) else self._attach(member)
            setup_time += perf_counter() - before
            try:
                answer, handing, solving = ask(self._members[member], solver, self._map, self._last)
            except BackendError:
                if member == last:
                    raise
                continue
            setup_time += handing
            solve_time += solving
            status, answer, polished = self._judge(answer)
            if status is SOLVED or status in NO_POINT:
                break
        if self._warm_start:
            self._last = (answer.x.copy(), answer.y.copy()) if status is SOLVED else None
        return self._report(answer, status, polished, member, start, setup_time, solve_time)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the parts of a compiled problem."""
        return rebuild, (compile, *parts(self._canonical.problem, self._keywords, self.parameters))

    def __deepcopy__(self, memo: dict[int, Any]) -> "CompiledProblem":
        """Copy everything but the model, which no solve changes."""
        return copy(self)

    def _judge(self, answer: Answer) -> tuple[Status, Answer, bool]:
        """Return the verdict on an answer by proofs and residuals, and the answer, polished if the problem says so."""
        claimed = answer.claimed
        residuals = self._residuals
        if claimed in NO_POINT:
            from solvers.certificates import prove  # scipy.optimize takes long to import

            proved = prove(self.program, residuals, self.tolerance)
            if proved is not None:
                residuals.forget()
                return proved, answer, False
            answer = answer._replace(message=f"claims {claimed}, not verified ({answer.message})")
            claimed = Status.FAILED
        worst = residuals.compute(answer.x, answer.y)
        polished = False
        if self._polish is not None and residuals.natural > EXACT:  # which nan is not
            better = self._polish.improve(answer.x, answer.y)
            if better is not None:
                worst = residuals.compute(*better)
                polished = True
                answer = answer._replace(x=better[0], y=better[1])
        # With polish, an answer within the tolerance counts as solved without a claim of the solver.
        if claimed is SOLVED or claimed is INACCURATE or self._polish is not None:
            if worst <= self.tolerance:
                return SOLVED, answer, polished
            if math.isnan(worst):
                return Status.FAILED, answer, polished
            if claimed is SOLVED:
                return INACCURATE, answer, polished
        return claimed, answer, polished

    def _report(
        self,
        answer: Answer,
        status: Status,
        polished: bool,
        member: int,
        start: float,
        setup_time: float,
        solve_time: float,
    ) -> Solution:
        x, y = answer.x, answer.y
        if status in NO_POINT:
            x, y = np.full(self.program.variables, np.nan), np.full(self.program.rows, np.nan)
        primal = {name: place.take(x) for name, place in self._primal}
        dual = [place.take(y) for place in self._dual]
        residuals = self._residuals
        return Solution(
            primal,
            dual,
            self._sense * (residuals.objective + self._map.constant.item()),
            status,
            answer.claimed,
            self._members[member],
            answer.iterations,
            member,
            polished,
            setup_time,
            solve_time,
            perf_counter() - start - setup_time - solve_time,
            residuals.primal,
            residuals.dual,
            residuals.complementarity,
            answer.message,
        )

    def _attach(self, member: int) -> Backend:
        """Set up a member of the chain at its first use."""
        name = self._members[member]
        if name.startswith(registry.REFERENCE):
            from solvers.backends.reference import Reference

            solver: Backend = Reference(self._canonical, name, self.tolerance, self._options[name])
        else:
            factory, options = registry.factory(name), self._options[name]
            solver = attach(name, lambda: factory(self.program, self.tolerance, options), self._map)
        self._solvers.append(solver)
        return solver

    def _refuse_not_finite(self) -> None:
        for name, view in self.parameters.items():
            if not np.isfinite(view).all():
                raise ParameterError(f"parameter {name!r} was never given or holds nan or inf; allowed: finite numbers")
        if not self._map.is_finite():  # a scalar product of large numbers overflows before they do
            raise ParameterError("the values of the parameters overflow in the products that the problem makes of them")
