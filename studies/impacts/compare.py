"""Compare the laws that reflection operators keep if several contacts are struck at once.

    python studies/impacts/compare.py [PROBLEM ...] [--draws N] [-o impacts.csv]

One row a problem and operator, every entry computed by reflecting, with the striker's speed as the unit:

energy, momentum   relative change of the kinetic energy, largest of the linear and angular momentum
symmetry           largest difference between the mirrored outcome and the outcome of the mirrored problem
approach           fastest remaining approach at a contact
pull               part of the impulse that no pushing contacts explain (nonnegative least squares)
opened             number of contacts that separate afterwards
one at a time      distance to the nearest of N sequences of pairwise collisions between bodies with small random
                   separations, in the limit of small gaps
exact              distance to the solution, if it is known
"""

import argparse
import csv

import numpy as np
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.optimize import nnls

import deli

PROBLEMS = {
    "cradle 3": lambda: deli.impacts.cradle(3),
    "cradle 5": lambda: deli.impacts.cradle(5),
    "cradle 10": lambda: deli.impacts.cradle(10),
    "cradle 50": lambda: deli.impacts.cradle(50),
    "bernoulli": deli.impacts.bernoulli,
    "rack of 6": lambda: deli.impacts.rack(3),
    "rack of 10": lambda: deli.impacts.rack(4),
}
OPERATORS = [("generalized", "index"), ("moreau", "index"), ("sequential", "index"), ("sequential", "fastest")]
COLUMNS = ("energy", "momentum", "symmetry", "approach", "pull", "opened", "one at a time", "exact")
ZERO = 1e-12
OPEN = 1e-9


def reflect(scene, momentum, operator, order):
    return deli.reflect(scene, scene.position, momentum, operator, order=order)


def normals(scene):
    """Return gradients over √M, of unit length: impulses and approach speeds in the metric of the mass."""
    rows = scene.unilateral.jacobian(scene.position) / np.sqrt(scene.mass)
    return rows / np.linalg.norm(rows, axis=1)[:, None]


def conserved(scene, momentum):
    """Return linear and angular momentum."""
    q, p = scene.position.reshape(scene.bodies, -1), momentum.reshape(scene.bodies, -1)
    turning = [q[:, 0] @ p[:, 1] - q[:, 1] @ p[:, 0]] if scene.dimension == 2 else []
    return np.array([*p.sum(axis=0), *turning])


def mirror(scene):
    """Return the map that mirrors momenta, with bodies numbered anew so that the scene does not change."""
    sign = np.array([1.0, -1.0]) if scene.dimension == 2 else np.array([-1.0])
    q = scene.position.reshape(scene.bodies, -1)
    center = np.where(sign < 0, (q.min(axis=0) + q.max(axis=0)) / 2, 0.0)
    image = (q - center) * sign + center
    number = np.linalg.norm(q[:, None] - image, axis=2).argmin(axis=1)
    return lambda momentum: (momentum.reshape(q.shape)[number] * sign).ravel()


def one_at_a_time(scene, draws):
    """Return momenta after pairwise collisions of separated bodies: a billiard inside the cone of linearized gaps."""
    rows, root = normals(scene), np.sqrt(scene.mass)
    opening = scene.unilateral.jacobian(scene.position)
    random = np.random.default_rng(1)
    outcomes = []
    for _ in range(draws):
        gaps = (
            opening @ (scene.position + random.uniform(-0.25, 0.25, scene.dof)) / np.linalg.norm(opening / root, axis=1)
        )
        velocity = scene.momentum / root
        while True:
            rates = rows @ velocity
            closing = np.flatnonzero(rates < -ZERO)
            if not len(closing):
                break
            times = np.maximum(gaps[closing], 0.0) / -rates[closing]
            first = closing[times.argmin()]
            gaps += times.min() * rates
            velocity = velocity - 2.0 * rates[first] * rows[first]
        outcomes.append(root * velocity)
    return np.array(outcomes)


def solution(name, scene):
    """Return the exact momentum after the impact, or None if it is not known."""
    if name.startswith("cradle"):
        return scene.momentum[::-1]
    if name == "bernoulli":
        cosine, striker = np.sqrt(0.75), scene.mass[0]
        impulse = 2.0 * cosine / (2.0 * cosine**2 / striker + 1.0)
        known = impulse * np.array([[-2.0 * cosine, 0.0], [cosine, -0.5], [cosine, 0.5]])
        return scene.momentum + known.ravel()
    return None


def measure(name, scene, sequences, operator, order):
    """Return the figures of one operator in the order of COLUMNS, nan for missing ones."""
    before, root, rows, mirrored = scene.momentum, np.sqrt(scene.mass), normals(scene), mirror(scene)
    after = reflect(scene, before, operator, order)
    impulse = (after - before) / root
    rates = rows @ (after / root)
    known = solution(name, scene)
    energy = np.sum((after / root) ** 2) / np.sum((before / root) ** 2) - 1.0
    return (
        abs(energy),
        np.abs(conserved(scene, after) - conserved(scene, before)).max(),
        np.abs(mirrored(after) - reflect(scene, mirrored(before), operator, order)).max(),
        max(0.0, -rates.min()),
        nnls(rows.T, impulse)[1] / np.linalg.norm(impulse),
        int((rates > OPEN).sum()),
        np.abs(sequences - after).max(axis=1).min(),
        np.nan if known is None else np.abs(after - known).max(),
    )


def words(figure):
    if isinstance(figure, int):
        return str(figure)
    return "-" if np.isnan(figure) else "0" if figure <= ZERO else f"{figure:.2g}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problem", nargs="*", default=list(PROBLEMS), help=f"one of: {', '.join(PROBLEMS)}")
    parser.add_argument("--draws", type=int, default=1000)
    parser.add_argument("-o", "--output", help="also write the figures, unrounded, to this csv file")
    options = parser.parse_args()
    unknown = set(options.problem) - set(PROBLEMS)
    if unknown:
        parser.error(f"unknown problem: {', '.join(sorted(unknown))}; allowed: {', '.join(PROBLEMS)}")

    results = []
    for name in track(options.problem, description="impacts", transient=True):
        scene = PROBLEMS[name]()
        sequences = one_at_a_time(scene, options.draws)
        for operator, order in OPERATORS:
            label = f"{operator}, {order}" if operator == "sequential" else operator
            results.append((name, label, *measure(name, scene, sequences, operator, order)))

    table = Table("problem", "operator", *COLUMNS, box=box.MARKDOWN)
    for name, label, *figures in results:
        table.add_row(name, label, *map(words, figures))
    Console(width=None if Console().is_terminal else 160).print(table)
    if options.output:
        with open(options.output, "w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows([("problem", "operator", *COLUMNS), *results])


if __name__ == "__main__":
    main()
