"""Compare placements of a reflection within a step, by the sum of its effects on the energy that smooth steps keep.

    python studies/drift_per_impact/placement.py [SCENE ...] [--impacts N] [--starts N] [--steps H ...]

forward   reflect at the start of a step that would cross: as GVI, except that this prediction includes rods
either    reflect there if the step would cross, or if the reversed reflected motion would
both      reflect there if the step would cross and the reversed reflected motion would too
middle    half a smooth step; reflect off violated contacts that approach; half a smooth step

kick      root mean square change of the shadow energy (order 12) in a reflection
drift     change of the shadow energy over a run by its impacts: mean over starts, with its standard error
walk      root mean square change over a run, as a multiple of kick √impacts: 1 if the signs of kicks are random
disagree  share of impacts that only one of the two directions of time sees
worst gap smallest gap at the end of a step
"""

import argparse
import dataclasses
import math

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli.integrators.recipe import Recipe
from deli.integrators.stepper import Stepper
from deli.mechanics.schemes import get_scheme

ORDER = 12
PLACEMENTS = ("forward", "either", "both", "middle")
LEAST = 1e-3  # gap of the contacts that take no part in a reflection


def billiard(random):
    """Return a particle in a circle, in a potential in which it moves chaotically."""
    angle = random.uniform(0.0, 2.0 * math.pi)
    wells = deli.RadialPowers(coefficients=[0.5, 0.6], exponents=[2, 4], centre=[0.3, 0.2])
    hills = [
        deli.RadialPowers(coefficients=[-0.7], exponents=[4], centre=[-0.4, 0.1]),
        deli.RadialPowers(coefficients=[0.5], exponents=[6], centre=[0.1, -0.5]),
    ]
    return deli.Scene(
        mass=1.0,
        position=random.uniform(-0.3, 0.3, 2),
        momentum=[2.0 * math.cos(angle), 2.0 * math.sin(angle)],
        potential=[wells, *hills],
        unilateral=deli.SpheresInside(radius=1.0),
        dimension=2,
    )


def mixed(random):
    """Return the spring and sphere of Fig. 8.3: the second mass slides on the circle, the first one bounces."""
    position = [[4.0, -1.0] + 0.1 * random.standard_normal(2), [3.0, -4.0]]
    return deli.scenes.spring_sphere(start="mixed", position=position, speed=1.0 + 0.03 * random.standard_normal())


# Function that draws a start, scheme and step sizes.
CASES = {
    "billiard": (billiard, "verlet", (0.05,)),
    "spring_sphere": (mixed, "midpoint", (0.25,)),
}


class Steps:
    """Smooth steps in a circle, and reflections off it at any position of a body."""

    def __init__(self, scene, scheme, step_size, energy):
        self.scene, self.h = scene, step_size
        self.smooth = deli.DiscreteSmooth(scheme).stepper(scene, step_size)
        self.mirror = deli.GVI(scheme, energy=energy).stepper(scene, step_size)
        self.shadow = Stepper(scene, step_size, Recipe(weights=get_scheme(scheme).weights, shadow=ORDER))
        self.touches = 1e-8 * scene.length_scale

    def gaps(self, q):
        return self.scene.unilateral.value(q)

    def speeds(self, q, p):
        return self.scene.unilateral.jacobian(q) @ (p / self.scene.mass)

    def reflect(self, q, p, rows):
        """Return the momentum reflected off `rows` and the touching contacts, at any positions."""
        found = self.gaps(q)
        wanted = np.where(rows | (np.abs(found) <= self.touches), 0.0, np.maximum(found, LEAST))
        circle = self.scene.unilateral.families[0]
        moved = dataclasses.replace(circle, radius=circle.radius - (found - wanted))
        self.mirror.switch(dataclasses.replace(self.scene, position=q, momentum=p, unilateral=moved))
        return self.mirror.reflect(q, p)

    def level(self, q, p):
        return self.shadow.shadow_energies(q[None], p[None])[0]


