"""Tables that commands print."""

import math

from rich.console import Console
from rich.table import Table
from rich.text import Text

from deli.recording import provenance
from deli.recording.paths import partial_path
from deli.running.plan import Plan
from deli.summary import Summary


def print_plan(console: Console, plan: Plan) -> None:
    """Say what a plan would do."""
    config = plan.config()
    plan.stepper()
    console.print(f"Would run: {provenance.title(config)}", markup=False, soft_wrap=True)
    table = Table(show_header=False)
    for key, value in provenance.flatten(config).items():
        _add(table, key, _literal(value))
    _add(table, "duration", f"{plan.steps * plan.step_size:.9g}")
    _add(table, "rows", f"{plan.rows:,} (about {_size(plan)})")
    _add(table, "output", "none" if plan.output is None else str(plan.output))
    if plan.output is not None and plan.resume:
        _add(table, "resume", _resumption(plan))
    console.print(table)


def print_summary(console: Console, title: str, summary: Summary) -> None:
    """Print what a run amounts to."""
    console.print(title, markup=False, soft_wrap=True)
    table = Table(show_header=False)
    _add(table, "outcome", summary.outcome)
    _add(table, "rows", f"{summary.rows:,} over time {summary.duration:.9g}")
    _add(table, "energy H(0)", f"{summary.energy:.9g}")
    _add(table, "energy error", f"{summary.energy_low:+.2e} … {summary.energy_high:+.2e}")
    if not math.isnan(summary.drift):
        _add(table, "energy drift", f"{summary.drift:+.1e} ± {summary.drift_error:.0e} a unit of time")
    errors = ", ".join(f"{name} {error:.1e}" for name, error in summary.momentum_errors.items())
    _add(table, "momentum error", errors or "no component is conserved in this scene")
    if not math.isnan(summary.gap_min):
        _add(table, "worst gap", f"{summary.gap_min:+.2e}")
    if not math.isnan(summary.equality_residual):
        _add(table, "equality residual", f"{summary.equality_residual:.2e}")
    for name, work in summary.subproblems.items():
        text = f"{work.solves:,} solves, {work.skipped:,} skipped, {work.iterations:,} iterations"
        _add(table, name, text + (f", {work.fallbacks:,} fallbacks" if work.fallbacks else ""))
    times = (
        f"{summary.solver_time:.3g} s solver, {summary.overhead_time:.3g} s overhead, {summary.rest_time:.3g} s rest"
    )
    _add(table, "time", f"{times}; {summary.wall_time:.3g} s in all")
    console.print(table)


def _add(table: Table, *cells: str) -> None:
    table.add_row(*(Text(cell) for cell in cells))  # as it is: a message may hold what looks like markup


def _literal(value: object) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _size(plan: Plan) -> str:
    a_row = 8 * (2 * plan.scene.dof + 12) + 3 * 81
    size = plan.rows * a_row / 1e6
    return f"{size:.1f} MB" if size < 1e3 else f"{size / 1e3:.1f} GB"


def _resumption(plan: Plan) -> str:
    if plan.output is not None and plan.output.exists():
        return "nothing to do: the run is finished"
    return "continues" if plan.output is not None and partial_path(plan.output).exists() else "starts anew"
