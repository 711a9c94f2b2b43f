"""What kind of step a method takes: the description from which a stepper is made."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deli.kernels.codes import FROZEN
from deli.mechanics.scene import Scene
from deli.mechanics.schemes import Scheme

Weights = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """A method in the numbers that its step is made of; what they mean, `deli.kernels.system.Method` says.

    Attributes
    ----------
    unit : str
        The unit that takes a step: its module and its name.
    weights, later : (start, middle, end)
        Of the force in the position update, and in the momentum at x of methods that do not reflect.
    gain, share, place, rows, restitution
        Of methods that do not reflect.
    recurrence : rows of 3 numbers
        Of the nonsmooth generalized-alpha method.
    memory : int
        Arrays of dof numbers that a state has besides q and p.
    begin : callable, optional
        ``begin(scene, position)`` returns the memory with which a run begins, of shape (memory, dof).
    reflects : bool
        Whether Algorithm 1 is followed, or only its smooth part.
    operator, order : str
        A pair of `deli.subproblems.reflection.SELECTIONS`.
    numerical : Scheme, optional
        The scheme whose numerical Hamiltonian reflections conserve, if it is one's.
    shadow : int
        Order of the shadow energy that reflections conserve, if it is one: 2, 4, 6 or 8.
    closed_loop : bool
    event_order, discrete
        Of collision integrators.
    """

    unit: str = "deli.kernels.step.step"
    weights: Weights
    later: Weights = (0.0, 0.0, 0.0)
    gain: float = 0.0
    share: float = 1.0
    place: float = 1.0
    rows: int = FROZEN
    restitution: float = 0.0
    recurrence: tuple[Weights, ...] = ()
    memory: int = 0
    begin: Callable[[Scene, np.ndarray], np.ndarray] | None = None
    reflects: bool = False
    operator: str = "generalized"
    order: str = "index"
    numerical: Scheme | None = None
    shadow: int = 0
    closed_loop: bool = False
    event_order: int = 0
    discrete: bool = False
