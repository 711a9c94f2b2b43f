"""A stepper that integrates from event to event with SciPy."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from deli.errors import StepError
from deli.integrators.recipe import Recipe
from deli.integrators.stepper import Stepper
from deli.kernels.codes import POSITION
from deli.kernels.contacts import VIOLATED
from deli.kernels.record import Record
from deli.mechanics.scene import Scene

MOST_EVENTS = 1000  # in one step
_ROUNDING = 8 * 2.0**-52  # rounding in gaps, relative to positions and the path of one step
_OPENED = 8.0  # roundings that a contact must open by before it is met again


class EventStepper(Stepper):
    """A stepper with steps by SciPy, and with reflections and records by kernels.

    `settings` are keywords of `scipy.integrate.solve_ivp`.
    """

    def __init__(
        self,
        scene: Scene,
        step_size: float,
        recipe: Recipe,
        solvers: object,
        skip: bool,
        contact_tolerance: float,
        settings: Mapping[str, Any],
    ) -> None:
        # A contact that is met to rounding must count as touching, so that it is reflected.
        super().__init__(scene, step_size, recipe, solvers, skip, max(contact_tolerance, VIOLATED))
        self._settings, self._span = settings, float(step_size)

    def step(
        self, position: np.ndarray, momentum: np.ndarray, memory: np.ndarray | None = None
    ) -> tuple[np.ndarray, ...]:
        """Return (q, p) one step later; see `Stepper.step`."""
        q, p = self._integrate(np.array(position, dtype=float), np.array(momentum, dtype=float))
        q.flags.writeable = p.flags.writeable = False
        return q, p

    def advance(self, block: Record, steps: int, every: int, deadline: float) -> StepError | None:
        """Take further steps; see `Stepper.advance`."""
        progress, rows = block.fields.progress, len(block.fields.steps)
        while progress[0] < steps and progress[1] < rows:
            q, p = (part.copy() for part in self.state)
            try:
                following = self._integrate(q, p)
            except BaseException as error:
                self.place(q, p)
                if isinstance(error, StepError):
                    return error
                raise
            self.place(*following)
            progress[0] += 1
            if progress[0] % every == 0 or progress[0] == steps:
                self.record(block)
            if time.monotonic() > deadline:
                break
        return None

    def _integrate(self, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Integrate from (q, p) over one step; a step that fails counts no reflected contacts."""
        struck = self.stats.reflected_contacts
        try:
            return self._follow(q, p)
        except BaseException:
            self.stats.tally.contacts[1] = struck
            raise

    def _follow(self, q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Integrate from (q, p) over one step, event by event; contacts that touch at its start are an event."""
        scene, span, dof = self.scene, self._span, self.scene.dof
        mass = scene.mass

        def rates(_: float, y: np.ndarray) -> np.ndarray:
            return span * np.concatenate([y[dof:], -scene.potential.gradient(y[:dof]) / mass])

        gaps = _Gaps(scene, span)
        events = [gaps.event(row) for row in range(scene.unilateral.rows)]
        now, y = 0.0, np.concatenate([q, p / mass])  # time in steps: SciPy finds events to an absolute 1e-15
        for number in range(MOST_EVENTS):
            if gaps.begin(y):
                y[dof:] = self.reflect(y[:dof], mass * y[dof:]) / mass
            if now >= 1.0:
                return y[:dof].copy(), mass * y[dof:]
            found = solve_ivp(rates, (now, 1.0), y, events=events, **self._settings)
            self.stats.iterations[POSITION] += found.nfev
            y = found.y[:, -1]
            if found.status < 0 or not np.isfinite(y).all():
                where = f"{now * span:.6g} into the step"
                raise StepError(f"solve_ivp: {found.message} {where}; try another algorithm or rtol.")
            if found.status == 0:
                return y[:dof].copy(), mass * y[dof:]
            (row,) = (row for row, times in enumerate(found.t_events) if len(times))
            if not gaps.opened(row, y, found.t[-1] - now):
                raise StepError(
                    f"solve_ivp: unilateral constraint {row} is met again before it opens, after {number} events of "
                    f"the step, {found.t[-1] * span:.6g} into its {span:g}: contacts rest or slide, or impacts "
                    "accumulate; use deli.GVI."
                )
            now = found.t[-1]
        raise StepError(f"solve_ivp: {MOST_EVENTS} events in one step; use a smaller step_size, or deli.GVI.")


class _Gaps:
    """All gaps at once, for SciPy's events, which are functions of one gap each.

    A contact that touches to rounding at the beginning is not met there, whatever the sign of its gap. It is met when
    its gap falls below the initial value by more than rounding.
    """

    def __init__(self, scene: Scene, span: float) -> None:
        self._scene, self._span = scene, span
        self._time, self._values = np.nan, np.empty(0)
        self._touching, self._level = np.empty(0, dtype=bool), np.empty(0)

    def begin(self, y: np.ndarray) -> bool:
        """Begin at a state, and return whether any contact is violated there, or touches to rounding."""
        gaps, rounding = self._scene.unilateral.value(y[: self._scene.dof]), self._rounding(y)
        self._touching = gaps <= rounding
        self._level = np.where(self._touching, gaps - rounding, 0.0)
        self._time = np.nan
        return bool(self._touching.any())

    def event(self, row: int) -> Callable[[float, np.ndarray], float]:
        """Return an event that ends the integration when one gap falls below its level."""

        def above(now: float, y: np.ndarray) -> float:
            if now != self._time:
                self._time, self._values = now, self._scene.unilateral.value(y[: self._scene.dof]) - self._level
            return float(self._values[row])

        above.terminal, above.direction = True, -1  # type: ignore[attr-defined]
        return above

    def opened(self, row: int, y: np.ndarray, steps: float) -> bool:
        """Return whether a contact has opened by more than rounding before it is met, judged by its speed and time."""
        if not self._touching[row]:
            return True
        q, velocity = np.split(y, 2)
        way = abs(self._scene.unilateral.jacobian(q)[row] @ velocity) * steps * self._span
        return bool(way > _OPENED * self._rounding(y)[row])

    def _rounding(self, y: np.ndarray) -> np.ndarray:
        q, velocity = np.split(y, 2)
        size = self._scene.length_scale + np.abs(q).max() + self._span * np.abs(velocity).max()
        return _ROUNDING * size * np.linalg.norm(self._scene.unilateral.jacobian(q), axis=1)
