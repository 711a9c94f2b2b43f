"""A scene bound to a method and its solvers: the machine with which kernels are called."""

import time
from typing import Any

import numpy as np

from deli.errors import StepError
from deli.integrators.arrays import mail_arrays, work_arrays
from deli.integrators.binding import bind_method, bind_system, search
from deli.integrators.bridge import Bridge
from deli.integrators.recipe import Recipe
from deli.kernels import codes
from deli.kernels.advance import has_strayed
from deli.kernels.compiled import UNITS, Unit
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.record import Record
from deli.mechanics.scene import Scene
from deli.subproblems.choices import SolverChoice
from deli.subproblems.collector import Collector
from deli.subproblems.models import MODELS
from deli.subproblems.program import ProgramSolver
from deli.subproblems.stats import StepStats

_SEARCHES = 16  # searches for neighbours in one step, each twice as far, before the step fails


class Bound:
    """A scene with a method: their records for kernels, and the answers of Python to kernels.

    Parameters
    ----------
    scene : Scene
    recipe : Recipe
    step_size : float
    choices : dict of SolverChoice
        By subproblem.
    skip : bool
    contact_tolerance : float
    stats : StepStats
        The statistics that kernels write.

    Attributes
    ----------
    method : deli.kernels.system.Method
    unit : Unit
        The compiled function that takes a step.
    work : deli.kernels.work.Work
        The arrays of the step at hand, `q`, `p` and `memory` those of its state.
    search_seconds : float
        Time spent in searches for neighbours.
    collector : Collector or None
        The collector of the subproblems that solvers get.
    """

    def __init__(
        self,
        scene: Scene,
        recipe: Recipe,
        step_size: float,
        choices: dict[str, SolverChoice],
        skip: bool,
        contact_tolerance: float,
        stats: StepStats,
    ) -> None:
        self.recipe, self.step_size = recipe, step_size
        self.unit = UNITS[recipe.unit]
        self.method = bind_method(recipe, step_size, choices, skip, contact_tolerance)
        self._stats = stats
        self.search_seconds = 0.0
        self.collector: Collector | None = None
        self._take(scene)
        self._solvers = [
            ProgramSolver(number, *pair, self._program, choice, stats, measured=number != codes.POSITION, skip=skip)
            for number, (pair, choice) in enumerate(zip(MODELS, choices.values(), strict=True))
        ]
        self._connect()

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have been called."""
        return set().union(*(solver.backends for solver in self._solvers))

    def switch(self, scene: Scene, system: int | None) -> None:
        """Take another scene in the place of this one; see `deli.integrators.stepper.Stepper.switch`."""
        if system is None:
            self._take(scene)
            self._hand_on()
            self._connect()
        else:
            self.scene, self._tries = scene, 0
            self._machine.point("system", system)

    def collect(self, collector: Collector) -> None:
        """Hand every subproblem that a solver gets from now on to the collector as well."""
        self.collector = collector
        self._connect()

    def place(self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None) -> None:
        """Put the scene in a state; see `deli.integrators.stepper.Stepper.place`."""
        self.work.q[:] = position
        self.work.p[:] = momentum
        if self.recipe.begin is not None:
            self.work.memory[:] = self.recipe.begin(self.scene, self.work.q) if memory is None else memory
        self._tries = 0
        if self.scene.unilateral.searched:
            known = self._system.reference.size and not self.call(has_strayed)
            if not known:
                self._search(1.0)

    def call(self, unit: Unit, *arguments: Any) -> int:
        """Call a unit; an overflow in Python functions that it calls gives no warning, but shows in the results."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            code: int = unit.call(self._machine.address, *arguments)
        return code

    def forget(self) -> BaseException | None:
        """Return the exception that a user's function or a solver has raised since the last call, or None."""
        return self._bridge.forget()

    def advanced(self) -> None:
        """Note that a step has been taken: the next search for neighbours has its usual reach again."""
        self._tries = 0

    def widen(self) -> None:
        """Search neighbours anew, twice as far at each request of the same step, which then begins anew.

        Raises
        ------
        StepError
            If the step has requested too many searches.
        """
        if self.collector is not None:
            self.collector.forget_step()
        if self._tries == _SEARCHES:
            raise StepError("a body moves farther in one step than any search for neighbours; use a smaller step_size.")
        self._search(2.0**self._tries)
        self._tries += 1

    def _take(self, scene: Scene) -> None:
        numerical, memory = self.method.numerical, self.recipe.memory
        self.scene, self._tries = scene, 0
        self._system = bind_system(scene, self.method.implicit)
        self._mail = mail_arrays(self._system, numerical)
        self.work, self._islands, self._program = work_arrays(self._system, numerical, memory)

    def _connect(self) -> None:
        self._bridge = Bridge(self.scene, self._mail, self._solvers, self.method, self.unit.address, self.collector)
        self._build()

    def _search(self, factor: float) -> None:
        began, work = time.perf_counter(), self.work
        self._system = search(self._system, self.scene, work.q, work.p, self.step_size, factor)
        known = (work, self._islands, self._program)
        self.work, self._islands, self._program = work_arrays(
            self._system, self.method.numerical, self.recipe.memory, known
        )
        self._hand_on()
        self._build()
        self.search_seconds += time.perf_counter() - began

    def _hand_on(self) -> None:
        for solver in self._solvers:
            solver.bind(self._program)

    def _build(self) -> None:
        self.work.span[0] = self.step_size
        parts = (self._system, self.method, self.work, self._islands, self._program, self._mail, self._bridge.hooks)
        self._machine = Record(MACHINE, Machine(*parts, self._stats.tally, StepStats().tally))
