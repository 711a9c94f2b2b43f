"""Collect subproblems, easy and hard, from short runs of deli's scenes and of a few difficult ones.

    python studies/library/make.py [-o subproblems.nc]

`deli replay` solves the result if no file is named. Of each run, and each shape of problem in it, the script keeps a
few problems spread over time and the nearest to degenerate ones, in which a row hardly presses and is hardly open.
"""

import argparse
from pathlib import Path

import numpy as np
import xarray as xr

import deli
from deli.recording.reading import read_subproblems
from deli.recording.schema import POSED
from deli.recording.seal import seal
from deli.recording.subproblems import ORIGIN, SUBPROBLEM_VARIABLES, pack

SPREAD, DEGENERATE = 4, 3  # numbers of problems of each shape
SHAPES = 5  # number of shapes of each run and subproblem, from the smallest to the largest


def packed_corner():
    """Return three by three discs that touch each other and two walls; another disc hits them along the diagonal."""
    places = np.array([[0.5 + column, 0.5 + row] for row in range(3) for column in range(3)] + [[3.35, 3.35]])
    momentum = np.zeros_like(places)
    momentum[-1] = [-3.0, -3.0]
    return deli.Scene(
        mass=1.0,
        position=places,
        momentum=momentum,
        unilateral=[
            deli.SpheresApart(pairs=None, distance=1.0),
            deli.Planes(normals=np.repeat([[1.0, 0.0], [0.0, 1.0]], 9, axis=0), offsets=0.5, bodies=[*range(9)] * 2),
        ],
        dimension=2,
    )


def touching_row():
    """Return discs side by side on a floor: neighbours touch and do not press, which is degenerate to rounding."""
    count = 6
    places = np.stack([np.arange(count, dtype=float), np.full(count, 0.5)], axis=1)
    return deli.Scene(
        mass=1.0,
        position=places,
        momentum=np.zeros_like(places),
        potential=[deli.Gravity([0.0, -9.8])],
        unilateral=[
            deli.Planes(normals=np.repeat([[0.0, 1.0]], count, axis=0), offsets=0.5, bodies=[*range(count)]),
            deli.SpheresApart(pairs=None, distance=1.0),
        ],
        dimension=2,
    )


def grazing_gaps():
    """Return discs that slide along a floor and past each other, with gaps and approach speeds down to rounding."""
    count = 6
    gaps = np.concatenate(([0.0], np.cumsum(1.0 + 10.0 ** -np.arange(4.0, 4.0 + 2 * (count - 1), 2.0))))
    places = np.stack([gaps, np.full(count, 0.5)], axis=1)
    speeds = np.stack([1.0 - 10.0 ** -np.arange(2.0, 2.0 + 2 * count, 2.0)[::-1], np.zeros(count)], axis=1)
    return deli.Scene(
        mass=1.0,
        position=places,
        momentum=speeds,
        potential=[deli.Gravity([0.0, -9.8])],
        unilateral=[
            deli.Planes(normals=np.repeat([[0.0, 1.0]], count, axis=0), offsets=0.5, bodies=[*range(count)]),
            deli.SpheresApart(pairs=None, distance=1.0),
        ],
        dimension=2,
    )


def redundant_contacts():
    """Return two beads on a rod that is listed twice, on a floor that is listed three times, once tilted by 1e-7."""
    normals = np.array([[0.0, 1.0], [0.0, 2.0], [1e-7, 1.0]])
    return deli.Scene(
        mass=[1.0, 2.0],
        position=[[0.0, 0.0], [1.0, 0.0]],
        momentum=[[0.3, 0.0], [0.6, -1.0]],
        potential=[deli.Gravity([0.0, -9.8])],
        unilateral=[deli.Planes(normals=np.repeat(normals, 2, axis=0), bodies=[0, 1] * 3)],
        bilateral=[deli.Rods(pairs=[(0, 1)], length=1.0), deli.Rods(pairs=[(0, 1)], length=1.0)],
        dimension=2,
    )


def stack(masses, speed=0.0):
    """Return balls on each other on a line, the lowest on the floor."""
    count = len(masses)
    rows = np.eye(count) - np.eye(count, k=-1)
    apart = np.array([0.0, *[1.0] * (count - 1)])
    return deli.Scene(
        mass=masses,
        position=np.arange(count, dtype=float),
        momentum=[*[0.0] * (count - 1), -speed * masses[-1]],
        potential=[deli.Gravity([-9.8])],
        unilateral=[deli.Constraints(value=lambda q: rows @ q - apart, jacobian=lambda q: rows)],
    )


