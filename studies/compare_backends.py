"""Run one scene with every backend, with and without polishing, and compare conservation and cost.

    python studies/compare_backends.py [SCENE] [--steps N] [--tolerance T ...] [--backend NAME ...] [--no-skip]
                                        [-o compare.nc]

One row a run: range of the energy error, error of conserved momenta, worst gap, largest residual of a position
update, solves and time. Rows of equal energy and gap took the same path. -o keeps the table as an xarray dataset.
"""

import argparse

import numpy as np
import xarray as xr
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
import solvers

COLUMNS = ("energy_low", "energy_high", "momentum_error", "gap_min", "residual", "solves", "solver_time", "wall_time")


def measure(scene, method, step_size, steps, choice, skip):
    """Return the figures of one run in the order of COLUMNS, and its outcome."""
    run = deli.simulate(scene, method, step_size=step_size, steps=steps, solvers=choice, skip=skip)
    found, stats = deli.metrics.measure(run), run["solver_stats"].sel(subproblem="position")
    residuals = [float(stats[name].max()) for name in ("primal_residual", "dual_residual", "complementarity")]
    found["momentum_error"] = np.fmax(found["momentum_error"], found["angular_momentum_error"])
    found["gap_min"], found["residual"] = run["trajectory"]["gap_min"].min(), max(residuals)
    return [float(found[name]) for name in COLUMNS], run.attrs["outcome"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="newtons_cradle", choices=deli.scenes.available())
    parser.add_argument("--steps", type=int, default=500)
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-9])
    parser.add_argument("--backend", nargs="+", default=solvers.available())
    parser.add_argument("--no-skip", dest="skip", action="store_false", help="call solvers for closed forms too")
    parser.add_argument("-o", "--output")
    options = parser.parse_args()

    scene, defaults = deli.scenes.get(options.scene)(), deli.scenes.defaults(options.scene)
    method = deli.GVI(scheme=defaults["scheme"])
    axes = {"backend": options.backend, "tolerance": options.tolerance, "polish": [True, False]}
    shape = tuple(len(values) for values in axes.values())
    figures, outcomes = np.full((*shape, len(COLUMNS)), np.nan), np.full(shape, "", dtype=object)
    for index in track(list(np.ndindex(shape)), description=options.scene, transient=True):
        choice = {name: values[place] for (name, values), place in zip(axes.items(), index, strict=True)}
        figures[index], outcomes[index] = measure(
            scene, method, defaults["step_size"], options.steps, choice, options.skip
        )

    table = Table(
        *axes, *COLUMNS, "outcome", title=f"{options.scene}, h = {defaults['step_size']}, {options.steps} steps"
    )
    for index in np.ndindex(shape):
        labels = [str(values[place]) for values, place in zip(axes.values(), index, strict=True)]
        table.add_row(*labels, *(f"{figure:.3g}" for figure in figures[index]), str(outcomes[index]).split(":")[0])
    Console(width=None if Console().is_terminal else 200).print(table)
    if options.output:
        data = {name: (tuple(axes), figures[..., place]) for place, name in enumerate(COLUMNS)}
        data["outcome"] = (tuple(axes), outcomes.astype(str))
        xr.Dataset(data, axes, attrs={"scene": options.scene, "steps": options.steps}).to_netcdf(options.output)


if __name__ == "__main__":
    main()
