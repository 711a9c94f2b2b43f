"""Run the paper's scenes with every method; show energy range, worst gap and lost angular momentum.

python studies/compare_methods.py
"""

import logging

import numpy as np
from rich.console import Console
from rich.table import Table

import deli

METHODS = (
    deli.GVI("midpoint"),
    deli.Direct("midpoint"),
    deli.Direct("endpoint"),
    deli.Newmark(),
    deli.Newmark(0.0, 0.5),
    deli.MoreauJean(),
    deli.NonsmoothAlpha(),
)
CASES = (
    (deli.scenes.spring_sphere(start="mixed"), 0.5, 100.0),
    (deli.scenes.nonlinear_oscillator(), 0.1, 100.0),
    (deli.scenes.pogo_stick(), 0.1, 500.0),
)


def main():
    logging.getLogger("deli").setLevel(logging.ERROR)  # the table shows failed runs
    table = Table("scene", "method", "energy at first", "least", "most", "worst gap", "angular momentum", "outcome")
    for scene, step_size, duration in CASES:
        for method in METHODS:
            run = deli.simulate(scene, method, step_size=step_size, duration=duration)
            record = run["trajectory"]
            energy = record["hamiltonian"].values
            lost = "–"
            if "angular_momentum" in record:
                angular = record["angular_momentum"].values
                lost = f"{np.abs(angular - angular[0]).max():.2g}"
            figures = (energy[0], energy.min(), energy.max(), record["gap_min"].values.min())
            outcome = run.attrs["outcome"].split(":")[0]
            table.add_row(scene.name, str(method), *(f"{figure:.3g}" for figure in figures), lost, outcome)
    Console(width=None if Console().is_terminal else 200).print(table)


if __name__ == "__main__":
    main()
