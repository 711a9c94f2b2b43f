"""From a cvxpy problem to standard form: with `solvers.leaves` the only file that touches cvxpy's internals.

cvxpy's parametrized program holds tensors whose product with its parameter vector gives P, q, A, b. They are
composed here with the map from the problem's own Parameters to that vector. The fields read are private to
cvxpy, therefore the result is compared with cvxpy's own ``apply_parameters`` whenever a problem is compiled.
"""

import math
import warnings
from dataclasses import dataclass
from typing import Any

import cvxpy as cp
import numpy as np
from cvxpy.error import DPPError
from cvxpy.error import SolverError as CvxpySolverError
from cvxpy.reductions.cvx_attr2constr import CvxAttr2Constr
from cvxpy.reductions.solution import Solution as CvxpySolution
from scipy import sparse

from solvers.affine import AffineMap, Tensors
from solvers.errors import ParameterError, SolverError
from solvers.leaves import assign, declared_entries, kept_values, lowered_view, value_of, view_shape

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
        Writable views of theta, by Parameter name, in the Parameter's shape; of a sparse one its declared entries.
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

    def to_view(self, name: str, value: np.ndarray) -> np.ndarray:
        """Turn the value of a sparse Parameter into what its view holds.

        Raises
        ------
        ParameterError
            If the Parameter is not sparse or of another shape, or does not declare all entries that are not zero.
        """
        (parameter,) = (parameter for parameter in self.problem.parameters() if parameter.name() == name)
        if not parameter.attributes["sparsity"] or value.shape != parameter.shape:
            raise ParameterError(f"parameter {name!r} has shape {value.shape}; allowed: {parameter.shape}")
        return declared_entries(parameter, value)


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
            assign(parameter, np.ones(view_shape(parameter)))
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
    size = sum(math.prod(view_shape(parameter)) for parameter in problem.parameters())
    theta = np.zeros(size + 1)
    theta[-1] = 1.0
    views: dict[str, np.ndarray] = {}
    lowered: dict[int, cp.Parameter] = {}
    rows, columns = [np.array([parametrized.total_param_size])], [np.array([size])]
    start = 0
    for parameter in problem.parameters():
        shape = view_shape(parameter)
        stop = start + math.prod(shape)
        views[parameter.name()] = theta[start:stop].reshape(shape, order="F")
        places = np.arange(start, stop).reshape(shape, order="F")
        kept = lowered_view(parameter, places).ravel(order="F")
        identifier = replaced.get(parameter.id, parameter.id)
        lowered[identifier] = parameter
        column = parametrized.param_id_to_col.get(identifier)
        if column is not None:  # a Parameter can drop out, with a constraint without rows
            rows.append(np.arange(column, column + kept.size))
            columns.append(kept)
        start = stop
    row, column = np.concatenate(rows), np.concatenate(columns)
    chosen = sparse.csr_array((np.ones(row.size), (row, column)), shape=(parametrized.total_param_size + 1, size + 1))
    return theta, views, chosen, lowered


def check_against_cvxpy(
    affine: AffineMap, parametrized: Any, views: dict[str, np.ndarray], lowered: dict[int, cp.Parameter]
) -> None:
    """Compare the affine map with cvxpy's own at random parameter values."""
    random = np.random.default_rng(0)
    values = {}
    for identifier, parameter in lowered.items():
        view = views[parameter.name()]
        value = random.uniform(0.5, 1.5, view.shape)
        view[...] = value + value.T if any(parameter.attributes[name] for name in SYMMETRIC) else value
        values[identifier] = lowered_view(parameter, view)
    affine.apply()
    P, q, constant, A, b = parametrized.apply_parameters(values, quad_obj=True)
    program = affine.program
    sign = np.where(np.arange(program.rows) < program.equalities, 1.0, -1.0)
    P, A = sparse.csc_array(P), sparse.csc_array(A)
    A.data = A.data * sign[A.indices]
    for name, mine, theirs in (
        ("P", program.quadratic.to_sparse(), P),
        ("transpose of P", program.quadratic.to_sparse().T, P),
        ("q", program.linear, q),
        ("the objective's constant", affine.constant, np.atleast_1d(constant)),
        ("A", program.matrix.to_sparse(), A),
        ("u", program.upper, -sign * b if program.rows else np.zeros(0)),
    ):
        apart = _largest(mine - theirs)
        if not apart <= 1e-12 * (1.0 + _largest(theirs)):
            raise SolverError(
                f"cvxpy {cp.__version__} lays out {name} differently from what solvers/canonical.py knows "
                f"(largest difference {apart:.1e}): install the cvxpy version deli pins"
            )


def _largest(numbers: Any) -> float:
    entries = sparse.csc_array(numbers).data if sparse.issparse(numbers) else numbers
    return float(np.abs(entries).max(initial=0.0))


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
