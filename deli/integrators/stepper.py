"""A method bound to a scene: single steps, many steps at once, and the statistics of their cost."""

import numpy as np

from deli.errors import InputError, StepError
from deli.integrators.bound import Bound
from deli.integrators.failures import explain
from deli.integrators.recipe import Recipe
from deli.kernels import codes
from deli.kernels.advance import advance, make_block, record_state
from deli.kernels.build import ready
from deli.kernels.record import Record
from deli.kernels.shadow import measure_shadow
from deli.kernels.step import reflect_touching
from deli.mechanics.scene import Scene
from deli.subproblems.choices import parse_choices
from deli.subproblems.collector import Collector
from deli.subproblems.stats import StepStats


class Stepper:
    """A method bound to one scene, which it advances.

    A step is a function of the state alone: of (q, p), or of (q, p, memory) for a method that carries more from step
    to step. Nothing is warm-started unless a choice of solver asks for it, so a run can be continued from any recorded
    state.

    Parameters
    ----------
    scene : Scene
    step_size : float
        h > 0.
    recipe : Recipe
        The recipe of the method's step.
    solvers : str or mapping
        As for `deli.simulate`.
    skip : bool
        Whether subproblems that need no solver are answered without one; the trajectory is the same to solver
        tolerance.
    contact_tolerance : float
        τ: "g = 0" means ``|g_i| ≤ τ L |∇g_i(q₀)|`` with L the scene's length; "∇gᵀv = 0" means
        ``|∇g_iᵀv| ≤ τ ‖∇g_i‖ (‖p‖ + ‖impulse of the forces in one step‖)``, norms in the metric M⁻¹ over the bodies
        that the constraint touches. Both are unchanged by units and by how a constraint is scaled.

    Attributes
    ----------
    scene : Scene
    stats : StepStats
        Statistics of the steps since the last ``stats.reset()``.

    Raises
    ------
    InputError
        For a step size or a tolerance out of range, or a choice of solver that is refused.
    """

    def __init__(
        self,
        scene: Scene,
        step_size: float,
        recipe: Recipe,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
    ) -> None:
        if isinstance(step_size, bool) or not isinstance(step_size, (int, float)) or not 0 < step_size < np.inf:
            raise InputError(f"step_size is {step_size!r}; allowed: a finite number > 0.")
        ready()
        self.stats = StepStats()
        self._bound = Bound(
            scene, recipe, float(step_size), parse_choices(solvers), skip, contact_tolerance, self.stats
        )

    @property
    def scene(self) -> Scene:
        """The scene that the stepper advances."""
        return self._bound.scene

    def collect(self, collector: Collector) -> None:
        """Hand every subproblem that a solver gets from now on to the collector as well."""
        self._bound.collect(collector)

    def switch(self, scene: Scene, system: int | None = None) -> None:
        """Step another scene of equal dof and dimension from now on, as if this were a new stepper.

        Solvers with warm starts still begin with their last answers.

        Parameters
        ----------
        scene : Scene
        system : int, optional
            Address of the scene's record in `deli.integrators.systems.bind_systems`, which the caller keeps alive, if
            the scene has the same shape as the stepper's first one.
        """
        self.stats.reset()
        self.stats.tally.contacts[0] = 0
        self._bound.switch(scene, system)

    @property
    def implicit(self) -> bool:
        """Whether the force of a step depends on the new position."""
        return self._bound.method.implicit

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have solved a subproblem so far."""
        names = self._bound.backends
        return names | {"native"} if self.stats.native_solves else names

    @property
    def search_seconds(self) -> float:
        """Seconds spent in searches for neighbours so far."""
        return self._bound.search_seconds

    def step(
        self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None
    ) -> tuple[np.ndarray, ...]:
        """Return the state one step later as read-only arrays: (q, p), or (q, p, memory).

        Without `memory`, a method with memory begins anew.

        Raises
        ------
        StepError
            If a subproblem could not be solved, or the state is no longer finite.
        """
        self.place(position, momentum, memory)
        code = self._bound.call(self._bound.unit, 0, 0, 0)
        while code == codes.REFRESH:
            self._bound.widen()
            code = self._bound.call(self._bound.unit, 0, 0, 0)
        if code != codes.DONE:
            raise explain(code, self._bound)
        work = self._bound.work
        following = self._parts(work.moved.copy(), work.carried.copy(), work.remembered.copy())
        for part in following:
            part.flags.writeable = False
        return following

    def reflect(self, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Return the momentum reflected off all contacts that touch.

        Raises
        ------
        StepError
            If the reflection does not end or a solver fails.
        """
        self.place(position, momentum)
        code = self._bound.call(reflect_touching)
        if code != codes.DONE:
            raise explain(code, self._bound)
        return self._bound.work.momentum.copy()

    @property
    def state(self) -> tuple[np.ndarray, ...]:
        """The state (q, p) or (q, p, memory) after the last step of `advance`; later steps write to these arrays."""
        work = self._bound.work
        return self._parts(work.q, work.p, work.memory)

    def place(self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None) -> None:
        """Put the scene in a state from which `advance` continues; without `memory`, with that of a run's beginning."""
        self._bound.place(position, momentum, memory)

    def record(self, block: Record) -> None:
        """Write the state as the next row of `block`, with the statistics of the steps since the row before."""
        if block.fields.progress[1] == len(block.fields.steps):
            raise InputError(f"the block is full: all of its {len(block.fields.steps)} rows are written.")
        code = self._bound.call(record_state, block.address)
        if code != codes.DONE:
            raise explain(code, self._bound)

    def diagnose(self, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Return diagnostics of states q, p of shape (rows, dof), a row each, with the columns of `Block`."""
        block = make_block(1, self.scene.dof, self.scene.dimension)
        found = np.empty((len(position), block.fields.diagnostics.shape[1]))
        for row in range(len(position)):
            self.place(position[row], momentum[row])
            block.fields.progress[:] = 0
            self.record(block)
            found[row] = block.fields.diagnostics[0]
        return found

    def shadow_energies(self, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Return shadow energies, shape (rows,), of states q, p of shape (rows, dof), of the order in the recipe.

        Raises
        ------
        StepError
            If the smooth steps from a state do not converge.
        """
        found = np.empty(len(position))
        for row in range(len(position)):
            self.place(position[row], momentum[row])
            code = self._bound.call(measure_shadow)
            if code != codes.DONE:
                raise explain(code, self._bound)
            found[row] = self._bound.work.report[0]
        return found

    def advance(self, block: Record, steps: int, every: int, deadline: float) -> StepError | None:
        """Take steps until the run has `steps` steps, `block` is full, or the clock passes `deadline`.

        The block counts steps and filled rows. Returns the error that stopped the run, or None.

        Raises
        ------
        Exception
            Any exception of a user's function; `state` is then the last good state.
        """
        progress, bound = block.fields.progress, self._bound
        bound.advanced()
        if bound.collector is not None:
            bound.collector.follow(progress)
        while True:
            before = progress[0]
            code = bound.call(advance, block.address, steps, every, deadline)
            if progress[0] > before:
                bound.advanced()
            if code == codes.DONE:
                return None
            try:
                if code != codes.REFRESH:
                    raise explain(code, bound)
                bound.widen()
            except StepError as error:
                return error

    def _parts(self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray) -> tuple[np.ndarray, ...]:
        return (position, momentum, memory) if len(memory) else (position, momentum)
