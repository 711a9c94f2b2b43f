"""The timing of steps as a run takes them: many at once, with rows recorded and passed on."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import deli
from deli.mechanics.scene import Scene
from deli.recording.recorder import Recorder
from deli.running.plan import make_plan
from deli.running.session import REFRESH_SECONDS
from deli.scenes.registry import defaults, get

EVERY = 10
_CALIBRATION_SECONDS = 0.02


@dataclass(frozen=True)
class Case:
    """A scene with its parameters, to be stepped.

    Parameters
    ----------
    label : str
    scene : str
        A scene's name; it runs with its own step size and scheme.
    parameters : mapping
        Parameters of the scene.
    build : callable, optional
        Function that makes the scene in place of the registered one.
    """

    label: str
    scene: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    build: Callable[[], Scene] | None = None

    def runner(self, **keywords: Any) -> "Runner":
        """Return a runner with keywords of `deli.simulate`."""
        usual = defaults(self.scene)
        scene = get(self.scene)(**self.parameters) if self.build is None else self.build()
        return Runner(scene, deli.GVI(scheme=usual["scheme"]), usual["step_size"], **keywords)


SCENES = (
    Case("ball in flight", "point_mass", {"position": 1e12}),
    Case("ball bouncing", "point_mass"),
    Case("pogo_stick in flight", "pogo_stick", {"gravity": 0.0}),
    Case("pogo_stick", "pogo_stick"),
    Case("newtons_cradle, 3 balls", "newtons_cradle", {"balls": 3, "pulled": 1}),
    Case("newtons_cradle, 5 balls", "newtons_cradle"),
    Case("hard_rods, 10 rods", "hard_rods"),
    Case("lennard_jones", "lennard_jones"),
    Case("spring_sphere, smooth", "spring_sphere", {"start": "smooth"}),
    Case("spring_sphere, mixed", "spring_sphere", {"start": "mixed"}),
    Case("nonlinear_oscillator", "nonlinear_oscillator"),
)


class Counter:
    """A recorder that drops rows and sums up their costs.

    Attributes
    ----------
    solves : int
    solving, touching : int
        Number of rows with a solve, and with a contact.
    solver_seconds, overhead_seconds : float
        Time inside solvers, and time to pass data to them.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Set all sums to zero."""
        self.solves = self.solving = self.touching = 0
        self.solver_seconds = self.overhead_seconds = 0.0

    def write(
        self, first_row: int, trajectory: Mapping[str, Any], stats: Mapping[str, Any], problems: Any = None
    ) -> None:
        """Count rows, and drop them."""
        solves = stats["solves"].sum(axis=1)
        self.solves += int(solves.sum())
        self.solving += int((solves > 0).sum())
        self.touching += int(((trajectory["smooth_contacts"] > 0) | (trajectory["reflected_contacts"] > 0)).sum())
        self.solver_seconds += float(stats["solve_time"].sum())
        self.overhead_seconds += float(stats["overhead_time"].sum())


class Runner:
    """A run of a scene without a file.

    Parameters
    ----------
    scene : Scene
    method : deli.GVI, ...
    step_size : float
    **keywords
        Keywords of `deli.simulate`.
    """

    def __init__(self, scene: Scene, method: Any, step_size: float, **keywords: Any) -> None:
        self.stepper = make_plan(scene, method, step_size=step_size, steps=1, **keywords).stepper()
        self.counter = Counter()
        self._recorder = Recorder(scene, step_size, self.counter, memory=method.MEMORY)
        self.place(scene.position, scene.momentum)
        self.stepper.record(self._recorder.block)
        self._recorder.flush()

    @property
    def state(self) -> tuple[np.ndarray, ...]:
        """A copy of the stepper's state."""
        return tuple(part.copy() for part in self.stepper.state)

    def place(self, *state: np.ndarray) -> None:
        """Continue from the given state."""
        self.stepper.place(*state)

    def run(self, steps: int, every: int = EVERY) -> float:
        """Take steps; return their time in seconds.

        Raises
        ------
        StepError
            If a step fails.
        """
        progress = self._recorder.block.fields.progress
        progress[0] = 0
        began = time.perf_counter()
        while progress[0] < steps:
            error = self.stepper.advance(self._recorder.block, steps, every, time.monotonic() + REFRESH_SECONDS)
            if error is not None:
                raise error
            if self._recorder.full:
                self._recorder.flush()
        self._recorder.flush()
        return time.perf_counter() - began

    def pace(self) -> float:
        """Return the approximate seconds of a step after compilation."""
        steps = EVERY
        while True:
            seconds = self.run(steps)
            if seconds > _CALIBRATION_SECONDS:
                return self.run(steps) / steps
            steps *= 4


@dataclass(frozen=True)
class Cost:
    """The cost of steps.

    Attributes
    ----------
    seconds : float
        Time of a step, with every 10th recorded; the median over rounds.
    solves : float
        Number of solves a step.
    share : float
        Share of steps with a solve.
    """

    seconds: float
    solves: float
    share: float


def race(case: Case, contenders: Mapping[str, Mapping[str, Any]], rounds: int, seconds: float) -> dict[str, Cost]:
    """Time contenders on the same stretches of a trajectory, in turn.

    Every round continues from the end of the first contender's last round. Each stretch runs twice: first to count and
    to compile, then to be timed.

    Parameters
    ----------
    case : Case
    contenders : mapping
        Keywords for `deli.simulate` by name.
    rounds : int
    seconds : float
        Time of the slowest contender's round.
    """
    runners = {name: case.runner(**keywords) for name, keywords in contenders.items()}
    first = next(iter(runners.values()))
    start = first.state
    pace = max(runner.pace() for runner in runners.values())
    steps = max(EVERY, round(seconds / pace / EVERY) * EVERY)
    times: dict[str, list[float]] = {name: [] for name in runners}
    counts = {name: np.zeros(2) for name in runners}
    state = start
    for _ in range(rounds):
        for name, runner in runners.items():
            counter = runner.counter
            counter.reset()
            runner.place(*state)
            runner.run(steps, every=1)
            counts[name] += counter.solves, counter.solving
            runner.place(*state)
            times[name].append(runner.run(steps) / steps)
        state = first.state
    return {
        name: Cost(float(np.median(times[name])), *(float(value) for value in counts[name] / (rounds * steps)))
        for name in runners
    }
