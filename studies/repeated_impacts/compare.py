"""Compare methods over thousands of impacts: a wall under a quartic potential, and rods on a line.

    python studies/repeated_impacts/compare.py [PROBLEM ...] [--steps N] [--method NAME ...] [-o impacts.csv]

quartic_wall: V = q^4/4 and a wall at 0, from rest at q = 1, h = .05

energy           largest |H - H(0)| / H(0)
at the end       mean of H / H(0) - 1 over the last tenth of the run
worst gap        of all steps

hard_rods: 10 equal rods that fill half of a line, h = .01, against the exact solution. Rods that meet exchange
velocities, and are thus free points in their order. The unit is the length of a rod, which is also the mean gap.

impacts          contacts that reflect or press, over all steps
by 10, 100, ...  largest error of a position until this time; positions are compared in their order, rod by rod
lost at          time when a rod is half a unit off; later, a rod may be compared to points of other rods
velocities       largest error of the sorted speeds, which do not change in the exact motion
worst gap        of all steps
"""

import argparse
import csv
import itertools
import logging

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli.figures.exact import passing_points
from deli.integrators.registry import METHODS

STEPS = 100_000
ZERO = 1e-15
HALF_SPACE = 0.5
TIMES = (10.0, 100.0, 1000.0)
# Choices that can matter: a single mass has no two contacts, and without a force schemes and energies are the same.
# Methods that are not named here take every combination of their choices.
SETTINGS = {
    "quartic_wall": {
        "gvi": {
            "scheme": ("midpoint", "verlet"),
            "energy": ("hamiltonian", "numerical"),
            "predictor": ("forward", "closed_loop"),
        },
        "collision": {"scheme": ("midpoint", "verlet"), "energy": ("hamiltonian", "numerical", "discrete")},
        "newmark": {"beta": (0.25, 0.0), "imex": (False, True)},
        "solve_ivp": {},
    },
    "hard_rods": {
        "gvi": {"reflection": ("generalized", "moreau", "sequential"), "predictor": ("forward", "closed_loop")},
        "discrete_smooth": {},
        "collision": {"energy": ("hamiltonian", "numerical", "discrete")},
        "newmark": {"beta": (0.25, 0.0), "imex": (False, True)},
        "solve_ivp": {},
    },
}


def methods(problem, names):
    """Yield methods with their settings in words."""
    for name in names:
        settings = SETTINGS[problem].get(name, METHODS[name].CHOICES)
        for values in itertools.product(*settings.values()):
            chosen = dict(zip(settings, values, strict=True))
            said = [value if isinstance(value, str) else f"{key}={value}" for key, value in chosen.items()]
            yield f"{name} {', '.join(said)}".strip(), METHODS[name](**chosen)


def quartic_wall(scene, record):
    change = record["hamiltonian"].values / record["hamiltonian"].values[0] - 1.0
    return {
        "energy": np.abs(change).max(),
        "at the end": change[-max(1, len(change) // 10) :].mean(),
        "worst gap": record["gap_min"].values.min(),
    }


def hard_rods(scene, record):
    time, speeds = record["time"].values, np.sort(np.abs(record["momentum"].values / scene.mass), axis=1)
    error = np.abs(record["position"].values - passing_points(scene, time)).max(axis=1)
    beyond = np.flatnonzero(error > HALF_SPACE * scene.parameters["size"])
    return {
        "impacts": int(record["reflected_contacts"].values.sum() + record["smooth_contacts"].values.sum()),
        **{f"by {end:g}": error[time <= end].max() if time[-1] >= end else np.nan for end in TIMES},
        "lost at": time[beyond[0]] if len(beyond) else np.nan,
        "velocities": np.abs(speeds - speeds[0]).max(),
        "worst gap": record["gap_min"].values.min(),
    }


PROBLEMS = {"quartic_wall": (0.05, quartic_wall), "hard_rods": (0.01, hard_rods)}


def words(figure):
    if isinstance(figure, int):
        return str(figure)
    return "-" if np.isnan(figure) else "0" if abs(figure) <= ZERO else f"{figure:.3g}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problem", nargs="*", default=list(PROBLEMS), help=f"one of: {', '.join(PROBLEMS)}")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--method", nargs="+", default=list(METHODS), choices=list(METHODS), metavar="NAME")
    parser.add_argument("-o", "--output", help="also write the figures, unrounded, to this csv file")
    options = parser.parse_args()
    unknown = set(options.problem) - set(PROBLEMS)
    if unknown:
        parser.error(f"unknown problem: {', '.join(sorted(unknown))}; allowed: {', '.join(PROBLEMS)}")

    logging.getLogger("deli").setLevel(logging.ERROR)  # the table shows failed runs
    console, rows = Console(width=None if Console().is_terminal else 240), []
    for problem in options.problem:
        step_size, measure = PROBLEMS[problem]
        table, scene = None, deli.scenes.get(problem)()
        for name, method in track(list(methods(problem, options.method)), description=problem, transient=True):
            run = deli.simulate(scene, method, step_size=step_size, steps=options.steps)
            figures, outcome = measure(scene, run["trajectory"]), run.attrs["outcome"]
            if table is None:
                table = Table(problem, *figures, "outcome", box=box.MARKDOWN)
            table.add_row(name, *map(words, figures.values()), outcome)
            rows += [(problem, name, key, value, outcome) for key, value in figures.items()]
        console.print(table)
    if options.output:
        with open(options.output, "w", newline="", encoding="utf-8") as file:
            header = ("problem", "method", "figure", "value", "outcome")
            csv.writer(file, lineterminator="\n").writerows([header, *rows])


if __name__ == "__main__":
    main()
