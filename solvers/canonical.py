"""From a cvxpy problem to standard form: the only file that touches cvxpy's internals.

cvxpy's parametrized program holds tensors whose product with its parameter vector gives P, q, A, b. They are
composed here with the map from the problem's own Parameters to that vector. The fields read are private to
cvxpy, therefore the result is compared with cvxpy's own ``apply_parameters`` whenever a problem is compiled.
"""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.error import DPPError
from cvxpy.error import SolverError as CvxpySolverError
from cvxpy.reductions.cvx_attr2constr import CvxAttr2Constr, lower_value
from cvxpy.reductions.solution import Solution as CvxpySolution
from scipy import sparse

from solvers.affine import AffineMap, Tensors
from solvers.errors import SolverError
from solvers.solution import Solution, Status

SYMMETRIC = ("PSD", "NSD", "symmetric")
UNSUPPORTED = ("hermitian", "complex", "imag", "boolean", "integer", "bounds")


@dataclass(slots=True, eq=False)
class Canonical:
    """A problem in standard form, and the ways in and out of it.

    Attributes
    ----------
    problem : cvxpy.Problem
        The model.
    map : AffineMap
        From theta, all parameter values flattened in Fortran order and then a one, to the program.
    views : dict of str to ndarray
        Writable views of theta, by Parameter name, in the Parameter's shape.
    primal : list of (str, slice, tuple or None)
        Name of each Variable, its place in x and the shape to give it (None: already right).
    dual : list of (slice, tuple or None)
        The same for the constraints and y, in order.
    """

    problem: cp.Problem
    map: AffineMap
    views: dict[str, np.ndarray]
    primal: list[tuple[str, Any, tuple[int, ...] | None]]
    dual: list[tuple[Any, tuple[int, ...] | None]]


def canonicalize(problem: cp.Problem) -> Canonical:
    """Canonicalize a convex quadratic problem once for all values of its Parameters.

    Raises
    ------
    SolverError
        If the problem is not a quadratic program, does not follow the rules of disciplined parametrized
        programming, names two things alike, or if cvxpy's internals are not what this file knows.
    """
    _refuse_duplicates("Parameter", problem.parameters())
    _refuse_duplicates("Variable", problem.variables())
    for parameter in problem.parameters():
        for attribute in UNSUPPORTED:
            if parameter.attributes[attribute]:
                raise SolverError(f"Parameter {parameter.name()!r} has the attribute {attribute}: not supported")
    own = cp.Problem(problem.objective, problem.constraints)  # leaves the caller's solver cache alone
    with kept_values(problem), warnings.catch_warnings():
        # cvxpy reads its own sparse Parameters in the way it warns about
        warnings.filterwarnings("ignore", message=".*sparse CVXPY expression", category=RuntimeWarning)
        for parameter in problem.parameters():
            parameter.save_value(np.ones(parameter.shape))
        try:
            data, chain, inverse = own.get_problem_data("OSQP", canon_backend="COO", enforce_dpp=True)
        except (DPPError, CvxpySolverError, cp.DCPError) as error:
            raise SolverError(f"the problem is not a parametrized quadratic program: {error}") from error
    if data["bool_vars_idx"] or data["int_vars_idx"]:
        raise SolverError("the problem has integer Variables; only continuous Variables are allowed")
    parametrized = data["param_prob"]
    theta, views, selection, lowered = _lay_out_parameters(problem, chain, parametrized)
    tensors = Tensors(
        parametrized.x.size,
        parametrized.constr_size,
        parametrized.cone_dims.zero,
        *(sparse.coo_array(t @ selection) for t in (parametrized.q, parametrized.A, parametrized.P)),
    )
    affine = AffineMap(theta, tensors)
    check_against_cvxpy(affine, parametrized, views, lowered)
    answers = _probe_answers(problem, chain, inverse, parametrized)
    affine.theta[:-1] = np.nan  # refused until given
    for parameter in problem.parameters():
        value = value_of(parameter)
        if value is not None:
            views[parameter.name()][...] = value
    return Canonical(problem, affine, views, *answers)


@contextmanager
def kept_values(problem: cp.Problem) -> Iterator[None]:
    """Put back, on leaving, the values of a problem's Parameters, Variables and multipliers."""
    leaves = [*problem.parameters(), *problem.variables()]
    leaves += [variable for constraint in problem.constraints for variable in constraint.dual_variables]
    saved = [(leaf, leaf._value) for leaf in leaves]
    try:
        yield
    finally:
        for leaf, value in saved:
            leaf._value = value


def value_of(parameter: cp.Parameter) -> np.ndarray | None:
    """Return a Parameter's value as a dense array, None if it has none."""
    if parameter.attributes["sparsity"]:  # cvxpy warns when such a value is read the usual way
        entries = parameter.value_sparse if parameter._value is not None else None
        return None if entries is None else np.asarray(entries.toarray())
    return None if parameter.value is None else np.asarray(parameter.value)


def write_back(problem: cp.Problem, solution: Solution) -> None:
    """Write a solution into a problem's Variables, multipliers, status and value, as ``problem.solve`` does."""
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
    primal = {variable.id: solution.primal[variable.name()] for variable in problem.variables()}
    found = zip(problem.constraints, solution.dual, strict=True)
    dual = {constraint.id: multiplier for constraint, multiplier in found} if not np.isinf(value) else {}
    problem.unpack(CvxpySolution(status, value, primal, dual, {}))


def _refuse_duplicates(kind: str, leaves: list[Any]) -> None:
    names = [leaf.name() for leaf in leaves]
    for name in names:
        if names.count(name) > 1:
            raise SolverError(f"{names.count(name)} {kind}s are named {name!r}: give each its own name")


