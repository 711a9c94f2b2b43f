"""Compare the forward predictor with the closed loop: admissibility, energy band and drift.

python studies/closed_loop/compare.py [--members 32] [--random 300]
"""

import argparse
import dataclasses
import logging
from random import Random

import numpy as np
from random_scenes import random_scene
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli.metrics import drift, measure

PREDICTORS = ("forward", "closed_loop")
ENERGIES = ("hamiltonian", "numerical")
TOLERANCE = 1e-8
"""Contact tolerance, in lengths of the scene."""

scenes = deli.scenes
PAPER = (
    ("point_mass", scenes.point_mass(), 0.01, 20.0, "midpoint"),
    ("pogo_stick", scenes.pogo_stick(), 0.1, 5000.0, "verlet"),
    ("pogo_stick from (5.3, .3)", scenes.pogo_stick(position=(5.3, 0.3)), 0.1, 5000.0, "verlet"),
    ("pogo_stick from (5, .01)", scenes.pogo_stick(position=(5.0, 0.01)), 0.1, 5000.0, "verlet"),
    ("spring_sphere smooth", scenes.spring_sphere(start="smooth"), 0.5, 1000.0, "midpoint"),
    ("spring_sphere mixed", scenes.spring_sphere(start="mixed"), 0.5, 1000.0, "midpoint"),
    ("nonlinear_oscillator", scenes.nonlinear_oscillator(), 0.1, 300.0, "midpoint"),
    ("newtons_cradle, h = .03", scenes.newtons_cradle(), 0.03, 60.0, "midpoint"),
    ("newtons_cradle, h = .02", scenes.newtons_cradle(), 0.02, 60.0, "midpoint"),
    ("newtons_cradle, h = .01", scenes.newtons_cradle(), 0.01, 60.0, "midpoint"),
    ("newtons_cradle, h = .005", scenes.newtons_cradle(), 0.005, 60.0, "midpoint"),
    ("lennard_jones", scenes.lennard_jones(), 0.01, 2000.0, "verlet"),
)


def apart(scene):
    """Return the impact set with gaps of a fiftieth of the distances, so that one step has several impacts."""
    return dataclasses.replace(scene, position=1.02 * scene.position)


OTHERS = (
    ("impacts.cradle", apart(deli.impacts.cradle(5)), 0.3, 15.0, "midpoint"),
    ("impacts.bernoulli", apart(deli.impacts.bernoulli()), 0.3, 15.0, "midpoint"),
    ("impacts.rack", apart(deli.impacts.rack(4)), 0.3, 15.0, "midpoint"),
    ("wedge", scenes.wedge(), 0.01, 200.0, "midpoint"),
    ("wedge, 3 walls at 80°", scenes.wedge(walls=3, spread=2.8, position=(0.05, 1.0)), 0.02, 200.0, "midpoint"),
    ("quartic_wall", scenes.quartic_wall(), 0.05, 1000.0, "midpoint"),
    ("hard_rods", scenes.hard_rods(rods=8), 0.05, 50.0, "midpoint"),
    ("hard_sphere_gas", scenes.hard_sphere_gas(spheres=32, filled=0.3, boundary="walls"), 0.05, 50.0, "midpoint"),
    ("granular_chain", scenes.granular_chain(beads=8), 0.02, 50.0, "midpoint"),
    ("disc_pile", scenes.disc_pile(rows=4, columns=4), 0.01, 5.0, "midpoint"),
    ("chain_on_cylinder", scenes.chain_on_cylinder(masses=8), 0.005, 2.0, "midpoint"),
)


def faster(scene, members):
    """Return variants of a scene with momenta up to a hundredth larger or smaller."""
    return [dataclasses.replace(scene, momentum=scene.momentum * factor) for factor in np.linspace(0.99, 1.01, members)]


def dropped(low, high, members):
    """Return pogo sticks whose lower ends start at heights between two bounds."""
    return [scenes.pogo_stick(position=(5.0 + height, height)) for height in np.linspace(low, high, members)]


def ensembles(members):
    """Return chaotic scenes, of which only means over starts can be compared."""
    crowded = scenes.lennard_jones(container=1.9, speed=4.0)
    return (
        ("spring_sphere mixed, h = .5", faster(scenes.spring_sphere(start="mixed"), members), 0.5, 1000.0, "midpoint"),
        ("the same, h = .1", faster(scenes.spring_sphere(start="mixed"), members), 0.1, 1000.0, "midpoint"),
        ("pogo_stick dropped low, h = .1", dropped(0.005, 0.1, members), 0.1, 2000.0, "verlet"),
        ("pogo_stick dropped high, h = .1", dropped(0.1, 1.5, members), 0.1, 2000.0, "verlet"),
        ("the same, h = .05", dropped(0.1, 1.5, members), 0.05, 2000.0, "verlet"),
        ("nonlinear_oscillator, h = .1", faster(scenes.nonlinear_oscillator(), members), 0.1, 300.0, "midpoint"),
        ("lennard_jones, h = .01", faster(scenes.lennard_jones(), members), 0.01, 200.0, "verlet"),
        ("the same, fast, in a small room", faster(crowded, members), 0.01, 100.0, "verlet"),
    )


