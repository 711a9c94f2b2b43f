"""Ways to land, in the smallest scene that needs them: pogo sticks whose lower mass bounces within a step.

python studies/closed_loop/landings.py

The code is for two masses above each other and verlet, so that it can compare ways that deli does not have.
"""

import numpy as np
from rich.console import Console
from rich.table import Table

from deli.metrics import drift
from solvers.kept import kept

STIFFNESS, LENGTH, GRAVITY, STEP, STEPS = 10.0, 5.0, 9.8, 0.1, 20_000
FORWARD, RAW, CLOSED, KEPT, BALANCED = range(5)
WAYS = {
    RAW: "to the floor, momentum as it comes out",
    CLOSED: "to the floor, momentum across it by E(x, y) = E(q, p)",
    KEPT: "at its gap, momentum across it kept",
    BALANCED: "at its gap, momentum across it by E(x, y) = E(q, p)",
    FORWARD: "none: forward predictor",
}


@kept()
def slope(q):
    pull = STIFFNESS * (q[0] - q[1] - LENGTH)
    return np.array([GRAVITY + pull, GRAVITY - pull])


@kept()
def energy(q, p, numerical):
    """Return H, or the numerical Hamiltonian of verlet."""
    total = 0.5 * (p[0] ** 2 + p[1] ** 2) + 0.5 * STIFFNESS * (q[0] - q[1] - LENGTH) ** 2 + GRAVITY * (q[0] + q[1])
    if numerical:
        force = slope(q)
        total += STEP**2 * (STIFFNESS * (p[0] - p[1]) ** 2 / 12.0 - (force[0] ** 2 + force[1] ** 2) / 24.0)
    return total


@kept()
def across(q, along, wanted, numerical):
    """Return the larger nonnegative momentum across the floor with which the energy is `wanted`, or nearest to it."""
    curvature = STEP**2 * STIFFNESS / 6.0 if numerical else 0.0
    square, mixed = 1.0 + curvature, -curvature * along
    missing = energy(q, np.array([along, 0.0]), numerical) - wanted
    root = np.sqrt(max(0.0, mixed * mixed - 2.0 * square * missing))
    return max(0.0, (root - mixed) / square)


@kept()
def step(q, p, way, numerical):
    """Take one step; return whether it lands."""
    force, landing = slope(q), False
    meets = way == FORWARD and q[1] + STEP * (p[1] - 0.5 * STEP * force[1]) <= 0.0
    while True:
        left = p.copy()
        if meets and p[1] < 0.0:
            left[1] = across(q, p[0], energy(q, p, numerical), numerical)
        velocity = left - 0.5 * STEP * force
        x = q + STEP * velocity
        if way == FORWARD or x[1] >= 0.0:
            break
        if meets:
            x[1], landing = (q[1] if way in (KEPT, BALANCED) else 0.0), True
            velocity[1] = (x[1] - q[1]) / STEP
            break
        meets = True
    y = velocity - 0.5 * STEP * slope(x)
    if landing and way == KEPT:
        y[1] = left[1]
    elif landing and way != RAW:
        y[1] = across(x, y[0], energy(q, p, numerical), numerical)
    return x, y, landing


@kept()
def run(height, way, numerical):
    q, p = np.array([LENGTH + height, height]), np.zeros(2)
    energies, least, landings = np.empty(STEPS + 1), height, 0
    energies[0] = energy(q, p, numerical)
    for k in range(STEPS):
        q, p, landed = step(q, p, way, numerical)
        energies[k + 1] = energy(q, p, numerical)
        least, landings = min(least, q[1]), landings + landed
    return energies, least, landings


def main():
    heights = np.concatenate([np.linspace(0.005, 0.1, 20), np.linspace(0.1, 1.5, 40)])
    time = STEP * np.arange(STEPS + 1)
    for numerical in (False, True):
        name = "H₂" if numerical else "H"
        table = Table("landing", "worst gap", f"band of {name}", "widest", f"rms gain of {name}", "landings")
        table.title = f"{len(heights)} pogo sticks, E = {name}, h = {STEP}, {STEPS} steps"
        for way, words in WAYS.items():
            runs = [run(height, way, numerical) for height in heights]
            bands = np.array([np.ptp(energies) for energies, _, _ in runs])
            gains = np.array([drift(time, energies).slope * time[-1] for energies, _, _ in runs])
            table.add_row(
                words,
                f"{min(least for _, least, _ in runs):.1e}",
                f"{bands.mean():.3g}",
                f"{bands.max():.3g}",
                f"{np.sqrt((gains**2).mean()):.2g}",
                f"{np.mean([landings for _, _, landings in runs]):.0f}",
            )
        Console(width=None if Console().is_terminal else 160).print(table)


if __name__ == "__main__":
    main()
