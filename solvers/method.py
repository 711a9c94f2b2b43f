"""The compiled path for people who call ``problem.solve``."""

from typing import Any
from weakref import WeakKeyDictionary

from solvers.compiled import CompiledProblem, compile
from solvers.errors import ParameterError

_compiled: "WeakKeyDictionary[Any, dict[Any, CompiledProblem]]" = WeakKeyDictionary()


def register_solve_method(name: str = "compiled") -> None:
    """Let every cvxpy problem be solved with ``problem.solve(method=name, backend="daqp", ...)``.

    Takes the keywords of `solvers.compile`; values, multipliers, status and objective value are written back as
    cvxpy does. Each problem is compiled at its first solve, once for every choice of keywords.
    """
    import cvxpy

    cvxpy.Problem.register_solve(name, _solve)


def _solve(problem: Any, **keywords: Any) -> float:
    from solvers.leaves import value_of, write_back

    known = _compiled.setdefault(problem, {})
    key = repr(sorted(keywords.items()))
    if key not in known:
        known[key] = compile(problem, **keywords)
    values = {}
    for parameter in problem.parameters():
        value = value_of(parameter)
        if value is None:
            raise ParameterError(f"parameter {parameter.name()!r} has no value: set its .value first")
        values[parameter.name()] = value
    write_back(problem, known[key].solve(**values))
    return float(problem.value)
