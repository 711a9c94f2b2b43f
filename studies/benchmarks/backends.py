"""The cost of a re-solve: rebuilt model, cvxpy's own re-solve, the compiled path, and the solver alone.

    python studies/benchmarks/backends.py [--quick] [--backend NAME ...] [-o results.csv]

The measurements of `deli bench backends`, for backends of your choice, as a table or a file to plot from. Times are
medians in microseconds within one run; only their ratios mean something on another machine. "adapter" is the part of a
compiled solve spent handing data over and in the solver; "raw" calls the solver on arrays made beforehand.
"""

import argparse
import csv
import json
import sys
from pathlib import Path

from rich.console import Console

import solvers
from deli.bench.backends import HORIZONS, PART, SIZES, measure, measure_control
from deli.bench.report import print_part


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
    backends, results = options.backend or ["auto", *solvers.available()], []
    for size in SIZES[:-1] if options.quick else SIZES:
        for backend in backends:
            results.append(measure(backend, size, options.quick))
            print(f"{size[0]}, {size[1]}: {backend}", file=sys.stderr)
    for horizon in () if options.quick else HORIZONS:
        for backend in backends:
            if backend != "native":  # which needs curvature
                results.append(measure_control(backend, horizon))
                print(f"control of {horizon}: {backend}", file=sys.stderr)
    print_part(Console(width=140), PART, {"rows": results}, None)
    if options.output:
        save(results, options.output)


if __name__ == "__main__":
    main()