def at_start(steps, q, p, placement):
    """Take one step that reflects at its start; also return kicks, and impacts missed by one direction of time."""
    x, y = steps.smooth.step(q, p)
    gaps, here = steps.gaps(x), steps.gaps(q)
    crossed = gaps <= -steps.touches
    meets = crossed
    if placement == "either":
        speeds = steps.speeds(q, p)
        meets = crossed | ((here > steps.touches) & (speeds < 0.0) & (gaps < -0.3 * steps.h * speeds))
    if not meets.any():
        return x, y, [], 0, 0
    after = steps.reflect(q, p, meets)
    back = steps.gaps(steps.smooth.step(q, -after)[0]) <= -steps.touches
    disagree = int((meets & (crossed != back)).sum())
    chosen = {"forward": meets, "either": meets & (crossed | back), "both": meets & back}[placement]
    if (chosen != meets).any():
        after = steps.reflect(q, p, chosen) if chosen.any() else p
    kicks = [] if np.array_equal(after, p) else [steps.level(q, after) - steps.level(q, p)]
    x, y = steps.smooth.step(q, after)
    return x, y, kicks, int(chosen.sum()) if kicks else 0, disagree


def at_middle(steps, q, p):
    """Take half a smooth step, a reflection off violated contacts that approach, and half a smooth step."""
    x, y = steps.smooth.step(q, p)
    meets = (steps.gaps(x) <= -steps.touches) & (steps.speeds(x, y) < 0.0)
    kicks = []
    if meets.any():
        after = steps.reflect(x, y, meets)
        kicks = [] if np.array_equal(after, y) else [steps.level(x, after) - steps.level(x, y)]
        y = after
    x, y = steps.smooth.step(x, y)
    return x, y, kicks, int(meets.sum()) if kicks else 0, 0


def follow(name, step_size, energy, placement, impacts, seed):
    """Return the change of the shadow energy over a run, its kicks, impacts, disagreements and worst gap."""
    draw, scheme, _ = CASES[name]
    scene = draw(np.random.default_rng(seed))
    steps = Steps(scene, scheme, 0.5 * step_size if placement == "middle" else step_size, energy)
    q, p = scene.position, scene.momentum
    begin, kicks, struck, disagree, worst = steps.level(q, p), [], 0, 0, math.inf
    while struck < impacts:
        if placement == "middle":
            q, p, found, hit, odd = at_middle(steps, q, p)
        else:
            q, p, found, hit, odd = at_start(steps, q, p, placement)
        kicks += found
        struck += hit
        disagree += odd
        worst = min(worst, steps.gaps(q).min())
    return steps.level(q, p) - begin, kicks, struck, disagree, worst


def compare(name, step_size, energy, placement, impacts, starts):
    runs = [follow(name, step_size, energy, placement, impacts, seed) for seed in range(starts)]
    change, kicks, struck, disagree, worst = zip(*runs, strict=True)
    change, struck, kick = np.array(change), np.array(struck), math.sqrt(np.mean(np.concatenate(kicks) ** 2))
    rate = change / struck
    return {
        "scene": name,
        "h": step_size,
        "energy": energy,
        "placement": placement,
        "kick": kick,
        "drift": float(rate.mean()),
        "error": rate.std(ddof=1) / math.sqrt(starts),
        "walk": math.sqrt(np.mean(change**2 / struck)) / kick,
        "disagree": float(sum(disagree) / struck.sum()),
        "worst gap": float(min(worst)),
    }


def shown(value):
    return f"{value:.2g}" if isinstance(value, float) else str(value)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", nargs="*", default=list(CASES), help=", ".join(CASES))
    parser.add_argument("--impacts", type=int, default=300)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--steps", nargs="+", type=float, help="step sizes instead of each scene's own")
    parser.add_argument("--energy", nargs="+", default=["hamiltonian", "numerical", "shadow8"])
    parser.add_argument("--placement", nargs="+", choices=PLACEMENTS, default=PLACEMENTS)
    options = parser.parse_args()
    unknown = [name for name in options.scene if name not in CASES]
    if unknown:
        parser.error(f"scene {unknown[0]!r} is unknown; choose from {', '.join(CASES)}")
    cases = [
        (name, h, energy, placement)
        for name in options.scene
        for h in options.steps or CASES[name][2]
        for energy in options.energy
        for placement in options.placement
    ]
    rows = [compare(*case, options.impacts, options.starts) for case in track(cases, console=Console(stderr=True))]
    table = Table(*rows[0], box=box.SIMPLE)
    for row in rows:
        table.add_row(*(shown(value) for value in row.values()))
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
