"""The cost of a re-solve: rebuilt model, cvxpy's own re-solve, the compiled path, and the solver alone."""

import time
import warnings
from collections.abc import Callable
from typing import Any

import cvxpy as cp
import numpy as np
from scipy import sparse

import solvers
from deli.bench import control
from deli.bench.part import Column, Measure, Part, Row
from deli.bench.raw import RAW, TOLERANCE, Numbers, standard_form
from solvers import tolerances

SIZES = ((4, 1, 1.0), (4, 2, 1.0), (18, 20, 1.0), (100, 150, 0.05))
"""Sizes of problems: variables, rows, and the share of nonzero coefficients."""

HORIZONS = (4, 10, 20)
"""Numbers of steps of the predictive control in `deli.bench.control`."""

USUAL = ("native", "daqp", "piqp", "clarabel", "osqp")
CONTROLLING = tuple(name for name in USUAL if name != "native")


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    sizes = SIZES[1:-1] if quick else SIZES
    known = solvers.available()
    backends = [name for name in USUAL if name in known] if quick else ["auto", *known]
    projections: list[tuple[str, Measure]] = [
        (f"{size[0]}, {size[1]} {backend}", lambda b=backend, s=size: [measure(b, s, quick)])  # type: ignore[misc]
        for size in sizes
        for backend in backends
    ]
    control: list[tuple[str, Measure]] = [
        (f"control of {horizon} {backend}", lambda b=backend, h=horizon: [measure_control(b, h)])  # type: ignore[misc]
        for horizon in (() if quick else HORIZONS)
        for backend in ("auto", *CONTROLLING)
    ]
    return projections + control


def measure(backend: str, size: tuple[int, int, float], quick: bool) -> Row:
    """Return a row: one backend on one size of problem, all times medians in microseconds.

    Every solve gets new values of all Parameters. ``adapter`` is the part of a compiled solve that passes data to the
    solver and solves.
    """
    n, rows, density = size
    random = np.random.default_rng(0)
    pattern = random.uniform(size=(rows, n)) < density
    pattern[np.arange(rows), np.arange(rows) % n] = True
    metric = np.diag(random.uniform(1.0, 2.0, n))
    values = [_draw(random, pattern) for _ in range(20)]
    few, many = (3, 40) if quick else (20, 2000 if n < 100 else 400)
    raw = float("nan")
    if backend in RAW:
        cases = standard_form(values, pattern)
        raw = _median_time(RAW[backend](metric, cases), cases, many)
    row = _measure(backend, _build(metric, pattern), values, few, many, lambda case: _build(metric, pattern, case))
    return {**row, "problem": "projection", "raw": raw, "overhead": row["compiled"] - raw}


def measure_control(backend: str, horizon: int) -> Row:
    """Return a row: one backend on predictive control, without rebuilt models and without the solver alone."""
    random = np.random.default_rng(0)
    values = [control.draw(random) for _ in range(20)]
    return {**_measure(backend, control.build(horizon), values, 20, 100), "problem": "control"}


def _measure(
    backend: str,
    model: cp.Problem,
    values: list[Numbers],
    few: int,
    many: int,
    rebuild: Callable[[Numbers], cp.Problem] | None = None,
) -> Row:
    """Time cvxpy a few times, and the compiled problem many times."""
    compiled = solvers.compile(model, backend, tolerance=TOLERANCE)
    solved = [compiled.solve(**value) for value in values]
    total = _median_time(lambda value: compiled.solve(**value), values, many)
    adapter = []
    for k in range(many):
        solution = compiled.solve(**values[k % len(values)])
        adapter.append(solution.setup_time + solution.solve_time)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cvxpy's remarks on accuracy and on its own sparse Parameters
        again = _time_cvxpy(backend, lambda case: _assign(model, case), values, few)
        rebuilt = float("nan") if rebuild is None else _time_cvxpy(backend, rebuild, values, few)
    return {
        "variables": compiled.program.variables,
        "rows": compiled.program.rows,
        "backend": backend,
        "answered": "/".join(sorted({solution.backend for solution in solved})),
        "rebuild": rebuilt,
        "problem_solve": again,
        "compiled": total,
        "adapter": 1e6 * float(np.median(adapter)),
        "raw": float("nan"),
        "speedup": again / total,
        "overhead": float("nan"),
        "verified": sum(solution.ok for solution in solved) / len(solved),
    }


