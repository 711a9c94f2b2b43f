"""What a re-solve costs: rebuilt model, cvxpy's own re-solve, the compiled path, and the solver alone."""

import time
import warnings
from collections.abc import Callable
from typing import Any

import cvxpy as cp
import numpy as np
from scipy import sparse

import solvers
from deli.bench.part import Column, Measure, Part, Row
from deli.bench.raw import RAW, TOLERANCE, Numbers, standard_form
from solvers import tolerances

SIZES = ((4, 1, 1.0), (4, 2, 1.0), (18, 20, 1.0), (100, 150, 0.05))
"""Variables, rows, and share of coefficients that are not zero."""

USUAL = ("native", "daqp", "piqp", "clarabel", "osqp")


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    sizes = SIZES[1:-1] if quick else SIZES
    known = solvers.available()
    backends = [name for name in USUAL if name in known] if quick else known
    return [
        (f"{size[0]}, {size[1]} {backend}", lambda b=backend, s=size: [measure(b, s, quick)])  # type: ignore[misc]
        for size in sizes
        for backend in backends
    ]


def measure(backend: str, size: tuple[int, int, float], quick: bool) -> Row:
    """Return a row: one backend on one size of problem, all times medians in microseconds.

    Every solve gets new values of all Parameters. ``adapter`` is the part of a compiled solve spent handing data over
    and in the solver.
    """
    n, rows, density = size
    random = np.random.default_rng(0)
    pattern = random.uniform(size=(rows, n)) < density
    pattern[np.arange(rows), np.arange(rows) % n] = True
    metric = np.diag(random.uniform(1.0, 2.0, n))
    values = [_draw(random, pattern) for _ in range(20)]
    few, many = (3, 40) if quick else (20, 2000 if n < 100 else 400)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cvxpy's remarks on accuracy and on its own sparse Parameters
        rebuild, again = _time_cvxpy(backend, metric, pattern, values, few)
    compiled = solvers.compile(_build(metric, pattern), backend, tolerance=TOLERANCE)
    solved = [compiled.solve(**value) for value in values]
    total = _median_time(lambda value: compiled.solve(**value), values, many)
    adapter = []
    for k in range(many):
        solution = compiled.solve(**values[k % len(values)])
        adapter.append(solution.setup_time + solution.solve_time)
    raw = float("nan")
    if backend in RAW:
        cases = standard_form(values, pattern)
        raw = _median_time(RAW[backend](metric, cases), cases, many)
    return {
        "variables": n,
        "rows": rows,
        "backend": backend,
        "rebuild": rebuild,
        "problem_solve": again,
        "compiled": total,
        "adapter": 1e6 * float(np.median(adapter)),
        "raw": raw,
        "speedup": again / total,
        "overhead": total - raw,
        "verified": sum(solution.ok for solution in solved) / len(solved),
    }


def _build(metric: np.ndarray, pattern: np.ndarray, values: Numbers | None = None) -> cp.Problem:
    """One projection; with values it is a model of constants, built to be solved once."""
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
    """Median over the arguments in turn, in microseconds; the first round warms up."""
    for argument in arguments[:3]:
        function(argument)
    times = []
    for k in range(repeat):
        argument = arguments[k % len(arguments)]
        start = time.perf_counter()
        function(argument)
        times.append(time.perf_counter() - start)
    return 1e6 * float(np.median(times))


def _time_cvxpy(
    backend: str, metric: np.ndarray, pattern: np.ndarray, values: list[Numbers], repeat: int
) -> list[float]:
    """Rebuild and re-solve through cvxpy, nan where cvxpy has no interface to the solver or that fails."""
    if backend.upper() not in cp.installed_solvers():
        return [float("nan")] * 2
    solver = backend.upper()
    settings: dict[str, Any] = tolerances.settings(backend, TOLERANCE)
    if backend == "osqp":
        settings["polishing"] = False

    def rebuild(case: Numbers) -> None:
        _build(metric, pattern, case).solve(solver=solver, **settings)

    model = _build(metric, pattern)
    parameters = {parameter.name(): parameter for parameter in model.parameters()}

    def again(case: Numbers) -> None:
        for name, parameter in parameters.items():
            if parameter.attributes["sparsity"]:
                found = np.nonzero(pattern)
                parameter.value_sparse = sparse.coo_array((case[name][found], found), shape=pattern.shape)
            else:
                parameter.value = case[name]
        model.solve(solver=solver, **settings)

    times = []
    for function in (rebuild, again):
        try:
            times.append(_median_time(function, values, repeat))
        except (cp.SolverError, TypeError, ValueError):
            times.append(float("nan"))
    return times


PART = Part(
    name="backends",
    title="median µs per re-solve, every parameter changing",
    keys=("variables", "rows", "backend"),
    columns=(
        Column("variables", "n"),
        Column("rows", "rows"),
        Column("backend", "backend"),
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
