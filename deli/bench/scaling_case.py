"""One case of `deli.bench.scaling`, in a process of its own: ``python -m deli.bench.scaling_case SCENE N SECONDS``."""

import json
import sys
import time
from typing import Any

import numpy as np

import deli
from deli.bench.part import Row
from deli.kernels.advance import make_block
from deli.mechanics.scene import Scene
from deli.scenes.registry import defaults, get

EVERY, MOST_STEPS, WARM_UP = 10, 2000, 3
_NUMBER = {
    "hard_sphere_gas": "spheres",
    "hard_rods": "rods",
    "granular_chain": "beads",
    "chain_on_cylinder": "masses",
}


def build(name: str, bodies: int) -> Scene:
    """Return a scene of about the given number of bodies."""
    if name == "disc_pile":
        side = max(2, round(bodies**0.5))
        return get(name)(rows=side, columns=side)
    return get(name)(**{_NUMBER[name]: bodies})


def measure(name: str, bodies: int, seconds: float) -> Row:
    """Return the row of one case.

    Parameters
    ----------
    name : str
        Name of the scene.
    bodies : int
    seconds : float
        Time after which no further step is taken.
    """
    scene, usual = build(name, bodies), defaults(name)
    step_size = usual["step_size"]
    if name == "chain_on_cylinder":  # rods get shorter as there are more, and a step must not turn one by much
        step_size *= min(1.0, 100.0 / bodies)
    stepper: Any = deli.GVI(scheme=usual["scheme"]).stepper(scene, step_size)
    block = make_block(MOST_STEPS // EVERY + 4, scene.dof, scene.dimension)
    progress = block.fields.progress
    stepper.place(scene.position, scene.momentum)
    stepper.record(block)
    error = stepper.advance(block, WARM_UP, EVERY, time.monotonic() + seconds)
    warmed = int(progress[0])
    searched_before, solved_before = stepper.search_seconds, _solver_seconds(block, stepper)
    began = time.perf_counter()
    if error is None and seconds > 0.0:
        error = stepper.advance(block, MOST_STEPS, EVERY, time.monotonic() + seconds)
    elapsed = time.perf_counter() - began
    searched, solved = stepper.search_seconds - searched_before, _solver_seconds(block, stepper) - solved_before
    steps = int(progress[0]) - warmed
    import resource  # of POSIX systems

    peak = 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024.0 if sys.platform == "darwin" else 1.0)
    if error is not None:
        return {"failed": f"step {int(progress[0]) + 1}: {error}", "simulated": scene.bodies}
    row: Row = {"simulated": scene.bodies, "peak": peak, "steps": steps}
    if steps == 0:
        return row
    stepper.record(block)  # the last state counts for the errors, whatever its number
    rows = int(progress[1])
    # Timed by itself, it can come out longer than what there is where a run takes microseconds.
    recording = min(_recording_seconds(stepper, scene) * (steps // EVERY), max(0.0, elapsed - searched - solved))
    shares = {"search": searched, "solves": solved, "recording": recording}
    row |= {f"share_{part}": value / elapsed for part, value in shares.items()}
    row["share_kernels"] = max(0.0, 1.0 - sum(shares.values()) / elapsed)
    row |= {"us_per_step": 1e6 * elapsed / steps, "us_per_body": 1e6 * elapsed / steps / scene.bodies}
    return row | _errors(scene, block.fields.diagnostics[:rows], block.fields.momentum[:rows])


def _solver_seconds(block: Any, stepper: Any) -> float:
    rows = int(block.fields.progress[1])
    return float(block.fields.times[:rows].sum() + stepper.stats.tally.times.sum())


def _recording_seconds(stepper: Any, scene: Scene) -> float:
    """Return the seconds to write a row, including the evaluation of gaps."""
    scratch, times = make_block(5, scene.dof, scene.dimension), []
    for _ in range(5):
        began = time.perf_counter()
        stepper.record(scratch)
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def _errors(scene: Scene, diagnostics: np.ndarray, momentum: np.ndarray) -> Row:
    """Return the largest errors of all rows; errors of energy and momentum are relative to their magnitudes."""
    energy = diagnostics[:, 0] + diagnostics[:, 1]
    size = max(abs(energy[0]), float(diagnostics[:, 0].max()))
    kept = np.flatnonzero(np.array(scene.symmetry.linear, dtype=bool))
    row: Row = {"energy_error": float(np.abs(energy - energy[0]).max()) / size}
    if kept.size:
        total = diagnostics[:, 4 + kept]
        row["momentum_error"] = float(np.abs(total - total[0]).max() / np.abs(momentum).sum(axis=1).max())
    row["gap_min"] = float(diagnostics[:, 2].min())
    return row


if __name__ == "__main__":
    print(json.dumps(measure(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))))
