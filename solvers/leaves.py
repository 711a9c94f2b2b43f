"""Values of a cvxpy problem's Parameters and Variables: reading and writing them."""

from collections.abc import Iterator
from contextlib import contextmanager

import cvxpy as cp
import numpy as np
from cvxpy.error import SolverError as CvxpySolverError
from cvxpy.lin_ops.lin_utils import ID_COUNTER
from cvxpy.problems.problem import SolverStats
from cvxpy.reductions.cvx_attr2constr import lower_value
from cvxpy.reductions.solution import Solution as CvxpySolution
from scipy import sparse

from solvers.errors import ParameterError
from solvers.solution import Solution, Status


@contextmanager
def kept_values(problem: cp.Problem) -> Iterator[None]:
    """Restore the values of a problem's Parameters, Variables and multipliers on leaving."""
    leaves = [*problem.parameters(), *problem.variables()]
    leaves += [variable for constraint in problem.constraints for variable in constraint.dual_variables]
    saved = [(leaf, leaf._value) for leaf in leaves]
    try:
        yield
    finally:
        for leaf, value in saved:
            leaf._value = value


def without_cache(problem: cp.Problem) -> cp.Problem:
    """Return a copy of a problem without cvxpy's cache of its solves, which cannot be pickled."""
    return cp.Problem(problem.objective, problem.constraints)


def highest_identifier() -> int:
    """Return the highest number that cvxpy has given to a Variable, Parameter or constraint in this process."""
    return int(ID_COUNTER.count)


def reserve_identifiers(upto: int) -> None:
    """Let cvxpy use only higher numbers from now on, for a problem that comes from another process.

    cvxpy numbers the auxiliary variables of a problem from the count of its process. In a new process these numbers
    could collide with those of an unpickled problem.
    """
    ID_COUNTER.count = max(ID_COUNTER.count, upto)


def value_of(parameter: cp.Parameter) -> np.ndarray | None:
    """Return a Parameter's value as its view holds it; None if it has no value."""
    if parameter.attributes["sparsity"]:  # cvxpy warns when such a value is read the usual way
        return None if parameter._value is None else np.asarray(parameter._value)[np.argsort(_places(parameter))]
    return None if parameter.value is None else np.asarray(parameter.value)


def assign(parameter: cp.Parameter, value: np.ndarray) -> None:
    """Give a Parameter the value that its view holds, unchecked."""
    if parameter.attributes["sparsity"]:
        entries = sparse.coo_array((value[_ranks(parameter)], parameter.sparse_idx), shape=parameter.shape)
        parameter.save_value(entries, sparse_path=True)
    else:
        parameter.save_value(value)


def view_shape(parameter: cp.Parameter) -> tuple[int, ...]:
    """Return the shape of a Parameter's view: its own; of a sparse Parameter the number of its declared entries."""
    shape: tuple[int, ...] = parameter.shape
    return (parameter.sparse_idx[0].size,) if parameter.attributes["sparsity"] else shape


def write_back(problem: cp.Problem, solution: Solution) -> None:
    """Write a solution into a problem's Variables, multipliers, status, value and stats, as ``problem.solve`` does."""
    sense = -1.0 if isinstance(problem.objective, cp.Maximize) else 1.0
    status, value = {
        Status.SOLVED: (cp.OPTIMAL, 0.0),
        Status.INACCURATE: (cp.OPTIMAL_INACCURATE, 0.0),
        Status.INFEASIBLE: (cp.INFEASIBLE, sense * np.inf),
        Status.UNBOUNDED: (cp.UNBOUNDED, -sense * np.inf),
    }.get(solution.status, (cp.SOLVER_ERROR, np.nan))
    if status == cp.SOLVER_ERROR:
        message = f"the backend {solution.backend} ended with {solution.status} ({solution.message})"
        raise CvxpySolverError(f"{message}: try another backend")
    primal = {variable.id: _as_cvxpy(variable, solution.primal[variable.name()]) for variable in problem.variables()}
    found = zip(problem.constraints, solution.dual, strict=True)
    dual = {constraint.id: multiplier for constraint, multiplier in found} if not np.isinf(value) else {}
    times = {cp.settings.SOLVE_TIME: solution.solve_time, cp.settings.SETUP_TIME: solution.setup_time}
    stats = {**times, cp.settings.NUM_ITERS: solution.iterations, cp.settings.EXTRA_STATS: solution}
    problem.unpack(CvxpySolution(status, value, primal, dual, stats))
    problem._solver_stats = SolverStats.from_dict(stats, solution.backend)


def _as_cvxpy(variable: cp.Variable, value: np.ndarray) -> "np.ndarray | sparse.dia_array":
    """Return a Variable's value as cvxpy stores it: sparse if the Variable is diagonal."""
    return sparse.diags_array(np.diag(value)) if variable.attributes["diag"] else value


def lowered_view(parameter: cp.Parameter, view: np.ndarray) -> np.ndarray:
    """Return the free entries by which cvxpy replaces a Parameter, from the content of its view."""
    if parameter.attributes["sparsity"]:
        return view[_ranks(parameter)]
    return np.asarray(lower_value(parameter, view)) if parameter._has_dim_reducing_attr else view


def declared_entries(parameter: cp.Parameter, value: np.ndarray) -> np.ndarray:
    """Return the declared entries of a sparse Parameter, row by row, from a value in the Parameter's shape.

    Raises
    ------
    ParameterError
        If an entry that is not declared is not zero.
    """
    entries: np.ndarray = value.ravel()[np.sort(_places(parameter))]
    if np.count_nonzero(entries) != np.count_nonzero(value):
        raise ParameterError(f"parameter {parameter.name()!r} has entries outside the pattern it declares")
    return entries


def _places(parameter: cp.Parameter) -> np.ndarray:
    """Return the places of the entries of a sparse Parameter, in cvxpy's order, which depends on scipy's version."""
    return np.asarray(np.ravel_multi_index(parameter.sparse_idx, parameter.shape))


def _ranks(parameter: cp.Parameter) -> np.ndarray:
    ranks: np.ndarray = np.argsort(np.argsort(_places(parameter)))
    return ranks
