"""Effects of landings and reflections on the energy that smooth steps keep, with either predictor.

python studies/closed_loop/shadow_energies.py [--members 12]

The shadow energy has order 12. Its wander is its largest change over a run, in the mean over starts. Its gain is the
root mean square of its drift times the duration.
"""

import argparse

import numpy as np
from compare import PREDICTORS, dropped, faster
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli import metrics

ORDER, ROWS = 12, 3000
ENERGIES = ("hamiltonian", "numerical", "shadow4", "shadow8")


def scenes(members):
    return (
        ("pogo_stick dropped low, h = .1", dropped(0.005, 0.1, members), 0.1, 2000.0, "verlet"),
        ("pogo_stick dropped high, h = .1", dropped(0.1, 1.5, members), 0.1, 2000.0, "verlet"),
        ("the same, h = .05", dropped(0.1, 1.5, members), 0.05, 2000.0, "verlet"),
        (
            "spring_sphere mixed, h = .25",
            faster(deli.scenes.spring_sphere(start="mixed"), members),
            0.25,
            500.0,
            "midpoint",
        ),
    )


def measure(scene, method, step_size, duration):
    """Return wander and gain of the shadow energy, and the worst violation."""
    every = max(1, round(duration / step_size / ROWS)) | 1  # odd, because even ones may fall in step with the motion
    run = deli.simulate(scene, method, step_size=step_size, duration=duration, every=every)
    if run.attrs["outcome"] != "complete":
        raise RuntimeError(run.attrs["outcome"])
    level, time = metrics.shadow_energy(run, ORDER, scene).values, run["trajectory"]["time"].values
    gain = metrics.drift(time, level).slope * duration
    return np.ptp(level), gain, max(0.0, -float(run["trajectory"]["gap_min"].min()))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--members", type=int, default=12, help="variants of each scene")
    members = parser.parse_args().members
    table = Table("scene", "E", "predictor", "worst violation", "wander", "widest", "rms gain")
    cases = [(case, energy, predictor) for case in scenes(members) for energy in ENERGIES for predictor in PREDICTORS]
    for (name, variants, step_size, duration, scheme), energy, predictor in track(cases, console=Console(stderr=True)):
        method = deli.GVI(scheme, energy=energy, predictor=predictor)
        wander, gain, violation = np.array([measure(scene, method, step_size, duration) for scene in variants]).T
        table.add_row(
            name,
            energy,
            predictor,
            f"{violation.max():.1e}",
            f"{wander.mean():.2g}",
            f"{wander.max():.2g}",
            f"{np.sqrt((gain**2).mean()):.1e}",
            end_section=predictor == PREDICTORS[-1],
        )
    Console(width=None if Console().is_terminal else 160).print(table)


if __name__ == "__main__":
    main()
