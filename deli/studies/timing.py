"""CPU time of a case's steps, and of their recording."""

import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from deli.running.plan import Plan

TIMES = {
    "cpu_time": ("s", "CPU time of the steps, with nothing recorded"),
    "recording_time": ("s", "CPU time of the recorded run beyond that of the steps"),
}
"""Units and long name of each time of a case whose study has ``time_steps``."""
LEAST_SECONDS = 0.1
"""The CPU time that ends the repetitions: thousands of ticks of the clock, and many interruptions."""


def time_run(plan: Plan) -> dict[str, float]:
    """Measure the CPU time of a plan's steps without recording, and the CPU time that recording adds.

    Both runs are repeated until they have taken `LEAST_SECONDS`, and the least time of each counts, because
    disturbances of a process only add to its time. Binding the scene, compiling and making solvers are not timed.

    Parameters
    ----------
    plan : Plan
        Plan of a run that ends; it is carried out at least once without and once with recording.

    Returns
    -------
    dict
        Seconds by the names in `TIMES`.

    Raises
    ------
    StepError
        If a step fails.
    """
    from deli.simulation import run_plan

    stepping = _least_seconds(_stepping(plan))
    with tempfile.TemporaryDirectory() as folder:
        recorded = replace(plan, output=Path(folder, "run.nc"), resume=False, overwrite=True)
        recording = _least_seconds(lambda: run_plan(recorded))
    return {"cpu_time": stepping, "recording_time": recording - stepping}


def _stepping(plan: Plan) -> Callable[[], None]:
    """Return a function that takes all steps of a plan, and stores the last state alone."""
    from deli.kernels.advance import make_block

    scene, stepper = plan.scene, plan.stepper()
    block = make_block(1, scene.dof, scene.dimension, len(plan.memory))
    progress = block.fields.progress

    def take() -> None:
        progress[:] = 0
        stepper.place(scene.position, scene.momentum)
        while progress[0] < plan.steps:
            error = stepper.advance(block, plan.steps, plan.steps, float("inf"))
            if error is not None:
                raise error

    return take


def _least_seconds(run: Callable[[], object]) -> float:
    least, spent = float("inf"), 0.0
    while spent < LEAST_SECONDS:
        began = time.process_time()
        run()
        seconds = time.process_time() - began
        least, spent = min(least, seconds), spent + seconds
    return least
