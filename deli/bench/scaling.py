"""The cost of a step by the number of bodies, each case in a process of its own."""

import json
import math
import subprocess
import sys

import numpy as np

from deli.bench.part import Column, Measure, Part, Row

FULL = {
    "hard_sphere_gas": (100, 1000, 10_000, 100_000),
    "hard_rods": (100, 1000, 10_000),
    "granular_chain": (100, 1000, 10_000),
    "chain_on_cylinder": (100, 1000, 10_000),
    "disc_pile": (100, 1000, 10_000),
}
QUICK = {"hard_sphere_gas": (100, 1000), "hard_rods": (100, 1000), "granular_chain": (100,), "disc_pile": (100,)}
LIMIT, QUICK_LIMIT = 60.0, 10.0  # seconds a case may take
BUDGET, QUICK_BUDGET = 15.0, 1.0  # seconds that the steps of a case take
_TINY = 4
_LEAST_MEMORY = 4e6  # bytes above those of a tiny case that tell


def _cases(quick: bool) -> list[tuple[str, Measure]]:
    sizes, limit, budget = (QUICK, QUICK_LIMIT, QUICK_BUDGET) if quick else (FULL, LIMIT, BUDGET)
    return [
        (f"{scene}, {bodies}", lambda s=scene, n=bodies: [_case(s, n, limit, budget)])  # type: ignore[misc]
        for scene, numbers in sizes.items()
        for bodies in numbers
    ]


def _case(scene: str, bodies: int, limit: float, budget: float) -> Row:
    row: Row = {"scene": scene, "bodies": bodies}
    try:
        found = _child(scene, bodies, limit, budget)
        if "failed" not in found:
            tiny = _child(scene, _TINY, limit, 0.0)
            more = found["peak"] - tiny.get("peak", math.nan)
            found["bytes_per_body"] = more / found["simulated"] if more > _LEAST_MEMORY else None
    except subprocess.TimeoutExpired:
        found = {"failed": f"not done after {limit:.0f} s"}
    return row | found


def _child(scene: str, bodies: int, limit: float, budget: float) -> Row:
    command = [sys.executable, "-m", "deli.bench.scaling_case", scene, str(bodies), str(budget)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
    if done.returncode:
        lines = done.stderr.strip().splitlines()
        return {"failed": lines[-1] if lines else f"ended with status {done.returncode}"}
    row: Row = json.loads(done.stdout)
    return row


def _finish(rows: list[Row]) -> None:
    """Add the exponent of the cost in the number of bodies to the last row of each scene."""
    for scene in dict.fromkeys(row["scene"] for row in rows):
        good = [row for row in rows if row["scene"] == scene and row.get("us_per_step")]
        if len(good) > 1:
            sizes, costs = (np.log([row[name] for row in good]) for name in ("simulated", "us_per_step"))
            good[-1]["exponent"] = float(np.polyfit(sizes, costs, 1)[0])


PART = Part(
    name="scaling",
    title="cost of a step of N bodies, every 10th recorded",
    keys=("scene", "bodies"),
    columns=(
        Column("scene", "scene"),
        Column("bodies", "N", "d"),
        Column("us_per_step", "µs a step", ".0f", compared=True),
        Column("us_per_body", "a body", ".2f"),
        Column("exponent", "exponent", ".2f"),
        Column("steps", "steps"),
        Column("bytes_per_body", "B a body", ".0f"),
    ),
    more=(
        Column("share_search", "search", ".0%"),
        Column("share_kernels", "kernels", ".0%"),
        Column("share_solves", "solves", ".0%"),
        Column("share_recording", "rows", ".0%"),
        Column("energy_error", "ΔH/H", ".0e"),
        Column("momentum_error", "Δp/Σ|p|", ".0e"),
        Column("gap_min", "worst gap", ".0e"),
    ),
    cases=_cases,
    finish=_finish,
)
