"""The tables that commands print."""

import math
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

from deli.memory import in_words
from deli.numerals import numeral
from deli.recording import provenance
from deli.recording.paths import partial_path
from deli.recording.schema import STATS, TRAJECTORY, dataset_of
from deli.running.plan import Plan

if TYPE_CHECKING:
    import xarray as xr


def print_plan(console: Console, plan: Plan) -> None:
    """Print the run that a plan describes."""
    config = plan.config()
    plan.stepper()
    console.print(f"Would run: {provenance.title(config)}", markup=False, soft_wrap=True)
    table = Table(show_header=False)
    for key, value in provenance.flatten(config).items():
        _add(table, key, _literal(value))
    _add(table, "duration", f"{plan.steps * plan.step_size:.9g}")
    _add(table, "rows", f"{plan.rows:,} (about {in_words(plan.size)})")
    _add(table, "output", "none" if plan.output is None else str(plan.output))
    if plan.output is not None and plan.resume:
        _add(table, "resume", _resumption(plan))
    console.print(table)


def print_summary(console: Console, run: "xr.DataTree") -> None:
    """Print a summary of a run."""
    from deli import metrics

    trajectory, stats = dataset_of(run, TRAJECTORY), dataset_of(run, STATS)
    measured = metrics.measure(run)
    found = {name: value.item() for name, value in measured.items()}
    console.print(run.attrs["title"], markup=False, soft_wrap=True)
    table = Table(show_header=False)
    _add(table, "outcome", run.attrs["outcome"])
    _add(table, "rows", f"{trajectory.sizes['time']:,} over time {float(trajectory['time'][-1]):.9g}")
    _add(table, "energy H(0)", f"{float(trajectory['hamiltonian'][0]):.9g}")
    _add(table, "energy error", f"{found['energy_low']:+.2e} … {found['energy_high']:+.2e}")
    if not math.isnan(found["energy_drift"]):
        _add(
            table, "energy drift", f"{found['energy_drift']:+.1e} ± {found['energy_drift_error']:.0e} per unit of time"
        )
    errors = [f"{name} {error:.1e}" for name, error in metrics.momentum_errors(run).items()]
    errors += [f"{name}: unknown whether this scene conserves it" for name in metrics.undecided_momenta(run)]
    _add(table, "momentum error", ", ".join(errors) or "no component is conserved in this scene")
    if not math.isnan(found["violation_worst"]):
        _add(table, "smallest gap", f"{float(trajectory['gap_min'].min()):+.2e}")
    if not math.isnan(found["equality_residual"]):
        _add(table, "equality residual", f"{found['equality_residual']:.2e}")
    sums = stats[["solves", "skipped", "iterations", "fallbacks"]].sum("step")
    for name in sums["subproblem"].values:
        work = {key: int(value) for key, value in sums.sel(subproblem=name).data_vars.items()}
        text = f"{work['solves']:,} solves, {work['skipped']:,} skipped, {work['iterations']:,} iterations"
        _add(table, str(name), text + (f", {work['fallbacks']:,} fallbacks" if work["fallbacks"] else ""))
    if "note" in measured.attrs:
        _add(table, "note", measured.attrs["note"])
    rest = found["wall_time"] - found["solver_time"] - found["overhead_time"]
    times = f"{found['solver_time']:.3g} s solver, {found['overhead_time']:.3g} s overhead, {rest:.3g} s rest"
    _add(table, "time", f"{times}; {found['wall_time']:.3g} s in all")
    console.print(table)


def _add(table: Table, *cells: str) -> None:
    table.add_row(*(Text(cell) for cell in cells))  # literally, because a message may look like markup


def _literal(value: object) -> str:
    return numeral(value, 9) if isinstance(value, float) else str(value)


def _resumption(plan: Plan) -> str:
    if plan.output is not None and plan.output.exists():
        return "nothing to do: the run is finished"
    return "continues" if plan.output is not None and partial_path(plan.output).exists() else "starts anew"
