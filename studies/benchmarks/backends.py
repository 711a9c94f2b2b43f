"""What a re-solve costs: rebuilt model, cvxpy's own re-solve, the compiled path, and the solver alone.

    python studies/benchmarks/backends.py [--quick] [--backend NAME ...] [-o results.csv]

Every solve gets new values of all Parameters. Times are medians in microseconds within one run; only their
ratios mean something on another machine. "adapter" is the part of a compiled solve spent handing data over and
in the solver; "raw" calls the solver on arrays made beforehand, with no adapter around it.
"""

import argparse
import csv
import json
import sys
import time
import warnings
from pathlib import Path

import clarabel
import cvxpy as cp
import daqp
import numpy as np
import osqp
import piqp
from rich.console import Console
from rich.table import Table
from scipy import sparse

import solvers
from solvers import tolerances

SIZES = [(4, 1, 1.0), (4, 2, 1.0), (18, 20, 1.0), (100, 150, 0.05)]
TOLERANCE = 1e-9


def build(metric, pattern, values=None):
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


def draw(random, pattern):
    rows, n = pattern.shape
    gradients = np.where(pattern, random.normal(size=pattern.shape), 0.0)
    inside = random.normal(size=n)
    return {
        "linear": random.normal(size=n),
        "gradients": gradients,
        "bounds": gradients @ inside - np.abs(random.normal(size=rows)),
    }


def median_time(function, arguments, repeat):
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


def raw_daqp(metric, values):
    settings = tolerances.settings("daqp", TOLERANCE)
    rows = len(values[0]["bounds"])
    sense, lower = np.zeros(rows, dtype=np.intc), np.full(rows, -np.inf)

    def run(case):
        daqp.solve(metric, case["q"], case["A"], case["u"], lower, sense, **settings)

    return run


def raw_piqp(metric, values):
    settings = tolerances.settings("piqp", TOLERANCE)
    n = len(metric)
    is_dense = bool(np.all(values[0]["A"]))
    P = metric if is_dense else sparse.csc_matrix(metric)
    nothing = np.zeros((0, n), order="F") if is_dense else sparse.csc_matrix((0, n))
    no_numbers = np.zeros(0)
    key = "A_fortran" if is_dense else "A_sparse"

    def run(case):
        solver = piqp.DenseSolver() if is_dense else piqp.SparseSolver()
        for name, value in settings.items():
            setattr(solver.settings, name, value)
        solver.setup(P, case["q"], nothing, no_numbers, case[key], None, case["u"])
        solver.solve()
        return np.array(solver.result.x), np.array(solver.result.z_u)

    return run


def raw_clarabel(metric, values):
    settings = clarabel.DefaultSettings()
    chosen = {"verbose": False, "max_threads": 1, "presolve_enable": False, "equilibrate_enable": False}
    for name, value in {**chosen, **tolerances.settings("clarabel", TOLERANCE)}.items():
        setattr(settings, name, value)
    first, cones = values[0], [clarabel.NonnegativeConeT(len(values[0]["u"]))]
    P = sparse.triu(sparse.csc_matrix(metric), format="csc")
    solver = clarabel.DefaultSolver(P, first["q"], first["A_sparse"], first["u"], cones, settings)

    def run(case):
        solver.update(q=case["q"], A=case["A_sparse"].data, b=case["u"])
        result = solver.solve()
        return np.array(result.x), np.array(result.z)

    return run


def raw_osqp(metric, values):
    extension = osqp.OSQP(algebra="builtin").ext
    settings = extension.OSQPSettings()
    extension.osqp_set_default_settings(settings)
    chosen = {"verbose": False, "polishing": False, "adaptive_rho": 1, "adaptive_rho_interval": 50}
    for name, value in {**chosen, **tolerances.settings("osqp", TOLERANCE)}.items():
        setattr(settings, name, value)
    P = sparse.triu(sparse.csc_matrix(metric), format="csc")
    rows, n = values[0]["A"].shape
    lower = np.full(rows, -1e30)

    def run(case):
        P_, A = extension.CSC(P), extension.CSC(case["A_sparse"])
        solver = extension.OSQPSolver(P_, case["q"], A, lower, case["u"], rows, n, settings)
        solver.solve()
        return np.array(solver.solution.x), np.array(solver.solution.y)

    return run


