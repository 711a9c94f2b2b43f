"""Canonicalization of a cvxpy problem to standard form.

Only this file, `solvers.leaves` and `solvers.places` use cvxpy's internals. cvxpy's parametrized program holds tensors
whose product with its parameter vector gives P, q, A, b. This file composes them with the map from the problem's own
Parameters to that vector. The fields that it reads are private to cvxpy. Therefore the result is compared with cvxpy's
own ``apply_parameters`` whenever a problem is compiled.
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
from scipy import sparse

from solvers.affine import AffineMap, Tensors
from solvers.errors import ParameterError, SolverError
from solvers.leaves import assign, declared_entries, kept_values, lowered_view, value_of, view_shape
from solvers.places import Place, places_of_multipliers, places_of_variables
from solvers.refusals import refuse_cones, refuse_not_finite, refuse_parts

SYMMETRIC = ("PSD", "NSD", "symmetric")


@dataclass(slots=True, eq=False)
class Canonical:
    """A problem in standard form, with the places of its Parameters, Variables and multipliers.

    Attributes
    ----------
    problem : cvxpy.Problem
        The model.
    map : AffineMap
        The map from theta to the program. theta holds all parameter values, flattened in Fortran order, and then a one.
    views : dict of str to ndarray
        Writable views of theta, by Parameter name, in the Parameter's shape. The view of a sparse Parameter has its
        declared entries.
    primal : list of (str, Place)
        Name of each Variable and its place in x.
    dual : list of Place
        Places of the constraints' multipliers in y, in order.
    """

    problem: cp.Problem
    map: AffineMap
    views: dict[str, np.ndarray]
    primal: list[tuple[str, Place]]
    dual: list[Place]

    def to_view(self, name: str, value: np.ndarray) -> np.ndarray:
        """Return the entries of a sparse Parameter's value, as its view holds them.

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
        programming, gives a name twice, or if cvxpy's internals differ from those that this file knows.
    """
    refuse_parts(problem)
    with kept_values(problem), warnings.catch_warnings():
        # cvxpy warns about its own use of sparse Parameters
        warnings.filterwarnings("ignore", message=".*sparse CVXPY expression", category=RuntimeWarning)
        for parameter in problem.parameters():
            assign(parameter, np.ones(view_shape(parameter)))
        try:
            # OSQP stands for every solver of quadratic programs
            data, chain, inverse = _own(problem).get_problem_data("OSQP", canon_backend="COO", enforce_dpp=True)
        except (DPPError, cp.DCPError) as error:
            raise SolverError(f"the problem is not a parametrized quadratic program: {error}") from error
        except CvxpySolverError as error:
            refuse_cones(problem)
            raise SolverError("the problem is not a parametrized quadratic program") from error
    if data["bool_vars_idx"] or data["int_vars_idx"]:
        raise SolverError("the problem has integer Variables; only continuous Variables are allowed")
    parametrized = data["param_prob"]
    theta, views, selection, lowered = _lay_out_parameters(problem, chain, parametrized)
    linear, matrix, quadratic = (
        sparse.coo_array(t @ selection) for t in (parametrized.q, parametrized.A, parametrized.P)
    )
    bad, kept = _judge_rows(parametrized, matrix)
    if bad.any() or not all(np.isfinite(part.data).all() for part in (linear, quadratic)):
        places = places_of_multipliers(problem, chain, inverse, parametrized, np.cumsum(np.ones_like(kept)))
        at_fault = [number for number, place in enumerate(places) if place.entries(np.flatnonzero(bad)).size]
        refuse_not_finite(problem, at_fault)
    matrix = _rows(matrix, kept)
    tensors = Tensors(parametrized.x.size, int(kept.sum()), parametrized.cone_dims.zero, linear, matrix, quadratic)
    affine = AffineMap(theta, tensors)
    check_against_cvxpy(affine, parametrized, views, lowered, kept)
    primal = places_of_variables(problem, chain, parametrized)
    dual = places_of_multipliers(problem, chain, inverse, parametrized, np.where(kept, np.cumsum(kept), 0))
    affine.theta[:-1] = np.nan  # refused until given
    for parameter in problem.parameters():
        value = value_of(parameter)
        if value is not None:
            views[parameter.name()][...] = value
    return Canonical(problem, affine, views, primal, dual)


def _own(problem: cp.Problem) -> cp.Problem:
    """Return a copy of a problem, so that the caller's solver cache does not change.

    cvxpy does not canonicalize a problem without Variables. Such a problem gets a Variable whose square is minimized.
    """
    objective = problem.objective
    if not problem.variables():
        sign = -1.0 if isinstance(objective, cp.Maximize) else 1.0
        objective = type(objective)(objective.expr + sign * cp.square(cp.Variable()))
    return cp.Problem(objective, problem.constraints)


def _judge_rows(parametrized: Any, matrix: sparse.coo_array) -> tuple[np.ndarray, np.ndarray]:
    """Return masks of the rows of Ax + b >= 0 with invalid numbers, and of the rows to keep: b = inf bounds nothing."""
    rows, last = parametrized.constr_size, matrix.shape[1] - 1
    constant = (matrix.row >= rows * parametrized.x.size) & (matrix.col == last)
    bounds = np.zeros(rows)
    bounds[matrix.row[constant] % max(rows, 1)] = matrix.data[constant]
    bad = ~(bounds > -np.inf)
    bad[: parametrized.cone_dims.zero] |= bounds[: parametrized.cone_dims.zero] == np.inf
    bad[matrix.row[~constant & ~np.isfinite(matrix.data)] % max(rows, 1)] = True
    return bad, bounds < np.inf


def _rows(matrix: sparse.coo_array, kept: np.ndarray) -> sparse.coo_array:
    """Leave rows out of the tensor of [A b]."""
    if kept.all():
        return matrix
    row, column = matrix.row % kept.size, matrix.row // kept.size
    stays, left = kept[row], int(kept.sum())
    place = column[stays] * left + np.cumsum(kept)[row[stays]] - 1
    shape = (matrix.shape[0] // kept.size * left, matrix.shape[1])
    return sparse.coo_array((matrix.data[stays], (place, matrix.col[stays])), shape)


def _lay_out_parameters(
    problem: cp.Problem, chain: Any, parametrized: Any
) -> tuple[np.ndarray, dict[str, np.ndarray], sparse.csr_array, dict[int, cp.Parameter]]:
    """Lay out theta, and select from it the parameter vector of cvxpy's parametrized program.

    cvxpy replaces PSD, symmetric, diagonal and sparse Parameters by vectors of their free entries, and orders
    its vector in its own way. Columns are therefore looked up by identifier.
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
    affine: AffineMap,
    parametrized: Any,
    views: dict[str, np.ndarray],
    lowered: dict[int, cp.Parameter],
    kept: np.ndarray,
) -> None:
    """Compare the affine map with the kept rows of cvxpy's own, at random parameter values."""
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
    P, A = sparse.csc_array(P), sparse.csc_array(sparse.csr_array(A)[kept])
    A.data = A.data * sign[A.indices]
    for name, mine, theirs in (
        ("P", program.quadratic.to_sparse(), P),
        ("transpose of P", program.quadratic.to_sparse().T, P),
        ("q", program.linear, q),
        ("the objective's constant", affine.constant, np.atleast_1d(constant)),
        ("A", program.matrix.to_sparse(), A),
        ("u", program.upper, -sign * b[kept] if program.rows else np.zeros(0)),
    ):
        apart = _largest(mine - theirs)
        if not apart <= 1e-12 * (1.0 + _largest(theirs)):
            raise SolverError(
                f"cvxpy {cp.__version__} has another layout of {name} than solvers/canonical.py expects "
                f"(largest difference {apart:.1e}): install the cvxpy version deli pins"
            )


def _largest(numbers: Any) -> float:
    entries = sparse.csc_array(numbers).data if sparse.issparse(numbers) else numbers
    return float(np.abs(entries).max(initial=0.0))
