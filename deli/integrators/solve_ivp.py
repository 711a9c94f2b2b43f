"""SciPy's `solve_ivp` with events, a common way to simulate contact."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from deli.errors import InputError
from deli.integrators.integrator import Choices, Integrator, Ranges
from deli.integrators.recipe import Recipe
from deli.mechanics.schemes import get_scheme

if TYPE_CHECKING:
    from deli.integrators.stepper import Stepper
    from deli.mechanics.scene import Scene


@dataclass(frozen=True)
class SolveIvp(Integrator):
    """Adaptive integration between events by `scipy.integrate.solve_ivp`, for comparison with geometric methods.

    M q̈ = −∇V(q) is integrated over each step of size h to the given tolerances. When a gap crosses zero, all contacts
    that touch are reflected by Algorithm 2, which conserves H, and the integration begins anew. A gap that is zero to
    rounding at the start of a step counts as crossing zero there, so that an impact may fall on the end of a step. The
    step size h only determines the times of the states; nothing else is carried over from step to step. Evaluations of
    the force are counted as iterations of the position subproblem. A contact tolerance below 1e-12, the size of
    rounding, is replaced by 1e-12.

    A step fails with a StepError if contacts rest or slide under a force, or if impacts accumulate: if a contact is met
    again before it has opened by more than rounding. A contact that is violated and left again within one of the
    solver's own steps is not detected.

    Parameters
    ----------
    algorithm : {"DOP853", "RK45", "Radau", "LSODA"}
        Method of `solve_ivp`.
    rtol, atol : float
        Relative and absolute tolerance of `solve_ivp`.

    Raises
    ------
    InputError
        For a value out of range; from `stepper`, for a scene with bilateral constraints or with contacts found by
        search.

    Examples
    --------
    >>> import deli
    >>> run = deli.simulate(deli.scenes.quartic_wall(), deli.SolveIvp(), step_size=0.5, steps=10)
    >>> energy = run["trajectory"].hamiltonian
    >>> bool(abs(energy - energy[0]).max() < 1e-9)
    True
    """

    CHOICES: ClassVar[Choices] = {"algorithm": ("DOP853", "RK45", "Radau", "LSODA")}
    RANGES: ClassVar[Ranges] = {"rtol": (1e-13, 1.0), "atol": (0.0, np.inf)}

    algorithm: str = "DOP853"
    rtol: float = 1e-9
    atol: float = 1e-12

    def recipe(self) -> Recipe:
        """Return the recipe of the reflections between steps."""
        return Recipe(weights=get_scheme("verlet").weights, reflects=True)

    def stepper(
        self,
        scene: "Scene",
        step_size: float,
        solvers: object = "auto",
        skip: bool = True,
        contact_tolerance: float = 1e-8,
    ) -> "Stepper":
        """Bind the method to a scene; see `deli.integrators.stepper.Stepper`."""
        if scene.bilateral.rows:
            raise InputError("SolveIvp integrates no bilateral constraints; choose another scene, or deli.GVI.")
        if scene.unilateral.searched:
            raise InputError(
                "SolveIvp follows no contacts that are found by search; choose another scene, or deli.GVI."
            )
        from deli.integrators.event_stepper import EventStepper  # numba takes half a second to import

        settings = {"method": self.algorithm, "rtol": self.rtol, "atol": self.atol}
        return EventStepper(scene, step_size, self.recipe(), solvers, skip, contact_tolerance, settings)