def _lay_out_parameters(
    problem: cp.Problem, chain: Any, parametrized: Any
) -> tuple[np.ndarray, dict[str, np.ndarray], sparse.csr_array, dict[int, cp.Parameter]]:
    """Lay out theta, and select from it the parameter vector of cvxpy's parametrized program.

    cvxpy replaces PSD, symmetric, diagonal and sparse Parameters by vectors of their free entries, and orders
    its vector in its own way: columns are looked up by identifier, never assumed.
    """
    replaced: dict[int, int] = {}
    for reduction in chain.reductions:
        if isinstance(reduction, CvxAttr2Constr):
            replaced.update({original: new for original, (new,) in reduction.param_id_map.items()})
    size = sum(parameter.size for parameter in problem.parameters())
    theta = np.zeros(size + 1)
    theta[-1] = 1.0
    views: dict[str, np.ndarray] = {}
    lowered: dict[int, cp.Parameter] = {}
    rows, columns = [np.array([parametrized.total_param_size])], [np.array([size])]
    start = 0
    for parameter in problem.parameters():
        stop = start + parameter.size
        views[parameter.name()] = theta[start:stop].reshape(parameter.shape, order="F")
        places = np.arange(start, stop).reshape(parameter.shape, order="F")
        kept = np.asarray(lower_value(parameter, places) if parameter.id in replaced else places).ravel(order="F")
        identifier = replaced.get(parameter.id, parameter.id)
        lowered[identifier] = parameter
        column = parametrized.param_id_to_col.get(identifier)
        if column is not None:  # a Parameter can drop out, with a constraint without rows
            rows.append(np.arange(column, column + kept.size))
            columns.append(kept)
        start = stop
    row, column = np.concatenate(rows), np.concatenate(columns)
    shape = (parametrized.total_param_size + 1, size + 1)
    return theta, views, sparse.csr_array((np.ones(row.size), (row, column)), shape=shape), lowered


def check_against_cvxpy(
    affine: AffineMap, parametrized: Any, views: dict[str, np.ndarray], lowered: dict[int, cp.Parameter]
) -> None:
    """Compare the affine map with cvxpy's own at random parameter values."""
    random = np.random.default_rng(0)
    values = {}
    for identifier, parameter in lowered.items():
        view = views[parameter.name()]
        value = random.uniform(0.5, 1.5, parameter.shape)
        view[...] = value + value.T if any(parameter.attributes[name] for name in SYMMETRIC) else value
        values[identifier] = lower_value(parameter, view) if parameter._has_dim_reducing_attr else view
    affine.apply()
    P, q, _, A, b = parametrized.apply_parameters(values, quad_obj=True)
    program = affine.program
    sign = np.where(np.arange(program.rows) < program.equalities, 1.0, -1.0)
    for name, mine, theirs in (
        ("P", program.quadratic.to_dense(), P.toarray()),
        ("transpose of P", program.quadratic.to_dense().T, P.toarray()),
        ("q", program.linear, q),
        ("A", program.matrix.to_dense(), sign[:, None] * A.toarray()),
        ("u", program.upper, -sign * b if program.rows else np.zeros(0)),
    ):
        if not np.allclose(mine, theirs, rtol=1e-12, atol=1e-12 * (1.0 + np.abs(theirs).max(initial=0.0))):
            raise SolverError(
                f"cvxpy {cp.__version__} lays out {name} differently from what solvers/canonical.py knows "
                f"(largest difference {np.abs(mine - theirs).max():.1e}): install the cvxpy version deli pins"
            )


def _probe_answers(
    problem: cp.Problem, chain: Any, inverse: list[Any], parametrized: Any
) -> tuple[list[tuple[str, Any, tuple[int, ...] | None]], list[tuple[Any, tuple[int, ...] | None]]]:
    """Find where each Variable and each multiplier sits by sending 1, 2, 3, ... back through cvxpy's chain."""
    x = np.arange(1.0, parametrized.x.size + 1)
    y = np.arange(1.0, parametrized.constr_size + 1)
    ends = np.cumsum([constraint.size for constraint in parametrized.constraints], dtype=int)
    duals = {c.id: y[end - c.size : end] for c, end in zip(parametrized.constraints, ends, strict=True)}
    answer = CvxpySolution(cp.OPTIMAL, 0.0, {parametrized.x.id: x}, duals, {})
    for reduction, data in reversed(list(zip(chain.reductions[:-1], inverse[:-1], strict=True))):
        answer = reduction.invert(answer, data)
    primal = [
        (variable.name(), *_place(f"Variable {variable.name()!r}", answer.primal_vars[variable.id], variable.shape))
        for variable in problem.variables()
    ]
    dual = [
        _place(f"constraint {number}", answer.dual_vars[constraint.id], constraint.shape)
        for number, constraint in enumerate(problem.constraints)
    ]
    return primal, dual


def _place(what: str, probe: Any, shape: tuple[int, ...]) -> tuple[Any, tuple[int, ...] | None]:
    """Turn a probed value into a slice of the flat answer (an index array for symmetric Variables)."""
    if sparse.issparse(probe):
        probe = probe.toarray()
    flat = np.asarray(probe, dtype=float).ravel(order="F")
    index = flat.astype(int) - 1
    if np.any(index != flat - 1.0) or np.any(index < 0):
        raise SolverError(f"{what} has attributes the compiled path cannot return: state them as constraints")
    target = None if shape == (index.size,) else shape
    if index.size == 0:
        return slice(0, 0), target
    if np.array_equal(index, np.arange(index[0], index[0] + index.size)):
        return slice(int(index[0]), int(index[0]) + index.size), target
    return index, target
