"""A method bound to a scene: it steps, by itself or many steps at once, and knows what that cost."""

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
    """Advances one scene by a method.

    A step is a function of the state alone, which is (q, p), or (q, p, memory) where the method carries more from step
    to step: nothing is warm-started unless a choice of solver asks for it, so a run can be continued from any recorded
    state.

    Parameters
    ----------
    scene : Scene
    step_size : float
        h > 0.
    recipe : Recipe
        What kind of step the method takes.
    solvers : str or mapping
        As for `deli.simulate`.
    skip : bool
        Answer without a solver what needs none; the trajectory is the same to solver tolerance.
    contact_tolerance : float
        τ: "g = 0" means ``|g_i| ≤ τ L |∇g_i(q₀)|`` with L the scene's length; "∇gᵀv = 0" means
        ``|∇g_iᵀv| ≤ τ ‖∇g_i‖ (‖p‖ + ‖impulse of the forces in one step‖)``, norms in the metric M⁻¹ over the bodies
        that the constraint touches. Both are unchanged by units and by how a constraint is scaled.

    Attributes
    ----------
    scene : Scene
    stats : StepStats
        What the steps since the last ``stats.reset()`` cost.

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
        """The scene that is stepped."""
        return self._bound.scene

    def collect(self, collector: Collector) -> None:
        """Let the collector have every subproblem that a solver gets from now on."""
        self._bound.collect(collector)

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
        self.stats.reset()
        self.stats.tally.contacts[0] = 0
        self._bound.switch(scene, system)

    @property
    def implicit(self) -> bool:
        """Whether a step's force depends on where it leads."""
        return self._bound.method.implicit

    @property
    def backends(self) -> set[str]:
        """Names of the backends that have solved something so far."""
        names = self._bound.backends
        return names | {"native"} if self.stats.native_solves else names

    @property
    def search_seconds(self) -> float:
        """Seconds that searches for neighbours have taken so far."""
        return self._bound.search_seconds

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
        """(q, p) or (q, p, memory) after the last step of `advance`; arrays that later steps write to."""
        work = self._bound.work
        return self._parts(work.q, work.p, work.memory)

    def place(self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None) -> None:
        """Put the scene in a state, from which `advance` goes on; without `memory`, in one in which a run begins."""
        self._bound.place(position, momentum, memory)

    def record(self, block: Record) -> None:
        """Write the state as the next row of `block`, with what the steps since the row before have cost."""
        if block.fields.progress[1] == len(block.fields.steps):
            raise InputError(f"the block is full: all of its {len(block.fields.steps)} rows are written.")
        code = self._bound.call(record_state, block.address)
        if code != codes.DONE:
            raise explain(code, self._bound)

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

    def shadow_energies(self, position: np.ndarray, momentum: np.ndarray) -> np.ndarray:
        """Shadow energies, shape (rows,), of states q, p of shape (rows, dof), of the order in the recipe.

        Raises
        ------
        StepError
            Where the smooth steps from a state do not converge.
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
        """Step on until `steps` steps of a run are taken, `block` is full, or the clock passes `deadline`.

        Steps taken and rows filled are counted in the block. Returns what stopped the run, if anything did.

        Raises
        ------
        Exception
            Whatever a function of the user's raises; `state` is the last good one then.
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
