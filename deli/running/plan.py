"""The plan of a run, checked before anything is computed."""

import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deli.errors import InputError
from deli.integrators.integrator import Integrator
from deli.mechanics.scene import Scene
from deli.memory import require_disk, require_memory
from deli.recording import provenance
from deli.recording.paths import check_output
from deli.recording.schema import Schema
from deli.subproblems.collector import MOST

DURATION_TOLERANCE = 1e-9
LARGEST_STEP = 1e150
"""Bound on the size of a step, because steps need its square."""
MOST_STEPS = 2**53
"""Numbers of steps up to here are exact as floats; at a microsecond each they take 285 years."""


@dataclass(frozen=True)
class Plan:
    """A checked run; `deli.simulate` explains each field."""

    scene: Scene
    method: Integrator
    step_size: float
    steps: int
    solvers: Any
    every: int
    skip: bool
    contact_tolerance: float
    output: Path | None
    resume: bool
    overwrite: bool
    subproblems: int

    @property
    def rows(self) -> int:
        """Number of rows of the finished run: the initial state, every `every`-th step, and always the last step."""
        return 1 - (-self.steps // self.every)

    @property
    def size(self) -> int:
        """Size of all rows in bytes."""
        return self.rows * Schema(self.scene.dof, self.scene.dimension, self.memory).row_bytes

    def step_of(self, row: int) -> int:
        """Return the number of integration steps taken at a row."""
        return min(row * self.every, self.steps)

    def ends(self, row: int) -> Iterator[int]:
        """Return the step numbers at the rows that follow `row`."""
        return (self.step_of(later) for later in range(row + 1, self.rows))

    def config(self) -> dict[str, Any]:
        """Return the run as a config, with every default spelled out."""
        return provenance.describe(
            self.scene,
            self.method,
            step_size=self.step_size,
            steps=self.steps,
            skip=self.skip,
            contact_tolerance=self.contact_tolerance,
            solvers=self.solvers,
            every=self.every,
            subproblems=self.subproblems,
        )

    @property
    def memory(self) -> tuple[str, ...]:
        """Names of the recorded quantities besides q and p that the method carries from step to step."""
        return self.method.MEMORY

    def stepper(self, scene: Scene | None = None) -> Any:
        """Return a new stepper of the method, for the plan's scene or another."""
        return self.method.stepper(
            scene or self.scene,
            self.step_size,
            solvers=self.solvers,
            skip=self.skip,
            contact_tolerance=self.contact_tolerance,
        )


def make_plan(
    scene: Scene,
    method: Any,
    *,
    step_size: float,
    steps: int | None = None,
    duration: float | None = None,
    solvers: Any = "auto",
    output: Any = None,
    every: int = 1,
    skip: bool = True,
    resume: bool = False,
    contact_tolerance: float = 1e-8,
    overwrite: bool = False,
    subproblems: bool | int = False,
) -> Plan:
    """Check the arguments of `deli.simulate`, and return them as a plan.

    Raises
    ------
    InputError
        For the first argument that is not allowed; nothing has been computed or written then.
    """
    if not isinstance(scene, Scene):
        raise InputError(f"scene is {scene!r}; expected a deli.Scene, such as deli.scenes.point_mass().")
    if not isinstance(method, Integrator):
        raise InputError(f"method is {method!r}; expected a method's instance, such as deli.GVI().")
    size = _positive("step_size", step_size)
    if size > LARGEST_STEP:
        raise InputError(f"step_size is {size!r}; allowed: at most {LARGEST_STEP:g}.")
    for name, flag in (("skip", skip), ("resume", resume), ("overwrite", overwrite)):
        if not isinstance(flag, bool):
            raise InputError(f"{name} is {flag!r}; allowed: True or False.")
    if output is None and resume:
        raise InputError("resume is set, but there is no output to resume; name the file with output=.")
    target = None if output is None else Path(output)
    if target is not None:
        check_output(target, resume=resume, overwrite=overwrite)
    plan = Plan(
        scene=scene,
        method=method,
        step_size=size,
        steps=_count_steps(size, steps, duration),
        solvers=solvers,
        every=_count("every", every),
        skip=skip,
        contact_tolerance=_positive("contact_tolerance", contact_tolerance),
        output=target,
        resume=resume,
        overwrite=overwrite,
        subproblems=_most(subproblems),
    )
    _require_room(plan)
    return plan


def _require_room(plan: Plan) -> None:
    """Refuse rows that do not fit into memory, where a finished run is read, or onto the disk."""
    system = f"{plan.scene.dof:,} degrees of freedom"
    what = f"steps {plan.steps:,} and every {plan.every:,} make {plan.rows:,} rows of {system}"
    remedy = "record fewer (a larger record.every), or take fewer steps"
    in_memory = plan.size if plan.output is not None else 2 * plan.size  # blocks of rows, and then the whole
    require_memory(what, in_memory, remedy)
    if plan.output is not None:
        require_disk(what, plan.size, plan.output.resolve().parent, remedy)


def _count_steps(step_size: float, steps: int | None, duration: float | None) -> int:
    if (steps is None) == (duration is None):
        found = "neither" if steps is None else f"both (steps={steps!r}, duration={duration!r})"
        raise InputError(f"found {found} of steps and duration; give exactly one.")
    if duration is None:
        return _count("steps", steps)
    length = _positive("duration", duration)
    if not length / step_size <= MOST_STEPS:
        raise InputError(
            f"duration {length!r} takes {length / step_size:.3g} steps of step_size {step_size!r}; allowed: at most "
            f"{MOST_STEPS:,}."
        )
    nearest = round(length / step_size)
    if nearest < 1 or abs(nearest * step_size - length) > DURATION_TOLERANCE * length:
        below = math.floor(length / step_size)
        allowed = [f"{count * step_size:.12g} ({count} steps)" for count in (below, below + 1) if count >= 1]
        raise InputError(
            f"duration {length!r} is not a multiple of step_size {step_size!r}; the nearest allowed values are "
            f"{' and '.join(allowed)}."
        )
    return nearest


def _most(subproblems: Any) -> int:
    """Return the largest number of subproblems to record."""
    if isinstance(subproblems, bool):
        return MOST if subproblems else 0
    try:
        return _count("subproblems", subproblems)
    except InputError as error:
        raise InputError(
            f"subproblems is {subproblems!r}; allowed: True ({MOST:,} at most), False, or a whole number >= 1."
        ) from error


def _positive(name: str, value: Any) -> float:
    try:
        number = float("nan") if isinstance(value, bool | str) else float(value)
    except (TypeError, ValueError):
        number = float("nan")
    if not (math.isfinite(number) and number > 0):
        raise InputError(f"{name} is {value!r}; allowed: a finite number > 0.")
    return number


def _count(name: str, value: Any) -> int:
    try:
        number = 0 if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = 0
    if not 1 <= number <= MOST_STEPS:
        raise InputError(f"{name} is {value!r}; allowed: a whole number from 1 to {MOST_STEPS:,}.")
    return number
