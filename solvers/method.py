"""A solve method of cvxpy: ``problem.solve`` by the compiled path."""

from typing import Any
from weakref import WeakKeyDictionary

from solvers.compiled import CompiledProblem, compile
from solvers.errors import ParameterError
from solvers.threads import CVXPY

_compiled: "WeakKeyDictionary[Any, dict[str, CompiledProblem]]" = WeakKeyDictionary()


def register_solve_method(name: str = "compiled") -> None:
    """Register a method of cvxpy, for ``problem.solve(method=name, backend="daqp", ...)``.

    The method takes the keywords of `solvers.compile`. It writes values, multipliers, status and objective value back
    as cvxpy does. ``problem.solver_stats`` has the name of the backend that answered, its times and iterations, and the
    `solvers.Solution` as ``extra_stats``. Each problem is compiled at its first solve, once for every choice of
    keywords. The compiled problems are freed with their problem.

    Threads may solve problems of their own at the same time. A problem has one set of values: threads that share it
    have to hold a lock from setting its Parameters to reading its Variables, or use `solvers.compile`, whose answers
    belong to the caller.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import solvers
    >>> solvers.register_solve_method()
    >>> x, b = cp.Variable(2, name="x"), cp.Parameter(name="b", value=2.0)
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x[0] + x[1] >= b])
    >>> round(problem.solve(method="compiled", backend="daqp"), 6)
    2.0
    >>> x.value.round(6)
    array([1., 1.])
    """
    import cvxpy

    cvxpy.Problem.register_solve(name, _solve)


def _solve(problem: Any, **keywords: Any) -> float:
    from solvers.leaves import write_back

    with CVXPY:
        compiled, values = _prepare(problem, keywords)
    solution = compiled.solve(**values)
    with CVXPY:
        write_back(problem, solution)
        return float(problem.value)


def _prepare(problem: Any, keywords: dict[str, Any]) -> tuple[CompiledProblem, dict[str, Any]]:
    """Return the compiled problem for a choice of keywords, and the values of the Parameters."""
    import cvxpy

    from solvers.leaves import value_of

    known = _compiled.setdefault(problem, {})
    key = repr(sorted(keywords.items()))
    if key not in known:
        # A value that held the key itself would keep it alive.
        known[key] = compile(cvxpy.Problem(problem.objective, problem.constraints), **keywords)
    values = {}
    for parameter in problem.parameters():
        value = value_of(parameter)
        if value is None:
            raise ParameterError(f"parameter {parameter.name()!r} has no value: set its .value first")
        values[parameter.name()] = value
    return known[key], values
