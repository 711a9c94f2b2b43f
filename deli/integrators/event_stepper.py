"""A stepper whose steps SciPy takes, from event to event."""

import time
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from deli.errors import StepError
from deli.integrators.solve_ivp import SolveIvp
from deli.integrators.stepper import Stepper
from deli.kernels.codes import POSITION
from deli.kernels.record import Record
from deli.mechanics.scene import Scene

MOST_EVENTS = 1000  # of one step
AT_ONCE = 1e-12  # part of a step within which two events mean that the motion does not get on


class EventStepper(Stepper):
    """A stepper whose steps are taken by SciPy, and its reflections and records by kernels."""

    def __init__(
        self,
        method: SolveIvp,
        scene: Scene,
        step_size: float,
        solvers: object,
        skip: bool,
        contact_tolerance: float,
    ) -> None:
        super().__init__(scene, step_size, method.recipe(), solvers, skip, contact_tolerance)
        self._method, self._span = method, float(step_size)

    def step(
        self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None
    ) -> tuple[np.ndarray, ...]:
        """Return (q, p) one step later; see `Stepper.step`."""
        q, p = self._integrate(np.array(position, dtype=float), np.array(momentum, dtype=float))
        q.flags.writeable = p.flags.writeable = False
        return q, p

    def advance(self, block: Record, steps: int, every: int, deadline: float) -> StepError | None:
        """Step on; see `Stepper.advance`."""
        progress, rows = block.fields.progress, len(block.fields.steps)
        while progress[0] < steps and progress[1] < rows:
            q, p = (part.copy() for part in self.state)
            try:
                following = self._integrate(q, p)
            except StepError as error:
                self.place(q, p)
                return error
            self.place(*following)
            progress[0] += 1
            if progress[0] % every == 0 or progress[0] == steps:
                self.record(block)
            if time.monotonic() > deadline:
                break
        return None

    def _integrate(self, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Integrate from (q, p) over one step, event by event."""
        scene, method, span, dof = self.scene, self._method, self._span, self.scene.dof
        mass = scene.mass

        def rates(_: float, y: np.ndarray) -> np.ndarray:
            return span * np.concatenate([y[dof:], -scene.potential.gradient(y[:dof]) / mass])

        gaps = _Gaps(scene)
        events = [gaps.event(row) for row in range(scene.unilateral.rows)]
        now, y = 0.0, np.concatenate([q, p / mass])  # time in steps: SciPy finds events to an absolute 1e-15
        for number in range(MOST_EVENTS):
            found = solve_ivp(
                rates, (now, 1.0), y,
                method=method.algorithm, rtol=method.rtol, atol=method.atol, events=events,
            )  # fmt: skip
            self.stats.iterations[POSITION] += found.nfev
            y = found.y[:, -1]
            if found.status < 0 or not np.isfinite(y).all():
                where = f"{now * span:.6g} into the step"
                raise StepError(f"solve_ivp: {found.message} {where}; try another algorithm or rtol.")
            if found.status == 0:
                return y[:dof].copy(), mass * y[dof:]
            stuck, now = found.t[-1] - now <= AT_ONCE, found.t[-1]
            if stuck and number:
                raise StepError(
                    f"solve_ivp: a contact is met again at once, after {number} events of the step, {now * span:.6g} "
                    f"into its {span:g}: contacts rest or slide, or impacts accumulate; use deli.GVI."
                )
            y[dof:] = self.reflect(y[:dof], mass * y[dof:]) / mass
        raise StepError(f"solve_ivp: {MOST_EVENTS} events in one step; use a smaller step_size, or deli.GVI.")


class _Gaps:
    """All gaps at once, for events that ask for them one by one."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._time, self._values = scene, np.nan, np.empty(0)

    def event(self, row: int) -> Callable[[float, np.ndarray], float]:
        """Return an event that ends the integration where one gap becomes negative."""

        def gap(now: float, y: np.ndarray) -> float:
            if now != self._time:
                self._time, self._values = now, self._scene.unilateral.value(y[: self._scene.dof])
            return float(self._values[row])

        gap.terminal, gap.direction = True, -1  # type: ignore[attr-defined]
        return gap