RAW = {"daqp": raw_daqp, "piqp": raw_piqp, "clarabel": raw_clarabel, "osqp": raw_osqp}


def standard_form(values, pattern):
    """Arrays as the raw solvers want them, made before the clock starts."""
    indices = sparse.csc_matrix(pattern.astype(float))
    cases = []
    for value in values:
        A = -value["gradients"]
        data = A.T[pattern.T]
        same_pattern = sparse.csc_matrix((data, indices.indices, indices.indptr), shape=A.shape)
        case = {"q": value["linear"], "A": np.ascontiguousarray(A), "u": -value["bounds"]}
        cases.append({**case, "A_fortran": np.asfortranarray(A), "A_sparse": same_pattern, "bounds": value["bounds"]})
    return cases


def time_cvxpy(backend, metric, pattern, values, repeat):
    """Rebuild and re-solve through cvxpy, nan where cvxpy's interface to the solver fails."""
    solver = backend.upper()
    settings = tolerances.settings(backend, TOLERANCE)
    if backend == "osqp":
        settings["polishing"] = False

    def rebuild(case):
        build(metric, pattern, case).solve(solver=solver, **settings)

    model = build(metric, pattern)
    parameters = {parameter.name(): parameter for parameter in model.parameters()}

    def again(case):
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
            times.append(median_time(function, values, repeat))
        except (cp.SolverError, TypeError, ValueError):
            times.append(float("nan"))
    return times


def measure(backend, size, quick):
    n, rows, density = size
    random = np.random.default_rng(0)
    pattern = random.uniform(size=(rows, n)) < density
    pattern[np.arange(rows), np.arange(rows) % n] = True
    metric = np.diag(random.uniform(1.0, 2.0, n))
    values = [draw(random, pattern) for _ in range(20)]
    few, many = (3, 40) if quick else (20, 2000 if n < 100 else 400)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cvxpy's remarks on accuracy and on its own sparse Parameters
        rebuild, again = time_cvxpy(backend, metric, pattern, values, few)
    compiled = solvers.compile(build(metric, pattern), backend, tolerance=TOLERANCE)
    solved = [compiled.solve(**value) for value in values]
    total = median_time(lambda value: compiled.solve(**value), values, many)
    adapter = []
    for k in range(many):
        solution = compiled.solve(**values[k % len(values)])
        adapter.append(solution.setup_time + solution.solve_time)
    raw = float("nan")
    if backend in RAW:
        cases = standard_form(values, pattern)
        raw = median_time(RAW[backend](metric, cases), cases, many)
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


def show(results):
    table = Table(title="median µs per re-solve, every parameter changing")
    for column in ("n, rows", "backend", "rebuild", "problem.solve()", "compiled", "adapter", "raw"):
        table.add_column(column, justify="left" if column in ("n, rows", "backend") else "right")
    for column in ("problem.solve()/compiled", "compiled − raw", "verified"):
        table.add_column(column, justify="right")
    for row in results:
        times = [row[key] for key in ("rebuild", "problem_solve", "compiled", "adapter", "raw")]
        table.add_row(
            f"{row['variables']}, {row['rows']}",
            row["backend"],
            *("–" if np.isnan(time_) else f"{time_:.1f}" for time_ in times),
            "–" if np.isnan(row["speedup"]) else f"{row['speedup']:.0f}×",
            "–" if np.isnan(row["overhead"]) else f"{row['overhead']:.1f}",
            f"{row['verified']:.0%}",
        )
    Console(width=140).print(table)


def save(results, path):
    if path.suffix == ".json":
        path.write_text(json.dumps([{k: None if v != v else v for k, v in row.items()} for row in results], indent=1))
        return
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, fieldnames=results[0])
        writer.writeheader()
        writer.writerows(results)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few repetitions, without the large problem")
    parser.add_argument("--backend", action="append", help="only this backend; may be repeated")
    parser.add_argument("-o", "--output", type=Path, help="write the results to a .csv or .json file")
    options = parser.parse_args()
    backends = options.backend or solvers.available()
    sizes = SIZES[:-1] if options.quick else SIZES
    results = []
    for size in sizes:
        for backend in backends:
            results.append(measure(backend, size, options.quick))
            print(f"{size[0]}, {size[1]}: {backend}", file=sys.stderr)
    show(results)
    if options.output:
        save(results, options.output)


if __name__ == "__main__":
    main()
