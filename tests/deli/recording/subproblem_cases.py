"""Runs that record their subproblems, and the numbers of what they recorded."""

import numpy as np
import pytest

import deli

MIXED, CLOSED_LOOP = {"start": "mixed"}, deli.GVI(predictor="closed_loop")
RUNS = {
    "cradle": (deli.scenes.newtons_cradle, {}, deli.GVI(), 0.02, 80, {}),
    "cradle_no_skip": (deli.scenes.newtons_cradle, {"balls": 3}, deli.GVI(), 0.02, 60, {"skip": False}),
    "newton_metric": (deli.scenes.spring_sphere, MIXED, deli.GVI(), 0.5, 40, {"solvers": "daqp"}),
    "numerical": (deli.scenes.spring_sphere, MIXED, deli.GVI(energy="numerical"), 0.25, 60, {"skip": False}),
    "closed_loop": (
        deli.scenes.newtons_cradle,
        {},
        deli.GVI(predictor="closed_loop"),
        0.02,
        60,
        {"solvers": "clarabel"},
    ),
    "searched": (deli.scenes.disc_pile, {"rows": 3, "columns": 3}, deli.GVI(), 0.02, 10, {}),
    "gas": (deli.scenes.hard_sphere_gas, {"spheres": 30, "filled": 0.3}, deli.GVI(), 0.05, 150, {"skip": False}),
    "memory": (deli.scenes.newtons_cradle, {}, deli.NonsmoothAlpha(), 0.02, 40, {}),
    "direct": (deli.scenes.nonlinear_oscillator, {}, deli.Direct(), 0.05, 40, {}),
}
RUN = pytest.mark.parametrize("name", RUNS)


def simulate(name, steps=None, **keywords):
    build, parameters, method, step_size, usual, settings = RUNS[name]
    return deli.simulate(
        build(**parameters), method, step_size=step_size, steps=steps or usual, **{**settings, **keywords}
    )


def posed(run):
    return run["subproblems"].to_dataset()


def problems(run):
    """Numbers of each problem, by hand from the ragged arrays: A, wish, R, b, z, y, and how many rows are equations."""
    data = posed(run)
    ends = {name: 0 for name in ("variable", "row", "entry", "metric_entry")}
    for number in range(data.sizes["problem"]):
        one = data.isel(problem=number)
        sizes = dict(zip(ends, (int(one[c]) for c in ("variables", "rows", "entries", "metric_entries")), strict=True))
        part = {name: slice(end, end + sizes[name]) for name, end in ends.items()}
        n, m = sizes["variable"], sizes["row"]
        matrix = np.zeros((m, n))
        places = np.repeat(np.arange(m), data["row_entries"].values[part["row"]])
        matrix[places, data["column"].values[part["entry"]]] = data["value"].values[part["entry"]]
        metric = np.eye(n)
        if sizes["metric_entry"]:
            upper = np.zeros((n, n))
            upper[np.triu_indices(n)] = data["metric"].values[part["metric_entry"]]
            metric = upper + np.triu(upper, 1).T
        vectors = (data[name].values[part["variable"]] for name in ("linear", "velocity"))
        rows = (data[name].values[part["row"]] for name in ("bounds", "multiplier", "active"))
        yield metric, matrix, *vectors, *rows, int(one["equalities"]), one
        ends = {name: end + sizes[name] for name, end in ends.items()}