def _build(metric: np.ndarray, pattern: np.ndarray, values: Numbers | None = None) -> cp.Problem:
    """Return the model of a projection; with values, a model of constants for one solve."""
    rows, n = pattern.shape
    v = cp.Variable(n, name="velocity")
    if values is not None:
        linear, gradients, bounds = values["linear"], values["gradients"], values["bounds"]
    else:
        linear, bounds = cp.Parameter(n, name="linear"), cp.Parameter(rows, name="bounds")
        if pattern.all():
            gradients = cp.Parameter((rows, n), name="gradients")
        else:
            gradients = cp.Parameter((rows, n), sparsity=np.nonzero(pattern), name="gradients")
    return cp.Problem(cp.Minimize(0.5 * cp.quad_form(v, metric) + linear @ v), [gradients @ v >= bounds])


def _draw(random: np.random.Generator, pattern: np.ndarray) -> Numbers:
    rows, n = pattern.shape
    gradients = np.where(pattern, random.normal(size=pattern.shape), 0.0)
    inside = random.normal(size=n)
    return {
        "linear": random.normal(size=n),
        "gradients": gradients,
        "bounds": gradients @ inside - np.abs(random.normal(size=rows)),
    }


def _median_time(function: Callable[[Numbers], object], arguments: list[Numbers], repeat: int) -> float:
    """Return the median time over the arguments in turn, in microseconds; the first round is a warm-up."""
    for argument in arguments[:3]:
        function(argument)
    times = []
    for k in range(repeat):
        argument = arguments[k % len(arguments)]
        start = time.perf_counter()
        function(argument)
        times.append(time.perf_counter() - start)
    return 1e6 * float(np.median(times))


def _assign(model: cp.Problem, values: Numbers) -> cp.Problem:
    for parameter in model.parameters():
        value = values[parameter.name()]
        if parameter.attributes["sparsity"]:
            found = parameter.sparse_idx
            parameter.value_sparse = sparse.coo_array((value[found], found), shape=value.shape)
        else:
            parameter.value = value
    return model


def _time_cvxpy(backend: str, pose: Callable[[Numbers], cp.Problem], values: list[Numbers], repeat: int) -> float:
    """Time solves of posed problems through cvxpy; return nan if cvxpy lacks the solver, or the solver fails."""
    if backend.upper() not in cp.installed_solvers():
        return float("nan")
    settings: dict[str, Any] = tolerances.settings(backend, TOLERANCE)
    if backend == "osqp":
        settings["polishing"] = False
    try:
        return _median_time(lambda case: pose(case).solve(solver=backend.upper(), **settings), values, repeat)
    except (cp.SolverError, TypeError, ValueError):
        return float("nan")


PART = Part(
    name="backends",
    title="median µs per re-solve, every parameter changing",
    keys=("problem", "variables", "rows", "backend"),
    columns=(
        Column("problem", "problem"),
        Column("variables", "n"),
        Column("rows", "rows"),
        Column("backend", "backend"),
        Column("answered", "answered by"),
        Column("rebuild", "rebuild", ".0f"),
        Column("problem_solve", "solve()", ".0f"),
        Column("compiled", "compiled", ".1f", compared=True),
        Column("adapter", "adapter", ".1f"),
        Column("raw", "raw", ".1f"),
        Column("speedup", "solve()/compiled", ".0f"),
        Column("overhead", "compiled − raw", ".1f"),
        Column("verified", "verified", ".0%"),
    ),
    cases=_cases,
)
