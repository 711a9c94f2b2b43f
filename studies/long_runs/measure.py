"""Long runs: drift of the energy, growth of memory, slow-down of steps, and readings of the growing file.

    python studies/long_runs/measure.py [RUN ...] [--quick] [-o long_runs.json]

gain          drift of the energy over the whole run, in shares of its band, with its standard error
memory        growth of the process's memory after the first tenth of the steps
slow-down     processor time of a step in the last third of the run over that in the first
reads         number of readings of the growing file by another process, and of readings between two writes
"""

import argparse
import json
import multiprocessing
import tempfile
import time
from concurrent.futures import Future, ProcessPoolExecutor
from pathlib import Path

import numpy as np
import psutil
from rich import box
from rich.console import Console
from rich.progress import track
from rich.table import Table

import deli
from deli import metrics
from deli.config import parse
from deli.errors import InputError
from deli.recording.paths import partial_path
from deli.simulation import run_plan

QUICK = 10  # divisor of the numbers of steps
PAUSE_SECONDS = 0.2
# Rows are recorded at intervals that do not fall in step with the motion.
RUNS = {
    f"{scene['name']} {' '.join(method.values())}".strip(): {
        "scene": scene,
        "method": {"name": "gvi", **method},
        "steps": steps,
        "record": {"every": every},
    }
    for scene, steps, every, methods in (
        ({"name": "pogo_stick"}, 10_000_000, 997, ({}, {"energy": "numerical"}, {"predictor": "closed_loop"})),
        ({"name": "newtons_cradle"}, 1_000_000, 97, ({}, {"predictor": "closed_loop"})),
        ({"name": "nonlinear_oscillator"}, 1_000_000, 97, ({}, {"energy": "numerical"})),
        ({"name": "lennard_jones"}, 200_000, 19, ({}, {"energy": "numerical"}, {"energy": "shadow6"})),
    )
    for method in methods
}


def carry_out(name: str, steps: int, output: Path) -> list[tuple[int, float, int]]:
    """Run; return steps taken, processor seconds and bytes of memory at intervals."""
    samples, process = [], psutil.Process()
    plan = parse(RUNS[name] | {"steps": steps}).plan(output)
    run_plan(plan, lambda step: samples.append((step, time.process_time(), process.memory_info().rss)))
    return samples


def watch(running: Future, output: Path) -> tuple[list[np.ndarray], int]:
    """Read the growing file until the run ends; return the energies read, and the number of failed readings."""
    read, torn = [], 0
    while not running.done():
        time.sleep(PAUSE_SECONDS)
        if partial_path(output).exists():
            try:
                read.append(deli.open_run(partial_path(output))["trajectory"]["hamiltonian"].values)
            except InputError:  # the file was copied in the middle of a write, or has just got its name
                torn += 1
    return read, torn


def measure(name: str, quick: bool, folder: Path) -> dict[str, object]:
    steps, output = RUNS[name]["steps"] // (QUICK if quick else 1), folder / "run.nc"
    output.unlink(missing_ok=True)
    # A process of its own, so that no other work has grown its memory.
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), max_tasks_per_child=1) as pool:
        running = pool.submit(carry_out, name, steps, output)
        read, torn = watch(running, output)
        samples = np.array(running.result())
    run = deli.open_run(output)
    found, energy = metrics.measure(run), run["trajectory"]["hamiltonian"].values
    length = float(run["trajectory"]["time"][-1])
    low, high = metrics.energy_range(run)
    taken, spent, memory = samples.T
    settled = memory[taken >= 0.1 * steps]
    thirds = np.diff(np.interp(np.linspace(taken[0], taken[-1], 4), taken, spent))
    return {
        "run": name,
        "steps": steps,
        "outcome": run.attrs["outcome"],
        "energy": [low, high],
        "gain": float(found["energy_drift"]) * length / (high - low),
        "gain_error": float(found["energy_drift_error"]) * length / (high - low),
        "worst_gap": float(run["trajectory"]["gap_min"].min()),
        "equality_residual": float(np.nan_to_num(run["trajectory"]["equality_residual"].values).max()),
        "memory_growth_percent": 100.0 * float(settled.max() / settled[0] - 1.0),
        "memory_MB": float(memory.max() / 1e6),
        "slow_down": float(thirds[-1] / thirds[0]),
        "seconds": float(spent[-1] - spent[0]),
        "reads": len(read),
        "reads_between_writes": torn,
        "reads_that_differ": sum(not np.array_equal(part, energy[: len(part)]) for part in read),
    }


def table_of(rows: list[dict[str, object]]) -> Table:
    table = Table(box=box.SIMPLE)
    for column in ("run", "steps", "H - H(0)", "gain / band", "worst gap", "memory", "slow-down", "reads", "outcome"):
        table.add_column(column)
    for row in rows:
        low, high = row["energy"]
        table.add_row(
            row["run"],
            f"{row['steps']:.0e}",
            f"{low:+.3g} … {high:+.3g}",
            f"{row['gain']:+.2f} ± {row['gain_error']:.2f}",
            f"{row['worst_gap']:.1e}",
            f"{row['memory_growth_percent']:+.2f} % of {row['memory_MB']:.0f} MB",
            f"{row['slow_down']:.2f}",
            f"{row['reads']}, {row['reads_between_writes']} between writes, {row['reads_that_differ']} differ",
            row["outcome"],
        )
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", nargs="*", default=list(RUNS), metavar="RUN", help=", ".join(map(repr, RUNS)))
    parser.add_argument("--quick", action="store_true", help=f"a {QUICK}th of the steps")
    parser.add_argument("-o", "--output", type=Path, help="write the figures as JSON")
    options = parser.parse_args()
    unknown = [name for name in options.run if name not in RUNS]
    if unknown:
        parser.error(f"run {unknown[0]!r} is unknown; choose from {', '.join(map(repr, RUNS))}")
    with tempfile.TemporaryDirectory() as folder:
        console = Console(stderr=True)
        rows = [measure(name, options.quick, Path(folder)) for name in track(options.run, console=console)]
    Console(width=200).print(table_of(rows))
    if options.output:
        options.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
