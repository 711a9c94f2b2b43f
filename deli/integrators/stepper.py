"""A method bound to a scene: it steps, by itself or many steps at once, and knows what that cost."""

from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

from deli.errors import InputError, StepError
from deli.integrators.binding import bind_method, bind_system, mail_arrays, search, work_arrays
from deli.integrators.bridge import Bridge
from deli.kernels import codes
from deli.kernels.advance import advance, has_strayed, make_block, record_state
from deli.kernels.build import ready
from deli.kernels.compiled import Unit
from deli.kernels.machine import MACHINE, Machine
from deli.kernels.program import Program
from deli.kernels.record import Record
from deli.kernels.step import reflect_touching, step
from deli.mechanics.energies import reflection_metric
from deli.mechanics.scene import Scene
from deli.subproblems import position, projection, reflection
from deli.subproblems.choices import parse_choices
from deli.subproblems.program import ProgramSolver
from deli.subproblems.reflection import SELECTIONS
from deli.subproblems.stats import StepStats

_SEARCHES = 16  # times that neighbours are searched, ever farther, before a step is given up


class Stepper:
    """Advances one scene by a method.

    A step is a function of the state alone, which is (q, p), or (q, p, memory) where the method carries more from step
    to step: nothing is warm-started unless a choice of solver asks for it, so a run can be continued from any recorded
    state.

    Parameters
    ----------
    scene : Scene
    step_size : float
        h > 0.
    solvers : str or mapping
        As for `deli.simulate`.
    skip : bool
        Answer without a solver what needs none; the trajectory is the same to solver tolerance.
    contact_tolerance : float
        τ: "g = 0" means ``|g_i| ≤ τ L |∇g_i(q₀)|`` with L the scene's length; "∇gᵀv = 0" means
        ``|∇g_iᵀv| ≤ τ ‖∇g_i‖ (‖p‖ + ‖impulse of the forces in one step‖)``, norms in the metric M⁻¹ over the bodies
        that the constraint touches. Both are unchanged by units and by how a constraint is scaled.
    unit : Unit
        The kernel that takes a step.
    start : callable, optional
        ``start(scene, position)`` returns the memory with which a run begins, of shape (names, dof); for methods that
        have one.
    **method
        What kind of step it is: see `deli.integrators.binding.bind_method`.

    Attributes
    ----------
    stats : StepStats
        What the steps since the last ``stats.reset()`` cost.
    """

    def __init__(
        self,
        scene: Scene,
        step_size: float,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
        unit: Unit = step,
        start: Callable[[Scene, np.ndarray], np.ndarray] | None = None,
        **method: Any,
    ) -> None:
        if isinstance(step_size, bool) or not isinstance(step_size, (int, float)) or not 0 < step_size < np.inf:
            raise InputError(f"step_size is {step_size!r}; allowed: a finite number > 0.")
        ready()
        self.scene = scene
        self.step_size = float(step_size)
        self.choices = parse_choices(solvers)
        self.skip = skip
        self.stats = StepStats()
        self._unit, self._start = unit, start
        self._names = 0 if start is None else len(start(scene, scene.position))
        self._numerical = method.get("numerical")
        self._method = bind_method(self.step_size, self.choices, skip, contact_tolerance, **method)
        program = self._bind_scene()
        models = (
            (reflection.model, reflection.numerical_model),
            (position.model, position.newton_model),
            (projection.model, projection.model),
        )
        self._solvers = [
            ProgramSolver(number, *pair, program, choice, self.stats, measured=number != codes.POSITION, skip=skip)
            for number, (pair, choice) in enumerate(zip(models, self.choices.values(), strict=True))
        ]
        self._bridge = Bridge(scene, self._mail, self._solvers, self._method, unit.address)
        self._machine = self._bind(program)

    def switch(self, scene: Scene, system: int | None = None) -> None:
        """Step another scene of equal dof and dimension from now on, as if this were a new stepper.

        Solvers that were asked for warm starts still begin with their last answers.

        Parameters
        ----------
        scene : Scene
        system : int, optional
            Address of its record in `deli.integrators.systems.bind_systems`, which the caller keeps alive; for a scene
            of the same shape as the one that the stepper was made for.
        """
        self.scene, self._tries = scene, 0
        self.stats.reset()
        self.stats.tally.contacts[0] = 0
        if system is not None:
            self._machine.point("system", system)
            return
        program = self._bind_scene()
        for solver in self._solvers:
            solver.bind(program)
        self._bridge = Bridge(scene, self._mail, self._solvers, self._method, self._unit.address)
        self._machine = self._bind(program)

    @property
    def implicit(self) -> bool:
        """Whether a step's force depends on where it leads."""
        return self._method.implicit

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have solved something so far."""
        names = set().union(*(solver.backends for solver in self._solvers))
        return names | {"native"} if self.stats.native_solves else names

    def step(
        self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None
    ) -> tuple[np.ndarray, ...]:
        """Return the state one step later, arrays that are not to be written to: (q, p), or (q, p, memory).

        Without `memory` a method that has one begins anew.

        Raises
        ------
        StepError
            If a subproblem could not be solved, or the state is no longer finite.
        """
        self.place(position, momentum, memory)
        code = self._call(self._unit, 0, 0, 0)
        while code == codes.REFRESH:
            self._widen()
            code = self._call(self._unit, 0, 0, 0)
        if code != codes.DONE:
            self._raise(code)
        work = self._work
        following = [part.copy() for part in self._parts(work.moved, work.carried, work.remembered)]
        for part in following:
            part.flags.writeable = False
        return tuple(following)

    def reflect(self, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Return the momentum reflected off all contacts that touch.

        Raises
        ------
        StepError
            If the reflection does not end or a solver fails.
        """
        self.place(position, momentum)
        code = self._call(reflect_touching)
        if code != codes.DONE:
            self._raise(code)
        return self._work.momentum.copy()

    @property
    def state(self) -> tuple[np.ndarray, ...]:
        """(q, p) or (q, p, memory) after the last step of `advance`; arrays that later steps write to."""
        return self._parts(self._work.q, self._work.p, self._work.memory)

    def place(self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None) -> None:
        """Put the scene in a state, from which `advance` goes on; without `memory`, in one in which a run begins."""
        self._work.q[:] = position
        self._work.p[:] = momentum
        if self._start is not None:
            self._work.memory[:] = self._start(self.scene, self._work.q) if memory is None else memory
        self._tries = 0
        if self.scene.unilateral.searched:
            known = self._system.reference.size and not self._call(has_strayed)
            if not known:
                self._search(1.0)

    def record(self, block: Record) -> None:
        """Write the state as the next row of `block`, with what the steps since the row before have cost."""
        if block.fields.progress[1] == len(block.fields.steps):
            raise InputError(f"the block is full: all of its {len(block.fields.steps)} rows are written.")
        code = self._call(record_state, block.address)
        if code != codes.DONE:
            self._raise(code)

    def diagnose(self, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Diagnostics of states q, p of shape (rows, dof), a row each, with the columns of `Block`."""
        block = make_block(1, self.scene.dof, self.scene.dimension)
        found = np.empty((len(position), block.fields.diagnostics.shape[1]))
        for row in range(len(position)):
            self.place(position[row], momentum[row])
            block.fields.progress[:] = 0
            self.record(block)
            found[row] = block.fields.diagnostics[0]
        return found

    def advance(self, block: Record, steps: int, every: int, deadline: float) -> StepError | None:
        """Step on until `steps` steps of a run are taken, `block` is full, or the clock passes `deadline`.

        Steps taken and rows filled are counted in the block. Returns what stopped the run, if anything did.

        Raises
        ------
        Exception
            Whatever a function of the user's raises; `state` is the last good one then.
        """
        self._tries, progress = 0, block.fields.progress
        while True:
            before = progress[0]
            code = self._call(advance, block.address, steps, every, deadline)
            self._tries = 0 if progress[0] > before else self._tries
            if code == codes.DONE:
                return None
            try:
                if code == codes.REFRESH:
                    self._widen()
                else:
                    self._raise(code)
            except StepError as error:
                return error

    def _parts(self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray) -> tuple[np.ndarray, ...]:
        return (position, momentum, memory) if self._names else (position, momentum)

    def _bind_scene(self) -> Program:
        self._system, self._tries = bind_system(self.scene, self._method.implicit), 0
        self._mail = mail_arrays(self._system, self._method.numerical)
        self._work, self._islands, self._program = work_arrays(self._system, self._method.numerical, self._names)
        return self._program

    def _bind(self, program: Program) -> Record:
        self._work.span[0] = self.step_size
        parts = (self._system, self._method, self._work, self._islands, program, self._mail, self._bridge.hooks)
        return Record(MACHINE, Machine(*parts, self.stats.tally, StepStats().tally))

    def _call(self, unit: Unit, *arguments: Any) -> int:
        """Call a unit; what it asks of Python may overflow, which is seen in what comes of it."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            code: int = unit.call(self._machine.address, *arguments)
        return code

    def _widen(self) -> None:
        """Search neighbours anew, farther each time that the same step asks for it."""
        if self._tries == _SEARCHES:
            raise StepError("a body moves farther in one step than any search for neighbours; use a smaller step_size.")
        self._search(2.0**self._tries)
        self._tries += 1

    def _search(self, factor: float) -> None:
        self._system = search(self._system, self.scene, self._work.q, self._work.p, self.step_size, factor)
        known = (self._work, self._islands, self._program)
        self._work, self._islands, self._program = work_arrays(self._system, self._method.numerical, self._names, known)
        for solver in self._solvers:
            solver.bind(self._program)
        self._machine = self._bind(self._program)

    def _raise(self, code: int) -> NoReturn:
        """Raise what a kernel's code means."""
        raised = self._bridge.forget()
        if raised is not None:
            raise raised
        report = self._work.report
        if code == codes.UNCONVERGED:
            raise StepError(
                f"position: the update with {report[0]:.0f} unilateral and {report[1]:.0f} bilateral constraints "
                f"did not converge: scaled residuals are primal {report[2]:.1e}, dual {report[3]:.1e}, "
                f"complementarity {report[4]:.1e} where {report[5]:.0e} is allowed; use a smaller step_size, "
                f"polish = true or a tighter tolerance, or a potential with a hessian."
            )
        operator, _ = SELECTIONS[self._method.operator]
        if code == codes.NO_DIRECTION:
            raise StepError(
                f"reflection: {operator!r} turns back and forth between {report[0]:.0f} contacts that leave "
                f"the momentum no direction in which all of them separate; use a smaller step_size, so that "
                f"fewer of them are met at once."
            )
        if code == codes.TOO_MANY_PASSES:
            raise StepError(
                f"reflection: {operator!r} left {report[0]:.0f} of {report[1]:.0f} contacts approaching "
                f"(fastest at {report[3]:.2e}) after {report[2]:.0f} passes; try another operator or a smaller "
                f"step_size."
            )
        if code == codes.ACCUMULATED:
            raise StepError(
                f"collision: unilateral constraint {report[0]:.0f} is met again at once, after {report[1]:.0f} events "
                f"of the step, {report[2]:.6g} into its {self.step_size:g}: contacts rest or slide, or impacts "
                f"accumulate, which collision integrators cannot follow; use deli.GVI."
            )
        if code == codes.UNBALANCED:
            raise StepError(
                f"collision: no impulse at unilateral constraint {report[0]:.0f} conserves the discrete energy, "
                f"{report[2]:.6g} into the step of {self.step_size:g}; use a smaller step_size or another energy."
            )
        if code == codes.INDEFINITE and self._numerical is not None:
            reflection_metric(self.scene, self._numerical, self._work.q, self.step_size)  # says from which step size on
            raise StepError("reflection: the metric of the numerical Hamiltonian is not positive definite to rounding.")
        raise StepError("the state is no longer finite; use a smaller step_size.")
