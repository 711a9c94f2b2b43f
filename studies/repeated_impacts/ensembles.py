"""Run the paper's pogo stick and Newton's cradle from many starts, to test whether its claims depend on the start.

    python studies/repeated_impacts/ensembles.py [pogo_stick] [newtons_cradle] [--members N]

pogo_stick (Figs. 1.4, 6.1): h = .1, 10 000 steps, from random states. The lower mass starts .1 to 2.5 above the floor,
the spring stretched by -1 to 1, the upper mass with a momentum of -2 to 2, each uniformly distributed.

complete         members that reach the end
band             range of the energy: median over the members, and largest
wander           range of its means over tenths of the run, likewise

newtons_cradle (Fig. 8.4): 60 units of time, gravity from 9.2 to 10.4 in equal steps. The paper does not state gravity,
which determines the time of the first blow within its step.

clean swings     number of swings from the start in which the swinging balls have 90 % of the energy: median
energy error     largest |H - H(0)| of all members, over h^2
"""

import argparse
import logging

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli.figures.cradle import clean_swings

TENTHS = 10


def pogo_sticks(members):
    random = np.random.default_rng(1)
    starts = zip(*(random.uniform(low, high, members) for low, high in ((0.1, 2.5), (-1, 1), (-2, 2))), strict=True)
    return [
        deli.scenes.pogo_stick(gravity=9.8213, position=(5.0 + height + stretch, height), momentum=(momentum, 0.0))
        for height, stretch, momentum in starts
    ]


def pogo_stick(members):
    table = Table("pogo_stick", "complete", "band", "largest", "wander", "largest", box=box.MARKDOWN)
    bands, scenes = {}, pogo_sticks(members)
    methods = [kind("verlet", energy=energy) for energy in ("hamiltonian", "numerical") for kind in KINDS]
    for method in track(methods, description="pogo_stick", transient=True):
        run = deli.simulate_ensemble(scenes, method, step_size=0.1, steps=10_000)
        energy = run["trajectory"]["hamiltonian"].values
        complete = (run["outcome"] == "complete").values
        band = np.where(complete, np.ptp(energy, axis=1), np.nan)
        means = energy[complete, 1:].reshape(complete.sum(), TENTHS, -1).mean(axis=2)
        wander = np.ptp(means, axis=1)
        bands[type(method), method.energy] = band
        figures = (np.nanmedian(band), np.nanmax(band), np.median(wander), wander.max())
        name = f"{type(method).__name__} {method.energy}"
        table.add_row(name, f"{complete.sum()} of {members}", *(f"{figure:.3g}" for figure in figures))
    for kind in KINDS:
        ratio = bands[kind, "numerical"] / bands[kind, "hamiltonian"]
        ended, tighter = np.isfinite(ratio).sum(), (ratio < 1.0).sum()
        words = f"{tighter} of {ended}, median ratio {np.nanmedian(ratio):.2g}"
        table.add_row(f"{kind.__name__}: band of numerical narrower in", words)
    return table


def newtons_cradle(members):
    table = Table("newtons_cradle", "h", "clean swings", "quartiles", "energy error", box=box.MARKDOWN)
    scenes = [deli.scenes.newtons_cradle(gravity=gravity) for gravity in np.linspace(9.2, 10.4, members)]
    cases = [(operator, h) for operator in ("generalized", "sequential") for h in (0.04, 0.03, 0.02, 0.01, 0.005)]
    for operator, h in track(cases, description="newtons_cradle", transient=True):
        run = deli.simulate_ensemble(scenes, deli.GVI(reflection=operator), step_size=h, steps=round(60.0 / h))
        record = run["trajectory"].dataset
        swings = [clean_swings(scene, record.isel(member=number)) for number, scene in enumerate(scenes)]
        quartiles = " to ".join(f"{quartile:g}" for quartile in np.quantile(swings, (0.25, 0.75)))
        energy = record["hamiltonian"].values
        error = np.abs(energy - energy[:, :1]).max() / h**2
        table.add_row(operator, f"{h:g}", f"{np.median(swings):g}", quartiles, f"{error:.3g}")
    return table


KINDS = (deli.GVI, deli.Collision)
PROBLEMS = {"pogo_stick": pogo_stick, "newtons_cradle": newtons_cradle}
MEMBERS = {"pogo_stick": 40, "newtons_cradle": 24}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problem", nargs="*", default=list(PROBLEMS), help=f"one of: {', '.join(PROBLEMS)}")
    parser.add_argument("--members", type=int, help=f"by default {MEMBERS}")
    options = parser.parse_args()
    unknown = set(options.problem) - set(PROBLEMS)
    if unknown:
        parser.error(f"unknown problem: {', '.join(sorted(unknown))}; allowed: {', '.join(PROBLEMS)}")
    logging.getLogger("deli").setLevel(logging.ERROR)  # members that fail are counted in the table
    console = Console(width=None if Console().is_terminal else 160)
    for problem in options.problem:
        console.print(PROBLEMS[problem](options.members or MEMBERS[problem]))


if __name__ == "__main__":
    main()
