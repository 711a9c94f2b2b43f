"""Metrics of a made-up study whose findings are known."""

import numpy as np
import xarray as xr

from deli import metrics

SOLVERS, STEPS, TOLERANCES = ["quick", "slow"], [0.2, 0.1, 0.05, 0.025], [1e-3, 1e-6, 1e-9]


def made_up(**changes):
    """Two solvers, four step sizes, three tolerances: slow takes three times as long, the band is h², contacts last."""
    axes = {"solver": SOLVERS, "step_size": STEPS, "tolerance": TOLERANCES}
    solver, step, tolerance = np.meshgrid([1.0, 3.0], STEPS, TOLERANCES, indexing="ij")
    values = {name: np.zeros(solver.shape) for name in metrics.METRICS}
    values |= {
        "wall_time": solver / step,
        "energy_band": 2.0 * step**2,
        "smooth_contacts": np.full(solver.shape, 2.0),
        "solves": np.full(solver.shape, 10.0),
        "claimed_solves": np.full(solver.shape, 10.0),
        "verified_solves": np.full(solver.shape, 10.0),
        "violation_worst": 1e-12 * tolerance / tolerance.max(),
        "simulated_time": np.full(solver.shape, 100.0),
        "energy_drift_error": np.full(solver.shape, 1e-9),
        "trajectory_error": np.full(solver.shape, np.nan),
    }
    data = xr.Dataset(
        {
            name: (tuple(axes), value, dict(zip(("units", "long_name"), metrics.METRICS[name], strict=True)))
            for name, value in values.items()
        },
        axes,
    )
    data["state"] = (tuple(axes), np.full(solver.shape, "done", dtype=object))
    data["outcome"] = (tuple(axes), np.full(solver.shape, "complete", dtype=object))
    data["file"] = (tuple(axes), np.full(solver.shape, "case.nc", dtype=object))
    for name, (place, value) in changes.items():
        data[name].loc[place] = value
    return data