def single(title, cases):
    """Return the table of one run of each scene."""
    headings = ("scene", "E", "predictor", "worst violation", "H - H(0)", "drift of H", "momenta", "f(q)", "outcome")
    table = Table(*headings, title=title)
    every = [(case, energy, predictor) for case in cases for energy in ENERGIES for predictor in PREDICTORS]
    for (name, scene, step_size, duration, scheme), energy, predictor in track(every, title, transient=True):
        method = deli.GVI(scheme, energy=energy, predictor=predictor)
        run = deli.simulate(scene, method, step_size=step_size, duration=duration)
        found = {key: float(value) for key, value in measure(run).items()}
        momenta = np.nanmax([found["momentum_error"], found["angular_momentum_error"], -np.inf])
        table.add_row(
            name,
            energy,
            predictor,
            f"{found['violation_worst']:.1e}",
            f"{found['energy_low']:+.2e} … {found['energy_high']:+.2e}",
            f"{found['energy_drift']:+.0e} ± {found['energy_drift_error']:.0e}",
            f"{momenta:.0e}" if np.isfinite(momenta) else "–",
            f"{found['equality_residual']:.0e}" if np.isfinite(found["equality_residual"]) else "–",
            run.attrs["outcome"].split(";")[0],
            end_section=predictor == PREDICTORS[-1],
        )
    return table


def many(members):
    """Return means over variants of each scene with standard errors; the gain of H is its drift times the duration."""
    table = Table(
        "scene", "E", "predictor", "worst violation", "band of H", "widest", "gain of H", "rms gain", "failed"
    )
    for name, variants, step_size, duration, scheme in track(ensembles(members), "ensembles", transient=True):
        for energy in ENERGIES:
            for predictor in PREDICTORS:
                method = deli.GVI(scheme, energy=energy, predictor=predictor)
                run = deli.simulate_ensemble(variants, method, step_size=step_size, duration=duration)
                record = run["trajectory"]
                complete = run["outcome"].values == "complete"
                hamiltonian = record["hamiltonian"].values[complete]
                band = np.ptp(hamiltonian, axis=1)
                gain = duration * np.array([drift(record["time"].values, member).slope for member in hamiltonian])
                table.add_row(
                    name,
                    energy,
                    predictor,
                    f"{max(0.0, -np.nanmin(record['gap_min'].values)):.1e}",
                    mean(band),
                    f"{band.max():.3g}",
                    mean(gain),
                    f"{np.sqrt((gain**2).mean()):.2g}",
                    str(np.count_nonzero(~complete)),
                    end_section=predictor == PREDICTORS[-1],
                )
    table.title = f"Ensembles of {members}"
    return table


def mean(values):
    """Return mean and standard error as text."""
    return f"{values.mean():.3g} ± {values.std(ddof=1) / np.sqrt(len(values)):.1g}"


def unplanned(count, steps=400):
    """Return the table of random scenes, the same for both predictors."""
    table = Table(
        "E", "predictor", "violate", "worst violation / L", "give up", "band, closed / forward", "rms gain of H"
    )
    table.title = f"{count} random scenes, {steps} steps"
    for energy in ENERGIES:
        bands = {predictor: np.full(count, np.nan) for predictor in PREDICTORS}
        gains = {predictor: np.full(count, np.nan) for predictor in PREDICTORS}
        found = {}
        for predictor in PREDICTORS:
            violations, failed = np.zeros(count), 0
            for seed in track(range(count), f"random scenes, {energy}, {predictor}", transient=True):
                scene, step_size = random_scene(Random(seed))
                method = deli.GVI(("midpoint", "verlet")[seed % 2], energy=energy, predictor=predictor)
                run = deli.simulate(scene, method, step_size=step_size, steps=steps)
                record = run["trajectory"]
                violations[seed] = np.nanmax(np.append(-record["gap_min"].values, 0.0)) / scene.length_scale
                if run.attrs["outcome"] != "complete":
                    failed += 1
                    continue
                hamiltonian = record["hamiltonian"].values
                size = np.ptp(record["potential_energy"].values) + record["kinetic_energy"].values.max()
                if size > 0.0:
                    bands[predictor][seed] = np.ptp(hamiltonian) / size
                    gains[predictor][seed] = drift(np.arange(steps + 1) / steps, hamiltonian).slope / size
            found[predictor] = (violations, failed)
        both = np.isfinite(bands["forward"]) & np.isfinite(bands["closed_loop"])
        moved = both & (bands["forward"] > 1e-12) & (bands["closed_loop"] > 1e-12)
        ratio = bands["closed_loop"][moved] / bands["forward"][moved]
        for predictor in PREDICTORS:
            violations, failed = found[predictor]
            table.add_row(
                energy,
                predictor,
                str(np.count_nonzero(violations > TOLERANCE)),
                f"{violations.max():.1e}",
                str(failed),
                f"{np.exp(np.log(ratio).mean()):.3f} in the mean" if predictor == "closed_loop" else "1",
                f"{np.sqrt((gains[predictor][both] ** 2).mean()):.1e}",
                end_section=predictor == PREDICTORS[-1],
            )
    return table


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--members", type=int, default=32, help="variants of each chaotic scene")
    parser.add_argument("--random", type=int, default=300, help="random scenes")
    chosen = parser.parse_args()
    logging.getLogger("deli").setLevel(logging.ERROR)  # the tables show failed runs
    console = Console(width=None if Console().is_terminal else 220)
    console.print(single("The paper's scenes", PAPER))
    console.print(single("Impacts and many bodies", OTHERS))
    console.print(many(chosen.members))
    console.print(unplanned(chosen.random))


if __name__ == "__main__":
    main()