SCENES, GVI, NUMERICAL = deli.scenes, deli.GVI, deli.GVI("verlet", energy="numerical")
RUNS = [
    ("newtons_cradle", SCENES.newtons_cradle(), GVI(), 0.01, 400, {"skip": False}),
    ("spring_sphere smooth", SCENES.spring_sphere(start="smooth"), GVI(), 0.5, 100, {}),
    ("spring_sphere mixed", SCENES.spring_sphere(start="mixed"), GVI(energy="numerical"), 0.5, 200, {"skip": False}),
    ("nonlinear_oscillator", SCENES.nonlinear_oscillator(), GVI(), 0.1, 300, {"skip": False}),
    ("disc_pile", SCENES.disc_pile(rows=4, columns=4), GVI(), 0.01, 10, {}),
    (
        "lennard_jones",
        SCENES.lennard_jones(container=1.9, speed=4.0),
        GVI("verlet", energy="numerical"),
        0.02,
        200,
        {"skip": False},
    ),
    ("hard_rods", SCENES.hard_rods(rods=8), GVI(), 0.05, 200, {"skip": False}),
    ("granular_chain", SCENES.granular_chain(beads=12), GVI(), 0.05, 200, {"skip": False}),
    ("chain_on_cylinder", SCENES.chain_on_cylinder(masses=12), GVI(), 0.01, 100, {}),
    ("packed corner", packed_corner(), GVI(), 0.02, 40, {}),
    ("touching row", touching_row(), GVI(), 0.01, 20, {}),
    ("grazing gaps", grazing_gaps(), GVI(), 0.01, 100, {}),
    ("redundant contacts", redundant_contacts(), GVI(), 0.01, 40, {"skip": False}),
    ("mass ratio 1e8, heavy on light", stack([1.0, 1e8]), GVI(), 0.01, 20, {}),
    ("mass ratio 1e8, light on heavy", stack([1e8, 1.0, 1e4, 1.0]), GVI(), 0.01, 20, {}),
    ("mass ratio 1e8, blow", stack([1.0, 1e8, 1.0], speed=1.0), GVI(), 0.01, 20, {"skip": False}),
]


def choose(problems):
    """Return the problems to keep, in their order."""
    shapes = {}
    for place, posed in enumerate(problems):
        shapes.setdefault((posed.subproblem, posed.newton, posed.variables, posed.rows, posed.equalities), []).append(
            place
        )
    kept = set()
    for subproblem, newton in sorted({shape[:2] for shape in shapes}):
        of_kind = [places for shape, places in sorted(shapes.items()) if shape[:2] == (subproblem, newton)]
        for index in np.unique(np.linspace(0, len(of_kind) - 1, SHAPES).round().astype(int)):
            places = of_kind[index]
            kept.update(places[k] for k in np.unique(np.linspace(0, len(places) - 1, SPREAD).round().astype(int)))
            kept.update(sorted(places, key=lambda place: margin(problems[place]))[:DEGENERATE])
    return [problems[place] for place in sorted(kept)]


def margin(posed):
    """Return the distance of the closest inequality row from neither pressing nor being open."""
    free = slice(posed.equalities, None)
    slack = (posed.matrix @ posed.z - posed.bounds)[free]
    return np.maximum(slack, posed.y[free]).min(initial=np.inf)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).with_name("subproblems.nc"))
    output = parser.parse_args().output
    problems, origins = [], []
    for name, scene, method, step_size, steps, keywords in RUNS:
        recorded = output.with_suffix(".run")
        run = deli.simulate(
            scene,
            method,
            step_size=step_size,
            steps=steps,
            subproblems=True,
            output=recorded,
            overwrite=True,
            **keywords,
        )
        met, _ = read_subproblems(recorded)
        recorded.unlink()
        chosen = choose(met)
        problems += chosen
        origins += [name] * len(chosen)
        sizes = sorted({(one.name, one.variables, one.rows, one.equalities) for one in chosen})
        print(f"{name}: {run.attrs['outcome']}, {len(chosen)} of {len(met)}: {sizes}")
    arrays = pack(problems) | {"left_out": np.array(0)}
    data = xr.Dataset(
        {one.name: (one.dims, arrays[one.name].astype(one.dtype), one.attributes) for one in SUBPROBLEM_VARIABLES},
        attrs={"title": "subproblems of deli's scenes, easy and hard", "deli_version": deli.__version__},
    )
    data[ORIGIN] = ("problem", np.array(origins), {"long_name": "scene that the problem comes from"})
    packed = {name: {"zlib": True, "complevel": 9, "shuffle": True} for name in data if data[name].dims}
    packed[ORIGIN]["dtype"] = "S1"
    data.to_netcdf(output, group=POSED, encoding=packed)
    seal(output)
    print(f"{len(problems)} problems in {output}, {output.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
