"""What a run amounts to: energy and its drift, momentum, gaps, and where the time went."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from deli.recording.schema import STATS, TRAJECTORY, dataset_of

DRIFT_BLOCKS = 20


@dataclass(frozen=True)
class Subproblem:
    """Work on one subproblem, summed over a run."""

    solves: int
    skipped: int
    iterations: int
    fallbacks: int
    solve_time: float
    overhead_time: float


@dataclass(frozen=True)
class Summary:
    """The numbers a run is judged by.

    Attributes
    ----------
    outcome : str
        ``complete``, or why the run stopped.
    rows : int
        Recorded rows.
    duration : float
        Time simulated, in the scene's unit.
    energy : float
        Initial H.
    energy_low, energy_high : float
        Smallest and largest H - H(0).
    drift, drift_error : float
        Slope of H over time and its standard error, see `drift`; nan for runs too short to tell.
    momentum_errors : dict
        Largest |J - J(0)| of each conserved component of linear (``p_x``) and angular (``L_z``) momentum.
    gap_min, equality_residual : float
        Worst gap and bilateral residual of all rows, nan without such constraints.
    subproblems : dict
        `Subproblem` by name.
    wall_time, solver_time, overhead_time : float
        Seconds: in total, inside solvers, and in handing problems to them.
    """

    outcome: str
    rows: int
    duration: float
    energy: float
    energy_low: float
    energy_high: float
    drift: float
    drift_error: float
    momentum_errors: dict[str, float]
    gap_min: float
    equality_residual: float
    subproblems: dict[str, Subproblem]
    wall_time: float
    solver_time: float
    overhead_time: float

    @property
    def rest_time(self) -> float:
        """Seconds spent neither in solvers nor in handing problems to them: mechanics, recording, Python."""
        return self.wall_time - self.solver_time - self.overhead_time


def summarize(run: xr.DataTree) -> Summary:
    """Sum up a run from `deli.simulate` or `deli.open_run`."""
    trajectory, stats = dataset_of(run, TRAJECTORY), dataset_of(run, STATS)
    time, energy = trajectory["time"].values, trajectory["hamiltonian"].values
    subproblems = {str(name): _subproblem(stats, str(name)) for name in stats["subproblem"].values}
    slope, error = drift(time, energy)
    return Summary(
        outcome=run.attrs["outcome"],
        rows=len(time),
        duration=float(time[-1]),
        energy=float(energy[0]),
        energy_low=float((energy - energy[0]).min()),
        energy_high=float((energy - energy[0]).max()),
        drift=slope,
        drift_error=error,
        momentum_errors=momentum_errors(run),
        gap_min=float(trajectory["gap_min"].min()),
        equality_residual=float(trajectory["equality_residual"].max()),
        subproblems=subproblems,
        wall_time=float(run.attrs.get("wall_time", np.nan)),
        solver_time=sum(entry.solve_time for entry in subproblems.values()),
        overhead_time=sum(entry.overhead_time for entry in subproblems.values()),
    )


def drift(time: np.ndarray, energy: np.ndarray) -> tuple[float, float]:
    """Slope of the energy over time and its standard error.

    The energy of a symplectic method oscillates, so neighbouring rows are far from independent; the line is fitted
    to the means of `DRIFT_BLOCKS` blocks and the error comes from their scatter. An error as large as the slope means
    that no drift is seen.

    Returns
    -------
    slope, error : float
        In units of energy by time; nan where there are fewer than two rows a block.
    """
    if len(time) < 2 * DRIFT_BLOCKS:
        return float("nan"), float("nan")
    t = np.array([block.mean() for block in np.array_split(time, DRIFT_BLOCKS)])
    e = np.array([block.mean() for block in np.array_split(energy - energy[0], DRIFT_BLOCKS)])
    centred = t - t.mean()
    spread = centred @ centred
    slope = centred @ e / spread
    residual = e - e.mean() - slope * centred
    return float(slope), float(np.sqrt(residual @ residual / (DRIFT_BLOCKS - 2) / spread))


def momentum_errors(run: xr.DataTree) -> dict[str, float]:
    """Largest deviation from the initial value of each momentum component that the scene conserves."""
    return {
        name: float(np.abs(values - values[0]).max())
        for name, values in momentum_components(run, conserved=True).items()
    }


def momentum_components(run: xr.DataTree, conserved: bool) -> dict[str, np.ndarray]:
    """Components of linear and angular momentum over time, by name such as ``p_x`` and ``L_z``.

    Parameters
    ----------
    run : xarray.DataTree
    conserved : bool
        Whether to return those that the scene conserves, or those that it does not.
    """
    trajectory = dataset_of(run, TRAJECTORY)
    found: dict[str, np.ndarray] = {}
    for kind, symbol in (("linear", "p"), ("angular", "L")):
        if f"{kind}_momentum" not in trajectory:
            continue
        values = trajectory[f"{kind}_momentum"]
        axes = [str(axis) for axis in values["axis"].values] if values.ndim == 2 else ["z"]
        kept = run.attrs[f"conserved_{kind}_momentum"].split()
        columns = values.values.reshape(len(values), len(axes))
        for index, axis in enumerate(axes):
            if (axis in kept) == conserved:
                found[f"{symbol}_{axis}"] = columns[:, index]
    return found


def _subproblem(stats: xr.Dataset, name: str) -> Subproblem:
    sums = stats.sel(subproblem=name).sum()
    return Subproblem(
        solves=int(sums["solves"]),
        skipped=int(sums["skipped"]),
        iterations=int(sums["iterations"]),
        fallbacks=int(sums["fallbacks"]),
        solve_time=float(sums["solve_time"]),
        overhead_time=float(sums["overhead_time"]),
    )
