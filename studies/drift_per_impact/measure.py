"""Measure the effect of impacts on the energy that smooth steps keep, by step size and by conserved energy.

    python studies/drift_per_impact/measure.py [SCENE ...] [--impacts N] [--energy NAME ...] [-o drift.csv]

kick           root mean square change of the shadow energy in a step with an impact
drift          slope of the shadow energy over the number of impacts, with its standard error
walk           slope that as many kicks of random signs would leave (root mean square); a smaller drift is not one
in a million   change by a million impacts with that slope, as a share of H at the start
wander         largest change of the shadow energy over the run

The shadow energy has order 12, so that it also shows the errors of reflections that conserve the one of order 8.
"""

import argparse
import csv
import dataclasses
import itertools

import numpy as np
import xarray as xr
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli import metrics

ORDER = 12
ROWS = 2000
KICKS = 400


def gas():
    """Return thirty spheres that fill 30 % of a box, with a well of the Lennard-Jones potential at contact."""
    hard = deli.scenes.hard_sphere_gas(spheres=30, filled=0.3, boundary="walls")
    pairs = list(itertools.combinations(range(hard.bodies), 2))
    return dataclasses.replace(hard, potential=deli.LennardJones(pairs=pairs, epsilon=0.5, sigma=1.8))


# Function that builds the scene, its scheme, step sizes with the paper's first, and mean time between impacts.
CASES = {
    "pogo_stick": (lambda: deli.scenes.pogo_stick(momentum=[0.5, -0.5]), "verlet", (0.1, 0.05, 0.025), 0.42),
    "spring_sphere": (lambda: deli.scenes.spring_sphere(start="mixed"), "midpoint", (0.5, 0.25, 0.125), 1.5),
    "clockwise": (lambda: deli.scenes.spring_sphere(start="mixed", speed=-1.0), "midpoint", (0.5, 0.25, 0.125), 1.5),
    "lennard_jones": (deli.scenes.lennard_jones, "verlet", (0.01, 0.005, 0.0025), 0.9),
    "gas": (gas, "verlet", (0.02, 0.01, 0.005), 0.0055),
}


def measure(name, step_size, energy, impacts):
    build, scheme, _, between = CASES[name]
    scene, method = build(), deli.GVI(scheme, energy=energy)
    steps = round(impacts * between / step_size)
    run = deli.simulate(scene, method, step_size=step_size, steps=steps, every=max(1, steps // ROWS))
    found = {"scene": name, "h": step_size, "energy": energy, "outcome": run.attrs["outcome"]}
    if found["outcome"] != "complete":
        return found
    few = round(KICKS * between / step_size)
    short = deli.simulate(scene, method, step_size=step_size, steps=min(steps, few))
    hit = np.flatnonzero(short["trajectory"]["reflected_contacts"].values)
    before, after = (metrics.shadow_energy(rows_of(short, rows), ORDER, scene).values for rows in (hit - 1, hit))
    kicks = after - before
    level = metrics.shadow_energy(run, ORDER, scene).values
    struck = np.cumsum(run["trajectory"]["reflected_contacts"].values).astype(float)
    slope = metrics.drift(struck, level)
    start = float(run["trajectory"]["hamiltonian"][0])
    return found | {
        "impacts": int(struck[-1]),
        "kick": np.sqrt(np.mean(kicks**2)),
        "drift": slope.slope,
        "error": slope.error,
        "walk": np.sqrt(1.2 * np.mean(kicks**2) / struck[-1]),
        "in a million": 1e6 * slope.slope / start,
        "wander": np.abs(level - level[0]).max(),
        "worst gap": float(run["trajectory"]["gap_min"].min()),
        "us a step": 1e6 * run.attrs["wall_time"] / steps,
    }


def rows_of(run, rows):
    """Return some rows of a run."""
    trajectory = run["trajectory"].to_dataset().isel(time=rows)
    return xr.DataTree.from_dict({"/": xr.Dataset(attrs=run.attrs), "/trajectory": trajectory})


def shown(value):
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="*", default=list(CASES), help=", ".join(CASES))
    parser.add_argument("--impacts", type=int, default=2000)
    parser.add_argument("--energy", nargs="+", default=list(deli.GVI.CHOICES["energy"]))
    parser.add_argument("--steps", nargs="+", type=float, help="step sizes instead of each scene's own")
    parser.add_argument("-o", "--output")
    options = parser.parse_args()
    unknown = [name for name in options.scene if name not in CASES]
    if unknown:
        parser.error(f"scene {unknown[0]!r} is unknown; choose from {', '.join(CASES)}")
    steps = {name: options.steps or CASES[name][2] for name in options.scene}
    cases = [(name, h, energy) for name in options.scene for h in steps[name] for energy in options.energy]
    rows = [measure(*case, options.impacts) for case in track(cases, console=Console(stderr=True))]
    table = Table(box=box.SIMPLE)
    columns = [key for key in dict.fromkeys(key for row in rows for key in row) if key != "outcome"]
    for column in columns:
        table.add_column(column)
    for row in rows:
        table.add_row(*(shown(row.get(column, "")) for column in columns))
        if row["outcome"] != "complete":
            table.add_row("", "", "", row["outcome"])
    Console(width=140).print(table)
    if options.output:
        with open(options.output, "w", newline="") as file:
            writer = csv.DictWriter(file, [*columns, "outcome"])
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
