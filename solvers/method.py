"""The compiled path for people who call ``problem.solve``."""

from typing import Any
from weakref import WeakKeyDictionary

from solvers.compiled import CompiledProblem, compile
from solvers.errors import ParameterError
from solvers.threads import CVXPY

_compiled: "WeakKeyDictionary[Any, dict[str, CompiledProblem]]" = WeakKeyDictionary()


def register_solve_method(name: str = "compiled") -> None:
    """Let every cvxpy problem be solved with ``problem.solve(method=name, backend="daqp", ...)``.

    Takes the keywords of `solvers.compile`; values, multipliers, status and objective value are written back as
    cvxpy does. ``problem.solver_stats`` has the name of the backend that answered, its times and iterations, and the
    `solvers.Solution` as ``extra_stats``. Each problem is compiled at its first solve, once for every choice of
    keywords; what was compiled is freed with the problem.

    Threads may solve problems of their own at the same time. One problem has one set of values: threads that share it
    have to hold a lock from setting its Parameters to reading its Variables, or use `solvers.compile`, whose answers
    belong to the caller.
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
    """Return what is compiled for a problem and choice of keywords, and the values of its Parameters."""
    import cvxpy

    from solvers.leaves import value_of

    known = _compiled.setdefault(problem, {})
    key = repr(sorted(keywords.items()))
    if key not in known:
        # The key itself, held by its own value, would never be freed.
        known[key] = compile(cvxpy.Problem(problem.objective, problem.constraints), **keywords)
    values = {}
    for parameter in problem.parameters():
        value = value_of(parameter)
        if value is None:
            raise ParameterError(f"parameter {parameter.name()!r} has no value: set its .value first")
        values[parameter.name()] = value
    return known[key], values
